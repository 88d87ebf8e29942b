"""One part of a dataset: some buildings, whose tables are read on first use.

Each table is one array for all buildings of the part, with an offset for each building. The arrays
of one building are views of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from bsg_data.arrays import Counts, Ints
from bsg_data.dataset.histograms import NO_CATEGORY, OtherObjects, count_cells
from bsg_data.dataset.manifest import FileEntry, Manifest
from bsg_data.dataset.shards import read_file
from bsg_data.errors import DatasetError
from bsg_data.scene.class_map import is_nameless
from bsg_data.scene.connections import Connections
from bsg_data.scene.surroundings import EVIDENCE, Surroundings

_MOST_ROOMS = 1_000_000  # in one building
_NODE_BYTES = 250  # about what is held of a node besides its cells
_OBJECT_BYTES = 40


@dataclass(frozen=True, eq=False)
class DatasetPart:
    """A part of every table: B buildings with N nodes and O objects in all."""

    dataset: Path  # folder of the dataset
    manifest: Manifest  # its manifest
    files: Mapping[str, FileEntry]  # table → file of this part

    @property
    def weight(self) -> int:
        """Approximate number of bytes in memory after all tables were read."""
        nodes = self.files["scenes"].rows + self.files["rooms"].rows
        width = 8 * len(self.manifest.class_space.classes) + _NODE_BYTES
        return max(1, nodes * width + self.files["objects"].rows * _OBJECT_BYTES)

    @cached_property
    def scene_ids(self) -> tuple[str, ...]:
        """The ids of the scenes, in the order of the tables."""
        return tuple(self._scenes["scene_id"].to_pylist())

    @property
    def connection_methods(self) -> frozenset[str]:
        """The methods by which connections of its scenes are known."""
        return frozenset(np.unique(self._connections[1].methods).tolist())

    def count_unconnected(self) -> int:
        """Return the number of its scenes without connections."""
        return int((np.diff(self._connections[0]) == 0).sum())

    def cells(self, place: int) -> Counts:
        """Return the classified objects of the scene with an index in the part, `[1 + R, C]`."""
        return self.every_cell[self._rows_of(place)]

    def others(self, place: int) -> OtherObjects:
        """Return the objects of a scene outside the classes, by category."""
        nodes, kinds, counts, names = self._others
        rows = self._rows_of(place)
        first, last = np.searchsorted(nodes, [rows.start, rows.stop])
        there, columns = np.unique(kinds[first:last], return_inverse=True)
        cells = np.zeros((rows.stop - rows.start, len(there)), dtype=np.int64)
        cells[nodes[first:last] - rows.start, columns] = counts[first:last]
        return OtherObjects(tuple(names[kind] for kind in there), cells)

    def connections(self, place: int) -> Connections:
        """Return the known connections between rooms of a scene, in the order of the table."""
        starts, every = self._connections
        return every.take(np.s_[starts[place] : starts[place + 1]])

    def surroundings(self, place: int) -> Surroundings:
        """Return what is known of a scene and its rooms besides their objects."""
        return self._surroundings.take(self._rows_of(place), buildings=slice(place, place + 1))

    def _rows_of(self, place: int) -> slice:
        return slice(int(self.starts[place]), int(self.starts[place + 1]))

    def _read(self, table: str, columns: list[str]) -> pa.Table:
        return read_file(self.dataset, self.files[table], manifest=self.manifest, columns=columns)

    @cached_property
    def _scenes(self) -> pa.Table:
        columns = [n for kind in EVIDENCE.values() if kind.of_building for n in kind.columns]
        return self._read("scenes", ["scene_id", "num_rooms", *columns])

    @cached_property
    def starts(self) -> Ints:
        """Row of the first node of every scene, and the end, `[B + 1]`."""
        sizes = self._scenes["num_rooms"].to_numpy() + 1
        self._require(bool(((sizes >= 1) & (sizes < _MOST_ROOMS)).all()), "num_rooms")
        return np.concatenate([[0], np.cumsum(sizes)])

    @cached_property
    def _objects(self) -> tuple[Ints, Ints, npt.NDArray[np.bool_], pa.ChunkedArray]:
        """Row of the node, class, whether it has one, and category of every object, each `[O]`."""
        columns = ["scene_id", "room_index", "class_index", "category"]
        table = self._read("objects", columns)
        scene = self._number_scenes(table["scene_id"])
        rooms = table["room_index"].to_numpy()
        sizes = np.diff(self.starts)
        self._require(bool(((rooms >= 0) & (rooms < sizes[scene])).all()), "room_index")
        has_class = table["class_index"].is_valid().to_numpy()
        classes = pc.fill_null(table["class_index"], 0).to_numpy().astype(np.int64)
        self._require(bool((classes < len(self.manifest.class_space.classes)).all()), "class_index")
        return self.starts[scene] + rooms, classes, has_class, table["category"]

    @cached_property
    def every_cell(self) -> Counts:
        """The cells of all scenes in order, `[N, C]`."""
        nodes, classes, has_class, _ = self._objects
        shape = (int(self.starts[-1]), len(self.manifest.class_space.classes))
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
        table = self._read("edges", columns)
        table = table.filter(pc.equal(table["kind"], "adjacent"))
        scene = self._number_scenes(table["scene_id"])
        pairs = np.stack([table[f"{end}_index"].to_numpy() for end in ("source", "target")], axis=1)
        rooms = np.diff(self.starts)[scene] - 1
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
        rooms, rows = None, np.zeros(0, dtype=np.int64)
        if self.starts[-1] > len(self._scenes):  # there are rooms
            columns = [
                name for kind in EVIDENCE.values() for name in kind.columns if not kind.of_building
            ]
            rooms = self._read("rooms", ["scene_id", "room_index", *columns])
            scene = self._number_scenes(rooms["scene_id"])
            places = rooms["room_index"].to_numpy()
            sizes = np.diff(self.starts)
            self._require(bool(((places >= 1) & (places < sizes[scene])).all()), "room_index")
            rows = self.starts[scene] + places
        return Surroundings.of_tables(self._scenes, rooms, rows=rows, nodes=int(self.starts[-1]))

    def _number_scenes(self, column: pa.ChunkedArray) -> Ints:
        """Return the place of the scene of every row of a table."""
        encoded = column.combine_chunks().dictionary_encode()
        names = encoded.dictionary.to_pylist()
        place = {scene: place for place, scene in enumerate(self.scene_ids)}
        self._require(place.keys() >= set(names), "scene_id")
        numbers = np.array([place[name] for name in names], dtype=np.int64)
        return numbers[encoded.indices.to_numpy()] if len(encoded) else np.zeros(0, dtype=np.int64)

    def _require(self, sound: bool, column: str) -> None:
        if not sound:
            path = self.dataset / self.files["scenes"].path
            raise DatasetError(
                f"{path}: a {column} in this part of the tables is impossible; run "
                "`bsg-data check` to see where"
            )


def _number_categories(column: pa.ChunkedArray) -> tuple[Ints, tuple[str, ...]]:
    """Return a number for the category of every row, and the names in their order."""
    encoded = pc.fill_null(column, NO_CATEGORY).combine_chunks().dictionary_encode()
    given = [NO_CATEGORY if is_nameless(name) else name for name in encoded.dictionary.to_pylist()]
    names = tuple(sorted(set(given)))
    number = {name: place for place, name in enumerate(names)}
    numbers = np.array([number[name] for name in given], dtype=np.int64)
    rows = numbers[encoded.indices.to_numpy()] if len(encoded) else np.zeros(0, dtype=np.int64)
    return rows, names
