"""Define, write and read the rows of belief tables, one row group at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from bsg_data.errors import DatasetError
from bsg_data.inputs.bounds import MAX_STREAMED_ROWS
from bsg_data.inputs.parquet import open_parquet_file
from bsg_data.result_folder import SCRATCH
from bsg_data.seals import SEAL, replace_sealed, require_seal
from bsg_models.errors import BeliefFileError

ROWS_PER_GROUP = 65_536  # nodes
_SEALED = b"bsg.seal"  # in the metadata of every table that has a seal file beside it
_METRES = pa.list_(pa.float64())
SCHEMAS = {
    "nodes": pa.schema(
        [
            ("scene_id", pa.string()),
            ("node", pa.int32()),
            ("kind", pa.string()),
            ("id", pa.string()),
            ("room", pa.string()),
            ("category", pa.string()),
            ("corrected", pa.string()),
            ("class", pa.string()),
            ("expected", pa.float64()),
            ("presence", pa.float64()),
            ("visited", pa.bool_()),
            ("hidden_share", pa.float64()),
            ("hidden_share_sd", pa.float64()),
            ("label", pa.string()),
            ("position", _METRES),
            ("box", _METRES),
            ("footprint", _METRES),
            ("floor_index", pa.int16()),
            ("floor_area", pa.float64()),
            ("room_type", pa.map_(pa.string(), pa.float64())),
        ]
    ),
    "edges": pa.schema(
        [
            ("scene_id", pa.string()),
            ("source", pa.int32()),
            ("target", pa.int32()),
            ("kind", pa.string()),
        ]
    ),
    "histograms": pa.schema(
        [
            ("scene_id", pa.string()),
            ("node", pa.int32()),
            ("input", pa.list_(pa.int32())),
            ("expected", pa.list_(pa.float64())),
            ("presence", pa.list_(pa.float64())),
        ]
    ),
}
FILES = tuple(f"{name}.parquet" for name in SCHEMAS)
# Columns that were added later: `corrected` in version 2, the next two in 3, the last in 4.
_NEW = frozenset({"corrected", "floor_area", "room_type", "hidden_share_sd"})
NODES = "nodes.parquet"  # the file that identifies belief tables
_SORTED_BY = {"nodes": ("node",), "edges": ("source", "target"), "histograms": ("node",)}


def write_rows(
    packed: Iterable[Mapping[str, pa.RecordBatch]],
    folder: Path,
    *,
    metadata: Callable[[], Mapping[str, Mapping[bytes, str]]],
) -> None:
    """Write the rows of belief graphs, one file per table: all of them, sealed, or none.

    Args:
        packed: rows of each belief graph, by the names of `SCHEMAS`.
        folder: of the files; it is made once all rows exist.
        metadata: returns the metadata of some tables, once all rows exist.

    Raises:
        DatasetError: if they cannot be written.
    """
    try:
        with replace_sealed(folder, report=NODES) as (staged,):
            raw = staged.with_name(SCRATCH)
            raw.mkdir()
            places = {name: raw / name for name in SCHEMAS}
            with ExitStack() as stack:
                writers = {
                    name: stack.enter_context(
                        pq.ParquetWriter(places[name], schema, compression="zstd")
                    )
                    for name, schema in SCHEMAS.items()
                }
                for group in _group_rows(packed):
                    for name, writer in writers.items():
                        writer.write_table(pa.Table.from_batches([one[name] for one in group]))
            said = metadata()
            for name, place in places.items():
                schema = SCHEMAS[name].with_metadata({_SEALED: SEAL, **said.get(name, {})})
                _copy_rows(place, staged / f"{name}.parquet", schema)
    except OSError as error:
        raise DatasetError(f"{folder}: cannot be written ({error.strerror or error})") from error


def require_whole(folder: Path) -> None:
    """Refuse tables that differ from their seal; tables of early versions have none.

    Raises:
        DatasetError: naming the file that was changed.
        ValueError: if the seal is missing; without it, tables of two commands could be mixed.
    """
    sealed = require_seal(folder)
    for name in SCHEMAS:
        if sealed is None:
            said = pq.read_schema(folder / f"{name}.parquet").metadata or {}
            if _SEALED in said:
                raise ValueError(f"{SEAL}, which {name}.parquet was written with, is not there")
        elif f"{name}.parquet" not in sealed:
            raise ValueError(f"{SEAL} does not list {name}.parquet")


def _group_rows(
    packed: Iterable[Mapping[str, pa.RecordBatch]],
) -> Iterator[list[Mapping[str, pa.RecordBatch]]]:
    """Yield the belief graphs of one row group at a time: `ROWS_PER_GROUP` nodes, or a few more."""
    group: list[Mapping[str, pa.RecordBatch]] = []
    for one in packed:
        group.append(one)
        if sum(some["nodes"].num_rows for some in group) >= ROWS_PER_GROUP:
            yield group
            group = []
    if group:
        yield group


def _copy_rows(source: Path, target: Path, schema: pa.Schema) -> None:
    """Copy a table, by row groups, under a schema with other metadata."""
    with (
        pq.ParquetFile(source) as rows,
        pq.ParquetWriter(target, schema, compression="zstd") as writer,
    ):
        for number in range(rows.num_row_groups):
            group = rows.read_row_group(number, use_threads=False)
            writer.write_table(group.replace_schema_metadata(schema.metadata))


def _open(path: Path) -> pq.ParquetFile:
    return open_parquet_file(path, most=MAX_STREAMED_ROWS, error=BeliefFileError)


class SceneRows:
    """The rows of each scene of a table, sorted.

    A sorted table, as `write_tables` makes it from a dataset, is read one row group at a time.
    Any other table is read whole, and sorted once.

    Args:
        path: of the table.
        name: of `SCHEMAS`.
        scenes: in the order in which they are read.
    """

    def __init__(self, path: Path, name: str, scenes: Sequence[str]) -> None:
        self._file, self._schema = _open(path), SCHEMAS[name]
        by = _SORTED_BY[name]
        keys = self._file.read(columns=["scene_id", *by], use_threads=False)
        numbers = pc.index_in(keys["scene_id"], value_set=pa.array(scenes, pa.string()))
        if numbers.null_count:
            raise ValueError("there are rows of a building that the metadata does not list")
        numbers = numbers.to_numpy()
        order = np.lexsort((*(keys[one].to_numpy() for one in reversed(by)), numbers))
        self._ends = np.searchsorted(numbers[order], np.arange(len(scenes) + 1))
        groups = [
            self._file.metadata.row_group(g).num_rows for g in range(self._file.num_row_groups)
        ]
        self._groups = np.concatenate([[0], np.cumsum(groups, dtype=np.int64)])
        self._held: tuple[int, pa.Table] | None = None  # number of the first row, and the rows
        if not np.array_equal(order, np.arange(len(order))):
            self._held = 0, self._fit(self._file.read(use_threads=False).take(order))
            self._groups = np.array([0, len(order)])

    def read(self, number: int) -> pa.Table:
        """Return the rows of a scene."""
        start, stop = (int(end) for end in self._ends[number : number + 2])
        first = int(np.searchsorted(self._groups, start, side="right")) - 1
        last = max(int(np.searchsorted(self._groups, stop, side="left")), first + 1)
        begin, whole = int(self._groups[first]), int(self._groups[min(last, len(self._groups) - 1)])
        if self._held is None or self._held[0] != begin or len(self._held[1]) < whole - begin:
            groups = list(range(first, min(last, self._file.num_row_groups)))
            some = self._file.read_row_groups(groups, use_threads=False)
            self._held = begin, self._fit(some)
        return self._held[1].slice(start - begin, stop - start)

    def _fit(self, table: pa.Table) -> pa.Table:
        """Return a table in the current schema; columns added later are empty in old tables."""
        for name in _NEW - set(table.column_names):
            if name in self._schema.names:
                nothing = pa.nulls(len(table), self._schema.field(name).type)
                table = table.append_column(name, nothing)
        return table.select(self._schema.names).cast(self._schema)
