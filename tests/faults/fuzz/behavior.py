"""BEHAVIOR-1K's list of rooms and objects: `bsg_data.sources.behavior`."""

from __future__ import annotations

import re
from pathlib import Path

from bsg_data.sources.behavior import BehaviorRooms
from fuzz.target import Target, encode, load_map, put, read_source

_LIST = {
    "success": True,
    "scenes": {
        "Rs_int": {"kitchen_0": {"stove-abcdef": 1, "straight_chair-amgwaw": 2}, "bedroom_0": {}},
        "Rs_garden": {"kitchen_0": {"stove-abcdef": 1}, "garden_0": {"tree-ccc": 3}},
        "house_double_floor_upper": {"bedroom_10": {"shower_stall-gqxmqf": 1}},
        "office_bike": {"shared_office_0": {"desk-aaaaaa": 2}},
    },
}


def seeds() -> dict[str, bytes]:
    """Return a list of four scenes."""
    return {"list": encode(_LIST)}


def read(folder: Path, data: bytes) -> object:
    """Read a list, the scenes as they are and the houses that they are of.

    The objects are counted and not listed, so that a number does not become a million of them:
    that is in the bounds of the reader, and would slow the fuzzer down.
    """
    path, class_map = put(folder, ".json", data), load_map("behavior45-v1")
    if re.search(rb"[0-9]{4}", data):
        BehaviorRooms(path).find()
        return
    read_source(BehaviorRooms(path), class_map)
    read_source(BehaviorRooms(path, as_listed=True), class_map)


TARGET = Target(
    name="behavior",
    read=read,
    seeds=seeds,
    words=("scenes", "_int", "_garden", "house_double_floor_lower", "../x", "shower_stall-nvempw"),
    most=500,
)
