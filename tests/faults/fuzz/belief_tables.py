"""Belief graphs as parquet tables: `bsg_models.belief.tables`."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import pyarrow.parquet as pq

from bsg_data.seals import write_seal
from bsg_models.belief.formats import read_beliefs
from bsg_models.belief.table_rows import SCHEMAS
from bsg_models.belief.tables import write_tables
from fuzz.belief_json import make_belief
from fuzz.parquet_table import shrink, to_document, write_document
from fuzz.target import Target, encode, load_map, parse

NAMES = tuple(SCHEMAS)


@cache
def _sound() -> dict[str, bytes]:
    """Return the files of sound tables, small ones."""
    with tempfile.TemporaryDirectory() as folder:
        write_tables([make_belief(("kitchen", "hall"))], Path(folder, "x.tables"))
        found = {name: pq.read_table(Path(folder, f"x.tables/{name}.parquet")) for name in NAMES}
        return {name: shrink(table, Path(folder, "x")) for name, table in found.items()}


def seeds() -> dict[str, bytes]:
    """Return each file behind its number, and each table as a document."""
    made = {name: bytes([n]) + _sound()[name] for n, name in enumerate(NAMES)}
    with tempfile.TemporaryDirectory() as folder:
        for name in NAMES:
            path = Path(folder, name)
            path.write_bytes(_sound()[name])
            made[f"{name}.json"] = encode({name: to_document(pq.read_table(path))})
    return made


def read(folder: Path, data: bytes) -> object:
    """Read sound tables of which one, or some, are replaced."""
    load_map()
    place = folder / "x.tables"
    place.mkdir(exist_ok=True)
    for name in NAMES:
        (place / f"{name}.parquet").write_bytes(_sound()[name])
    if data[:1] == b"{":
        for name, document in parse(data).items():
            if name in SCHEMAS:
                write_document(document, place / f"{name}.parquet", schema=SCHEMAS[name])
    else:
        name = NAMES[data[0] % len(NAMES) if data else 0]
        (place / f"{name}.parquet").write_bytes(data[1:])
    write_seal(place, [f"{name}.parquet" for name in NAMES])  # as an attacker would
    return read_beliefs(place)


TARGET = Target(
    name="belief-tables",
    read=read,
    seeds=seeds,
    words=("PAR1", "int8", "double", "string", "binary", "bsg.beliefs", "timestamp[ns]", "bool"),
    most=9_000,
)
