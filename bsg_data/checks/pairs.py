"""Check that pairs follow from the tables and their recipe."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from bsg_data.arrays import Counts, Ints
from bsg_data.checks.part import NULL, Fault, Words
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import stack_histograms
from bsg_data.dataset.manifest import FileEntry
from bsg_data.observation.pairs import (
    fits_pairs,
    list_column,
    read_views,
    sample_pairs,
    split_of_file,
)
from bsg_data.observation.view import View
from bsg_data.recipes import PairsRecipe


class PairCheck:
    """Check the pairs of a dataset file by file against its tables and recipes."""

    def __init__(self, data: Dataset, splits: Mapping[str, str], recipe: PairsRecipe) -> None:
        """Start a check for a dataset with sound tables; `splits` is scene id → split."""
        self._data, self._splits, self._recipe = data, splits, recipe
        self._files: Counter[str] = Counter()

    def add(self, entry: FileEntry, table: pa.Table) -> Iterator[Fault]:
        """Check one file of pairs."""
        own = split_of_file(entry.path)
        names = Words.of(table["scene_id"])
        first = np.flatnonzero(np.diff(names.codes, prepend=NULL))
        runs = Counter(names.codes[first].tolist())
        self._files.update(names.names)
        pairs = _Pairs.of(table)
        for start, end in pairwise([*first, len(table)]):
            code = int(names.codes[start])
            name, where = names.names[code], f"{entry.path}, {names.names[code]}"
            if self._splits.get(name) != own:
                yield Fault(where, f"expected split {own}, found {self._splits.get(name)}")
            elif name not in self._data:
                yield Fault(where, "is no scene of the dataset")
            elif runs[code] > 1:
                yield Fault(where, "its rows are not consecutive")
            else:
                yield from self._check_scene(where, name, pairs.take(int(start), int(end)))

    def finish(self) -> Iterator[Fault]:
        """Check that every scene with a split has pairs, in one file.

        Scenes that the format of pairs cannot hold must have none.
        """
        for scene in sorted(self._splits.keys() - self._files.keys()):
            if fits_pairs(self._data.cells(scene)):
                yield Fault("pairs", f"{scene} has none")
        for scene in sorted(scene for scene, files in self._files.items() if files > 1):
            yield Fault("pairs", f"{scene} is in two files")

    def _check_scene(self, where: str, scene: str, pairs: _Pairs) -> Iterator[Fault]:
        cells, draws = self._data.cells(scene), self._recipe.draws
        nodes = pairs.view.nodes
        starts = np.flatnonzero(nodes == 0)
        rising = np.diff(nodes, prepend=-1) > 0
        rising[starts] = True
        if (
            len(starts) != draws
            or starts[0] != 0
            or not rising.all()
            or nodes.max() >= len(cells)
            or (pairs.draw != np.arange(draws).repeat(np.diff(starts, append=len(nodes)))).any()
        ):
            expected = f"expected draws 0..{draws - 1} of nodes 0..{len(cells) - 1}, in order"
            yield Fault(where, f"{expected}; found {len(starts)} draws in {len(nodes)} rows")
            return
        views = [pairs.view.take(a, b) for a, b in pairwise([*starts.tolist(), len(nodes)])]
        inputs, targets = (counts.astype(np.int64) for counts in (pairs.inputs, pairs.targets))
        there = np.concatenate([view.cut(cells) for view in views])
        faults = [
            *_check_histograms(where, inputs, targets, there, starts),
            *_check_view(where, pairs.view, inputs, targets),
        ]
        yield from faults
        if not faults and not self._is_drawn(scene, views, inputs):
            yield Fault(where, "is not the mask of its recipe, or another NumPy drew it")

    def _is_drawn(self, scene: str, views: Sequence[View], inputs: Counts) -> bool:
        """Say whether views and inputs `[P, C]` of a scene follow from the recipe."""
        drawn, shown, _ = sample_pairs(
            self._data.cells(scene),
            self._recipe,
            scene_id=scene,
            connections=self._data.connections(scene),
            nameable=self._data.nameable(scene),
        )
        same = all(one.agrees(view) for one, view in zip(drawn, views, strict=True))
        return same and np.array_equal(shown, inputs)


@dataclass(frozen=True, eq=False)
class _Pairs:
    """The rows of P pairs."""

    draw: npt.NDArray[np.int32]  # `[P]` numbers of the masks
    inputs: npt.NDArray[np.uint16]  # `[P, C]` input histograms
    targets: npt.NDArray[np.uint16]  # `[P, C]` target histograms
    view: View  # view of all rows

    @classmethod
    def of(cls, table: pa.Table) -> _Pairs:
        return cls(
            draw=table["draw"].to_numpy(),
            inputs=list_column(table, "input"),
            targets=list_column(table, "target"),
            view=read_views(table),
        )

    def take(self, first: int, last: int) -> _Pairs:
        """Return the rows from `first` to before `last`."""
        rows = slice(first, last)
        return replace(
            self,
            draw=self.draw[rows],
            inputs=self.inputs[rows],
            targets=self.targets[rows],
            view=self.view.take(first, last),
        )


def _check_view(where: str, view: View, inputs: Counts, targets: Counts) -> Iterator[Fault]:
    """Check that inputs `[P, C]` are possible under the stored view."""
    share, withheld = view.hidden_share, view.withheld.copy()
    withheld[view.nodes == 0] = False  # the building's row sums the searched rooms
    if not ((share >= 0) & (share <= 1)).all():
        yield Fault(where, "hidden_share is not from 0 to 1")
    elif (inputs[withheld] > 0).any():
        yield Fault(where, "shows objects of a withheld class")
    elif (inputs[share == 1] > 0).any():
        yield Fault(where, "shows objects where hidden_share is 1")
    elif ((share == 0)[:, None] & ~withheld & (inputs < targets)).any():
        yield Fault(where, "hides objects where hidden_share is 0")


def _check_histograms(
    where: str, inputs: Counts, targets: Counts, cells: Counts, starts: Ints
) -> Iterator[Fault]:
    """Check histograms `[P, C]` of buildings whose first rows are `starts`."""
    if (targets != stack_histograms(cells, starts)).any():
        yield Fault(where, "target is not the histogram of the objects table")
    if (inputs > targets).any():
        yield Fault(where, "input is above target, but masks only hide objects")
    null_region = 2 * inputs[starts] - np.add.reduceat(inputs, starts, axis=0)
    if (null_region < 0).any() or (null_region > cells[starts]).any():
        yield Fault(where, "the building's input is not the sum of its rooms and the null region")
