"""Open a dataset: read its manifest at once, and its tables part by part on demand.

Parts stay in memory up to a bound in bytes. A dataset below this bound is read once. To read a
larger dataset once, ask for its scenes in the order of the tables (`Dataset.in_parts`); memory then
does not grow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from bsg_data.arrays import Counts, Ints
from bsg_data.dataset.histograms import OtherObjects
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
from bsg_data.files import AnyPath
from bsg_data.scene.connections import Connections
from bsg_data.scene.surroundings import Surroundings

HELD_BYTES = 256 * 2**20  # bound of the parts in memory


@dataclass(frozen=True, eq=False)
class Dataset:
    """An opened dataset.

    Attributes:
        path: folder of the dataset.
        manifest: its manifest.
        sha256: hash of the manifest, which identifies the whole dataset.
    """

    path: Path
    manifest: Manifest
    sha256: str

    @classmethod
    def open(cls, path: AnyPath) -> Dataset:
        """Open a dataset; an unchanged dataset is returned from memory.

        This checks that the files exist with the right sizes. Hashes are compared when a file is
        read.

        Raises:
            DatasetError: if the dataset is missing, unfinished or damaged.
        """
        path = Path(path)
        try:
            return _open_once(path.absolute(), hash_manifest(path))
        except OSError:
            read_manifest(path)  # raises an error that says what is missing
            raise

    @cached_property
    def scene_ids(self) -> tuple[str, ...]:
        """The ids of the scenes, in the order of the tables."""
        table = read_table(self.path, "scenes", columns=["scene_id"], manifest=self.manifest)
        return tuple(table["scene_id"].to_pylist())

    @cached_property
    def splits(self) -> dict[str, tuple[str, ...]]:
        """Split or fold → ids of its scenes; empty before `bsg-data split`."""
        return read_splits(self.path, manifest=self.manifest) if self.manifest.split else {}

    def __contains__(self, scene_id: object) -> bool:
        """Say whether the dataset has a scene."""
        return scene_id in self._number

    def in_parts(self, scenes: Iterable[str]) -> Iterator[tuple[str, ...]]:
        """Yield some scene ids in the order of the tables, those of one part together.

        Reading scenes in this order reads each part only once.

        Raises:
            DatasetError: if a scene is not in the dataset.
        """
        numbers = np.sort([self._number_of(scene) for scene in scenes])
        for some in np.split(numbers, np.searchsorted(numbers, self._ends)):
            if len(some):
                yield tuple(self.scene_ids[number] for number in some)

    def parts(self) -> Iterator[DatasetPart]:
        """Yield the parts of the tables in order."""
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
        """Return the known connections between rooms of a scene, in the order of the table."""
        part, place = self._find(scene_id)
        return part.connections(place)

    def surroundings(self, scene_id: str) -> Surroundings:
        """Return what is known of a scene and its rooms besides their objects.

        Impossible values, and labels that this version does not list, count as unknown.
        """
        part, place = self._find(scene_id)
        return part.surroundings(place)

    @cached_property
    def connection_methods(self) -> frozenset[str]:
        """The methods by which connections of this dataset are known (`ADJACENCY_METHODS`)."""
        return frozenset().union(*(part.connection_methods for part in self.parts()))

    def count_unconnected(self) -> int:
        """Return the number of scenes without known connections."""
        return sum(part.count_unconnected() for part in self.parts())

    def _find(self, scene_id: str) -> tuple[DatasetPart, int]:
        """Return the part of a scene, and its index there."""
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
                f"{self.path}: its tables differ in their number of parts; run `bsg-data check` "
                "for details"
            )
        return tuple(
            dict(zip(tables, files, strict=True)) for files in zip(*tables.values(), strict=True)
        )

    def _part(self, number: int) -> DatasetPart:
        return self._kept(number)

    @cached_property
    def _kept(self) -> Callable[[int], DatasetPart]:
        """A function that returns a part by its number and keeps the last ones."""
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
                f"{path / entry.path}: is in the manifest but missing; build the dataset again"
            ) from error
        if size != entry.bytes:
            raise DatasetError(
                f"{path / entry.path}: is not what the manifest says: expected {entry.bytes} "
                f"bytes, found {size}; run `bsg-data check` for details"
            )
    return Dataset(path, manifest, sha256)


def read_cells(dataset: AnyPath) -> dict[str, Counts]:
    """Return scene id → cells `[1 + R, C]` for all scenes, in the order of the tables."""
    data = Dataset.open(dataset)
    return {scene_id: data.cells(scene_id) for scene_id in data.scene_ids}
