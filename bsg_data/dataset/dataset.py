"""A dataset that is opened once: its manifest, and each table the first time that it is asked for.

Tables are packed: one array for all buildings, whose rows begin at an offset for each. The arrays
of one building are views of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from bsg_data.arrays import Counts, Floats, Ints
from bsg_data.dataset.categories import NO_CATEGORY, OtherObjects
from bsg_data.dataset.histograms import count_cells
from bsg_data.dataset.manifest import Manifest, hash_manifest, read_manifest
from bsg_data.dataset.shards import describe_file, read_table
from bsg_data.dataset.splits import read_splits
from bsg_data.errors import DatasetError
from bsg_data.geometry.floor_area import find_floor_area
from bsg_data.scene.class_map import is_nameless
from bsg_data.scene.connections import Connections
from bsg_data.scene.scene_graph import Box
from bsg_data.scene.surroundings import MAX_FLOOR_AREA, Surroundings, label_rows

_MOST_ROOMS = 1_000_000  # in one building
_BOX = tuple(f"box_{end}_{axis}" for end in ("min", "max") for axis in "xyz")


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
        return tuple(self._scenes["scene_id"].to_pylist())

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
        ends = np.cumsum([entry.rows for entry in self.manifest.files_of("scenes")])
        for some in np.split(numbers, np.searchsorted(numbers, ends)):
            if len(some):
                yield tuple(self.scene_ids[number] for number in some)

    def cells(self, scene_id: str) -> Counts:
        """Return the classified objects of a scene, `[1 + R, C]`, row 0 the null region."""
        return self._cells[self._rows_of(scene_id)]

    def others(self, scene_id: str) -> OtherObjects:
        """Return the objects of a scene outside the classes, by category."""
        nodes, kinds, counts, names = self._others
        rows = self._rows_of(scene_id)
        first, last = np.searchsorted(nodes, [rows.start, rows.stop])
        there, columns = np.unique(kinds[first:last], return_inverse=True)
        cells = np.zeros((rows.stop - rows.start, len(there)), dtype=np.int64)
        cells[nodes[first:last] - rows.start, columns] = counts[first:last]
        return OtherObjects(tuple(names[kind] for kind in there), cells)

    def connections(self, scene_id: str) -> Connections:
        """Return which rooms of a scene are known to connect, in the order of the table."""
        starts, every = self._connections
        number = self._number[scene_id]
        return every.take(np.s_[starts[number] : starts[number + 1]])

    def surroundings(self, scene_id: str) -> Surroundings:
        """Return what is known of a scene and its rooms besides their objects.

        What no room can have, and labels that this version does not list, count as unknown.
        """
        number = self._number_of(scene_id)
        rows = self._rows_of(scene_id)
        return self._surroundings.take(rows, buildings=slice(number, number + 1))

    @property
    def connection_methods(self) -> frozenset[str]:
        """How connections of this dataset are known: any of `ADJACENCY_METHODS`."""
        return frozenset(np.unique(self._connections[1].methods).tolist())

    def _number_of(self, scene_id: str) -> int:
        if scene_id not in self._number:
            raise DatasetError(f"{self.path}: has no scene {scene_id!r}")
        return self._number[scene_id]

    def _rows_of(self, scene_id: str) -> slice:
        number = self._number_of(scene_id)
        return slice(int(self._starts[number]), int(self._starts[number + 1]))

    @cached_property
    def _scenes(self) -> pa.Table:
        return read_table(
            self.path, "scenes", columns=["scene_id", "num_rooms"], manifest=self.manifest
        )

    @cached_property
    def _number(self) -> dict[str, int]:
        return {scene_id: number for number, scene_id in enumerate(self.scene_ids)}

    @cached_property
    def _starts(self) -> Ints:
        """Row of the first node of every scene, and the end, `[B + 1]`."""
        sizes = self._scenes["num_rooms"].to_numpy() + 1
        self._require(bool(((sizes >= 1) & (sizes < _MOST_ROOMS)).all()), "num_rooms")
        return np.concatenate([[0], np.cumsum(sizes)])

    @cached_property
    def _objects(self) -> tuple[Ints, Ints, npt.NDArray[np.bool_], pa.ChunkedArray]:
        """Row of the node, class, whether it has one, and category of every object, each `[O]`."""
        columns = ["scene_id", "room_index", "class_index", "category"]
        table = read_table(self.path, "objects", columns=columns, manifest=self.manifest)
        scene = self._number_scenes(table["scene_id"])
        rooms = table["room_index"].to_numpy()
        sizes = np.diff(self._starts)
        self._require(bool(((rooms >= 0) & (rooms < sizes[scene])).all()), "room_index")
        has_class = table["class_index"].is_valid().to_numpy()
        classes = pc.fill_null(table["class_index"], 0).to_numpy().astype(np.int64)
        self._require(bool((classes < len(self.manifest.class_space.classes)).all()), "class_index")
        return self._starts[scene] + rooms, classes, has_class, table["category"]

    @cached_property
    def _cells(self) -> Counts:
        """The cells of all scenes one after another, `[ΣN, C]`."""
        nodes, classes, has_class, _ = self._objects
        shape = (int(self._starts[-1]), len(self.manifest.class_space.classes))
        cells = count_cells(nodes[has_class], classes[has_class], shape=shape)
        cells.setflags(write=False)  # all readers of this dataset share it
        return cells

    @cached_property
    def _others(self) -> tuple[Ints, Ints, Ints, tuple[str, ...]]:
        """Row of the node, category and number of all other objects, and the categories' names.

        Sorted by node, then by name.
        """
        nodes, _, has_class, categories = self._objects
        kinds, names = _number_categories(categories.filter(pa.array(~has_class)))
        key = nodes[~has_class] * max(len(names), 1) + kinds
        pairs, counts = np.unique(key, return_counts=True)
        return *np.divmod(pairs, max(len(names), 1)), counts, names

    @cached_property
    def _connections(self) -> tuple[Ints, Connections]:
        """Offsets of the scenes `[B + 1]`, and the connections of all of them."""
        columns = ["scene_id", "source_index", "target_index", "kind", "method", "distance_m"]
        table = read_table(self.path, "edges", columns=columns, manifest=self.manifest)
        table = table.filter(pc.equal(table["kind"], "adjacent"))
        scene = self._number_scenes(table["scene_id"])
        pairs = np.stack([table[f"{end}_index"].to_numpy() for end in ("source", "target")], axis=1)
        rooms = np.diff(self._starts)[scene] - 1
        rising = (pairs[:, 0] >= 1) & (pairs[:, 0] < pairs[:, 1]) & (pairs[:, 1] <= rooms)
        self._require(bool(rising.all()), "adjacent edge")
        order = np.argsort(scene, kind="stable")
        every = Connections(
            pairs.astype(np.int64),
            np.array(table["method"].to_pylist(), dtype=str),
            pc.fill_null(table["distance_m"], np.nan).to_numpy(),
        ).take(order)
        starts = np.searchsorted(scene[order], np.arange(len(self.scene_ids) + 1))
        return starts, every

    @cached_property
    def _surroundings(self) -> Surroundings:
        """What is known of all scenes, one after another."""
        columns = ["source", "building_kind"]
        scenes = read_table(self.path, "scenes", columns=columns, manifest=self.manifest)
        nothing = Surroundings.unknown(nodes=int(self._starts[-1]), buildings=len(scenes))
        floor_area, labels = nothing.floor_area, nothing.labels
        if self._starts[-1] > len(scenes):  # there are rooms
            rooms = self._read_rooms()
            scene = self._number_scenes(rooms["scene_id"])
            places = rooms["room_index"].to_numpy()
            sizes = np.diff(self._starts)
            self._require(bool(((places >= 1) & (places < sizes[scene])).all()), "room_index")
            nodes = self._starts[scene] + places
            floor_area[nodes] = _measure_rooms(rooms)
            labels[nodes] = label_rows(rooms["label"].to_pylist())
        for array in (floor_area, labels):
            array.setflags(write=False)  # all readers of this dataset share it
        return Surroundings(
            floor_area,
            labels,
            tuple(kind or "" for kind in scenes["building_kind"].to_pylist()),
            tuple(source or "" for source in scenes["source"].to_pylist()),
        )

    def _read_rooms(self) -> pa.Table:
        columns = ["scene_id", "room_index", "label", "floor_area", "footprint", *_BOX]
        return read_table(self.path, "rooms", columns=columns, manifest=self.manifest)

    def _number_scenes(self, column: pa.ChunkedArray) -> Ints:
        """Return the number of the scene of every row of a table."""
        encoded = column.combine_chunks().dictionary_encode()
        names = encoded.dictionary.to_pylist()
        self._require(self._number.keys() >= set(names), "scene_id")
        numbers = np.array([self._number[name] for name in names], dtype=np.int64)
        return numbers[encoded.indices.to_numpy()] if len(encoded) else np.zeros(0, dtype=np.int64)

    def _require(self, sound: bool, column: str) -> None:
        if not sound:
            raise DatasetError(
                f"{self.path}: a {column} in its tables is impossible; `bsg-data check` says where"
            )


@lru_cache(maxsize=8)
def _open_once(path: Path, sha256: str) -> Dataset:
    manifest = read_manifest(path)
    for entry in manifest.files:
        if (
            not (path / entry.path).is_file()
            or describe_file(path, entry.path, rows=entry.rows) != entry
        ):
            raise DatasetError(
                f"{path / entry.path}: is not what the manifest says; `bsg-data check`"
            )
    return Dataset(path, manifest, sha256)


def _measure_rooms(rooms: pa.Table) -> Floats:
    """Return the floor area of every row of the rooms' table, `[R]`; NaN where unknown."""
    areas: Floats = pc.fill_null(rooms["floor_area"], np.nan).to_numpy().astype(np.float64)
    silent = np.flatnonzero(~((areas > 0) & (areas <= MAX_FLOOR_AREA)))
    areas[silent] = np.nan
    for row, room in zip(silent, rooms.take(silent).to_pylist(), strict=True):
        corners = room["footprint"] or ()
        area = find_floor_area(
            None,
            footprint=tuple(zip(corners[::2], corners[1::2], strict=False)),
            box=_box(room),
        )
        areas[row] = np.nan if area is None else area
    return areas


def _box(room: dict[str, Any]) -> Box | None:
    values = [room[name] for name in _BOX]
    return None if None in values else Box(tuple(values[:3]), tuple(values[3:]))


def _number_categories(column: pa.ChunkedArray) -> tuple[Ints, tuple[str, ...]]:
    """Return a number for the category of every row, and the names in their order."""
    encoded = pc.fill_null(column, NO_CATEGORY).combine_chunks().dictionary_encode()
    given = [NO_CATEGORY if is_nameless(name) else name for name in encoded.dictionary.to_pylist()]
    names = tuple(sorted(set(given)))
    number = {name: place for place, name in enumerate(names)}
    numbers = np.array([number[name] for name in given], dtype=np.int64)
    rows = numbers[encoded.indices.to_numpy()] if len(encoded) else np.zeros(0, dtype=np.int64)
    return rows, names


def read_cells(dataset: Path) -> dict[str, Counts]:
    """Return the cells `[1 + R, C]` of every scene of a dataset, in the order of the scenes."""
    data = Dataset.open(dataset)
    return {scene_id: data.cells(scene_id) for scene_id in data.scene_ids}


def read_adjacency(dataset: Path) -> dict[str, list[tuple[int, int]]]:
    """Return the pairs of adjacent rooms of every scene that has any."""
    data = Dataset.open(dataset)
    pairs = {scene_id: data.connections(scene_id).pairs.tolist() for scene_id in data.scene_ids}
    return {scene_id: [(a, b) for a, b in own] for scene_id, own in pairs.items() if own}
