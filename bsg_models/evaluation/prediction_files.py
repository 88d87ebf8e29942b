"""Read and write predictions as parquet files, which any program can write.

Each row is one (scene, draw, node, class). The columns, in any order, besides any others:

    scene_id string, draw integer, node_index integer, class string
    presence       P(at least one hidden object), 0 to 1
    expected       expected number of hidden objects, 0 or more
    p0, p1, …, pJ  P(exactly 0, 1, …, J are hidden); optional
    total          whole count by a model of whole histograms, which may be less than what was
                   seen; optional, by default what was seen + expected

The metadata `bsg.masks_sha256` may hold the hash of the masks, which is then compared.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.files import open_beside
from bsg_data.inputs.bounds import MAX_STREAMED_ROWS
from bsg_data.inputs.parquet import open_parquet_file, refusing_damage
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_models.belief.count_distribution import MIN_RATE
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.evaluation.predictions import (
    EXPECTED,
    PRESENCE,
    TOTAL,
    LaidPredictions,
    PairCells,
    PredictedRows,
    is_exactly,
)

WRITTEN = 16  # number of the columns p0, p1, … that are written
_NAMES, _NUMBERS, _VALUES = ("scene_id", "class"), ("draw", "node_index"), (PRESENCE, EXPECTED)
_MOST_EXACTLY = 256
PIECE = 1 << 18  # rows read at a time
_GROUP = 1 << 20  # rows of a written row group
_MOST = 1e9  # objects of a class in a node
_MASKS = b"bsg.masks_sha256"


@dataclass(frozen=True, eq=False)
class PredictionFiles:
    """A file of predictions, or all files of a folder as one.

    Attributes:
        path: of the file or folder.
        files: with their numbers of rows, in order.
        columns: scored columns: presence, expected, p0, …, total.
        masks: hashes of the masks that the files state.
    """

    path: Path
    files: tuple[tuple[Path, int], ...]
    columns: tuple[str, ...]
    masks: frozenset[str]

    def __len__(self) -> int:
        """Return the number of rows."""
        return sum(rows for _, rows in self.files)

    @property
    def exactly(self) -> int:
        """Number of the columns p0, p1, …."""
        return sum(is_exactly(name) for name in self.columns)

    def read(self) -> Iterator[PredictedRows]:
        """Yield the rows, `PIECE` at a time.

        Raises:
            PredictionError: if a value is out of range.
        """
        for path, _ in self.files:
            file, start = _open(path), 0
            names = [*_NAMES, *_NUMBERS, *self.columns]
            with refusing_damage(path, error=PredictionError):
                for batch in file.iter_batches(batch_size=PIECE, columns=names, use_threads=False):
                    batch.validate(full=True)
                    table = pa.Table.from_batches([batch])
                    yield _read(path, table, self.columns, start=start)
                    start += len(table)

    def lay(self, cells: PairCells, *, elsewhere: frozenset[str] = frozenset()) -> LaidPredictions:
        """Align all rows with the measured pairs.

        Args:
            cells: of the pairs.
            elsewhere: scenes of other folds, whose rows are skipped.

        Raises:
            PredictionError: if a row is unknown or repeated, a value is out of range, or rows are
                missing.
        """
        laid = LaidPredictions(cells, self.columns, path=self.path)
        for rows in self.read():
            laid.add(rows, elsewhere=elsewhere)
        laid.finish()
        return laid


def open_predictions(path: Path, *, most_rows: int) -> PredictionFiles:
    """Open a file of predictions, or all files `*.parquet` of a folder as one.

    Args:
        path: of the file or folder.
        most_rows: number of rows of the benchmark; more are refused before they are read.

    Raises:
        PredictionError: if it is not readable, or has other columns.
    """
    files = sorted(path.glob("*.parquet")) if path.is_dir() else [path]
    if not files:
        raise PredictionError(f"{path}: holds no file *.parquet")
    opened = [_open(file) for file in files]
    rows = sum(file.metadata.num_rows for file in opened)
    if rows > most_rows:
        raise PredictionError(
            f"{path}: expected at most {most_rows:,} rows, as many as these pairs have nodes times "
            f"classes; found {rows:,}"
        )
    columns = [
        tuple(_choose(name, file.schema_arrow)[4:])
        for name, file in zip(files, opened, strict=True)
    ]
    if len(set(columns)) > 1:
        raise PredictionError(f"{path}: its files have different columns p0, p1, … or total")
    said = [(file.schema_arrow.metadata or {}).get(_MASKS) for file in opened]
    return PredictionFiles(
        path,
        tuple((name, file.metadata.num_rows) for name, file in zip(files, opened, strict=True)),
        columns[0],
        frozenset(one.decode("ascii", "replace") for one in said if one is not None),
    )


class PredictionWriter:
    """Writer of expectations of masked buildings, with p0 to p15; see `open_predictions`.

    It is a context manager: the file appears when the context ends without an error. `total` is
    written only if a model's totals differ from seen + hidden. That is known at the end, so the
    column is then removed from a file that does not need it.

    Args:
        path: of the file.
        classes: `[C]` names.
        masks_sha256: hash of the masks.

    Attributes:
        path: of the file.
    """

    def __init__(self, path: Path, classes: Sequence[str], *, masks_sha256: str) -> None:
        self.path, self._classes = path, tuple(classes)
        self._rows = path.with_name(f".{path.name}.rows")  # with totals, which may be removed
        self._metadata = {_MASKS: masks_sha256}
        self._stack = ExitStack()
        self._writer: pq.ParquetWriter | None = None
        self._own_totals = False

    def __enter__(self) -> PredictionWriter:
        """Start the file.

        Raises:
            DatasetError: if it cannot be written.
        """
        self._whole = self._stack.enter_context(open_beside(self.path))
        self._rows.unlink(missing_ok=True)  # left by a killed command
        self._stack.callback(self._rows.unlink, missing_ok=True)
        return self

    def __exit__(self, *raised: Any) -> bool | None:
        """Put the file in its place, unless there was an error."""
        with self._stack.pop_all() as stack:
            if self._writer is not None:
                self._writer.close()
            if raised[0] is None:
                self._settle()
            return stack.__exit__(*raised)

    def add(self, expectation: Expectation, masked: MaskedBuildings) -> None:
        """Write the expectation of some masked buildings."""
        table = _tabulate(expectation, masked, self._classes)
        near = np.allclose(expectation.totals, expectation.expected, rtol=1e-12, atol=1e-12)
        self._own_totals |= not near
        table = table.replace_schema_metadata(self._metadata)
        if self._writer is None:
            self._writer = pq.ParquetWriter(self._rows, table.schema, compression="zstd")
        self._writer.write_table(table)

    def _settle(self) -> None:
        """Copy the rows to their place, by row groups, without unneeded totals."""
        rows = pq.ParquetFile(self._rows)
        names = [n for n in rows.schema_arrow.names if self._own_totals or n != TOTAL]
        schema = pa.schema([rows.schema_arrow.field(name) for name in names], self._metadata)
        with rows, pq.ParquetWriter(self._whole, schema, compression="zstd") as writer:
            for batch in rows.iter_batches(batch_size=_GROUP, columns=names, use_threads=False):
                writer.write_batch(batch)


def _tabulate(
    expectation: Expectation, masked: MaskedBuildings, classes: tuple[str, ...]
) -> pa.Table:
    seen, number = masked.seen, len(classes)
    sizes = np.diff(seen.starts)
    node = np.arange(len(seen.inputs)) - np.repeat(seen.starts[:-1], sizes)
    of_scene = {name: i for i, name in enumerate(dict.fromkeys(seen.scene_ids))}
    scene = np.repeat([of_scene[name] for name in seen.scene_ids], sizes * number)
    label = np.tile(np.arange(number), len(node))
    columns: dict[str, Any] = {
        "scene_id": _name_rows(scene, tuple(of_scene)),
        "draw": np.repeat(masked.draws, sizes * number).astype(np.int32),
        "node_index": np.repeat(node, number).astype(np.int32),
        "class": _name_rows(label, classes),
        "presence": expectation.presence.ravel(),
        "expected": expectation.hidden.ravel(),
        TOTAL: expectation.totals.ravel(),
    }
    for count in range(WRITTEN):
        wanted = np.full(seen.inputs.shape, float(count))
        chance = np.exp(expectation.log_probability(wanted))
        columns[f"p{count}"] = chance.astype(np.float32).ravel()
    return pa.table(columns)


def _name_rows(numbers: Ints, names: tuple[str, ...]) -> pa.Array:
    return pa.DictionaryArray.from_arrays(pa.array(numbers.astype(np.int32)), pa.array(names))


def _open(path: Path) -> pq.ParquetFile:
    return open_parquet_file(
        path, most=MAX_STREAMED_ROWS, dictionaries=_NAMES, error=PredictionError
    )


def _read(path: Path, table: pa.Table, columns: Sequence[str], *, start: int) -> PredictedRows:
    """Return some rows, the first with number `start`, after checking the range of every value."""
    for name in table.column_names:
        if table[name].null_count:
            row = start + int(np.argmin(table[name].is_valid().to_numpy()))
            raise PredictionError(f"{path}: row {row}: expected a value in {name}, found none")
    scene, scenes = _number(table["scene_id"])
    label, labels = _number(table["class"])
    draw, node = (table[name].cast(pa.int64()).to_numpy() for name in _NUMBERS)
    values = {name: table[name].cast(pa.float64()).to_numpy().copy() for name in columns}
    _require_values(path, values, start=start)
    values[PRESENCE] = np.minimum(values[PRESENCE], 1.0)
    return PredictedRows(scenes, labels, scene, label, draw, node, values, (path, start))


def _choose(path: Path, schema: pa.Schema) -> list[str]:
    """Return the columns to read, names and numbers first, after checking that they are valid."""
    names = [*_NAMES, *_NUMBERS, *_VALUES]
    found = ", ".join(schema.names[:20])
    if absent := [name for name in names if schema.names.count(name) != 1]:
        raise PredictionError(
            f"{path}: expected the columns {', '.join(names)}, once each; {', '.join(absent)} is "
            f"missing or double; found {found}"
        )
    exactly = [name for name in schema.names if is_exactly(name)]
    wanted = [f"p{count}" for count in range(len(exactly))]
    if len(exactly) > _MOST_EXACTLY or set(exactly) != set(wanted):
        raise PredictionError(
            f"{path}: expected p0, p1, … without a gap, {_MOST_EXACTLY} at most, or none of them; "
            f"found {', '.join(exactly[:20])}"
        )
    names += wanted + [TOTAL] * (TOTAL in schema.names)
    for name in names:
        kind = schema.field(name).type
        if not _fits(name, kind):
            wanted_kind = (
                "text" if name in _NAMES else "integers" if name in _NUMBERS else "numbers"
            )
            raise PredictionError(f"{path}: expected {wanted_kind} in {name}, found {kind}")
    return names


def _fits(name: str, kind: pa.DataType) -> bool:
    if name in _NAMES:
        value = kind.value_type if pa.types.is_dictionary(kind) else kind
        return bool(pa.types.is_string(value) or pa.types.is_large_string(value))
    whole = pa.types.is_integer(kind)
    return bool(whole if name in _NUMBERS else whole or pa.types.is_floating(kind))


def _number(column: pa.ChunkedArray) -> tuple[Ints, tuple[str, ...]]:
    """Return a number for every row, and the names in their order."""
    if not pa.types.is_dictionary(column.type):
        column = column.dictionary_encode()
    encoded = column.unify_dictionaries().combine_chunks()
    return encoded.indices.to_numpy().astype(np.int64), tuple(encoded.dictionary.to_pylist())


def _require_values(path: Path, values: dict[str, Floats], *, start: int) -> None:
    def require(name: str, column: Floats, sound: Bools, expected: str) -> None:
        if not sound.all():
            row = int(np.argmin(sound))
            raise PredictionError(
                f"{path}: row {start + row}: expected {expected} in {name}, found "
                f"{column[row]:g}; {int((~sound).sum()):,} such rows"
            )

    exactly = [column for name, column in values.items() if is_exactly(name)]
    chances = {PRESENCE: values[PRESENCE]} | {f"p{n}": column for n, column in enumerate(exactly)}
    for name, column in chances.items():
        require(name, column, (column >= 0) & (column <= 1 + 1e-6), "a probability, 0 to 1,")
    expected = values[EXPECTED]
    require(EXPECTED, expected, (expected >= 0) & (expected <= _MOST), "a number from 0 to 1e9")
    if TOTAL in values:
        require(TOTAL, values[TOTAL], np.abs(values[TOTAL]) <= _MOST, "a finite number below 1e9")
    if exactly:
        whole = np.sum(exactly, axis=0)
        require("p0 + p1 + …", whole, whole <= 1 + 1e-5, "a sum of 1 at most")
        near = np.abs(1 - exactly[0] - values[PRESENCE]) <= 2 * MIN_RATE
        require("p0", exactly[0], near, "1 − presence")
