"""Write scene graphs as parquet shards, and read them back.

`read_scene_graphs` returns what `write_shards` wrote.
"""

from __future__ import annotations

import hashlib
import mmap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.dataset.manifest import ClassSpaceEntry, FileEntry, Manifest, read_manifest
from bsg_data.dataset.scene_tables import assemble_graphs, collect_columns
from bsg_data.dataset.schema import FORMAT_VERSION, SPLITS, TABLES, pairs_schema
from bsg_data.dataset.version_1 import TABLES_1, convert_table
from bsg_data.errors import DatasetError, MismatchError
from bsg_data.files import AnyPath, encode_json, open_beside
from bsg_data.inputs.bounded_file import Refusal, hash_file, read_bytes
from bsg_data.inputs.bounds import DATASET_TABLE
from bsg_data.inputs.parquet import reading_parquet, words_of
from bsg_data.scene.scene_graph import SceneGraph, is_scene_id

_ROOM = 32 * 2**20  # bytes; encoding a table of usual size takes less


def write_shards(
    graphs: Sequence[SceneGraph], folder: AnyPath, *, part: int, class_space: ClassSpaceEntry
) -> tuple[FileEntry, ...]:
    """Write one part of every table for some scenes, in the order given.

    Raises:
        DatasetError: if a file cannot be written; no incomplete file stays.
    """
    folder = Path(folder)
    columns = collect_columns(graphs, classes=class_space.classes)
    entries = []
    for name, schema in TABLES.items():
        table = pa.Table.from_pydict(columns[name], schema=schema)
        path = f"{name}/part-{part:05d}.parquet"
        with open_parquet(folder / path, schema, table=name, class_space=class_space) as writer:
            writer.write_table(table)
        entries.append(describe_file(folder, path, rows=table.num_rows))
    return tuple(entries)


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

    Raises:
        DatasetError: if a file is missing or unreadable.
        MismatchError: if a file has another class space or format than the manifest.
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
        raise DatasetError(f"{dataset}: has no {name}; run `bsg-data info` to see what it holds")
    return (read_file(dataset, entry, manifest=manifest, columns=columns) for entry in entries)


def read_file(
    dataset: Path, entry: FileEntry, *, manifest: Manifest, columns: list[str] | None = None
) -> pa.Table:
    """Read one parquet file of a dataset, and compare it with the manifest.

    Raises:
        DatasetError: if it is missing, changed or not readable.
        MismatchError: if it is of another class space or format than the manifest.
    """
    # No threads: files are small, and Arrow may abort a process that ends while it starts one.
    with open_listed(dataset, entry, manifest=manifest) as file:
        if manifest.format_version == 1:
            table = to_current(dataset / entry.path, file.read(use_threads=False), manifest)
            table = table if columns is None else table.select(columns)
        else:
            table = file.read(columns=columns, use_threads=False)
        table.validate(full=True)
    if entry.path.startswith("scenes/") and "scene_id" in table.column_names:
        _require_scene_ids(dataset / entry.path, table["scene_id"].to_pylist())
    return table


@contextmanager
def open_listed(dataset: Path, entry: FileEntry, *, manifest: Manifest) -> Iterator[pq.ParquetFile]:
    """Open one parquet file of a dataset; its bytes are read once and hashed.

    Raises:
        DatasetError: if it is missing, changed or unreadable; also inside the block.
        MismatchError: if it is of another class space or format than the manifest.
    """
    path = dataset / entry.path
    if not path.is_file():
        raise DatasetError(f"{path}: is in the manifest but missing; build the dataset again")
    data = read_listed(path, entry, error=_refuse)
    if hashlib.sha256(data).hexdigest() != entry.sha256:
        raise DatasetError(
            f"{path}: is not what the manifest says; run `bsg-data check` for details"
        )
    with reading_parquet(path, data=data, rows=entry.rows, error=_refuse) as file:
        check_file_metadata(path, file.schema_arrow, manifest)
        _require_columns(path, file.schema_arrow, schema_of(table_of(entry), manifest))
        yield file


def read_listed(path: Path, entry: FileEntry, *, error: Refusal) -> bytes:
    """Return the bytes of a file that a manifest lists; refuse another size before reading.

    Raises:
        DatasetError: (or the error that `error` returns) if it is unreadable or has another size.
    """
    try:
        size = path.stat().st_size
    except OSError as fault:
        raise error(f"{path}: cannot be read ({fault.strerror or fault})") from fault
    if size != entry.bytes:
        raise error(
            f"{path}: is not what the manifest says: expected {entry.bytes} bytes, found {size}"
        )
    most = min(size, DATASET_TABLE.bytes)
    return read_bytes(path, replace(DATASET_TABLE, bytes=most), error=error)  # it may grow


def _refuse(said: str) -> DatasetError:
    return DatasetError(f"{said}; run `bsg-data check` for details")


def to_current(path: Path, table: pa.Table, manifest: Manifest) -> pa.Table:
    """Return a table with the columns of format version 2, from a file of any version."""
    if manifest.format_version != 1:
        return table

    def read_sizes() -> pa.Table:
        scenes = path.parent.parent / "scenes" / path.name  # part k of all tables belongs together
        with reading_parquet(scenes, error=DatasetError) as file:
            return file.read(columns=["scene_id", "num_rooms"], use_threads=False)

    return convert_table(
        table,
        path.parent.name,
        class_map=manifest.sources[0].class_map.version,
        read_sizes=read_sizes,
    )


def schema_of(table: str, manifest: Manifest) -> pa.Schema:
    """Return the schema of the files of a table, for the version of the dataset."""
    if table == "splits":
        return SPLITS
    if table == "pairs":
        told = manifest.format_version != 1
        return pairs_schema(len(manifest.class_space.classes), told=told)
    return TABLES_1[table] if manifest.format_version == 1 else TABLES[table]


def table_of(entry: FileEntry) -> str:
    """Return the table of a file: `rooms/part-00000.parquet` → `rooms`."""
    return entry.path.split("/")[0].removesuffix(".parquet")


def _require_columns(path: Path, found: pa.Schema, expected: pa.Schema) -> None:
    if not found.equals(expected, check_metadata=False):
        plain = [{field.remove_metadata() for field in schema} for schema in (found, expected)]
        names = ", ".join(sorted({field.name for field in plain[0] ^ plain[1]})) or "their order"
        raise DatasetError(
            f"{path}: other columns than the format has ({names}); run `bsg-data check` for details"
        )


def _require_scene_ids(path: Path, names: Sequence[object]) -> None:
    """Refuse a scene id that is no file name or occurs twice."""
    known: set[object] = set()
    for name in names:
        if name in known:
            raise DatasetError(
                f"{path}: scene {name} is there twice; run `bsg-data check` for details"
            )
        known.add(name)
        if not is_scene_id(name):
            raise DatasetError(f"{path}: {name!r} is no scene id: it must be usable as a file name")


def read_scene_graphs(
    dataset: AnyPath, *, manifest: Manifest | None = None
) -> Iterator[SceneGraph]:
    """Yield the scene graphs of a dataset, with one shard in memory at a time."""
    dataset = Path(dataset)
    manifest = manifest or read_manifest(dataset)
    parts = zip(*(manifest.files_of(name) for name in TABLES), strict=True)
    for files in parts:
        tables = {
            name: read_file(dataset, file, manifest=manifest)
            for name, file in zip(TABLES, files, strict=True)
        }
        for graph in assemble_graphs(tables):
            _require_whole(dataset / files[0].path, graph)
            yield graph


def _require_whole(path: Path, graph: SceneGraph) -> None:
    """Refuse a scene whose rooms, objects and edges do not fit together."""
    rooms = range(1, len(graph.rooms) + 1)
    ends = [end for edge in graph.adjacency for end in (edge.source, edge.target)]
    is_whole = (
        [room.room_index for room in graph.rooms] == list(rooms)
        and all(obj.room_index == 0 or obj.room_index in rooms for obj in graph.objects)
        and all(end in rooms for end in ends)
    )
    if not is_whole:
        raise DatasetError(
            f"{path}: scene {graph.scene_id}: rooms, objects and edges do not fit together; run "
            "`bsg-data check` for details"
        )


def _require_memory() -> None:
    """Allocate memory and free it at once, without touching it.

    Arrow's dictionary encoder never ends if it gets no memory (seen with pyarrow 26).

    Raises:
        MemoryError: if there is not enough.
    """
    try:
        mmap.mmap(-1, _ROOM).close()
    except OSError as error:
        raise MemoryError(f"writing a table needs {_ROOM // 2**20} MiB of memory") from error


@contextmanager
def open_parquet(
    path: Path, schema: pa.Schema, *, table: str, class_space: ClassSpaceEntry, **extra: str
) -> Iterator[pq.ParquetWriter]:
    """Open a parquet file beside its final path; rename it there when the block succeeds.

    The metadata of every file has its table, format version, class space, class names and `extra`.
    """
    metadata = {
        "bsg.table": table,
        "bsg.format_version": str(FORMAT_VERSION),
        "bsg.class_space": class_space.name,
        "bsg.class_space_sha256": class_space.sha256,
        "bsg.classes": encode_json(class_space.classes, ensure_ascii=False),
        **{f"bsg.{key}": value for key, value in extra.items()},
    }
    _require_memory()
    with (
        open_beside(path) as partial,
        pq.ParquetWriter(
            partial, schema.with_metadata(metadata), compression="zstd", compression_level=3
        ) as writer,
    ):
        yield writer


def describe_file(folder: Path, path: str, *, rows: int) -> FileEntry:
    """Return the manifest's entry of a file that was just written."""
    where = folder / path
    return FileEntry(path=path, rows=rows, bytes=where.stat().st_size, sha256=hash_file(where))


def check_file_metadata(path: Path, schema: pa.Schema, manifest: Manifest) -> None:
    """Check that a file has the dataset's format and class space.

    Raises:
        MismatchError: naming the values of the file and of the manifest.
    """
    words = words_of(schema)
    if manifest.format_version == 1:
        what, ours = "class_map", manifest.sources[0].class_map
        name, sha256 = ours.version, ours.sha256
    else:
        what, name, sha256 = "class_space", manifest.class_space.name, manifest.class_space.sha256
    found = tuple(
        words.get(f"bsg.{key}", "none") for key in ("format_version", what, f"{what}_sha256")
    )
    expected = (str(manifest.format_version), name, sha256)
    if found != expected:
        shown = what.replace("_", " ")
        raise MismatchError(
            f"{path}: expected format {expected[0]}, {shown} {expected[1]} ({expected[2][:12]}…) "
            f"as in the manifest, found format {found[0]}, {found[1]} ({found[2][:12]}…)"
        )
