"""Compute means over rooms or cells from sums per building, so that buildings can be resampled.

Any sum over nodes divided by a number of cells, such as a likelihood or a calibration gap, is
measured without keeping the nodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Ints
from bsg_data.errors import RecipeError
from bsg_models.evaluation.metrics import Floats, mean_known

# Name → what each node adds to the sum, `[N]`, and its number of cells, `[N]`.
Shares = Mapping[str, tuple[Floats, Floats]]


@dataclass(frozen=True, eq=False)
class BuildingMeans:
    """Means over the nodes of B buildings; it is `Measurable`.

    Attributes:
        scene_ids: `[B]`.
        sums: name → `[B]` sum over the cells of each building.
        cells: name → `[B]` number of cells.
        folds: `[B]` fold of each building; a value is then the mean over the folds, as in a
            leaderboard. None pools all cells, which suits rare ones.
    """

    scene_ids: tuple[str, ...]
    sums: Mapping[str, Floats]
    cells: Mapping[str, Floats]
    folds: Ints | None = None

    def evaluate(self, building_weights: Floats | None = None) -> dict[str, float]:
        """Return every mean; the weights `[B]` say how often each building counts."""
        weights = np.ones(len(self.scene_ids)) if building_weights is None else building_weights
        values = {}
        for name, sums in self.sums.items():
            above, below = weights * sums, weights * self.cells[name]
            if self.folds is None:
                values[name] = float(_divide(above.sum(), below.sum()))
            else:
                parts = _divide(_sum(self.folds, above), _sum(self.folds, below))
                values[name] = mean_known(parts.tolist())
        return values

    def count_nodes(self, metric: str) -> int:
        """Return the number of cells behind a mean."""
        return int(self.cells[metric].sum())


def sum_buildings(
    scene_ids: Sequence[str], building: npt.NDArray[np.integer], shares: Shares
) -> BuildingMeans:
    """Return the means of nodes whose buildings are known.

    Args:
        scene_ids: `[B]`.
        building: `[N]` 0..B-1.
        shares: name → what each node adds, and its number of cells, both `[N]`.

    >>> two = (np.array([1.0, 3.0, 5.0]), np.array([1.0, 1.0, 2.0]))
    >>> means = sum_buildings(("a", "b"), np.array([0, 0, 1]), {"x": two})
    >>> means.evaluate()["x"], means.evaluate(np.array([1.0, 0.0]))["x"]
    (2.25, 2.0)
    """
    size = len(scene_ids)
    return BuildingMeans(
        tuple(scene_ids),
        MappingProxyType({k: _sum(building, a, size) for k, (a, _) in shares.items()}),
        MappingProxyType({k: _sum(building, b, size) for k, (_, b) in shares.items()}),
    )


def add_buildings(batches: Sequence[BuildingMeans]) -> BuildingMeans:
    """Return the means over several batches of nodes; a building may occur in several of them.

    Args:
        batches: one or more, with the same names.

    >>> one = sum_buildings(("a",), np.array([0]), {"x": (np.array([3.0]), np.array([1.0]))})
    >>> two = sum_buildings(("b", "a"), np.array([0, 1]), {"x": (np.ones(2), np.ones(2))})
    >>> both = add_buildings([one, two])
    >>> both.scene_ids, both.sums["x"].tolist(), both.cells["x"].tolist()
    (('a', 'b'), [4.0, 1.0], [2.0, 1.0])
    """
    scene_ids = tuple(dict.fromkeys(scene for batch in batches for scene in batch.scene_ids))
    number = {scene: place for place, scene in enumerate(scene_ids)}
    places = np.array([number[scene] for batch in batches for scene in batch.scene_ids])
    names = batches[0].sums
    return BuildingMeans(
        scene_ids,
        {k: _sum(places, np.concatenate([b.sums[k] for b in batches])) for k in names},
        {k: _sum(places, np.concatenate([b.cells[k] for b in batches])) for k in names},
    )


def join_buildings(parts: Sequence[BuildingMeans], *, by_fold: bool = False) -> BuildingMeans:
    """Return the means over the buildings of several parts, sorted by scene id.

    Args:
        parts: of different buildings, with the same names.
        by_fold: whether a value is the mean over the parts.

    Raises:
        RecipeError: if a building is in two parts.
    """
    scenes = [scene for part in parts for scene in part.scene_ids]
    order = np.argsort(np.array(scenes, dtype=object), kind="stable")
    if len(set(scenes)) < len(scenes):
        twice = next(s for s in scenes if scenes.count(s) > 1)
        raise RecipeError(f"building {twice} is tested on twice; each must be in one fold")
    folds = np.repeat(np.arange(len(parts)), [len(part.scene_ids) for part in parts])
    names = parts[0].sums
    return BuildingMeans(
        tuple(scenes[i] for i in order),
        {k: np.concatenate([part.sums[k] for part in parts])[order] for k in names},
        {k: np.concatenate([part.cells[k] for part in parts])[order] for k in names},
        folds[order] if by_fold else None,
    )


def _sum(group: npt.NDArray[np.integer], values: Floats, size: int = 0) -> Floats:
    return np.asarray(np.bincount(group, values, size), dtype=float)


def _divide(above: Floats | np.floating, below: Floats | np.floating) -> Floats:
    above, below = np.asarray(above, dtype=float), np.asarray(below, dtype=float)
    return np.asarray(np.divide(above, below, out=np.full(above.shape, np.nan), where=below > 0))
