"""Predictions of other programs: `bsg_models.evaluation.prediction_files`."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pyarrow as pa

from bsg_models.evaluation.prediction_files import open_predictions
from fuzz.parquet_table import shrink, to_document, write_document
from fuzz.target import Target, encode, parse, put

_COLUMNS = {
    "scene_id": ["a", "a"],
    "draw": [0, 0],
    "node_index": [1, 1],
    "class": ["chair", "bed"],
    "presence": [0.5, 0.25],
    "expected": [0.75, 0.25],
}
_EXACTLY = {"p0": [0.5, 0.75], "p1": [0.25, 0.25], "total": [2.0, 0.25]}


def seeds() -> dict[str, bytes]:
    """Return predictions as they are, and as documents."""
    with tempfile.TemporaryDirectory() as folder:
        whole = shrink(pa.table(_COLUMNS), Path(folder, "x"))
    told = pa.table({**_COLUMNS, **_EXACTLY}).replace_schema_metadata({"bsg.masks_sha256": "0"})
    return {
        "whole": whole,
        "json": encode(to_document(pa.table(_COLUMNS))),
        "exactly.json": encode(to_document(told)),
    }


def read(folder: Path, data: bytes) -> object:
    """Read a file, or the one that a document says."""
    path = put(folder, ".parquet", b"" if data[:1] == b"{" else data)
    if data[:1] == b"{":
        write_document(parse(data), path)
    return list(open_predictions(path, most_rows=10_000).read())


TARGET = Target(
    name="predictions",
    read=read,
    seeds=seeds,
    words=("PAR1", "int8", "uint64", "double", "string", "binary", "bool", "p2", "large_string"),
    most=2_500,
)
