"""Convert scene graphs to columns of the dataset's tables, and back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import pyarrow as pa

from bsg_data.dataset.schema import TABLES
from bsg_data.scene.scene_graph import Box, Edge, Point, Room, SceneGraph, SceneObject


def collect_columns(
    graphs: Iterable[SceneGraph], *, classes: tuple[str, ...]
) -> dict[str, dict[str, list[Any]]]:
    """Collect scene graphs as columns: table → column → values, scenes in the order given."""
    columns: dict[str, dict[str, list[Any]]] = {
        name: {column: [] for column in schema.names} for name, schema in TABLES.items()
    }

    def append(table: str, **row: Any) -> None:
        for column, values in columns[table].items():
            values.append(row[column])

    for graph in graphs:
        append(
            "scenes",
            scene_id=graph.scene_id,
            source=graph.source,
            source_version=graph.source_version,
            source_split=graph.source_split,
            class_map=graph.class_map,
            building_kind=graph.building_kind,
            num_rooms=len(graph.rooms),
            num_objects=len(graph.objects),
            num_classified=sum(obj.class_index is not None for obj in graph.objects),
            has_geometry=graph.has_geometry,
            up_axis=graph.up_axis,
            annotation_sha256=graph.annotation_sha256,
        )
        for room in graph.rooms:
            append(
                "rooms",
                scene_id=graph.scene_id,
                room_index=room.room_index,
                region_id=room.region_id,
                label=room.label,
                source_label=room.source_label,
                floor_index=room.floor_index,
                floor_z=room.floor_z,
                floor_area=room.floor_area,
                footprint=_flatten(room.footprint),
                **_position_columns(room),
            )
        for obj in graph.objects:
            append(
                "objects",
                **{"class": None if obj.class_index is None else classes[obj.class_index]},
                scene_id=graph.scene_id,
                object_index=obj.object_index,
                instance_id=obj.instance_id,
                room_index=obj.room_index,
                raw_category=obj.raw_category,
                category=obj.category,
                role=obj.role,
                class_index=obj.class_index,
                colour=obj.colour,
                has_geometry=obj.box is not None,
                area=obj.area,
                **_position_columns(obj),
                **_box_columns("part", obj.part_box),
            )
        for edge in graph.edges():
            source, target = graph.describe_node(edge.source), graph.describe_node(edge.target)
            append(
                "edges",
                scene_id=graph.scene_id,
                source_kind=source[0],
                source_index=source[1],
                target_kind=target[0],
                target_index=target[1],
                kind=edge.kind,
                method=edge.method,
                distance_m=edge.distance_m,
            )
    return columns


def _position_columns(node: Room | SceneObject) -> dict[str, float | None]:
    return {**_point_columns("centroid", node.centroid), **_box_columns("box", node.box)}


def _box_columns(name: str, box: Box | None) -> dict[str, float | None]:
    low, high = (box.minimum, box.maximum) if box else (None, None)
    return {**_point_columns(f"{name}_min", low), **_point_columns(f"{name}_max", high)}


def _point_columns(name: str, point: Point | None) -> dict[str, float | None]:
    values = point or (None, None, None)
    return {f"{name}_{axis}": value for axis, value in zip("xyz", values, strict=True)}


def _flatten(footprint: tuple[tuple[float, float], ...] | None) -> list[float] | None:
    return None if footprint is None else [value for corner in footprint for value in corner]


def assemble_graphs(tables: dict[str, pa.Table]) -> Iterator[SceneGraph]:
    """Assemble scene graphs from the four tables of one shard: the inverse of `collect_columns`."""
    rows = {name: _by_scene(table) for name, table in tables.items()}
    for scene_id, (scene,) in rows["scenes"].items():
        yield _graph(
            scene,
            rooms=rows["rooms"].get(scene_id, []),
            objects=rows["objects"].get(scene_id, []),
            edges=rows["edges"].get(scene_id, []),
        )


def _by_scene(table: pa.Table) -> dict[str, list[dict[str, Any]]]:
    rows: dict[str, list[dict[str, Any]]] = {}
    for row in table.to_pylist():
        rows.setdefault(row["scene_id"], []).append(row)
    return rows


def _graph(
    scene: dict[str, Any],
    *,
    rooms: list[dict[str, Any]],
    objects: list[dict[str, Any]],
    edges: list[dict[str, Any]],
) -> SceneGraph:
    return SceneGraph(
        scene_id=scene["scene_id"],
        source=scene["source"],
        source_version=scene["source_version"],
        source_split=scene["source_split"],
        annotation_sha256=scene["annotation_sha256"],
        up_axis=scene["up_axis"],
        class_map=scene["class_map"],
        building_kind=scene["building_kind"],
        rooms=tuple(
            Room(
                room_index=row["room_index"],
                region_id=row["region_id"],
                source_label=row["source_label"],
                label=row["label"],
                centroid=_point(row, "centroid"),
                box=_box(row, "box"),
                floor_index=row["floor_index"],
                floor_z=row["floor_z"],
                footprint=_footprint(row["footprint"]),
                floor_area=row["floor_area"],
            )
            for row in rooms
        ),
        objects=tuple(
            SceneObject(
                object_index=row["object_index"],
                instance_id=row["instance_id"],
                room_index=row["room_index"],
                raw_category=row["raw_category"],
                category=row["category"],
                class_index=row["class_index"],
                role=row["role"],
                colour=row["colour"],
                centroid=_point(row, "centroid"),
                box=_box(row, "box"),
                area=row["area"],
                part_box=_box(row, "part"),
            )
            for row in objects
        ),
        adjacency=tuple(
            Edge(
                row["source_index"],
                row["target_index"],
                row["kind"],
                row["method"],
                row["distance_m"],
            )
            for row in edges
            if row["kind"] == "adjacent"
        ),
    )


def _footprint(values: list[float] | None) -> tuple[tuple[float, float], ...] | None:
    return None if values is None else tuple(zip(values[::2], values[1::2], strict=True))


def _point(row: dict[str, Any], name: str) -> Point | None:
    x, y, z = (row[f"{name}_{axis}"] for axis in "xyz")
    return None if x is None else (x, y, z)


def _box(row: dict[str, Any], name: str) -> Box | None:
    minimum, maximum = _point(row, f"{name}_min"), _point(row, f"{name}_max")
    return None if minimum is None or maximum is None else Box(minimum, maximum)
