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

import re
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pandas as pd
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

KEYS = ("scene_id", "draw", "node_index", "class")
PRESENCE, EXPECTED, TOTAL = "presence", "expected", "total"
WRITTEN = 16  # number of the columns p0, p1, … that are written
_TEXTS, _NUMBERS = ("scene_id", "class"), ("draw", "node_index")
_EXACTLY = re.compile(r"p(?:0|[1-9][0-9]*)")
_MOST_EXACTLY = 256
_MOST = 1e9  # objects of a class in a node
_MASKS = b"bsg.masks_sha256"


@dataclass(frozen=True, eq=False)
class Predictions:
    """The rows of a file of predictions, or of all files of a folder."""

    path: Path  # of the file or folder
    files: tuple[Path, ...]  # in order
    rows: pd.DataFrame  # by (file, number of the row in it), with `KEYS` and the columns
    columns: tuple[str, ...]  # scored columns: presence, expected, p0, …, total
    masks: frozenset[str]  # hashes of the masks that the files state

    @property
    def exactly(self) -> int:
        """Number of the columns p0, p1, …."""
        return sum(is_exactly(name) for name in self.columns)


def is_exactly(column: str) -> bool:
    """Return whether a column is one of p0, p1, …."""
    return _EXACTLY.fullmatch(column) is not None


def read_predictions(path: Path, *, most_rows: int) -> Predictions:
    """Read a file of predictions, or all files `*.parquet` of a folder as one.

    Args:
        path: of the file or folder.
        most_rows: number of rows of the benchmark; more are refused before they are read.
    """
    files = sorted(path.glob("*.parquet")) if path.is_dir() else [path]
    if not files:
        raise PredictionError(
            f"{path}: holds no file *.parquet", code="predictions-none", where=path
        )
    with ExitStack() as stack:
        opened = [stack.enter_context(_open(file)) for file in files]
        rows = sum(file.metadata.num_rows for file in opened)
        if rows > most_rows:
            raise PredictionError(
                f"{path}: expected at most {most_rows:,} rows, as many as these pairs have nodes "
                f"times classes; found {rows:,}",
                code="predictions-many",
                where=path,
            )
        schemas = [file.schema_arrow for file in opened]
        columns = [_choose(*one) for one in zip(files, schemas, strict=True)]
        if len(set(columns)) > 1:
            raise PredictionError(
                f"{path}: its files have different columns p0, p1, … or total",
                code="predictions-differ",
                where=path,
            )
        frames = [_read(*one, columns[0]) for one in zip(files, opened, strict=True)]
    said = [(schema.metadata or {}).get(_MASKS) for schema in schemas]
    return Predictions(
        path,
        tuple(files),
        pd.concat(frames, keys=files),
        columns[0],
        frozenset(one.decode("ascii", "replace") for one in said if one is not None),
    )


class PredictionWriter:
    """Writer of expectations of masked buildings, with p0 to p15; see `read_predictions`.

    It is a context manager: the file appears when the context ends without an error.

    Args:
        path: of the file.
        classes: `[C]` names.
        masks_sha256: hash of the masks.

    Attributes:
        path: of the file.
    """

    def __init__(self, path: Path, classes: Sequence[str], *, masks_sha256: str) -> None:
        self.path, self._classes = path, tuple(classes)
        self._metadata = {_MASKS: masks_sha256}
        self._stack = ExitStack()
        self._writer: pq.ParquetWriter | None = None

    def __enter__(self) -> PredictionWriter:
        """Start the file."""
        self._partial = self._stack.enter_context(open_beside(self.path))
        return self

    def __exit__(self, *raised: Any) -> bool | None:
        """Put the file in its place, unless there was an error."""
        with self._stack.pop_all() as stack:
            if self._writer is not None:
                self._writer.close()
            return stack.__exit__(*raised)

    def add(self, expectation: Expectation, masked: MaskedBuildings) -> None:
        """Write the expectation of some masked buildings."""
        table = _tabulate(expectation, masked, self._classes)
        table = table.replace_schema_metadata(self._metadata)
        if self._writer is None:
            self._writer = pq.ParquetWriter(self._partial, table.schema, compression="zstd")
        self._writer.write_table(table)


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
        path, most=MAX_STREAMED_ROWS, dictionaries=_TEXTS, error=PredictionError
    )


def _read(path: Path, file: pq.ParquetFile, columns: tuple[str, ...]) -> pd.DataFrame:
    """Return all rows, after checking the range of every value."""
    with refusing_damage(path, error=PredictionError):
        table = file.read([*KEYS, *columns], use_threads=False)
        table.validate(full=True)
        kinds = dict.fromkeys(_NUMBERS, pa.int64()) | dict.fromkeys(columns, pa.float64())
        cast = {name: table[name].cast(kind) for name, kind in kinds.items()}
        table = pa.table({name: cast.get(name, table[name]) for name in table.column_names})
    for name in table.column_names:
        if table[name].null_count:
            row = int(np.argmin(table[name].is_valid().to_numpy()))
            _refuse(path, row, f"expected a value in {name}, found none")
    rows: pd.DataFrame = table.to_pandas()
    _require_values(path, rows, columns)
    rows[PRESENCE] = np.minimum(rows[PRESENCE], 1.0)
    return rows


def _choose(path: Path, schema: pa.Schema) -> tuple[str, ...]:
    """Return the scored columns, after checking that all are valid."""
    names = [*KEYS, PRESENCE, EXPECTED]
    found = ", ".join(schema.names[:20])
    if absent := [name for name in names if schema.names.count(name) != 1]:
        raise PredictionError(
            f"{path}: expected the columns {', '.join(names)}, once each; {', '.join(absent)} is "
            f"missing or double; found {found}",
            code="predictions-column",
            where=path,
        )
    exactly = [name for name in schema.names if is_exactly(name)]
    wanted = [f"p{count}" for count in range(len(exactly))]
    if len(exactly) > _MOST_EXACTLY or set(exactly) != set(wanted):
        raise PredictionError(
            f"{path}: expected p0, p1, … without a gap, {_MOST_EXACTLY} at most, or none of them; "
            f"found {', '.join(exactly[:20])}",
            code="predictions-gap",
            where=path,
        )
    names += wanted + [TOTAL] * (TOTAL in schema.names)
    for name in names:
        kind = schema.field(name).type
        if not _fits(name, kind):
            wanted_kind = (
                "text" if name in _TEXTS else "integers" if name in _NUMBERS else "numbers"
            )
            raise PredictionError(
                f"{path}: expected {wanted_kind} in {name}, found {kind}",
                code="predictions-type",
                where=path,
            )
    return tuple(names[len(KEYS) :])


def _fits(name: str, kind: pa.DataType) -> bool:
    if name in _TEXTS:
        value = kind.value_type if pa.types.is_dictionary(kind) else kind
        return bool(pa.types.is_string(value) or pa.types.is_large_string(value))
    whole = pa.types.is_integer(kind)
    return bool(whole if name in _NUMBERS else whole or pa.types.is_floating(kind))


def _require_values(path: Path, rows: pd.DataFrame, columns: tuple[str, ...]) -> None:
    def require(name: str, column: Floats, sound: Bools, expected: str) -> None:
        if not sound.all():
            row = int(np.argmin(sound))
            found = f"found {column[row]:g}; {int((~sound).sum()):,} such rows"
            _refuse(path, row, f"expected {expected} in {name}, {found}")

    values = {name: rows[name].to_numpy() for name in columns}
    exactly = [values[name] for name in columns if is_exactly(name)]
    for name in columns:
        column = values[name]
        if name == EXPECTED:
            require(name, column, (column >= 0) & (column <= _MOST), "a number from 0 to 1e9")
        elif name == TOTAL:
            require(name, column, np.abs(column) <= _MOST, "a finite number below 1e9")
        else:
            require(name, column, (column >= 0) & (column <= 1 + 1e-6), "a probability, 0 to 1,")
    if exactly:
        whole = np.sum(exactly, axis=0)
        require("p0 + p1 + …", whole, whole <= 1 + 1e-5, "a sum of 1 at most")
        near = np.abs(1 - exactly[0] - values[PRESENCE]) <= 2 * MIN_RATE
        require("p0", exactly[0], near, "1 − presence")


def _refuse(path: Path, row: int, why: str) -> NoReturn:
    raise PredictionError(
        f"{path}: row {row}: {why}", code="prediction-value", where=f"{path}: row {row}"
    )
