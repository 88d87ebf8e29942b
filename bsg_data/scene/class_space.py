"""Class spaces: the ordered lists of classes of all histograms.

A published space is a file of `mappings/`: `<name>.classes.csv` with `index,class,definition`.
Models, pairs and beliefs have one class space. Several class maps can share a space
(`bsg_data.scene.class_map`).
"""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.resources import files

import numpy as np
from pydantic import model_validator

from bsg_data.arrays import Ints
from bsg_data.errors import ClassMapError
from bsg_data.inputs.text_table import parse_csv
from bsg_data.records import Listed, Record
from bsg_data.words.nearest import ask_if_meant
from bsg_data.words.shown import SHOWN, show_value

DEFAULT_CLASS_SPACE = "hm3d45-v1"
_MAX_CLASSES = 256  # the objects table stores the index in a byte
_SUFFIX = ".classes.csv"
_PARTS = "parts-v1.csv"


class ClassSpace(Record):
    """An ordered list of classes: that of a histogram, as files hold it."""

    name: str  # e.g. `hm3d45-v1`
    sha256: str  # of the ordered names
    classes: Listed[str]  # [C]

    @model_validator(mode="after")
    def _hash_fits(self) -> ClassSpace:
        if self.sha256 != _hash_classes(self.classes):
            raise ValueError(f"class space {self.name}: expected the sha256 of its classes")
        return self

    @classmethod
    def of(cls, name: str, classes: Iterable[str]) -> ClassSpace:
        """Name and hash an ordered list of classes."""
        classes = tuple(classes)
        return cls(name=name, sha256=_hash_classes(classes), classes=classes)

    def __str__(self) -> str:
        """Name it, with the beginning of its hash."""
        return f"{self.name} (sha256 {self.sha256[:12]}…)"

    def class_index(self, name: str) -> int:
        """Return the index of a class; `ClassMapError` names the nearest."""
        if name in self.classes:
            return self.classes.index(name)
        asked = ask_if_meant(name, self.classes, most=3)
        hint = f"; {asked}" if asked else ""
        raise ClassMapError(
            f"{name[:SHOWN]!r} is not a class of {self.name}{hint}",
            code="class-unknown",
            where=name[:SHOWN],
        )


def _hash_classes(classes: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(classes).encode()).hexdigest()


def list_class_spaces() -> tuple[str, ...]:
    """Return the names of the published class spaces, sorted."""
    names = (item.name for item in files("bsg_mappings").iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in names if name.endswith(_SUFFIX)))


@cache
def load_class_space(name: str = DEFAULT_CLASS_SPACE) -> ClassSpace:
    """Load a published class space; `ClassMapError` if there is none, or it was changed."""
    if name not in list_class_spaces():
        raise ClassMapError(
            f"no class space {show_value(name)}: published are {', '.join(list_class_spaces())}"
        )
    return parse_class_space(name, read_published(f"{name}{_SUFFIX}"))[0]


def read_published(file: str, *, folder: str = "bsg_mappings") -> bytes:
    """Read a file that the SHA256SUMS of its folder lists; `ClassMapError` if it was changed."""
    data = files(folder).joinpath(file).read_bytes()
    if f"{hashlib.sha256(data).hexdigest()}  {file}" not in _list_published(folder):
        where = folder.removeprefix("bsg_").replace(".", "/")
        raise ClassMapError(
            f"{where}/{file} is not the published file (sha256 differs from SHA256SUMS): "
            "reinstall the package, or give your version a new name",
            code="file-changed",
            where=file,
        )
    return data


@cache
def _list_published(folder: str) -> frozenset[str]:
    """Return the hashes of the published files of a folder, with their names."""
    sums = files(folder).joinpath("SHA256SUMS").read_bytes().decode("utf-8", "replace")
    return frozenset(sums.splitlines())


def read_columns(file: str, *, folder: str = "bsg_mappings") -> dict[str, tuple[str, ...]]:
    """Read a published table, whose hash says that it is whole, as columns by name."""
    rows = csv.reader(read_published(file, folder=folder).decode().splitlines())
    return dict(zip(next(rows), zip(*rows, strict=True), strict=True))


def parse_class_space(name: str, data: bytes) -> tuple[ClassSpace, tuple[str, ...]]:
    """Parse `index,class,definition` as a space, and one sentence per class `[C]`."""
    file = f"{name}{_SUFFIX}"
    found: dict[str, str] = {}
    for line, (index, class_name, definition) in read_rows(
        file, data, ("index", "class", "definition")
    ):
        if index != str(len(found)) or not class_name or class_name in found:
            raise ClassMapError(
                f"{file}, line {line}: expected index {len(found)} and a new class name, "
                f"found {show_value(index)}, {show_value(class_name)}"
            )
        found[class_name] = definition
    if not 1 <= len(found) <= _MAX_CLASSES:
        raise ClassMapError(f"{file}: expected 1 to {_MAX_CLASSES} classes, found {len(found)}")
    return ClassSpace.of(name, found), tuple(found.values())


def read_rows(file: str, data: bytes, header: tuple[str, ...]) -> list[tuple[int, list[str]]]:
    """Read a CSV file in the form of `mappings/` as numbered rows.

    Raises:
        ClassMapError: if it is none, or has other columns; it names the line.
    """
    try:
        first, *rows = [*parse_csv(data)] or [(1, [])]
    except ValueError as error:
        raise ClassMapError(f"{file}: not a readable CSV file ({error})") from error
    if tuple(first[1]) != header:
        raise ClassMapError(
            f"{file}, line 1: expected {','.join(header)}, found {show_value(','.join(first[1]))}"
        )
    for line, row in rows:
        if len(row) != len(header):
            raise ClassMapError(
                f"{file}, line {line}: expected {len(header)} fields, found {len(row)}"
            )
    return rows


@cache
def _load_parts() -> dict[str, str]:
    return dict(zip(*read_columns(_PARTS).values(), strict=True))


def find_wholes(categories: Sequence[str], classes: Sequence[str]) -> Ints:
    """Return the index of the class that each category is a part of, `[K]`; -1 for none.

    A curtain rod tells that there is a curtain. A mask that hides objects independently can show
    the rod and hide the curtain. A real robot seldom sees one without the other.

    >>> find_wholes(["curtain rod", "wall"], ["bed", "curtain"])
    array([ 1, -1])
    """
    index = {name: number for number, name in enumerate(classes)}
    parts = _load_parts()
    return np.array([index.get(parts.get(name, ""), -1) for name in categories], dtype=np.int64)
