"""Tables of priors of one's own: `bsg_models.zoo.prior_table`."""

from __future__ import annotations

from pathlib import Path

from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.class_space import read_published
from bsg_models.zoo.prior_table import HAND_TABLE, read_prior_table
from fuzz.target import Target, encode, parse, put


def seeds() -> dict[str, bytes]:
    """Return the table that is shipped, cut down."""
    table = parse(read_published(HAND_TABLE))
    small = {key: _cut(value) for key, value in table.items()}
    return {"small": encode(small)}


def _cut(value: object) -> object:
    if not isinstance(value, dict):
        return value
    return {key: _cut(held) for key, held in list(value.items())[:3]}


def read(folder: Path, data: bytes) -> object:
    """Read a table."""
    return read_prior_table(str(put(folder, ".json", data)), load_class_map().classes)


TARGET = Target(
    name="prior-table",
    read=read,
    seeds=seeds,
    words=("objects", "room_types", "presence", "kitchen", "chair", "1e-320", "2"),
    most=2_500,
)
