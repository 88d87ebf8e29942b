"""ProcTHOR's houses, JSON lines or an array, gzip or not: `bsg_data.sources.procthor`."""

from __future__ import annotations

import gzip
from pathlib import Path

from bsg_data.sources.procthor import ProcTHORHouses
from fuzz.target import Target, encode, load_map, put, read_source

_HOUSE = {
    "rooms": [
        {
            "id": "room|4",
            "roomType": "Bedroom",
            "floorPolygon": [{"x": x, "y": 0, "z": z} for x, z in ((0, 0), (2, 0), (2, 1), (1, 2))],
        },
        {
            "id": "room|2",
            "roomType": "Bathroom",
            "floorPolygon": [{"x": x, "y": 0, "z": z} for x, z in ((2, 0), (4, 0), (4, 1))],
        },
    ],
    "doors": [{"id": "door|2|4", "room0": "room|4", "room1": "room|2"}],
    "walls": [{"roomId": "room|4", "polygon": [{"x": 0, "y": 2.5, "z": 0}]}],
    "objects": [
        {
            "id": "4|0|0",
            "assetId": "Bed_25",
            "position": {"x": 1, "y": 0.5, "z": 1},
            "children": [
                {"id": "small|9", "assetId": "pillow_1", "position": {"x": 1, "y": 1, "z": 0.5}}
            ],
        }
    ],
}


def seeds() -> dict[str, bytes]:
    """Return two houses, a house a line, the same as an array, and packed."""
    house = encode(_HOUSE)
    lines = house + b"\n" + house.replace(b"room|4", b"room|7") + b"\n"
    return {"lines": lines, "array": b"[" + house + b"]", "packed": gzip.compress(lines, mtime=0)}


def read(folder: Path, data: bytes) -> object:
    """Read a file, whose suffix is that of what it looks like."""
    suffix = ".json" if data[:1] == b"[" else ".jsonl"
    suffix += ".gz" if data[:1] == b"\x1f" else ""
    return read_source(ProcTHORHouses(put(folder, suffix, data)), load_map("procthor45-v1"))


TARGET = Target(
    name="procthor",
    read=read,
    seeds=seeds,
    words=("room|999999", "children", "floorPolygon", "assetId", "\n", "[", "]", "1e308", "|4|"),
    most=2_500,
)
