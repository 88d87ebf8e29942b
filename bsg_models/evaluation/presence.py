"""Select the (room, class) cells for measures of presence, and sort them once.

Presence is `CountDistribution.presence`: P(at least one hidden object). There are three selections
of cells: `all`; those of classes that are `unseen` in their room; and those of rooms that are
`unvisited`, of which nothing was seen, or a little through a door.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bsg_models.evaluation.metrics import Bools, Floats, Ranking, cumulate, rank

SELECTIONS = ("all", "unseen", "unvisited")


def select_cells(seen: Bools, visited: Bools) -> dict[str, Bools]:
    """Return the cells of each selection, `[N, C]`.

    Args:
        seen: `[N, C]` whether an object of the class was seen in the room.
        visited: `[N]`.
    """
    unvisited = np.broadcast_to(~visited[:, None], seen.shape)
    return dict(zip(SELECTIONS, (np.ones_like(seen), ~seen, unvisited), strict=True))


class Cells:
    """Some (room, class) cells.

    Attributes:
        presence: `[M]` predicted P(at least one hidden object).
        hidden: `[M]` whether there is one.
        ranking: of the cells by falling presence.
    """

    def __init__(self, presence: Floats, hidden: Bools, keep: Bools) -> None:
        self._rows = np.nonzero(keep)[0]
        self.presence = presence[keep]
        self.hidden = hidden[keep]
        self.ranking: Ranking = rank(self.presence, self.hidden)
        self._cumulated: tuple[Floats, tuple[Floats, Floats]] | None = None

    def weigh(self, weights: Floats) -> Floats:
        """Return the weight of each cell from those of the rooms."""
        return weights[self._rows]

    def cumulate(self, weights: Floats) -> tuple[Floats, Floats]:
        """Return `metrics.cumulate` of the ranking.

        The last answer is kept, because all measures ask for the sums of one resample in turn.
        """
        if self._cumulated is None or not np.array_equal(self._cumulated[0], weights):
            self._cumulated = weights, cumulate(self.ranking, weights)
        return self._cumulated[1]


class PresenceCells:
    """The cells of some rooms, in each selection: together, and class by class.

    Attributes:
        together: selection → all its cells.
        by_class: selection → its cells of each class.
        rooms: selection → number of rooms with such a cell.

    Args:
        presence: `[rooms, C]` P(at least one hidden object).
        seen: `[rooms, C]` whether an object was seen.
        hidden: `[rooms, C]` whether an object is hidden.
        visited: `[rooms]`.
    """

    def __init__(self, *, presence: Floats, seen: Bools, hidden: Bools, visited: Bools) -> None:
        selections: Mapping[str, Bools] = select_cells(seen, visited)
        self.rooms = {name: int(keep.any(axis=1).sum()) for name, keep in selections.items()}
        self.together = {name: Cells(presence, hidden, keep) for name, keep in selections.items()}
        self.by_class = {
            name: [
                Cells(presence[:, [c]], hidden[:, [c]], keep[:, [c]])
                for c in range(presence.shape[1])
            ]
            for name, keep in selections.items()
        }
