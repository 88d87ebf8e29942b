"""HM3D's annotation text: `bsg_data.sources.annotations`."""

from __future__ import annotations

from pathlib import Path

from bsg_data.sources.annotations import read_annotation
from fuzz.target import Target, put

_TEXT = 'HM3D Semantic Annotations\n1,1003,"wall",0\n2,0F3A9C,"chair, \u00fc",4\n7,FF,"",-1\n'


def seeds() -> dict[str, bytes]:
    """Return an annotation, with a byte order mark and with Windows' line ends, too."""
    return {
        "plain": _TEXT.encode(),
        "mark": _TEXT.encode("utf-8-sig"),
        "windows": _TEXT.replace("\n", "\r\n").encode(),
    }


def read(folder: Path, data: bytes) -> object:
    """Read a file."""
    return read_annotation(put(folder, ".semantic.txt", data))


TARGET = Target(
    name="annotation",
    read=read,
    seeds=seeds,
    words=("HM3D Semantic Annotations", '"chair"', ",-1", "\n", "\u2028", "unknown", "999999999"),
    most=400,
)
