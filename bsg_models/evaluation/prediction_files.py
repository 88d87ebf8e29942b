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

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.arrays import Bools
from bsg_data.inputs.parquet import refusing_damage
from bsg_models.belief.count_distribution import MIN_RATE
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.evaluation.truth import Prediction, Truth

NODE = ("scene_id", "draw", "node_index")
KEYS = (*NODE, "class")
WRITTEN = 16  # number of the columns p0, p1, … that are written
_WORD = pa.dictionary(pa.int32(), pa.string())  # a long name takes memory once
_TYPES = {"scene_id": _WORD, "class": _WORD, "draw": pa.int64(), "node_index": pa.int64()}
_LARGEST = 1e9  # objects of a class in a node
_MASKS = b"bsg.masks_sha256"


@dataclass(frozen=True, eq=False)
class Predictions:
    """The rows of a file of predictions, or of all files of a folder."""

    path: Path  # of the file or folder
    files: tuple[Path, ...]  # in order
    # by (file, number of the row in it): `KEYS`, presence, expected, p0, p1, … and total, if given
    rows: pd.DataFrame
    masks: frozenset[str]  # hashes of the masks that the files state

    @property
    def exactly(self) -> list[str]:
        """The columns p0, p1, …, in order."""
        return _list_exactly(self.rows.columns)


def read_predictions(path: Path) -> Predictions:
    """Read a file of predictions, or all files `*.parquet` of a folder as one."""
    files = sorted(path.glob("*.parquet")) if path.is_dir() else [path]
    if not files:
        message = f"{path}: expected files *.parquet, found none"
        raise PredictionError(message, code="predictions-none", where=path)
    tables = [_read(file) for file in files]
    hashes = [(table.schema.metadata or {}).get(_MASKS) for table in tables]
    masks = frozenset(text.decode("ascii", "replace") for text in hashes if text is not None)
    frames = [table.to_pandas(ignore_metadata=True) for table in tables]
    rows = pd.concat(frames, keys=files, names=["file", "row"])
    for name, values, sound, expected in _list_rules(rows):
        refuse_row(rows, ~sound, expected=f"{expected} in {name}", found=values)
    return Predictions(path, tuple(files), rows.assign(presence=rows.presence.clip(upper=1)), masks)


def _list_exactly(columns: Collection[object]) -> list[str]:
    """Return p0, p1, … as far as there is no gap."""
    number = next(n for n in range(len(columns) + 1) if f"p{n}" not in columns)
    return [f"p{count}" for count in range(number)]


def _read(path: Path) -> pa.Table:
    """Return the columns of a file that are read, in their types."""
    with refusing_damage(path, error=PredictionError):
        found = pq.read_schema(path).names
        required = [*KEYS, "presence", "expected"]
        if wrong := [name for name in required if found.count(name) != 1]:
            raise PredictionError(
                f"{path}: expected the columns {', '.join(required)}, each once; not so of "
                f"{', '.join(wrong)}; found {', '.join(found[:20])}",
                code="predictions-column",
                where=path,
            )
        names = [*required, *_list_exactly(found), *({"total"} & {*found})]
        table = pq.read_table(path, columns=names, read_dictionary=["scene_id", "class"])
        schema = pa.schema({name: _TYPES.get(name, pa.float64()) for name in names})
        return table.select(names).cast(schema.with_metadata(table.schema.metadata))


def _list_rules(rows: pd.DataFrame) -> Iterator[tuple[str, Any, Bools, str]]:
    """Yield name and values of a column, whether each is sound, and what is expected."""
    for name in KEYS:
        yield name, rows[name], rows[name].notna().to_numpy(), "a value"
    expected, presence = (rows[name].to_numpy() for name in ("expected", "presence"))
    yield "expected", expected, (expected >= 0) & (expected <= _LARGEST), "a number from 0 to 1e9"
    if "total" in rows:
        total = rows["total"].to_numpy()
        yield "total", total, np.abs(total) <= _LARGEST, "a finite number below 1e9"
    exactly = [rows[name].to_numpy() for name in _list_exactly(rows.columns)]
    for number, chance in enumerate([presence, *exactly], -1):
        name = "presence" if number < 0 else f"p{number}"
        yield name, chance, (chance >= 0) & (chance <= 1 + 1e-6), "a probability, 0 to 1,"
    if exactly:
        whole = np.sum(exactly, axis=0)
        yield "p0 + p1 + …", whole, whole <= 1 + 1e-5, "a sum of 1 at most"
        close = np.abs(1 - presence - exactly[0]) <= 2 * MIN_RATE
        yield "p0", exactly[0], close, "1 − presence"


def refuse_row(rows: pd.DataFrame, wrong: Bools, *, expected: str, found: Any = None) -> None:
    """Refuse predictions of which a row is wrong, and name the first.

    Args:
        rows: by (file, number of the row).
        wrong: of each row.
        expected: instead.
        found: of each row; None: where it stands.
    """
    if not wrong.any():
        return
    first = int(np.argmax(wrong))
    file, number = rows.index[first]
    scene, draw, node, label = rows.iloc[first][list(KEYS)]
    value = "" if found is None else f"{pd.Series(found).iloc[first]} "
    raise PredictionError(
        f"{file}: row {number}: expected {expected}; found {value}(scene {scene!r}, draw {draw}, "
        f"node {node}, class {label!r}), and {int(wrong.sum()) - 1:,} more such rows",
        code="prediction-row",
        where=f"{file}: row {number}",
    )


class PredictionWriter:
    """Writer of expectations of masked buildings, with p0 to p15; see `read_predictions`.

    It is a context manager, which closes the file.

    Args:
        path: of the file.
        classes: `[C]` names.
        masks_sha256: hash of the masks.
    """

    def __init__(self, path: Path, classes: Sequence[str], *, masks_sha256: str) -> None:
        self._path, self._classes = path, tuple(classes)
        self._metadata = {_MASKS: masks_sha256}
        self._writer: pq.ParquetWriter | None = None

    def __enter__(self) -> PredictionWriter:
        """Return the writer."""
        return self

    def __exit__(self, *raised: object) -> None:
        """Close the file."""
        if self._writer is not None:
            self._writer.close()

    def add(self, prediction: Prediction) -> None:
        """Write what is expected of some masked buildings; each begins with its building node."""
        table = _tabulate(prediction.truth, prediction.expectation, self._classes)
        table = table.replace_schema_metadata(self._metadata)
        if self._writer is None:
            self._writer = pq.ParquetWriter(self._path, table.schema, compression="zstd")
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
