"""A dataset that is opened once: its manifest at once, its tables part by part when asked for.

Of the parts that were read as many are kept as a bound in bytes allows. A dataset that fits is
therefore read once; of a larger one, whoever asks for scenes in the order of the tables
(`Dataset.in_parts`) reads each part once, in memory that does not grow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from bsg_data.arrays import Counts, Ints
from bsg_data.dataset.categories import OtherObjects
from bsg_data.dataset.manifest import (
    FileEntry,
    Manifest,
    hash_manifest,
    read_hashed_manifest,
    read_manifest,
)
from bsg_data.dataset.part import DatasetPart
from bsg_data.dataset.schema import TABLES
from bsg_data.dataset.shards import read_table
from bsg_data.dataset.splits import read_splits
from bsg_data.errors import DatasetError
from bsg_data.scene.connections import Connections
from bsg_data.scene.surroundings import Surroundings

HELD_BYTES = 256 * 2**20  # of the parts that are kept


@dataclass(frozen=True, eq=False)
class Dataset:
    """An opened dataset.

    Attributes:
        path: its folder.
        manifest: what it says of itself.
        sha256: of the manifest, which stands for the whole dataset.
    """

    path: Path
    manifest: Manifest
    sha256: str

    @classmethod
    def open(cls, path: Path) -> Dataset:
        """Open a dataset, from memory if its manifest has not changed since.

        That the files of its buildings are there and of the right size is seen now; hashes are
        compared when a file is read.

        Raises:
            DatasetError: if it is missing, unfinished or damaged.
        """
        try:
            return _open_once(path.absolute(), hash_manifest(path))
        except OSError:
            read_manifest(path)  # says in words what is missing
            raise

    @cached_property
    def scene_ids(self) -> tuple[str, ...]:
        """The scenes, in the order of the tables."""
        table = read_table(self.path, "scenes", columns=["scene_id"], manifest=self.manifest)
        return tuple(table["scene_id"].to_pylist())

    @cached_property
    def splits(self) -> dict[str, tuple[str, ...]]:
        """The scenes of each split or fold; empty before `bsg-data split`."""
        return read_splits(self.path, manifest=self.manifest) if self.manifest.split else {}

    def __contains__(self, scene_id: object) -> bool:
        """Say whether the dataset has a scene."""
        return scene_id in self._number

    def in_parts(self, scenes: Iterable[str]) -> Iterator[tuple[str, ...]]:
        """Yield some scenes, those of one part of the tables together, in the order of the tables.

        Whoever asks for scenes in this order has each part read once, however many there are.

        Raises:
            DatasetError: if one of them is no scene of the dataset.
        """
        numbers = np.sort([self._number_of(scene) for scene in scenes])
        for some in np.split(numbers, np.searchsorted(numbers, self._ends)):
            if len(some):
                yield tuple(self.scene_ids[number] for number in some)

    def parts(self) -> Iterator[DatasetPart]:
        """Yield the parts of the tables in their order."""
        return (self._part(number) for number in range(len(self._files)))

    def cells(self, scene_id: str) -> Counts:
        """Return the classified objects of a scene, `[1 + R, C]`, row 0 the null region."""
        part, place = self._find(scene_id)
        return part.cells(place)

    def others(self, scene_id: str) -> OtherObjects:
        """Return the objects of a scene outside the classes, by category."""
        part, place = self._find(scene_id)
        return part.others(place)

    def connections(self, scene_id: str) -> Connections:
        """Return which rooms of a scene are known to connect, in the order of the table."""
        part, place = self._find(scene_id)
        return part.connections(place)

    def surroundings(self, scene_id: str) -> Surroundings:
        """Return what is known of a scene and its rooms besides their objects.

        What no room can have, and labels that this version does not list, count as unknown.
        """
        part, place = self._find(scene_id)
        return part.surroundings(place)

    @cached_property
    def connection_methods(self) -> frozenset[str]:
        """How connections of this dataset are known: any of `ADJACENCY_METHODS`."""
        return frozenset().union(*(part.connection_methods for part in self.parts()))

    def count_unconnected(self) -> int:
        """Return how many scenes have no rooms that are known to connect."""
        return sum(part.count_unconnected() for part in self.parts())

    def _find(self, scene_id: str) -> tuple[DatasetPart, int]:
        """Return the part of a scene, and its place there."""
        number = self._number_of(scene_id)
        part = int(np.searchsorted(self._ends, number, side="right"))
        first = int(self._ends[part - 1]) if part else 0
        return self._part(part), number - first

    def _number_of(self, scene_id: str) -> int:
        if scene_id not in self._number:
            raise DatasetError(f"{self.path}: has no scene {scene_id!r}")
        return self._number[scene_id]

    @cached_property
    def _number(self) -> dict[str, int]:
        return {scene_id: number for number, scene_id in enumerate(self.scene_ids)}

    @cached_property
    def _ends(self) -> Ints:
        """Number of the first scene after each part."""
        return np.cumsum([files["scenes"].rows for files in self._files])

    @cached_property
    def _files(self) -> tuple[dict[str, FileEntry], ...]:
        """The file of every table of each part."""
        tables = {name: self.manifest.files_of(name) for name in TABLES}
        if len({len(files) for files in tables.values()}) != 1:
            raise DatasetError(
                f"{self.path}: its tables are not of as many parts; `bsg-data check` says more"
            )
        return tuple(
            dict(zip(tables, files, strict=True)) for files in zip(*tables.values(), strict=True)
        )

    def _part(self, number: int) -> DatasetPart:
        return self._kept(number)

    @cached_property
    def _kept(self) -> Callable[[int], DatasetPart]:
        """Parts by number, of which the last ones that were asked for are kept."""
        parts = [DatasetPart(self.path, self.manifest, files) for files in self._files]
        largest = max((part.weight for part in parts), default=1)
        return lru_cache(maxsize=max(2, HELD_BYTES // largest))(
            lambda number: DatasetPart(self.path, self.manifest, self._files[number])
        )


@lru_cache(maxsize=8)
def _open_once(path: Path, sha256: str) -> Dataset:
    manifest, found = read_hashed_manifest(path)
    if found != sha256:  # replaced meanwhile
        return _open_once(path, found)
    for entry in (entry for name in TABLES for entry in manifest.files_of(name)):
        try:
            size = (path / entry.path).stat().st_size
        except OSError as error:
            raise DatasetError(
                f"{path / entry.path}: in the manifest but not there; build again"
            ) from error
        if size != entry.bytes:
            raise DatasetError(
                f"{path / entry.path}: is not what the manifest says, {entry.bytes} bytes; found "
                f"{size}; `bsg-data check`"
            )
    return Dataset(path, manifest, sha256)


def read_cells(dataset: Path) -> dict[str, Counts]:
    """Return the cells `[1 + R, C]` of every scene of a dataset, in the order of the scenes."""
    data = Dataset.open(dataset)
    return {scene_id: data.cells(scene_id) for scene_id in data.scene_ids}


def read_adjacency(dataset: Path) -> dict[str, list[tuple[int, int]]]:
    """Return the pairs of adjacent rooms of every scene that has any."""
    data = Dataset.open(dataset)
    pairs = {scene_id: data.connections(scene_id).pairs.tolist() for scene_id in data.scene_ids}
    return {scene_id: [(a, b) for a, b in own] for scene_id, own in pairs.items() if own}
