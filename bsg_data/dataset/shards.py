"""Write scene graphs as parquet shards, and read them back.

`read_scene_graphs` returns what `write_shards` wrote. A file is compared with the hash that the
manifest has of it, and then trusted.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any, NoReturn, TypeAlias, TypeVar, cast

import pyarrow as pa
import pyarrow.compute as pc
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

HELD_FILES = 64 * 2**20  # bytes of the files of a dataset that an open one keeps
Held: TypeAlias = Mapping[str, bytes]  # path of a file below its dataset → its bytes
_Columns = dict[str, list[Any]]
_Record = TypeVar("_Record")


def write_shards(
    graphs: Sequence[SceneGraph], folder: AnyPath, *, number: int, class_space: ClassSpace
) -> tuple[FileEntry, ...]:
    """Write the shard with a number, of some scenes in the order given."""
    return tuple(
        write_parquet(
            Path(folder),
            f"{name}/part-{number:05d}.parquet",
            [table],
            table=name,
            class_space=class_space,
        )
        for name, table in make_tables(graphs, class_space.classes).items()
    )


def make_tables(graphs: Sequence[SceneGraph], classes: tuple[str, ...]) -> dict[str, pa.Table]:
    """Return the tables of one shard, of some scenes in the order given."""
    columns = collect_columns(graphs, classes)
    return {name: pa.table(columns[name], schema=schema) for name, schema in TABLES.items()}


def read_scene_graphs(dataset: AnyPath) -> Iterator[SceneGraph]:
    """Yield the scene graphs of a dataset, with one shard in memory at a time."""
    dataset = Path(dataset)
    manifest = read_manifest(dataset)
    entries = [entry for name in TABLES for entry in manifest.files_of(name)]
    return DatasetFiles(dataset, manifest, hold_files(dataset, entries)).read_graphs()


def _own_columns(schema: pa.Schema, names: Iterable[str]) -> list[str]:
    """Return the columns that are fields of a record with the same name."""
    return [name for name in names if name in schema.names]


_SCENE = _own_columns(SCENES, [one.name for one in fields(SceneGraph)])
_ROOM = _own_columns(ROOMS, [one.name for one in fields(Room)])
_OBJECT = _own_columns(OBJECTS, SceneObject._fields)
_EDGE = _own_columns(EDGES, [one.name for one in fields(Edge)])


def collect_columns(graphs: Sequence[SceneGraph], classes: tuple[str, ...]) -> dict[str, _Columns]:
    """Return table → column → values, scenes in the order given."""
    rooms = [room for graph in graphs for room in graph.rooms]
    held = _turn([obj for graph in graphs for obj in graph.objects])
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
            **{name: held[name] for name in _OBJECT},
            "scene_id": [graph.scene_id for graph in graphs for _ in graph.objects],
            "class": [None if at is None else classes[at] for at in held["class_index"]],
            "has_geometry": [box is not None for box in held["box"]],
            **_spread_points("centroid", held["centroid"]),
            **_spread_boxes("box", held["box"]),
            **_spread_boxes("part", held["part_box"]),
        },
        "edges": _collect_edges(graphs),
    }


def _turn(objects: Sequence[SceneObject]) -> _Columns:
    """Return the fields of objects as columns."""
    columns = zip(*objects, strict=True) if objects else (() for _ in SceneObject._fields)
    return dict(zip(SceneObject._fields, map(list, columns), strict=True))


def _collect_edges(graphs: Sequence[SceneGraph]) -> _Columns:
    """Return the columns of the edges: building → rooms, rooms → objects, then adjacency."""
    columns: _Columns = {name: [] for name in EDGES.names}
    for graph in graphs:
        rooms, edges = [room.room_index for room in graph.rooms], graph.adjacency
        above = [obj.room_index for obj in graph.objects]
        contained, joined = len(rooms) + len(above), len(edges)
        rows: _Columns = {
            "scene_id": [graph.scene_id] * (contained + joined),
            "kind": ["contains"] * contained + ["adjacent"] * joined,
            "source_kind": [
                *("building" for _ in rooms),
                *("room" if room else "building" for room in above),
                *("room" for _ in edges),
            ],
            "source_index": [0] * len(rooms) + above + [edge.source for edge in edges],
            "target_kind": ["room"] * len(rooms) + ["object"] * len(above) + ["room"] * joined,
            "target_index": [
                *rooms,
                *(obj.object_index for obj in graph.objects),
                *(edge.target for edge in edges),
            ],
            "method": ["annotation"] * contained + [edge.method for edge in edges],
            "distance_m": [None] * contained + [edge.distance_m for edge in edges],
        }
        for name, values in rows.items():
            columns[name] += values
    return columns


def _take(names: Iterable[str], records: Sequence[object]) -> _Columns:
    return {name: list(map(attrgetter(name), records)) for name in names}


def _spread_points(name: str, points: Sequence[Point | None]) -> _Columns:
    axes = [f"{name}_{axis}" for axis in "xyz"]
    if not any(points):  # as in a text without a mesh
        return dict.fromkeys(axes, [None] * len(points))
    return {axis: [point and point[number] for point in points] for number, axis in enumerate(axes)}


def _spread_boxes(name: str, boxes: Sequence[Box | None]) -> _Columns:
    low = [box.minimum if box else None for box in boxes]
    high = [box.maximum if box else None for box in boxes]
    return {**_spread_points(f"{name}_min", low), **_spread_points(f"{name}_max", high)}


def assemble_graphs(*tables: pa.Table) -> Iterator[SceneGraph]:
    """Assemble scene graphs from the tables of one shard: the inverse of `make_tables`."""
    scenes, rooms, objects, edges = tables
    room_of, object_of = _group(rooms, _read_rooms(rooms)), _group(objects, _read_objects(objects))
    edges = take_adjacent(edges)
    edge_of = _group(edges, _read_edges(edges))
    for row in scenes.to_pylist():
        scene = row["scene_id"]
        yield SceneGraph(
            **{name: row[name] for name in _SCENE},
            rooms=tuple(room_of.get(scene, ())),
            objects=tuple(object_of.get(scene, ())),
            adjacency=tuple(edge_of.get(scene, ())),
        )


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
    columns = _read_columns(table, _ROOM)
    columns["footprint"] = [
        corners and tuple(zip(corners[::2], corners[1::2], strict=True))
        for corners in columns["footprint"]
    ]
    columns["centroid"], columns["box"] = _read_points(table, "centroid"), _read_boxes(table, "box")
    return _make(Room, columns)


def _read_objects(table: pa.Table) -> Iterator[SceneObject]:
    columns = _read_columns(table, _OBJECT)
    columns["centroid"] = _read_points(table, "centroid")
    columns["box"], columns["part_box"] = _read_boxes(table, "box"), _read_boxes(table, "part")
    return map(
        SceneObject._make, zip(*(columns[name] for name in SceneObject._fields), strict=True)
    )


def _read_edges(table: pa.Table) -> Iterator[Edge]:
    ends = {end: table[f"{end}_index"].to_pylist() for end in ("source", "target")}
    return _make(Edge, ends | _read_columns(table, _EDGE))


def _make(record: type[_Record], columns: _Columns) -> Iterator[_Record]:
    """Make records of columns with the names of their fields."""
    return map(record, *(columns[one.name] for one in fields(cast(Any, record))))


def _read_columns(table: pa.Table, names: Iterable[str]) -> _Columns:
    return {name: read_column(table[name]) for name in names}


def read_column(column: pa.ChunkedArray) -> list[Any]:
    """Return the values of a column."""
    return [None] * len(column) if column.null_count == len(column) else column.to_pylist()


def _read_points(table: pa.Table, name: str) -> list[Point | None]:
    axes = (read_column(table[f"{name}_{axis}"]) for axis in "xyz")
    return [None if point[0] is None else point for point in zip(*axes, strict=True)]


def _read_boxes(table: pa.Table, name: str) -> list[Box | None]:
    corners = (_read_points(table, f"{name}_{end}") for end in ("min", "max"))
    return [a and b and Box(a, b) for a, b in zip(*corners, strict=True)]


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
        table: name of the table that it belongs to.
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
    schema, sink, rows = _schema_of(table, class_space), pa.BufferOutputStream(), 0
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


@dataclass(frozen=True, eq=False)
class DatasetFiles:
    """The files of a dataset, as its manifest lists them.

    Attributes:
        path: folder of the dataset.
        manifest: its manifest.
        held: its files in memory; none of a dataset larger than `HELD_FILES`.
    """

    path: Path
    manifest: Manifest
    held: Held = field(repr=False)

    def read_graphs(self) -> Iterator[SceneGraph]:
        """Yield the scene graphs, with one shard in memory at a time."""
        for files in zip(*map(self.manifest.files_of, TABLES), strict=True):
            yield from assemble_graphs(*map(self.read_file, files))

    def read_table(self, name: str, *, columns: list[str] | None = None) -> pa.Table:
        """Read a whole table, with rows in order.

        Args:
            name: `scenes`, `rooms`, `objects`, `edges` or `splits`.
            columns: names of the columns to read, in this order; None: all.
        """
        return pa.concat_tables(self.stream_table(name, columns=columns))

    def stream_table(self, name: str, *, columns: list[str] | None = None) -> Iterator[pa.Table]:
        """Yield a table file by file; see `read_table`."""
        entries = self.manifest.files_of(name)
        if not entries:
            message = f"{self.path}: has no {name}; run `bsg-data info` to see what it holds"
            raise DatasetError(message, code="table-missing", where=name)
        return (self.read_file(entry, columns=columns) for entry in entries)

    def read_file(
        self,
        entry: FileEntry,
        *,
        columns: list[str] | None = None,
        dictionaries: Sequence[str] = (),
    ) -> pa.Table:
        """Read one parquet file; see `open_file`."""
        # No threads: files are small, and Arrow may abort a process that ends while it starts one.
        with self.open_file(entry, dictionaries=dictionaries) as file:
            table = file.read(columns=columns, use_threads=False)
        if entry.path.startswith("scenes/") and "scene_id" in table.column_names:
            for scene in table["scene_id"].to_pylist():
                if not is_scene_id(scene):  # names of files have it in them
                    message = f"{self.path / entry.path}: {scene!r} cannot be part of a file name"
                    raise DatasetError(message, code="scene-id", where=entry.path)
        return table

    @contextmanager
    def open_file(
        self, entry: FileEntry, *, dictionaries: Sequence[str] = ()
    ) -> Iterator[pq.ParquetFile]:
        """Open one parquet file; its bytes are read once, hashed, and then trusted.

        Columns of words that repeat may be read as dictionaries.
        """
        path = self.path / entry.path
        data = self.held.get(entry.path) or _read_whole(path, entry)
        if data is None:
            self._refuse(entry)
        with pq.ParquetFile(pa.BufferReader(data), read_dictionary=[*dictionaries]) as file:
            expected = _schema_of(_table_of(entry), self.manifest.class_space)
            for name in {*dictionaries} & {*expected.names}:
                one = expected.field(name)
                words = one.with_type(pa.dictionary(pa.int32(), one.type))
                expected = expected.set(expected.get_field_index(name), words)
            if not file.schema_arrow.equals(expected, check_metadata=False):
                both = (file.schema_arrow, expected)
                plain = [{*map(pa.Field.remove_metadata, some)} for some in both]
                names = ", ".join(sorted({one.name for one in plain[0] ^ plain[1]}))
                message = f"{path}: other columns than the format has ({names or 'their order'})"
                raise DatasetError(message, code="columns", where=entry.path)
            yield file

    def _refuse(self, entry: FileEntry) -> NoReturn:
        """Say why a file cannot be read."""
        if read_manifest(self.path) != self.manifest:
            refuse_replaced(self.path)
        path = self.path / entry.path
        try:
            found = path.stat().st_size
        except OSError as error:
            raise DatasetError(
                f"{path}: is in the manifest but cannot be read ({error.strerror or error}); build "
                "the dataset again",
                code="file-missing",
                where=entry.path,
            ) from error
        raise DatasetError(
            f"{path}: was changed: expected {entry.bytes:,} bytes, sha256 {entry.sha256[:12]}…, "
            f"found {found:,} bytes; take another copy, or build the dataset again",
            code="file-changed",
            where=entry.path,
        )


def refuse_replaced(dataset: Path) -> NoReturn:
    """Refuse to go on with a dataset that another command has replaced: its old files are gone."""
    raise DatasetError(
        f"{dataset}: another command has replaced it while it was read; run this again",
        code="dataset-replaced",
        where=dataset,
    )


def hold_files(dataset: Path, entries: Sequence[FileEntry]) -> Held:
    """Read the bytes of files, so that a command that replaces the dataset takes nothing away.

    Files that together have more than `HELD_FILES` bytes are not held, nor is a damaged one, which
    is refused when it is read.
    """
    if sum(entry.bytes for entry in entries) > HELD_FILES:
        return {}
    read = ((entry.path, _read_whole(dataset / entry.path, entry)) for entry in entries)
    return {path: data for path, data in read if data is not None}


def _read_whole(path: Path, entry: FileEntry) -> bytes | None:
    """Read a file if it is as the manifest says."""
    try:
        data = path.read_bytes() if path.stat().st_size == entry.bytes else b""
    except OSError:
        return None
    return data if hashlib.sha256(data).hexdigest() == entry.sha256 else None


def _table_of(entry: FileEntry) -> str:
    return entry.path.partition("/")[0]


def _schema_of(table: str, class_space: ClassSpace) -> pa.Schema:
    """Return the schema of the files of a table."""
    if table == "pairs":
        return pairs_schema(len(class_space.classes))
    return SPLITS if table == "splits" else TABLES[table]
