"""Matterport3D's `.house` files: `bsg_data.sources.mp3d`."""

from __future__ import annotations

import gzip
from pathlib import Path

from bsg_data.sources.mp3d import MatterportHouses
from fuzz.target import Target, load_map, put, read_source

_HOUSE = b"""ASCII 1.1
H  -  -  1 1 3 1 1 2 2 2 1 1  0 0 0 0 0  0 0 0  8 4 3  0 0 0 0 0
L  0  0  -  4 2 0  0 0 0  8 4 3  0 0 0 0 0
R  0 0  0 0  k  1 1 0  0 0 0  4 4 2.5  2.5  0 0 0 0
R  1 0  0 0  b  6 2 0  4.1 0 0.1  8 4 2.5  2.4  0 0 0 0
P  0 0 1  D  4 1 0  4.1 2 2  0 0 0 0
S  0 0  0  F  1 1 0  0 0 1  0 0 0  4 4 0  0 0 0 0 0
V  0 0  F  0 0 0  0 0 1  0 0 0
V  1 0  F  4 0 0  0 0 1  0 0 0
V  2 0  F  4 2 0  0 0 1  0 0 0
P  00ebbf3782c64d74aaf7dd39cd561175  0 0  0  1 1 1.5  0 0 0 0 0
I  0 0   00ebbf3782c64d74aaf7dd39cd561175  0 0  0
C  0  1 wall  1 wall  0 0 0 0 0
C  1  2 coffee#table  5 table  0 0 0 0 0
O  0 0 1  1 1 0.25  1 0 0  0 1 0  0.5 0.25 0.25  0 0 0 0 0 0 0 0
O  1 1 -1  6 2 1  0 0 0  0 0 0  -1 -1 -1  0 0 0 0 0 0 0 0
E  0 0 1  0.5  1 1 0.5  0.5 0.75 0  1.5 1.25 0.5  0 0 0 0 0
"""


def seeds() -> dict[str, bytes]:
    """Return a house of two rooms, and the same packed."""
    return {"house": _HOUSE, "packed": gzip.compress(_HOUSE, mtime=0)}


def read(folder: Path, data: bytes) -> object:
    """Read a house, packed or not."""
    suffix = ".house.gz" if data[:1] == b"\x1f" else ".house"
    return read_source(MatterportHouses(put(folder, suffix, data)), load_map("mp3d45-v1"))


TARGET = Target(
    name="house",
    read=read,
    seeds=seeds,
    words=(
        "ASCII 1.1",
        "nan",
        "inf",
        "-1",
        "1e308",
        "999999999",
        "\nR ",
        "\nO ",
        "\nV ",
        "\nP ",
        "#",
    ),
    most=1_400,
)
