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
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from bsg_data.arrays import Bools, Floats
from bsg_data.files import open_beside
from bsg_data.inputs.parquet import refusing_damage
from bsg_models.belief.count_distribution import MIN_RATE
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.evaluation.truth import Truth

NODE = ("scene_id", "draw", "node_index")
KEYS = (*NODE, "class")
WRITTEN = 16  # number of the columns p0, p1, … that are written
_TEXTS, _NUMBERS = ("scene_id", "class"), ("draw", "node_index")
_LONGEST = 1_000  # bytes of a name
_EXACTLY = re.compile(r"p(?:0|[1-9][0-9]*)")
_MOST_EXACTLY = 256
_MOST = 1e9  # objects of a class in a node
_MASKS = b"bsg.masks_sha256"


@dataclass(frozen=True, eq=False)
class Predictions:
    """The rows of a file of predictions, or of all files of a folder."""

    path: Path  # of the file or folder
    files: tuple[Path, ...]  # in order
    # by (file, number of the row in it): `KEYS`, presence, expected, p0, p1, … and total, if there
    rows: pd.DataFrame
    masks: frozenset[str]  # hashes of the masks that the files state

    @property
    def exactly(self) -> list[str]:
        """The columns p0, p1, …, in order."""
        return [name for name in map(str, self.rows) if _EXACTLY.fullmatch(name)]


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
        frames = [_read(*one) for one in zip(files, opened, strict=True)]
        said = [(file.schema_arrow.metadata or {}).get(_MASKS) for file in opened]
    if any(list(frame) != list(frames[0]) for frame in frames):
        raise PredictionError(
            f"{path}: its files have different columns p0, p1, … or total",
            code="predictions-differ",
            where=path,
        )
    masks = frozenset(one.decode("ascii", "replace") for one in said if one is not None)
    return Predictions(path, tuple(files), pd.concat(frames, keys=files), masks)


def _open(path: Path) -> pq.ParquetFile:
    with refusing_damage(path, error=PredictionError):
        words = [name for name in _TEXTS if name in pq.read_schema(path).names]
        return pq.ParquetFile(path, read_dictionary=words)


def _read(path: Path, file: pq.ParquetFile) -> pd.DataFrame:
    """Return all rows, after checking the range of every value."""
    names = _choose_columns(path, file.schema_arrow)
    with refusing_damage(path, error=PredictionError):
        table = file.read(names, use_threads=False).select(names)
        table.validate(full=True)
        for name in _TEXTS:
            _refuse_long_names(path, name, table[name])
        for place, name in enumerate(names):
            if name not in _TEXTS:
                kind = pa.int64() if name in _NUMBERS else pa.float64()
                table = table.set_column(place, name, table[name].cast(kind))
        rows: pd.DataFrame = table.to_pandas(ignore_metadata=True)
    for name, values, sound, expected in _list_rules(rows):
        if not sound.all():
            row = int(np.argmin(sound))
            raise PredictionError(
                f"{path}: row {row}: expected {expected} in {name}, found {values[row]}; "
                f"{int((~sound).sum()):,} such rows",
                code="prediction-value",
                where=f"{path}: row {row}",
            )
    return rows.assign(presence=rows.presence.clip(upper=1.0))


def _refuse_long_names(path: Path, name: str, column: pa.ChunkedArray) -> None:
    """Refuse names that are none: pandas would make a text of each."""
    for chunk in column.chunks:
        words = chunk.dictionary if pa.types.is_dictionary(chunk.type) else chunk
        longest = pc.max(pc.binary_length(words.cast(pa.large_string()))).as_py() or 0
        if longest > _LONGEST:
            raise PredictionError(
                f"{path}: expected at most {_LONGEST:,} bytes in {name}, found {longest:,}",
                code="prediction-value",
                where=path,
            )


def _choose_columns(path: Path, schema: pa.Schema) -> list[str]:
    """Return the columns to read, after checking their names and types."""
    names = [*KEYS, "presence", "expected"]
    found = ", ".join(schema.names[:20])
    if absent := [name for name in names if schema.names.count(name) != 1]:
        raise PredictionError(
            f"{path}: expected the columns {', '.join(names)}, once each; {', '.join(absent)} is "
            f"missing or double; found {found}",
            code="predictions-column",
            where=path,
        )
    exactly = [name for name in schema.names if _EXACTLY.fullmatch(name)]
    wanted = [f"p{count}" for count in range(len(exactly))]
    if len(exactly) > _MOST_EXACTLY or set(exactly) != set(wanted):
        raise PredictionError(
            f"{path}: expected p0, p1, … without a gap, {_MOST_EXACTLY} at most, or none of them; "
            f"found {', '.join(exactly[:20])}",
            code="predictions-gap",
            where=path,
        )
    names += [*wanted, *["total"] * ("total" in schema.names)]
    for name in names:
        kind = "text" if name in _TEXTS else "integers" if name in _NUMBERS else "numbers"
        if not _fits(kind, schema.field(name).type):
            raise PredictionError(
                f"{path}: expected {kind} in {name}, found {schema.field(name).type}",
                code="predictions-type",
                where=path,
            )
    return names


def _fits(kind: str, found: pa.DataType) -> bool:
    if kind == "text":
        value = found.value_type if pa.types.is_dictionary(found) else found
        return bool(pa.types.is_string(value) or pa.types.is_large_string(value))
    return bool(pa.types.is_integer(found) or (kind == "numbers" and pa.types.is_floating(found)))


def _list_rules(rows: pd.DataFrame) -> Iterator[tuple[str, Any, Bools, str]]:
    """Yield name and values of a column, whether each is sound, and what is expected."""
    for name in KEYS:
        # Texts stay a dictionary, however long they are.
        yield name, rows[name].array, rows[name].notna().to_numpy(), "a value"
    values: dict[str, Floats] = {name: rows[name].to_numpy() for name in rows.columns[len(KEYS) :]}
    expected, total = values.pop("expected"), values.pop("total", np.zeros(len(rows)))
    sound = (expected >= 0) & (expected <= _MOST)
    yield "expected", expected, sound, "a number from 0 to 1e9"
    yield "total", total, np.abs(total) <= _MOST, "a finite number below 1e9"
    for name, chance in values.items():
        yield name, chance, (chance >= 0) & (chance <= 1 + 1e-6), "a probability, 0 to 1,"
    if "p0" in values:
        none, other = 1 - values.pop("presence"), values["p0"]
        whole = np.sum(list(values.values()), axis=0)
        yield "p0 + p1 + …", whole, whole <= 1 + 1e-5, "a sum of 1 at most"
        yield "p0", other, np.abs(none - other) <= 2 * MIN_RATE, "1 − presence"


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

    def add(self, truth: Truth, expectation: Expectation) -> None:
        """Write the expectation of some masked buildings; each begins with its building node."""
        table = _tabulate(truth, expectation, self._classes)
        table = table.replace_schema_metadata(self._metadata)
        if self._writer is None:
            self._writer = pq.ParquetWriter(self._partial, table.schema, compression="zstd")
        self._writer.write_table(table)


def _tabulate(truth: Truth, expectation: Expectation, classes: tuple[str, ...]) -> pa.Table:
    number, nodes = len(classes), len(truth.inputs)
    starts = np.flatnonzero(truth.is_building)
    node = np.arange(nodes) - np.repeat(starts, np.diff([*starts, nodes]))
    scene = np.repeat(truth.building, number).astype(np.int32)
    label = np.tile(np.arange(number, dtype=np.int32), nodes)
    columns: dict[str, Any] = {
        "scene_id": pa.DictionaryArray.from_arrays(scene, list(truth.scene_ids)),
        "draw": np.repeat(truth.draw, number).astype(np.int32),
        "node_index": np.repeat(node, number).astype(np.int32),
        "class": pa.DictionaryArray.from_arrays(label, list(classes)),
        "presence": expectation.presence.ravel(),
        "expected": expectation.hidden.ravel(),
        "total": expectation.totals.ravel(),
    }
    for count in range(WRITTEN):
        wanted = np.full(truth.inputs.shape, float(count))
        chance = np.exp(expectation.log_probability(wanted))
        columns[f"p{count}"] = chance.astype(np.float32).ravel()
    return pa.table(columns)
