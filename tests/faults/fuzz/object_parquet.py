"""Tables of objects as parquet: `bsg_data.sources.table_rows`."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pyarrow as pa

from bsg_data.sources.table import ObjectTable
from fuzz.parquet_table import shrink, to_document, write_document
from fuzz.target import Target, encode, load_map, parse, put, read_source

_COLUMNS = {
    "scene": ["a", "a", "b"],
    "room": ["kitchen", "hall", "1"],
    "category": ["chair", None, "bed"],
    "room_label": ["kitchen", None, None],
    "floor": [0.0, None, 1.0],
    "connected": [["hall"], [], None],
    "x": [1.0, None, 2.5],
    "y": [1.0, None, 2.5],
    "z": [1.0, None, 2.5],
    "mine": [1, 2, 3],
}


def seeds() -> dict[str, bytes]:
    """Return a table as it is, and as a document."""
    table = pa.table(_COLUMNS)
    with tempfile.TemporaryDirectory() as folder:
        return {
            "whole": shrink(table.drop_columns(["mine", "y", "z", "x"]), Path(folder, "x")),
            "json": encode(to_document(table)),
        }


def read(folder: Path, data: bytes) -> object:
    """Read a table, or the one that a document says."""
    path = put(folder, ".parquet", b"" if data[:1] == b"{" else data)
    if data[:1] == b"{":
        write_document(parse(data), path)
    return read_source(ObjectTable(path), load_map())


TARGET = Target(
    name="object-parquet",
    read=read,
    seeds=seeds,
    words=(
        "PAR1",
        "int8",
        "double",
        "string",
        "binary",
        "timestamp[ns]",
        "bool",
        "scene",
        "date32",
    ),
    most=2_500,
)
