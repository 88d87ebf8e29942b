"""Scene graphs as tables, and back: a table has the rows of all scenes of a shard.

Objects, of which there are many, are columns from the source to the shard. Rooms and connections
are records.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from itertools import chain, pairwise
from operator import attrgetter
from typing import Any, TypeVar, cast, overload

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from bsg_data.arrays import Bools, Ints, find_runs
from bsg_data.dataset.manifest import Totals
from bsg_data.dataset.schema import OBJECTS, ROOMS, SCENES, TABLES
from bsg_data.scene.scene_graph import Box, Edge, Point, Room, SceneGraph, SceneObject, is_placed

_Columns = dict[str, Any]
_Record = TypeVar("_Record")
_DERIVED = ("scene_id", "class", "has_geometry")  # columns that follow from others
OBJECT_COLUMNS = pa.schema([field for field in OBJECTS if field.name not in _DERIVED])


class Objects(Sequence[SceneObject]):
    """The objects of one scene: columns, and records that are made on first use.

    Attributes:
        table: their `OBJECT_COLUMNS`.
    """

    def __init__(self, table: pa.Table) -> None:
        self.table = table

    @classmethod
    def of(cls, objects: Sequence[SceneObject]) -> Objects:
        """Return the columns of records, or of what has columns already."""
        if isinstance(objects, Objects):
            return objects
        turned = zip(*objects, strict=True) if objects else ([] for _ in SceneObject._fields)
        held = dict(zip(SceneObject._fields, map(list, turned), strict=True))
        places = spread_places(held.pop("centroid"), held.pop("box"))
        columns = held | places | spread_boxes("part", held.pop("part_box"))
        return cls(pa.table({f.name: columns[f.name] for f in OBJECT_COLUMNS}, OBJECT_COLUMNS))

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.table)

    @overload
    def __getitem__(self, place: int) -> SceneObject: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[SceneObject]: ...
    def __getitem__(self, place: int | slice) -> SceneObject | Sequence[SceneObject]:
        """Return the record of one object, or of several."""
        return self._records[place]

    def __iter__(self) -> Iterator[SceneObject]:
        """Iterate over the records."""
        return iter(self._records)

    def __eq__(self, other: object) -> bool:
        """Say whether others are the same objects."""
        return isinstance(other, Sequence) and self._records == tuple(other)

    __hash__ = None  # type: ignore[assignment]

    @cached_property
    def _records(self) -> tuple[SceneObject, ...]:
        held = {name: _read_column(self.table[name]) for name in OBJECT_COLUMNS.names}
        held |= _gather_places(self.table)
        held["part_box"] = _gather_boxes(self.table, "part")
        return tuple(map(SceneObject, *(held[name] for name in SceneObject._fields)))


def _own_columns(schema: pa.Schema, record: type) -> list[str]:
    """Return the columns that are fields of a record with the same name."""
    return [field.name for field in fields(record) if field.name in schema.names]


_SCENE, _ROOM = _own_columns(SCENES, SceneGraph), _own_columns(ROOMS, Room)
_EDGE = ("kind", "method", "distance_m")
_TELLING = ("centroid_x", "box_min_x", "class_index")


def make_tables(graphs: Sequence[SceneGraph], classes: tuple[str, ...]) -> dict[str, pa.Table]:
    """Return the tables of some scenes, in the order given."""
    some = [Objects.of(graph.objects).table for graph in graphs] or [OBJECT_COLUMNS.empty_table()]
    objects = pa.concat_tables(some).combine_chunks()
    columns = {
        "scenes": _scene_columns(graphs, objects),
        "rooms": _room_columns(graphs),
        "objects": _object_columns(graphs, objects, classes),
        "edges": _edge_columns(graphs, objects),
    }
    return {
        name: pa.table([columns[name][column] for column in schema.names], schema=schema)
        for name, schema in TABLES.items()
    }


def count_totals(tables: Mapping[str, pa.Table]) -> Totals:
    """Return the sums over the scenes of a shard, by its tables."""
    scenes, rooms, objects, edges = (tables[name] for name in TABLES)
    return Totals(
        scenes=len(scenes),
        rooms=len(rooms),
        labelled=len(rooms) - rooms["label"].null_count,
        objects=len(objects),
        classified=len(objects) - objects["class_index"].null_count,
        unmapped=objects["category"].null_count,
        placed=sum(scenes["has_geometry"].to_pylist()),
        adjacent=len(take_adjacent(edges)),
    )


def _scene_columns(graphs: Sequence[SceneGraph], objects: pa.Table) -> _Columns:
    ends = np.cumsum([0, *(len(graph.objects) for graph in graphs)])
    is_known = {name: objects[name].is_valid().to_numpy() for name in _TELLING}
    placed = _sum_up(is_known["centroid_x"] | is_known["box_min_x"], ends)
    return {
        **{name: [getattr(graph, name) for graph in graphs] for name in _SCENE},
        "num_rooms": [len(graph.rooms) for graph in graphs],
        "num_objects": np.diff(ends),
        "num_classified": _sum_up(is_known["class_index"], ends),
        "has_geometry": [
            bool(number) or any(map(is_placed, graph.rooms))
            for number, graph in zip(placed, graphs, strict=True)
        ],
    }


def _sum_up(marks: Bools, ends: Ints) -> Ints:
    """Return how many marks there are between ends that follow one another."""
    return np.diff(np.concatenate([[0], np.cumsum(marks)])[ends])


def _room_columns(graphs: Sequence[SceneGraph]) -> _Columns:
    rooms = [room for graph in graphs for room in graph.rooms]
    return {
        **{name: list(map(attrgetter(name), rooms)) for name in _ROOM},
        "scene_id": [graph.scene_id for graph in graphs for _ in graph.rooms],
        "footprint": [room.footprint and [*chain(*room.footprint)] for room in rooms],
        **spread_places([room.centroid for room in rooms], [room.box for room in rooms]),
    }


def _object_columns(
    graphs: Sequence[SceneGraph], objects: pa.Table, classes: tuple[str, ...]
) -> _Columns:
    return {
        **dict(zip(objects.column_names, objects.columns, strict=True)),
        "scene_id": _repeat(graphs, [len(graph.objects) for graph in graphs]),
        "class": pa.array(classes, pa.string()).take(objects["class_index"].combine_chunks()),
        "has_geometry": objects["box_min_x"].is_valid(),
    }


def _edge_columns(graphs: Sequence[SceneGraph], objects: pa.Table) -> _Columns:
    """Return the edges: of each scene building → rooms, → objects, then adjacency."""
    sizes = [[len(g.rooms), len(g.objects), len(g.adjacency)] for g in graphs]
    counts = np.array(sizes, dtype=np.int64).reshape(-1, 3)
    part = np.repeat(np.tile(np.arange(3), len(graphs)), counts.ravel())
    joined = [edge for graph in graphs for edge in graph.adjacency]
    rooms = [room.room_index for graph in graphs for room in graph.rooms]
    source, target = np.zeros((2, len(part)), dtype=np.int32)
    target[part == 0] = rooms
    source[part == 1], target[part == 1] = objects["room_index"], objects["object_index"]
    source[part == 2] = [edge.source for edge in joined]
    target[part == 2] = [edge.target for edge in joined]
    words = ["annotation", *dict.fromkeys(edge.method for edge in joined)]
    method, distance = np.zeros(len(part), dtype=np.int32), np.full(len(part), np.nan)
    method[part == 2] = [words.index(edge.method) for edge in joined]
    distance[part == 2] = [np.nan if e.distance_m is None else e.distance_m for e in joined]
    return {
        "scene_id": _repeat(graphs, counts.sum(axis=1)),
        "kind": _choose(["contains", "adjacent"], part == 2),
        "source_kind": _choose(["building", "room"], source > 0),
        "source_index": source,
        "target_kind": _choose(["room", "object"], part == 1),
        "target_index": target,
        "method": _choose(words, method),
        "distance_m": pa.array(distance, from_pandas=True),
    }


def _repeat(graphs: Sequence[SceneGraph], times: Sequence[int] | Ints) -> pa.Array:
    return _choose([graph.scene_id for graph in graphs], np.repeat(np.arange(len(graphs)), times))


def _choose(words: Sequence[str], numbers: np.ndarray[Any, Any]) -> pa.Array:
    return pa.array(words, pa.string()).take(pa.array(numbers.astype(np.int32)))


def spread_places(centroids: Sequence[Point | None], boxes: Sequence[Box | None]) -> _Columns:
    """Return the columns of centroids and boxes, metres."""
    return {**_spread_points("centroid", centroids), **spread_boxes("box", boxes)}


def spread_boxes(name: str, boxes: Sequence[Box | None]) -> _Columns:
    """Return the columns of boxes, metres."""
    low = [box.minimum if box else None for box in boxes]
    high = [box.maximum if box else None for box in boxes]
    return {**_spread_points(f"{name}_min", low), **_spread_points(f"{name}_max", high)}


def _spread_points(name: str, points: Sequence[Point | None]) -> _Columns:
    axes = [f"{name}_{axis}" for axis in "xyz"]
    if not any(points):  # as in a text without a mesh
        return dict.fromkeys(axes, pa.nulls(len(points), pa.float64()))
    return {axis: [point and point[number] for point in points] for number, axis in enumerate(axes)}


def assemble_graphs(*tables: pa.Table) -> Iterator[SceneGraph]:
    """Assemble scene graphs from the tables of one shard: the inverse of `make_tables`."""
    scenes, rooms, objects, edges = tables
    edges = take_adjacent(edges)
    room_of, edge_of = _group(rooms, _read_rooms(rooms)), _group(edges, _read_edges(edges))
    objects = objects.select(["scene_id", *OBJECT_COLUMNS.names])
    object_of = dict(divide(objects))
    for row in scenes.to_pylist():
        scene = row["scene_id"]
        own = object_of.get(scene, objects.slice(0, 0))
        yield SceneGraph(
            **{name: row[name] for name in _SCENE},
            rooms=tuple(room_of.get(scene, ())),
            objects=Objects(own.drop_columns("scene_id")),
            adjacency=tuple(edge_of.get(scene, ())),
        )


def divide(table: pa.Table) -> Iterator[tuple[str, pa.Table]]:
    """Yield the rows of one scene after another; rows that lie apart are two groups."""
    names = table["scene_id"].combine_chunks()
    starts, _ = find_runs(names.dictionary_encode().indices.to_numpy())
    for start, end in pairwise([*starts.tolist(), len(table)]):
        yield names[start].as_py(), table.slice(start, end - start)


def take_adjacent(edges: pa.Table) -> pa.Table:
    """Return the edges between rooms."""
    # Not `pc.equal`: a scalar imports pandas, if it is there, which takes as long as all the rest.
    kinds = edges["kind"].cast(pa.string())
    return edges.filter(pc.match_substring_regex(kinds, "^adjacent$"))


def _group(table: pa.Table, records: Iterable[_Record]) -> dict[str, list[_Record]]:
    """Return scene id → the records of its rows."""
    found: dict[str, list[_Record]] = {}
    for scene, record in zip(table["scene_id"].to_pylist(), records, strict=True):
        found.setdefault(scene, []).append(record)
    return found


def _read_rooms(table: pa.Table) -> Iterator[Room]:
    columns = {name: _read_column(table[name]) for name in _ROOM} | _gather_places(table)
    columns["footprint"] = [
        corners and tuple(zip(corners[::2], corners[1::2], strict=True))
        for corners in columns["footprint"]
    ]
    return _make(Room, columns)


def _read_edges(table: pa.Table) -> Iterator[Edge]:
    ends = {end: table[f"{end}_index"].to_pylist() for end in ("source", "target")}
    return _make(Edge, ends | {name: _read_column(table[name]) for name in _EDGE})


def _make(record: type[_Record], columns: Mapping[str, Sequence[Any]]) -> Iterator[_Record]:
    """Make records of columns with the names of their fields."""
    return map(record, *(columns[field.name] for field in fields(cast(Any, record))))


def _read_column(column: pa.ChunkedArray) -> list[Any]:
    """Return the values of a column."""
    return [None] * len(column) if column.null_count == len(column) else column.to_pylist()


def _gather_places(table: pa.Table) -> _Columns:
    return {"centroid": _gather_points(table, "centroid"), "box": _gather_boxes(table, "box")}


def _gather_points(table: pa.Table, name: str) -> list[Point | None]:
    axes = (_read_column(table[f"{name}_{axis}"]) for axis in "xyz")
    return [None if point[0] is None else point for point in zip(*axes, strict=True)]


def _gather_boxes(table: pa.Table, name: str) -> list[Box | None]:
    corners = (_gather_points(table, f"{name}_{end}") for end in ("min", "max"))
    return [a and b and Box(a, b) for a, b in zip(*corners, strict=True)]
