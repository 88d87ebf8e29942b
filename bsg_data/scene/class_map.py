"""Class maps: from the free text of an annotation to one of the classes.

A published map is two files in `mappings/` that never change: `<version>.csv` with
`raw_category,category,class`, one row a spelling, and `<version>.classes.csv` with
`index,class,definition`, whose order is the order of every histogram.
"""

from __future__ import annotations

import csv
import difflib
import hashlib
import io
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Literal

from bsg_data.errors import ClassMapError

DEFAULT_CLASS_MAP = "hm3d45-v1"
MAX_CLASSES = 256  # the objects table has the index in a byte
UNKNOWN = "unknown"  # the category of a nameless object
Role = Literal["classified", "left-out", "structure", "nameless", "unmapped"]


@dataclass(frozen=True, slots=True)
class MapEntry:
    """What the map says of one spelling.

    Attributes:
        category: the corrected name.
        class_index: its class, or None outside the classes.
    """

    category: str
    class_index: int | None


@dataclass(frozen=True, slots=True)
class Classified:
    """What an annotated name comes to under a class map.

    Attributes:
        category: the corrected name, `unknown` for a nameless one; None for an unmapped name.
        class_index: its class, or None outside the classes.
        role: `classified` with a class; `left-out`, an object outside the classes; `structure`,
            a part of the building; `nameless`, blank or `unknown`; `unmapped`, a name that the map
            does not have.
    """

    category: str | None
    class_index: int | None
    role: Role


@dataclass(frozen=True, slots=True)
class ClassMap:
    """A class map, ready to look names up.

    Attributes:
        version: its name, e.g. `hm3d45-v1`.
        sha256: of the bytes of `<version>.csv` followed by those of `<version>.classes.csv`.
        classes: `[C]` class names in the order of every histogram.
        definitions: `[C]` one sentence a class.
        structure: categories that are part of the building itself, not objects in it.
        entries: every spelling as published.
        normalised: the same under `normalise_name`.
    """

    version: str
    sha256: str
    classes: tuple[str, ...]
    definitions: tuple[str, ...]
    structure: frozenset[str]
    entries: Mapping[str, MapEntry]
    normalised: Mapping[str, MapEntry]

    def lookup(self, name: str) -> MapEntry | None:
        """Look a name up: exact, then normalised; None for an unmapped name."""
        entry = self.entries.get(name)
        return entry if entry is not None else self.normalised.get(normalise_name(name))

    def classify(self, name: str) -> Classified:
        """Return what an annotated name comes to: the one rule from a name to a class."""
        entry = self.lookup(name)
        if entry is None:
            nameless = is_nameless(name)
            return Classified(UNKNOWN, None, "nameless") if nameless else _UNMAPPED
        role: Role = "left-out"
        if entry.class_index is not None:
            role = "classified"
        elif is_nameless(entry.category):
            role = "nameless"
        elif entry.category in self.structure:
            role = "structure"
        return Classified(entry.category, entry.class_index, role)

    def nearest(self, name: str, *, count: int = 3) -> tuple[str, ...]:
        """Return the known spellings most like `name`, best first."""
        return tuple(difflib.get_close_matches(normalise_name(name), self.normalised, n=count))

    def class_index(self, name: str) -> int:
        """Return the index of a class.

        Raises:
            ClassMapError: for a name that is no class, with the nearest ones.
        """
        if name in self.classes:
            return self.classes.index(name)
        near = difflib.get_close_matches(name, self.classes, n=3)
        hint = f"; did you mean {', '.join(near)}?" if near else ""
        raise ClassMapError(f"{name!r} is not a class of {self.version}{hint}")


_UNMAPPED = Classified(None, None, "unmapped")


def normalise_name(name: str) -> str:
    """Return `name` as NFC, casefolded, trimmed, runs of white space as one space.

    >>> normalise_name("  Shower   DIAL ")
    'shower dial'
    """
    return " ".join(unicodedata.normalize("NFC", name).casefold().split())


def is_nameless(name: str) -> bool:
    """Say whether a name says nothing: blank, `unknown`, or `unknown/` and something.

    >>> is_nameless(" Unknown/remove")
    True
    """
    return normalise_name(name).split("/")[0].strip() in ("", UNKNOWN)


def list_class_maps() -> tuple[str, ...]:
    """Return the versions of the published maps, sorted."""
    suffix = ".classes.csv"
    names = (item.name for item in files("bsg_mappings").iterdir())
    return tuple(sorted(name.removesuffix(suffix) for name in names if name.endswith(suffix)))


@cache
def load_class_map(name: str = DEFAULT_CLASS_MAP) -> ClassMap:
    """Load a published map by its version, or one of your own by the path of its csv.

    Raises:
        ClassMapError: if it is missing or malformed, or a published file was changed.
    """
    if name.casefold().endswith(".csv"):
        return _read_own_map(Path(name))
    if name not in list_class_maps():
        known = ", ".join(list_class_maps())
        raise ClassMapError(
            f"no class map {name!r}: published are {known}; a map of your own is named by the "
            "path of its .csv file (NAME.csv, with NAME.classes.csv beside it)"
        )
    folder = files("bsg_mappings")
    published = _published_hashes(folder.joinpath("SHA256SUMS").read_text("utf-8"))
    contents = {}
    for part in (f"{name}.csv", f"{name}.classes.csv", f"{name}.structure.csv"):
        data = folder.joinpath(part).read_bytes()
        if hashlib.sha256(data).hexdigest() != published.get(part):
            raise ClassMapError(
                f"mappings/{part} is not the published file (sha256 differs from SHA256SUMS): "
                "published maps never change; reinstall, or give your version a new name"
            )
        contents[part] = data
    return _parse_map(name, *contents.values())


def _read_own_map(path: Path) -> ClassMap:
    if path.stem in list_class_maps():
        raise ClassMapError(f"{path}: {path.stem} is the name of a published map; choose another")
    parts = [path, path.with_suffix(".classes.csv"), path.with_suffix(".structure.csv")]
    for part in parts[:2]:
        if not part.is_file():
            raise ClassMapError(
                f"{part}: no such file; a class map is NAME.csv (raw_category,category,class) "
                "with NAME.classes.csv (index,class,definition) beside it"
            )
    structure = parts[2].read_bytes() if parts[2].is_file() else b"category\n"
    return _parse_map(path.stem, parts[0].read_bytes(), parts[1].read_bytes(), structure)


def _published_hashes(text: str) -> dict[str, str]:
    pairs = (line.split(maxsplit=1) for line in text.splitlines() if line.strip())
    return {name.lstrip("*"): digest for digest, name in pairs}


def _parse_map(version: str, spellings: bytes, classes: bytes, structure: bytes) -> ClassMap:
    names, definitions = _parse_classes(f"{version}.classes.csv", classes)
    entries, normalised = _parse_spellings(f"{version}.csv", spellings, names)
    rows = _rows(f"{version}.structure.csv", structure, ("category",))
    return ClassMap(
        version=version,
        sha256=hashlib.sha256(spellings + classes).hexdigest(),
        classes=names,
        definitions=definitions,
        structure=frozenset(category for _, (category,) in rows),
        entries=entries,
        normalised=normalised,
    )


def _parse_classes(file: str, data: bytes) -> tuple[tuple[str, ...], tuple[str, ...]]:
    names: list[str] = []
    definitions: list[str] = []
    for line, (index, name, definition) in _rows(file, data, ("index", "class", "definition")):
        if index != str(len(names)) or not name or name in names:
            raise ClassMapError(
                f"{file}, line {line}: expected index {len(names)} and a new class name, "
                f"found {index!r}, {name!r}"
            )
        names.append(name)
        definitions.append(definition)
    if not 1 <= len(names) <= MAX_CLASSES:
        raise ClassMapError(f"{file}: expected 1 to {MAX_CLASSES} classes, found {len(names)}")
    return tuple(names), tuple(definitions)


def _parse_spellings(
    file: str, data: bytes, classes: tuple[str, ...]
) -> tuple[dict[str, MapEntry], dict[str, MapEntry]]:
    index = {name: i for i, name in enumerate(classes)}
    entries: dict[str, MapEntry] = {}
    normalised: dict[str, MapEntry] = {}
    for line, (raw, category, name) in _rows(file, data, ("raw_category", "category", "class")):
        if name and name not in index:
            raise ClassMapError(f"{file}, line {line}: {name!r} is not in {file[:-4]}.classes.csv")
        if raw in entries:
            raise ClassMapError(f"{file}, line {line}: {raw!r} is listed twice")
        entry = MapEntry(category, index[name] if name else None)
        entries[raw] = entry
        first = normalised.setdefault(normalise_name(raw), entry)
        if first.class_index != entry.class_index:
            raise ClassMapError(
                f"{file}, line {line}: {raw!r} differs from an earlier row only in case or spaces "
                "but has another class"
            )
    return entries, normalised


def _rows(file: str, data: bytes, header: tuple[str, ...]) -> list[tuple[int, list[str]]]:
    try:
        reader = csv.reader(io.StringIO(data.decode("utf-8-sig"), newline=""), strict=True)
        first = next(reader, [])
        if tuple(first) != header:
            raise ClassMapError(
                f"{file}, line 1: expected {','.join(header)}, found {','.join(first)!r}"
            )
        rows = [(reader.line_num, row) for row in reader]
    except UnicodeDecodeError as error:
        raise ClassMapError(
            f"{file}: expected UTF-8, found byte {error.start} that is not"
        ) from error
    except csv.Error as error:
        raise ClassMapError(f"{file}: not a readable CSV file ({error})") from error
    for line, row in rows:
        if len(row) != len(header):
            raise ClassMapError(
                f"{file}, line {line}: expected {len(header)} fields, found {len(row)}"
            )
    return rows
