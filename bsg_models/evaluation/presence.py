"""The measures of presence over (room, class) cells: all, of unseen classes, of unvisited rooms."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from bsg_models.evaluation import metrics
from bsg_models.evaluation.metrics import Bools, Floats

TOP = (1, 3, 5)


class PresenceMeasurement:
    """The measures of presence over (room, class) cells, sorted once.

    Three selections of cells: `all`, those of classes `unseen` in their room, and those of rooms
    that are `unvisited`, whose classes are all unseen.

    Args:
        presence: `[rooms, C]` P(at least one hidden object).
        seen: `[rooms, C]` whether an object was seen.
        hidden: `[rooms, C]` whether an object is hidden.
        visited: `[rooms]`.
    """

    def __init__(self, *, presence: Floats, seen: Bools, hidden: Bools, visited: Bools) -> None:
        selections = {
            "all": np.ones_like(seen),
            "unseen": ~seen,
            "unvisited": np.broadcast_to(~visited[:, None], seen.shape),
        }
        self._rooms = {name: int(keep.any(axis=1).sum()) for name, keep in selections.items()}
        self._micro = {
            name: _Selection(presence, hidden, keep) for name, keep in selections.items()
        }
        self._macro = {
            name: [
                _Selection(presence[:, [c]], hidden[:, [c]], keep[:, [c]])
                for c in range(presence.shape[1])
            ]
            for name, keep in selections.items()
        }
        self._hits = {k: metrics.topk_unseen(presence, seen, hidden, k=k) for k in TOP}

    def evaluate(self, weights: Floats) -> Iterator[tuple[str, float]]:
        """Yield every measure for weights `[rooms]`."""
        for name, micro in self._micro.items():
            mass = micro.weigh(weights)
            yield f"presence_auroc_micro/{name}", metrics.auroc(micro.ranking, mass)
            yield f"presence_ap_micro/{name}", metrics.average_precision(micro.ranking, mass)
            yield f"presence_brier/{name}", metrics.brier(micro.scores, micro.truth, mass)
            yield (
                f"presence_calibration_error/{name}",
                metrics.calibration_error(micro.scores, micro.truth, mass),
            )
            for measure, function in _ORDERED.items():
                values = [function(one.ranking, one.weigh(weights)) for one in self._macro[name]]
                yield f"{measure}_macro/{name}", metrics.mean_known(values)
        for k, hits in self._hits.items():
            yield f"top{k}_unseen", metrics.moments(hits, weights).mean

    def count_rooms(self, measure: str) -> int:
        """Return the number of rooms that a measure of `evaluate` is over."""
        if measure.startswith("top"):  # those that hide an unseen class
            return int((~np.isnan(self._hits[TOP[0]])).sum())
        return self._rooms[measure.rpartition("/")[2]]


_ORDERED: Mapping[str, Callable[..., float]] = {
    "presence_auroc": metrics.auroc,
    "presence_ap": metrics.average_precision,
}


class _Selection:
    """Some (room, class) cells with their scores, sorted once."""

    def __init__(self, presence: Floats, hidden: Bools, keep: Bools) -> None:
        self._rows = np.nonzero(keep)[0]
        self.scores = presence[keep]
        self.truth = hidden[keep]
        self.ranking = metrics.rank(self.scores, self.truth)

    def weigh(self, weights: Floats) -> Floats:
        """Return the weight of each cell from those of the rooms."""
        return weights[self._rows]
