"""Predictions as a parquet file, which any program can write.

A row is of a (scene, draw, node, class). Its columns, in any order, beside any others:

    scene_id string, draw integer, node_index integer, class string
    presence       P(at least one hidden object), 0 to 1
    expected       expected number of hidden objects, 0 or more
    p0, p1, …, pJ  P(exactly 0, 1, …, J are hidden); optional
    total          the whole count as a model of whole histograms predicts it, which may be less
                   than what was seen; optional, else what was seen + expected

The metadata `bsg.masks_sha256` may hold the hash of the masks, which is then compared.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.files import open_beside
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_models.belief.count_distribution import MIN_RATE
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.evaluation.predictions import EXPECTED, PRESENCE, TOTAL, Predictions

WRITTEN = 16  # of p0, p1, … that are written
_NAMES, _NUMBERS, _VALUES = ("scene_id", "class"), ("draw", "node_index"), (PRESENCE, EXPECTED)
_EXACTLY = re.compile(r"p(?:0|[1-9][0-9]*)")
_MOST_EXACTLY = 256
_MOST = 1e9  # objects of a class in a node
_MASKS = b"bsg.masks_sha256"


def read_predictions(path: Path, *, most_rows: int) -> Predictions:
    """Read a file of predictions, or all files `*.parquet` of a folder as one.

    Args:
        path: of the file or folder.
        most_rows: as many as the benchmark has; more are refused before they are read.

    Raises:
        PredictionError: if it is not readable, has other columns, or a value is out of range.
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
    parts = [_read(file, one) for file, one in zip(files, opened, strict=True)]
    if len({(tuple(part.values), len(part.exactly)) for part in parts}) > 1:
        raise PredictionError(f"{path}: its files have different columns p0, p1, … or total")
    return _join(path, parts)


def write_predictions(
    path: Path,
    expectation: Expectation,
    masked: MaskedBuildings,
    classes: Sequence[str],
    *,
    masks_sha256: str,
) -> None:
    """Write what is expected of masked buildings, with p0 to p15; see `read_predictions`.

    Raises:
        DatasetError: if it cannot be written.
    """
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
        "class": _name_rows(label, tuple(classes)),
        "presence": expectation.presence.ravel(),
        "expected": expectation.hidden.ravel(),
    }
    if not np.allclose(expectation.totals, expectation.expected, rtol=1e-12, atol=1e-12):
        columns["total"] = expectation.totals.ravel()
    for count in range(WRITTEN):
        wanted = np.full(seen.inputs.shape, float(count))
        chance = np.exp(expectation.log_probability(wanted))
        columns[f"p{count}"] = chance.astype(np.float32).ravel()
    table = pa.table(columns).replace_schema_metadata({_MASKS: masks_sha256})
    with open_beside(path) as partial:
        pq.write_table(table, partial, compression="zstd")


def _name_rows(numbers: Ints, names: tuple[str, ...]) -> pa.Array:
    return pa.DictionaryArray.from_arrays(pa.array(numbers.astype(np.int32)), pa.array(names))


def _open(path: Path) -> pq.ParquetFile:
    try:
        return pq.ParquetFile(path, read_dictionary=list(_NAMES))
    except FileNotFoundError as error:
        raise PredictionError(f"{path}: is not there") from error
    except (OSError, pa.ArrowException) as error:
        raise PredictionError(f"{path}: not readable as parquet ({error})") from error


def _read(path: Path, file: pq.ParquetFile) -> Predictions:
    """Read the columns that are scored, and see that every value is in its range."""
    names = _choose(path, file.schema_arrow)
    try:
        table = file.read(columns=names)
        for name in names:
            if table[name].null_count:
                row = int(np.argmin(table[name].is_valid().to_numpy()))
                raise PredictionError(f"{path}: row {row}: expected a value in {name}, found none")
        scene, scenes = _number(table["scene_id"])
        label, labels = _number(table["class"])
        draw, node = (table[name].cast(pa.int64()).to_numpy() for name in _NUMBERS)
        values = {n: table[n].cast(pa.float64()).to_numpy().copy() for n in names[4:]}
    except (OSError, pa.ArrowException) as error:
        raise PredictionError(f"{path}: not readable as parquet ({error})") from error
    exactly = tuple(values.pop(name) for name in names if _EXACTLY.fullmatch(name))
    _require_values(path, values, exactly)
    values[PRESENCE] = np.minimum(values[PRESENCE], 1.0)
    said = (file.schema_arrow.metadata or {}).get(_MASKS)
    return Predictions(
        path,
        scenes,
        labels,
        scene,
        label,
        draw,
        node,
        values,
        exactly,
        files=((path, len(table)),),
        masks=frozenset() if said is None else frozenset([said.decode("ascii", "replace")]),
    )


def _choose(path: Path, schema: pa.Schema) -> list[str]:
    """Return the columns to read: names and numbers first; see that all are there and fit."""
    names = [*_NAMES, *_NUMBERS, *_VALUES]
    found = ", ".join(schema.names[:20])
    if absent := [name for name in names if schema.names.count(name) != 1]:
        raise PredictionError(
            f"{path}: expected the columns {', '.join(names)}, once each; {', '.join(absent)} is "
            f"missing or double; found {found}"
        )
    exactly = [name for name in schema.names if _EXACTLY.fullmatch(name)]
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


def _require_values(path: Path, values: dict[str, Floats], exactly: Sequence[Floats]) -> None:
    def require(name: str, column: Floats, sound: Bools, expected: str) -> None:
        if not sound.all():
            row = int(np.argmin(sound))
            raise PredictionError(
                f"{path}: row {row}: expected {expected} in {name}, found {column[row]:g}; "
                f"{int((~sound).sum()):,} such rows"
            )

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


def _join(path: Path, parts: Sequence[Predictions]) -> Predictions:
    """Return the rows of several files as one, in order."""

    def renumber(
        names: Sequence[tuple[str, ...]], numbers: Sequence[Ints]
    ) -> tuple[Ints, tuple[str, ...]]:
        every = {name: i for i, name in enumerate(dict.fromkeys(n for own in names for n in own))}
        moved = [
            np.array([every[name] for name in own], dtype=np.int64)[number]
            for own, number in zip(names, numbers, strict=True)
            if len(number)
        ]
        return np.concatenate([np.zeros(0, dtype=np.int64), *moved]), tuple(every)

    scene, scenes = renumber([p.scenes for p in parts], [p.scene for p in parts])
    label, classes = renumber([p.classes for p in parts], [p.label for p in parts])
    return Predictions(
        path,
        scenes,
        classes,
        scene,
        label,
        draw=np.concatenate([p.draw for p in parts]),
        node=np.concatenate([p.node for p in parts]),
        values={name: np.concatenate([p.values[name] for p in parts]) for name in parts[0].values},
        exactly=tuple(map(np.concatenate, zip(*(p.exactly for p in parts), strict=True))),
        files=tuple(file for p in parts for file in p.files),
        masks=frozenset().union(*(p.masks for p in parts)),
    )
