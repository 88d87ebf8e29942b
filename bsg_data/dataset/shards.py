"""Write scene graphs as parquet shards, and read them back.

`read_scene_graphs` returns what `write_shards` wrote. A file is compared with the hash that the
manifest has of it, and then trusted.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.dataset.manifest import FORMAT_VERSION, FileEntry, Manifest, read_manifest
from bsg_data.dataset.schema import (
    EDGES,
    OBJECTS,
    ROOMS,
    SCENES,
    SPLITS,
    TABLES,
    pairs_schema,
)
from bsg_data.errors import DatasetError
from bsg_data.files import AnyPath, encode_json
from bsg_data.scene.class_space import ClassSpace
from bsg_data.scene.scene_graph import (
    Box,
    Edge,
    Point,
    Room,
    SceneGraph,
    SceneObject,
    is_scene_id,
)

_Columns = dict[str, list[Any]]
_Row = dict[str, Any]


def write_shards(
    graphs: Sequence[SceneGraph], folder: AnyPath, *, part: int, class_space: ClassSpace
) -> tuple[FileEntry, ...]:
    """Write one part of every table for some scenes, in the order given."""
    return tuple(
        write_parquet(
            Path(folder),
            f"{name}/part-{part:05d}.parquet",
            [table],
            table=name,
            class_space=class_space,
        )
        for name, table in make_tables(graphs, class_space.classes).items()
    )


def make_tables(graphs: Sequence[SceneGraph], classes: tuple[str, ...]) -> dict[str, pa.Table]:
    """Return one part of every table for some scenes, in the order given."""
    columns = _collect_columns(graphs, classes)
    return {name: pa.table(columns[name], schema=schema) for name, schema in TABLES.items()}


def read_scene_graphs(
    dataset: AnyPath, *, manifest: Manifest | None = None
) -> Iterator[SceneGraph]:
    """Yield the scene graphs of a dataset, with one shard in memory at a time."""
    dataset = Path(dataset)
    manifest = manifest or read_manifest(dataset)
    for files in zip(*(manifest.files_of(name) for name in TABLES), strict=True):
        tables = (read_file(dataset, file, manifest=manifest) for file in files)
        yield from assemble_graphs(*tables)


def _own_columns(schema: pa.Schema, record: type) -> list[str]:
    """Return the columns that are fields of a record with the same name."""
    names = {field.name for field in fields(record)}
    return [name for name in schema.names if name in names]


_SCENE, _EDGE = _own_columns(SCENES, SceneGraph), _own_columns(EDGES, Edge)
_ROOM, _OBJECT = _own_columns(ROOMS, Room), _own_columns(OBJECTS, SceneObject)


def _collect_columns(graphs: Sequence[SceneGraph], classes: tuple[str, ...]) -> dict[str, _Columns]:
    """Return table → column → values, scenes in the order given."""
    rooms = [room for graph in graphs for room in graph.rooms]
    objects = [obj for graph in graphs for obj in graph.objects]
    indices = [obj.class_index for obj in objects]
    edges = [edge for graph in graphs for edge in _list_edges(graph)]
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
        "edges": {name: [edge[i] for edge in edges] for i, name in enumerate(EDGES.names)},
    }


def _list_edges(graph: SceneGraph) -> Iterator[tuple[object, ...]]:
    """Yield the rows of the edges: building → rooms, rooms → objects, then adjacency."""
    scene = graph.scene_id
    for room in graph.rooms:
        yield scene, "contains", "building", 0, "room", room.room_index, "annotation", None
    for obj in graph.objects:
        ends = "room" if obj.room_index else "building", obj.room_index, "object", obj.object_index
        yield scene, "contains", *ends, "annotation", None
    for edge in graph.adjacency:
        ends = "room", edge.source, "room", edge.target
        yield scene, "adjacent", *ends, edge.method, edge.distance_m


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


def _group_rows(table: pa.Table) -> dict[str, list[_Row]]:
    """Return scene id → its rows."""
    rows: dict[str, list[_Row]] = {}
    for row in table.to_pylist():
        rows.setdefault(row["scene_id"], []).append(row)
    return rows


def assemble_graphs(*tables: pa.Table) -> Iterator[SceneGraph]:
    """Assemble scene graphs from one part of every table: the inverse of `make_tables`."""
    scenes, rooms, objects, edges = map(_group_rows, tables)
    for scene_id, (scene,) in scenes.items():
        adjacent = (row for row in edges.get(scene_id, ()) if row["kind"] == "adjacent")
        yield SceneGraph(
            **{name: scene[name] for name in _SCENE},
            rooms=tuple(map(_room, rooms.get(scene_id, ()))),
            objects=tuple(map(_object, objects.get(scene_id, ()))),
            adjacency=tuple(
                Edge(row["source_index"], row["target_index"], *(row[name] for name in _EDGE))
                for row in adjacent
            ),
        )


def _room(row: _Row) -> Room:
    corners = row["footprint"]
    row["footprint"] = corners and tuple(zip(corners[::2], corners[1::2], strict=True))
    own = {name: row[name] for name in _ROOM}
    return Room(**own, centroid=_point(row, "centroid"), box=_box(row, "box"))


def _object(row: _Row) -> SceneObject:
    own = {name: row[name] for name in _OBJECT}
    centroid, box, part = _point(row, "centroid"), _box(row, "box"), _box(row, "part")
    return SceneObject(**own, centroid=centroid, box=box, part_box=part)


def _point(row: _Row, name: str) -> Point | None:
    x, y, z = (row[f"{name}_{axis}"] for axis in "xyz")
    return None if x is None else (x, y, z)


def _box(row: _Row, name: str) -> Box | None:
    minimum, maximum = _point(row, f"{name}_min"), _point(row, f"{name}_max")
    return None if minimum is None or maximum is None else Box(minimum, maximum)


def write_parquet(
    folder: Path,
    path: str,
    tables: Iterable[pa.Table],
    *,
    table: str,
    class_space: ClassSpace,
    **extra: str,
) -> FileEntry:
    """Write a parquet file at a path that nobody reads yet, and return its entry.

    Its metadata has its table, format version, class space, class names and `extra`.

    Args:
        folder: of the dataset.
        path: path of the file below it.
        tables: its row groups.
        table: name of the table that it is a part of.
        class_space: the classes of the dataset.
        **extra: more metadata.
    """
    metadata = {
        "bsg.table": table,
        "bsg.format_version": str(FORMAT_VERSION),
        "bsg.class_space": class_space.name,
        "bsg.class_space_sha256": class_space.sha256,
        "bsg.classes": encode_json(class_space.classes, ensure_ascii=False),
        **{f"bsg.{key}": value for key, value in extra.items()},
    }
    schema, sink, rows = schema_of(table, class_space), pa.BufferOutputStream(), 0
    with pq.ParquetWriter(
        sink, schema.with_metadata(metadata), compression="zstd", compression_level=3
    ) as writer:
        for group in tables:
            writer.write_table(group)
            rows += len(group)
    data, where = sink.getvalue(), folder / path
    try:
        where.parent.mkdir(parents=True, exist_ok=True)
        with where.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        message = f"{where}: cannot be written ({error.strerror or error})"
        raise DatasetError(message, code="not-written", where=where) from error
    sha256 = hashlib.sha256(data).hexdigest()
    return FileEntry(path=path, rows=rows, bytes=len(data), sha256=sha256)


def read_table(
    dataset: AnyPath,
    name: str,
    *,
    columns: list[str] | None = None,
    manifest: Manifest | None = None,
) -> pa.Table:
    """Read a whole table of a dataset, with rows in order.

    Args:
        dataset: folder of the dataset.
        name: `scenes`, `rooms`, `objects`, `edges` or `splits`.
        columns: names of the columns to read, in this order; None: all.
        manifest: its manifest, if it was read already.
    """
    dataset = Path(dataset)
    return pa.concat_tables(stream_table(dataset, name, columns=columns, manifest=manifest))


def stream_table(
    dataset: Path, name: str, *, columns: list[str] | None = None, manifest: Manifest | None = None
) -> Iterator[pa.Table]:
    """Yield a table of a dataset file by file; see `read_table`."""
    manifest = manifest or read_manifest(dataset)
    entries = manifest.files_of(name)
    if not entries:
        message = f"{dataset}: has no {name}; run `bsg-data info` to see what it holds"
        raise DatasetError(message, code="table-missing", where=name)
    return (read_file(dataset, entry, manifest=manifest, columns=columns) for entry in entries)


def read_file(
    dataset: Path, entry: FileEntry, *, manifest: Manifest, columns: list[str] | None = None
) -> pa.Table:
    """Read one parquet file of a dataset; see `open_listed`."""
    # No threads: files are small, and Arrow may abort a process that ends while it starts one.
    with open_listed(dataset, entry, manifest=manifest) as file:
        table = file.read(columns=columns, use_threads=False)
    if entry.path.startswith("scenes/") and "scene_id" in table.column_names:
        for scene in table["scene_id"].to_pylist():
            if not is_scene_id(scene):  # it becomes part of names of files
                message = f"{dataset / entry.path}: {scene!r} cannot be part of a file name"
                raise DatasetError(message, code="scene-id", where=entry.path)
    return table


@contextmanager
def open_listed(dataset: Path, entry: FileEntry, *, manifest: Manifest) -> Iterator[pq.ParquetFile]:
    """Open one parquet file of a dataset; its bytes are read once, hashed, and then trusted."""
    path = dataset / entry.path
    try:
        data = path.read_bytes() if path.stat().st_size == entry.bytes else b""
    except OSError as error:
        raise DatasetError(
            f"{path}: is in the manifest but cannot be read ({error.strerror or error}); build the "
            "dataset again",
            code="file-missing",
            where=entry.path,
        ) from error
    if hashlib.sha256(data).hexdigest() != entry.sha256:
        message = f"{path}: is not what the manifest says; run `bsg-data check` for details"
        raise DatasetError(message, code="file-changed", where=entry.path)
    with pq.ParquetFile(pa.BufferReader(data)) as file:
        expected = schema_of(entry.path.partition("/")[0], manifest.class_space)
        if not file.schema_arrow.equals(expected, check_metadata=False):
            plain = [{*map(pa.Field.remove_metadata, one)} for one in (file.schema_arrow, expected)]
            names = ", ".join(sorted({field.name for field in plain[0] ^ plain[1]}))
            message = f"{path}: other columns than the format has ({names or 'their order'})"
            raise DatasetError(message, code="columns", where=entry.path)
        yield file


def schema_of(table: str, class_space: ClassSpace) -> pa.Schema:
    """Return the schema of the files of a table."""
    if table == "pairs":
        return pairs_schema(len(class_space.classes))
    return SPLITS if table == "splits" else TABLES[table]
