"""Convert scene graphs to columns of the dataset's tables, and back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from operator import attrgetter
from typing import Any

import pyarrow as pa

from bsg_data.scene.scene_graph import Box, Edge, Point, Room, SceneGraph, SceneObject

_Columns = dict[str, list[Any]]
# Fields of the records that are columns of the same name.
_SCENE = (
    *("scene_id", "source", "source_version", "source_split", "class_map", "building_kind"),
    *("up_axis", "annotation_sha256"),
)
_ROOM = ("room_index", "region_id", "label", "source_label", "floor_index", "floor_z", "floor_area")
_OBJECT = (
    *("object_index", "instance_id", "room_index", "raw_category", "category", "role"),
    *("class_index", "colour", "area"),
)
_EDGE = ("kind", "method", "distance_m")


def collect_columns(
    graphs: Sequence[SceneGraph], *, classes: tuple[str, ...]
) -> dict[str, _Columns]:
    """Collect scene graphs as columns: table → column → values, scenes in the order given."""
    rooms = [room for graph in graphs for room in graph.rooms]
    objects = [obj for graph in graphs for obj in graph.objects]
    indices = [obj.class_index for obj in objects]
    edges = [(graph, edge) for graph in graphs for edge in graph.edges()]
    sources = [graph.describe_node(edge.source) for graph, edge in edges]
    targets = [graph.describe_node(edge.target) for graph, edge in edges]
    return {
        "scenes": {
            **_take(_SCENE, graphs),
            "num_rooms": [len(graph.rooms) for graph in graphs],
            "num_objects": [len(graph.objects) for graph in graphs],
            "num_classified": [
                sum(obj.class_index is not None for obj in graph.objects) for graph in graphs
            ],
            "has_geometry": [graph.has_geometry for graph in graphs],
        },
        "rooms": {
            **_take(_ROOM, rooms),
            "scene_id": [graph.scene_id for graph in graphs for _ in graph.rooms],
            "footprint": [room.footprint and [*chain(*room.footprint)] for room in rooms],
            **_spread_points("centroid", [room.centroid for room in rooms]),
            **_spread_boxes("box", [room.box for room in rooms]),
        },
        "objects": {
            **_take(_OBJECT, objects),
            "scene_id": [graph.scene_id for graph in graphs for _ in graph.objects],
            "class": [None if index is None else classes[index] for index in indices],
            "has_geometry": [obj.box is not None for obj in objects],
            **_spread_points("centroid", [obj.centroid for obj in objects]),
            **_spread_boxes("box", [obj.box for obj in objects]),
            **_spread_boxes("part", [obj.part_box for obj in objects]),
        },
        "edges": {
            **_take(_EDGE, [edge for _, edge in edges]),
            "scene_id": [graph.scene_id for graph, _ in edges],
            "source_kind": [kind for kind, _ in sources],
            "source_index": [index for _, index in sources],
            "target_kind": [kind for kind, _ in targets],
            "target_index": [index for _, index in targets],
        },
    }


def _take(names: Iterable[str], records: Sequence[object]) -> _Columns:
    return {name: list(map(attrgetter(name), records)) for name in names}


def _spread_points(name: str, points: Sequence[Point | None]) -> _Columns:
    return {
        f"{name}_{axis}": [point and point[number] for point in points]
        for number, axis in enumerate("xyz")
    }


def _spread_boxes(name: str, boxes: Sequence[Box | None]) -> _Columns:
    low = [box.minimum if box else None for box in boxes]
    high = [box.maximum if box else None for box in boxes]
    return {**_spread_points(f"{name}_min", low), **_spread_points(f"{name}_max", high)}


def assemble_graphs(tables: dict[str, pa.Table]) -> Iterator[SceneGraph]:
    """Assemble scene graphs from the four tables of one shard: the inverse of `collect_columns`."""
    rows: dict[str, dict[str, list[dict[str, Any]]]] = {name: {} for name in tables}
    for name, table in tables.items():
        for row in table.to_pylist():
            rows[name].setdefault(row["scene_id"], []).append(row)
    for scene_id, (scene,) in rows["scenes"].items():
        yield SceneGraph(
            **{name: scene[name] for name in _SCENE},
            rooms=tuple(map(_room, rows["rooms"].get(scene_id, ()))),
            objects=tuple(map(_object, rows["objects"].get(scene_id, ()))),
            adjacency=tuple(
                Edge(row["source_index"], row["target_index"], *(row[name] for name in _EDGE))
                for row in rows["edges"].get(scene_id, ())
                if row["kind"] == "adjacent"
            ),
        )


def _room(row: dict[str, Any]) -> Room:
    corners = row["footprint"]
    return Room(
        **{name: row[name] for name in _ROOM},
        centroid=_point(row, "centroid"),
        box=_box(row, "box"),
        footprint=corners and tuple(zip(corners[::2], corners[1::2], strict=True)),
    )


def _object(row: dict[str, Any]) -> SceneObject:
    return SceneObject(
        **{name: row[name] for name in _OBJECT},
        centroid=_point(row, "centroid"),
        box=_box(row, "box"),
        part_box=_box(row, "part"),
    )


def _point(row: dict[str, Any], name: str) -> Point | None:
    x, y, z = (row[f"{name}_{axis}"] for axis in "xyz")
    return None if x is None else (x, y, z)


def _box(row: dict[str, Any], name: str) -> Box | None:
    minimum, maximum = _point(row, f"{name}_min"), _point(row, f"{name}_max")
    return None if minimum is None or maximum is None else Box(minimum, maximum)
