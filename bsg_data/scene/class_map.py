"""Class maps: map the free text of an annotation to a class of a class space.

A published map is a file of `mappings/` that never changes: `<version>.csv` with
`raw_category,category,class`, one row per spelling. `class_maps.csv` has its class space, and
whether rules resolve names that it does not list.
"""

from __future__ import annotations

import hashlib
import os
import unicodedata
from collections import ChainMap
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Literal, NamedTuple

from bsg_data.errors import ClassMapError
from bsg_data.files import AnyPath, write_bytes
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import CLASS_MAP
from bsg_data.recipes import Record
from bsg_data.scene.class_space import (
    DEFAULT_CLASS_SPACE,
    ClassSpace,
    parse_class_space,
    read_published,
    read_rows,
)
from bsg_data.scene.spoken_names import RULES_VERSION, Rule, resolve
from bsg_data.spelling import SHOWN, ask_if_meant, nearest_names

DEFAULT_CLASS_MAP = "hm3d45-v2"
UNKNOWN = "unknown"  # the category of a nameless object
_SYNONYMS = "synonyms-v1.csv"
SUFFIX, CLASSES, STRUCTURE = ".csv", ".classes.csv", ".structure.csv"
_FILES = {"spellings": SUFFIX, "classes": CLASSES, "structure": STRUCTURE}
Role = Literal["classified", "left-out", "structure", "nameless", "unmapped"]


@dataclass(frozen=True, slots=True)
class Classified:
    """What an annotated name is under a class map."""

    category: str | None  # the corrected name; `unknown` if nameless; None if unmapped
    class_index: int | None  # None outside the classes
    # classified: has a class; left-out: an object outside the classes; structure: a part of the
    # building; nameless: blank or `unknown`; unmapped: not in the map
    role: Role
    rule: Rule | None = None  # that gave the category; None for a listed name


@dataclass(frozen=True, slots=True)
class ClassMap:
    """A class map, ready to look names up."""

    version: str  # its name, e.g. `hm3d45-v1`
    # hash of its files: spellings, then classes; for a map with rules also the list of structure,
    # the synonyms and the version of the rules
    sha256: str
    space: ClassSpace
    definitions: tuple[str, ...]  # [C] one sentence per class
    structure: frozenset[str]  # categories that are parts of the building, not objects in it
    entries: Mapping[str, Classified]  # by spelling, as published
    normalised: Mapping[str, Classified]  # by normalised spelling (`normalise_name`)
    # normalised name → listed name, or the empty name if the last word misleads; None for a map
    # without rules
    synonyms: Mapping[str, str] | None = None
    _resolved: dict[str, Classified] = field(default_factory=dict, repr=False, compare=False)

    @property
    def classes(self) -> tuple[str, ...]:
        """The names of the classes, `[C]`, in the order of every histogram."""
        return self.space.classes

    @property
    def nameable(self) -> tuple[str, ...]:
        """The classes that some name of the map leads to; its source has no word for the others."""
        known = {entry.class_index for entry in self.entries.values()}
        return tuple(name for index, name in enumerate(self.classes) if index in known)

    def lookup(self, name: str) -> Classified | None:
        """Look up a listed name, exact first, then normalised; None if it is not listed."""
        entry = self.entries.get(name)
        return entry if entry is not None else self.normalised.get(normalise_name(name))

    def classify(self, name: str) -> Classified:
        """Return category, class and role of an annotated name; every lookup goes through here."""
        entry = self.lookup(name)
        if entry is not None:
            return entry
        if is_nameless(name):
            return Classified(UNKNOWN, None, "nameless")
        if name not in self._resolved:
            self._resolved[name] = self._resolve(name)
        return self._resolved[name]

    def _resolve(self, name: str) -> Classified:
        """Resolve a name that is not listed by the rules."""
        listed = self.normalised.__contains__
        words = normalise_name(name)
        found = () if self.synonyms is None else resolve(words, self.synonyms, known=listed)
        for other, rule in found:
            entry = self.normalised[normalise_name(other)]
            if rule != "head noun" or entry.class_index is not None:
                return replace(entry, rule=rule)
        return Classified(None, None, "unmapped")

    def nearest(self, name: str, *, count: int = 3) -> tuple[str, ...]:
        """Return the known spellings most like `name`, best first."""
        return nearest_names(normalise_name(name), self.normalised, most=count)


class PublishedMap(NamedTuple):
    """A row of `mappings/class_maps.csv`."""

    class_map: str
    class_space: str
    source: str  # whose names it maps
    rules: bool  # whether rules resolve names that it does not list


class OwnMap(Record):
    """The files of a user's own class map, which datasets and checkpoints keep."""

    name: str  # of its file, without `.csv`
    spellings: bytes  # NAME.csv
    classes: bytes | None = None  # NAME.classes.csv; None: the default class space
    structure: bytes | None = None  # NAME.structure.csv


def normalise_name(name: str) -> str:
    """Return `name` as NFC, casefolded, trimmed, runs of white space as one space."""
    return " ".join(unicodedata.normalize("NFC", name).casefold().split())


def is_nameless(name: str) -> bool:
    """Say whether a name is blank, `unknown` or `unknown/...`."""
    return normalise_name(name).split("/")[0].strip() in ("", UNKNOWN)


@cache
def published_maps() -> Mapping[str, PublishedMap]:
    """Return the published maps by their names, in the order of `mappings/class_maps.csv`."""
    data = files("bsg_mappings").joinpath("class_maps.csv").read_bytes()
    rows = read_rows("class_maps.csv", data, ("class_map", "class_space", "source", "rules"))
    return {row[0]: PublishedMap(row[0], row[1], row[2], row[3] == "yes") for _, row in rows}


def map_into(class_space: str) -> str:
    """Return the published map of HM3D's names (everyday words) into a class space."""
    for row in published_maps().values():
        if row.class_space == class_space and row.source == "hm3d":
            return row.class_map
    raise ClassMapError(
        f"no published class map is for the class space {class_space!r}; published are "
        f"{', '.join(list_class_maps())}. Read the graph in Python with your own NAME.csv: "
        "read_robot_graph(path, class_map='NAME.csv')"
    )


def list_class_maps() -> tuple[str, ...]:
    """Return the versions of the published maps, sorted."""
    return tuple(sorted(published_maps()))


def load_class_map(name: AnyPath | ClassMap = DEFAULT_CLASS_MAP) -> ClassMap:
    """Load a published map by its version, or your own map by the path of its NAME.csv.

    A `ClassMap` is returned unchanged.

    Raises:
        ClassMapError: if the map is missing or malformed, or a published file was changed.
    """
    return name if isinstance(name, ClassMap) else _load(os.fspath(name))


@cache
def _load(name: str) -> ClassMap:
    if is_own_map(name):
        return parse_own_map(read_own_map(Path(name)))
    if name not in published_maps():
        known = list_class_maps()
        asked = f"{ask_if_meant(name, known)} published are {', '.join(known)}".lstrip()
        raise ClassMapError(
            f"no class map {name[:SHOWN]!r}: {asked}; for a map of your own give the path of its "
            ".csv file (NAME.csv, with NAME.classes.csv beside it)"
        )
    row = published_maps()[name]
    return _parse_map(
        name,
        row.class_space,
        spellings=read_published(f"{name}.csv"),
        classes=read_published(f"{row.class_space}.classes.csv"),
        structure=read_published(f"{name}.structure.csv"),
        rules=row.rules,
    )


def is_own_map(name: str) -> bool:
    """Say whether the name of a class map is the path of a `NAME.csv`."""
    return name.casefold().endswith(SUFFIX)


def read_own_map(path: Path) -> OwnMap:
    """Read the files of a class map, by the path of its `NAME.csv`.

    Raises:
        ClassMapError: if it is missing, cannot be read, or is too large for a class map.
    """
    if not path.is_file():
        raise ClassMapError(
            f"{path}: no such file; expected a class map NAME.csv (raw_category,category,class), "
            "and NAME.classes.csv (index,class,definition) beside it for its own classes",
            code="class-map-missing",
            where=path,
        )
    found = {
        part: read_bytes(file, CLASS_MAP, error=ClassMapError)
        for part, suffix in _FILES.items()
        if (file := path.with_suffix(suffix)).is_file()
    }
    return OwnMap(name=path.stem, **{"spellings": b"", **found})


def write_own_map(own: OwnMap, folder: Path) -> Path:
    """Write the files of a class map into a folder, and return the path of its `NAME.csv`."""
    for part, suffix in _FILES.items():
        if (data := getattr(own, part)) is not None:
            write_bytes(folder / f"{own.name}{suffix}", data)
    return folder / f"{own.name}{SUFFIX}"


def parse_own_map(own: OwnMap) -> ClassMap:
    """Parse a user's own map; its classes are its own, or those of the default class space."""
    if own.name in published_maps():
        raise ClassMapError(f"{own.name} is the name of a published map; choose another name")
    return _parse_map(
        own.name,
        DEFAULT_CLASS_SPACE if own.classes is None else own.name,
        spellings=own.spellings,
        classes=own.classes or read_published(f"{DEFAULT_CLASS_SPACE}.classes.csv"),
        structure=own.structure or b"category\n",
    )


def join_maps(first: ClassMap, *others: ClassMap) -> ClassMap:
    """Return one map with the names of several; the first map that lists a name decides.

    Raises:
        ClassMapError: if their class spaces differ.
    """
    if not others:
        return first
    for other in others:
        if other.space != first.space:
            raise ClassMapError(
                f"class maps {first.version} and {other.version} have different class spaces"
            )
    maps = (first, *others)
    normalised = ChainMap(*(dict(one.normalised) for one in maps))
    synonyms = ChainMap(*(dict(one.synonyms or {}) for one in maps))
    return replace(
        first,
        version=" + ".join(one.version for one in maps),
        sha256=hashlib.sha256("".join(one.sha256 for one in maps).encode()).hexdigest(),
        structure=frozenset().union(*(one.structure for one in maps)),
        entries=ChainMap(*(dict(one.entries) for one in maps)),
        normalised=normalised,
        synonyms={name: word for name, word in synonyms.items() if name not in normalised},
        _resolved={},
    )


def _parse_map(
    version: str,
    space_name: str,
    *,
    spellings: bytes,
    classes: bytes,
    structure: bytes,
    rules: bool = True,
) -> ClassMap:
    space, definitions = parse_class_space(space_name, classes)
    parts = frozenset(
        row[0] for _, row in read_rows(f"{version}.structure.csv", structure, ("category",))
    )
    entries, normalised = _parse_spellings(f"{version}.csv", spellings, space, parts)
    words = read_published(_SYNONYMS)
    hashed = [spellings, classes, *([structure, words, RULES_VERSION] if rules else [])]
    return ClassMap(
        version=version,
        sha256=hashlib.sha256(b"".join(hashed)).hexdigest(),
        space=space,
        definitions=definitions,
        structure=parts,
        entries=entries,
        normalised=normalised,
        synonyms=_parse_synonyms(words, normalised) if rules else None,
    )


def _parse_synonyms(data: bytes, listed: Mapping[str, Classified]) -> dict[str, str]:
    """Return the synonyms of what a map lists; it need not list all that there are."""
    rows = [row for _, row in read_rows(_SYNONYMS, data, ("name", "category"))]
    words = {normalise_name(name): normalise_name(category) for name, category in rows}
    return {name: other for name, other in words.items() if not other or other in listed}


def _parse_spellings(
    file: str, data: bytes, space: ClassSpace, structure: frozenset[str]
) -> tuple[dict[str, Classified], dict[str, Classified]]:
    entries: dict[str, Classified] = {}
    normalised: dict[str, Classified] = {}
    for line, (raw, category, name) in read_rows(file, data, ("raw_category", "category", "class")):
        if name and name not in space.classes:
            raise ClassMapError(f"{file}, line {line}: {name!r} is no class of {space.name}")
        if raw in entries:
            raise ClassMapError(f"{file}, line {line}: {raw!r} is listed twice")
        index = space.classes.index(name) if name else None
        entries[raw] = Classified(category, index, _find_role(category, index, structure))
        if normalised.setdefault(normalise_name(raw), entries[raw]).class_index != index:
            raise ClassMapError(
                f"{file}, line {line}: {raw!r} differs from an earlier row only in case or spaces "
                "but has another class"
            )
    return entries, normalised


def _find_role(category: str, class_index: int | None, structure: frozenset[str]) -> Role:
    if class_index is not None:
        return "classified"
    if is_nameless(category):
        return "nameless"
    return "structure" if category in structure else "left-out"
