"""What is in each building, read from the tables when the pairs are checked: a few parts at a time.

Pairs stand in the order of the scenes within each split, so each part is read once a split.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from bsg_data.arrays import Counts
from bsg_data.checks.part import Rows
from bsg_data.dataset.histograms import count_cells
from bsg_data.dataset.manifest import Manifest
from bsg_data.dataset.shards import read_file
from bsg_data.scene.connections import Connections

_SCENES_HELD = 8192  # in memory, about 1 kB each
_COLUMNS = {
    "scenes": ["scene_id", "num_rooms"],
    "objects": ["scene_id", "room_index", "class_index"],
    "edges": ["scene_id", "kind", "source_index", "target_index"],
}


class Truth:
    """Cells and connections of the scenes of a dataset whose tables are sound."""

    def __init__(self, dataset: Path, manifest: Manifest, parts: dict[str, int]) -> None:
        """Read from the tables of a dataset; `parts` has the number of every scene's part."""
        self._dataset, self._manifest, self._parts = dataset, manifest, parts
        self._files = {name: manifest.files_of(name) for name in _COLUMNS}
        held = max(1, _SCENES_HELD // max(manifest.scenes_per_shard, 1))
        self._read_once = lru_cache(maxsize=held)(self._read)

    def __contains__(self, scene_id: str) -> bool:
        """Say whether the dataset has a scene."""
        return scene_id in self._parts

    def cells(self, scene_id: str) -> Counts:
        """Count the classified objects of a scene, `[1 + R, C]`, row 0 the null region."""
        return self._read_once(self._parts[scene_id]).cells(scene_id)

    def connections(self, scene_id: str) -> Connections:
        """Return which of its rooms connect."""
        return self._read_once(self._parts[scene_id]).connections(scene_id)

    def _read(self, number: int) -> _PartTruth:
        tables = {
            name: read_file(
                self._dataset / files[number].path, manifest=self._manifest, columns=_COLUMNS[name]
            )
            for name, files in self._files.items()
        }
        return _PartTruth(tables, classes=len(self._manifest.class_space.classes))


class _PartTruth:
    """Cells and connections of the scenes of one part, packed."""

    def __init__(self, tables: dict[str, pa.Table], *, classes: int) -> None:
        scene_ids = tables["scenes"]["scene_id"].to_pylist()
        self._number = {scene_id: number for number, scene_id in enumerate(scene_ids)}
        self._rooms = tables["scenes"]["num_rooms"].to_numpy()
        self._classes = classes
        counted = tables["objects"].filter(tables["objects"]["class_index"].is_valid())
        objects = Rows.of(counted, self._number)
        self._first_object = self._starts(objects)
        self._room = objects.integers("room_index").astype(np.int32)
        self._class = objects.integers("class_index").astype(np.uint8)
        table = tables["edges"].filter(pc.equal(tables["edges"]["kind"], "adjacent"))
        edges = Rows.of(table, self._number)
        self._first_edge = self._starts(edges)
        ends = [edges.integers(f"{end}_index") for end in ("source", "target")]
        self._pairs = np.stack(ends, axis=1).astype(np.int32)

    def _starts(self, rows: Rows) -> Counts:
        """Return where the rows of every scene begin, and the end, `[B + 1]`."""
        return np.searchsorted(rows.scene, np.arange(len(self._number) + 1))

    def cells(self, scene_id: str) -> Counts:
        number = self._number[scene_id]
        rows = np.s_[self._first_object[number] : self._first_object[number + 1]]
        shape = (int(self._rooms[number]) + 1, self._classes)
        return count_cells(self._room[rows], self._class[rows], shape=shape)

    def connections(self, scene_id: str) -> Connections:
        number = self._number[scene_id]
        pairs = self._pairs[self._first_edge[number] : self._first_edge[number + 1]]
        return Connections.of_pairs(map(tuple, pairs.tolist()))
