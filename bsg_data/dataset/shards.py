"""Write scene graphs as parquet shards, and read them back.

`read_scene_graphs` returns what `write_shards` wrote. A file is compared with the hash that the
manifest has of it, and then trusted.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.dataset.manifest import FileEntry, Manifest, read_manifest
from bsg_data.dataset.scene_tables import assemble_graphs, collect_columns
from bsg_data.dataset.schema import FORMAT_VERSION, SPLITS, TABLES, pairs_schema
from bsg_data.errors import DatasetError, MismatchError
from bsg_data.files import AnyPath, encode_json
from bsg_data.scene.class_space import ClassSpace
from bsg_data.scene.scene_graph import SceneGraph, is_scene_id


def write_shards(
    graphs: Sequence[SceneGraph], folder: AnyPath, *, part: int, class_space: ClassSpace
) -> tuple[FileEntry, ...]:
    """Write one part of every table for some scenes, in the order given."""
    columns = collect_columns(graphs, classes=class_space.classes)
    entries = []
    for name, schema in TABLES.items():
        table = pa.Table.from_pydict(columns[name], schema=schema)
        path = f"{name}/part-{part:05d}.parquet"
        with writing_parquet(
            Path(folder), path, schema, table=name, class_space=class_space
        ) as writer:
            writer.write(table)
        entries.append(writer.entry)
    return tuple(entries)


class ParquetFile:
    """A parquet file that is being written, hashed on its way to the disk."""

    entry: FileEntry  # what the manifest says of it, when it is written

    def __init__(self, writer: pq.ParquetWriter) -> None:
        self._writer, self.rows = writer, 0

    def write(self, table: pa.Table) -> None:
        """Add rows as one row group."""
        self._writer.write_table(pa.table(table.columns, schema=self._writer.schema))
        self.rows += table.num_rows


@contextmanager
def writing_parquet(
    folder: Path,
    path: str,
    schema: pa.Schema,
    *,
    table: str,
    class_space: ClassSpace,
    **extra: str,
) -> Iterator[ParquetFile]:
    """Write a parquet file at a path that nobody reads yet, and flush it.

    Its metadata has its table, format version, class space, class names and `extra`.
    """
    metadata = {
        "bsg.table": table,
        "bsg.format_version": str(FORMAT_VERSION),
        "bsg.class_space": class_space.name,
        "bsg.class_space_sha256": class_space.sha256,
        "bsg.classes": encode_json(class_space.classes, ensure_ascii=False),
        **{f"bsg.{key}": value for key, value in extra.items()},
    }
    where = folder / path
    try:
        where.parent.mkdir(parents=True, exist_ok=True)
        with where.open("wb") as raw:
            hashed = _Hashed(raw)
            with pq.ParquetWriter(
                hashed, schema.with_metadata(metadata), compression="zstd", compression_level=3
            ) as writer:
                written = ParquetFile(writer)
                yield written
            raw.flush()
            os.fsync(raw.fileno())
            size = raw.tell()
    except OSError as error:
        message = f"{where}: cannot be written ({error.strerror or error})"
        raise DatasetError(message, code="not-written", where=where) from error
    written.entry = FileEntry(
        path=path, rows=written.rows, bytes=size, sha256=hashed.digest.hexdigest()
    )


class _Hashed(io.RawIOBase):
    """A file whose bytes are hashed as they are written."""

    def __init__(self, raw: io.BufferedWriter) -> None:
        self._raw, self.digest = raw, hashlib.sha256()

    def writable(self) -> bool:
        return True

    def write(self, data: Any, /) -> int:
        self.digest.update(data)
        return self._raw.write(data)


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
    if _table_of(entry) == "scenes" and "scene_id" in table.column_names:
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
        _require_schema(path, entry, file, manifest)
        yield file


def _require_schema(path: Path, entry: FileEntry, file: pq.ParquetFile, manifest: Manifest) -> None:
    """Refuse a file of other columns, or of another format or class space than the manifest."""
    schema, expected = file.schema_arrow, schema_of(_table_of(entry), manifest)
    words = {key.decode(): value.decode() for key, value in (schema.metadata or {}).items()}
    found = tuple(
        words.get(f"bsg.{key}", "none")
        for key in ("format_version", "class_space", "class_space_sha256")
    )
    space = manifest.class_space
    if found != (str(FORMAT_VERSION), space.name, space.sha256):
        raise MismatchError(
            f"{path}: expected format {FORMAT_VERSION} and class space {space} as in the manifest, "
            f"found format {found[0]} and {found[1]} (sha256 {found[2][:12]}…)",
            code="file-mismatch",
            where=entry.path,
        )
    if not schema.equals(expected, check_metadata=False):
        plain = [{field.remove_metadata() for field in one} for one in (schema, expected)]
        names = ", ".join(sorted({field.name for field in plain[0] ^ plain[1]})) or "their order"
        message = f"{path}: other columns than the format has ({names})"
        raise DatasetError(message, code="columns", where=entry.path)


def schema_of(table: str, manifest: Manifest) -> pa.Schema:
    """Return the schema of the files of a table."""
    if table == "pairs":
        return pairs_schema(len(manifest.class_space.classes))
    return SPLITS if table == "splits" else TABLES[table]


def _table_of(entry: FileEntry) -> str:
    """Return the table of a file: `rooms/part-00000.parquet` → `rooms`."""
    return entry.path.partition("/")[0]


def read_scene_graphs(
    dataset: AnyPath, *, manifest: Manifest | None = None
) -> Iterator[SceneGraph]:
    """Yield the scene graphs of a dataset, with one shard in memory at a time."""
    dataset = Path(dataset)
    manifest = manifest or read_manifest(dataset)
    for files in zip(*(manifest.files_of(name) for name in TABLES), strict=True):
        yield from assemble_graphs(
            {
                name: read_file(dataset, file, manifest=manifest)
                for name, file in zip(TABLES, files, strict=True)
            }
        )
