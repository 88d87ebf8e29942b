"""Class maps of one's own: `bsg_data.scene.own_map` and `bsg_data.scene.class_map`."""

from __future__ import annotations

from pathlib import Path

from bsg_data.scene.class_map import parse_own_map
from bsg_data.scene.own_map import read_own_map
from fuzz.target import Target

_SUFFIXES = (".csv", ".classes.csv", ".structure.csv")


def seeds() -> dict[str, bytes]:
    """Return a map with classes of its own, and one without."""
    spellings = b'raw_category,category,class\nchair,chair,chair\n"a, b",sofa,\nWall,wall,\n'
    classes = b"index,class,definition\n0,chair,A seat.\n1,bed,To sleep in.\n"
    return {"own": b"\0".join((spellings, classes, b"category\nwall\n")), "default": spellings}


def read(folder: Path, data: bytes) -> object:
    """Read a map, whose files stand one after another with a byte of 0 between."""
    for path in folder.iterdir():
        path.unlink()
    for suffix, text in zip(_SUFFIXES, data.split(b"\0"), strict=False):
        (folder / f"mine{suffix}").write_bytes(text)
    class_map = parse_own_map(read_own_map(folder / "mine.csv"))
    for name in ("chairs", "", "kitchen chair 2", "unknown/x", "ﬁ\u0345"):
        class_map.classify(name)
    return class_map.nearest("chiar")


TARGET = Target(
    name="class-map",
    read=read,
    seeds=seeds,
    words=("chair", "bed", "category", "\0", '"', "\r\n", "unknown", "\ufeff", "\u0345", "2,x,y\n"),
    most=300,
)
