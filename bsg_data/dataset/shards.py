"""Write scene graphs as parquet shards, and read them back.

`read_scene_graphs` returns what `write_shards` wrote. A file is compared with the hash that the
manifest has of it, and then trusted.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.dataset.manifest import FORMAT_VERSION, FileEntry, Manifest, read_manifest
from bsg_data.dataset.scenes import assemble_graphs
from bsg_data.dataset.schema import SPLITS, TABLES, pairs_schema
from bsg_data.errors import DatasetError
from bsg_data.files import AnyPath, encode_json, flush_file, writing
from bsg_data.scene.class_space import ClassSpace
from bsg_data.scene.scene_graph import SceneGraph, is_scene_id


def write_shards(
    tables: Mapping[str, pa.Table], folder: AnyPath, *, number: int, class_space: ClassSpace
) -> tuple[FileEntry, ...]:
    """Write the tables of the shard with a number."""
    return tuple(
        write_parquet(
            Path(folder),
            f"{name}/part-{number:05d}.parquet",
            [table],
            table=name,
            class_space=class_space,
        )
        for name, table in tables.items()
    )


def read_scene_graphs(dataset: AnyPath) -> Iterator[SceneGraph]:
    """Yield the scene graphs of a dataset, with one shard in memory at a time."""
    dataset = Path(dataset)
    return DatasetFiles(dataset, read_manifest(dataset)).read_graphs()


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
    with writing(where):
        where.parent.mkdir(parents=True, exist_ok=True)
        where.write_bytes(data)
        flush_file(where)
    sha256 = hashlib.sha256(data).hexdigest()
    return FileEntry(path=path, rows=rows, bytes=len(data), sha256=sha256)


@dataclass(frozen=True, eq=False)
class DatasetFiles:
    """The files of a dataset, as its manifest lists them.

    Attributes:
        path: folder of the dataset.
        manifest: its manifest.
    """

    path: Path
    manifest: Manifest

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
        data = _read_whole(path, entry)
        if data is None:
            self._refuse(entry)
        with pq.ParquetFile(pa.BufferReader(data), read_dictionary=[*dictionaries]) as file:
            expected = _schema_of(entry.path.partition("/")[0], self.manifest.class_space)
            for name in {*dictionaries} & {*expected.names}:
                field = expected.field(name)
                words = field.with_type(pa.dictionary(pa.int32(), field.type))
                expected = expected.set(expected.get_field_index(name), words)
            if not file.schema_arrow.equals(expected, check_metadata=False):
                both = (file.schema_arrow, expected)
                plain = [{*map(pa.Field.remove_metadata, some)} for some in both]
                names = ", ".join(sorted({field.name for field in plain[0] ^ plain[1]}))
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


def _read_whole(path: Path, entry: FileEntry) -> bytes | None:
    """Read a file if it is as the manifest says."""
    try:
        data = path.read_bytes() if path.stat().st_size == entry.bytes else b""
    except OSError:
        return None
    return data if hashlib.sha256(data).hexdigest() == entry.sha256 else None


def _schema_of(table: str, class_space: ClassSpace) -> pa.Schema:
    """Return the schema of the files of a table."""
    if table == "pairs":
        return pairs_schema(len(class_space.classes))
    return SPLITS if table == "splits" else TABLES[table]
