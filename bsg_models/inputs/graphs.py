"""Read the stored pairs of a split, and convert whole buildings to PyG graphs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import torch
from torch_geometric.data import HeteroData

from bsg_data.arrays import Floats, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import count_cells, to_histograms
from bsg_data.dataset.scenes import make_tables
from bsg_data.errors import DatasetError
from bsg_data.observation.masked_buildings import (
    MaskedBuildings,
    stack_masked,
    stream_masked,
)
from bsg_data.scene.scene_graph import ADJACENCY_METHODS, BUILDING, SceneGraph
from bsg_data.scene.surroundings import Surroundings
from bsg_models.inputs.folds import Split, scenes_of, splits_of

_POS = tuple(f"centroid_{axis}" for axis in "xyz")
_BOX = tuple(f"box_{end}_{axis}" for end in ("min", "max") for axis in "xyz")


def read_split(
    data: Dataset, split: Split, *, fold: int | None = None, vocabulary: tuple[str, ...] = ()
) -> MaskedBuildings:
    """Return the stored pairs of train, val or test.

    Raises:
        DatasetError: if there are none.
    """
    parts = list(stream_split(data, split, fold=fold, vocabulary=vocabulary))
    if not parts:
        raise DatasetError(
            f"{data.path}: no building of split {split!r} has pairs",
            code="pairs-missing",
            where=split,
        )
    return stack_masked(parts)


def stream_split(
    data: Dataset,
    split: Split,
    *,
    fold: int | None = None,
    vocabulary: tuple[str, ...] = (),
) -> Iterator[MaskedBuildings]:
    """Yield the stored pairs one file at a time: the data of `read_split`."""
    scenes = frozenset(scenes_of(data, split, fold=fold))
    for name in splits_of(data, split, fold=fold):
        for masked in stream_masked(data, name, vocabulary=vocabulary):
            chosen = [i for i, scene in enumerate(masked.seen.scene_ids) if scene in scenes]
            if len(chosen) == len(masked):
                yield masked
            elif chosen:
                yield masked.take(chosen)


def to_pyg(
    graph: SceneGraph, *, classes: Sequence[str], categories: Sequence[str] = ()
) -> HeteroData:
    """Return a building as one heterogeneous graph of R rooms and O objects.

    All nodes have `x` `[n, C]`, the objects by class: of an object itself, all 0 without a class;
    of a room those in it; of the building all. There is no `y`: a task makes its own. Numbers that
    are not known are NaN, and indices -1.

    - `building`: `building_kind` and `source` `[1]`, indices in `BUILDING_KINDS`, `KNOWN_SOURCES`.
    - `room`: `label` `[R]`, index in `list_room_labels()`; `floor_area` `[R]`, square metres;
      `floor_index` and `floor_z` `[R]`, its storey and the height of its floor; `pos` and `box`;
      `region_id` `[R]`.
    - `object`: `class_index` `[O]`; `category` `[O]`, index in `categories`; `area` `[O]` of its
      surface, square metres; `pos` and `box`; `instance_id` `[O]`.

    `pos` `[n, 3]` is the centroid; `box` `[n, 6]` has the lowest corner (x, y, z), then the
    highest: metres, Z up. `region_id` and `instance_id` lead to the rows of the tables.

    Edges are (building, contains, room), (building, contains, object) of no room, (room, contains,
    object) and (room, adjacent, room) with `distance_m` and `method` `[E]`, an index in
    `ADJACENCY_METHODS`. Each is there once; PyG's `ToUndirected` adds the way back.

    Args:
        graph: the building.
        classes: of its dataset, `manifest.class_space.classes`.
        categories: words for objects to number, such as those of all buildings.
    """
    tables = make_tables([graph], tuple(classes))
    rooms, objects = tables["rooms"], tables["objects"]
    rooms_of, class_index = _read(objects, "room_index"), _read(objects, "class_index")
    nodes, classified = 1 + len(rooms), class_index >= 0
    around = Surroundings.of_tables(tables["scenes"], rooms, rows=np.arange(1, nodes), nodes=nodes)
    shape = nodes, len(classes)
    counts = to_histograms(count_cells(rooms_of[classified], class_index[classified], shape=shape))
    counts = counts.astype(np.float32)
    number: dict[str | None, int] = {category: index for index, category in enumerate(categories)}
    columns = {
        "building": {
            "x": counts[:1],
            "building_kind": around.building_kinds,
            "source": around.sources,
        },
        "room": {
            "x": counts[1:],
            "label": np.where(around.labels.any(axis=1), around.labels.argmax(axis=1), -1)[1:],
            "floor_area": around.floor_area[1:],
            **{name: _read(rooms, name) for name in ("floor_index", "floor_z", "region_id")},
            **_place(rooms),
        },
        "object": {
            "x": np.eye(len(classes) + 1, len(classes), dtype=np.float32)[class_index],  # -1: 0
            "category": np.array([number.get(one.category, -1) for one in graph.objects], int),
            **{name: _read(objects, name) for name in ("class_index", "area", "instance_id")},
            **_place(objects),
        },
    }
    made = HeteroData(scene_id=graph.scene_id)
    for kind, values in columns.items():
        for name, value in values.items():
            made[kind][name] = _to_tensor(value)
    _connect(made, graph, rooms_of)
    return made


def _connect(made: HeteroData, graph: SceneGraph, rooms_of: Ints) -> None:
    """Add the edges; rooms and objects are numbered from 1 in the tables, and here from 0."""
    rooms, inside = np.arange(len(graph.rooms)), rooms_of != BUILDING
    loose, held = np.flatnonzero(~inside), np.flatnonzero(inside)
    pairs = np.array([(edge.source, edge.target) for edge in graph.adjacency], int).reshape(-1, 2)
    ends = {
        ("building", "contains", "room"): (0 * rooms, rooms),
        ("building", "contains", "object"): (0 * loose, loose),
        ("room", "contains", "object"): (rooms_of[held] - 1, held),
        ("room", "adjacent", "room"): tuple(pairs.T - 1),
    }
    for key, (sources, targets) in ends.items():
        made[key].edge_index = _to_tensor(np.stack([sources, targets]))
    lengths = [np.nan if edge.distance_m is None else edge.distance_m for edge in graph.adjacency]
    number = {method: index for index, method in enumerate(ADJACENCY_METHODS)}
    methods = [number.get(edge.method, -1) for edge in graph.adjacency]
    made["room", "adjacent", "room"].distance_m = _to_tensor(np.array(lengths, float))
    made["room", "adjacent", "room"].method = _to_tensor(np.array(methods, int))


def _place(table: pa.Table) -> dict[str, Floats]:
    names = {"pos": _POS, "box": _BOX}
    return {
        name: np.stack([_read(table, axis) for axis in axes], axis=1)
        for name, axes in names.items()
    }


def _read(table: pa.Table, name: str) -> npt.NDArray[Any]:
    """Return a column `[n]` of integers, -1 for null, or of numbers, NaN for null."""
    column = table[name]
    if pa.types.is_integer(column.type):
        return np.asarray(column.cast(pa.int64()).fill_null(-1).to_numpy())
    return np.asarray(column.fill_null(np.nan).to_numpy())


def _to_tensor(values: npt.NDArray[Any]) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float32 if values.dtype.kind == "f" else torch.int64)
