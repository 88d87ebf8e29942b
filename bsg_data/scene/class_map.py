"""Class maps: map the free text of an annotation to a class of a class space.

A published map is a file of `mappings/`: `<version>.csv` with `raw_category,category,class`, one
row per spelling. `class_maps.csv` has its class space. Rules resolve names that it does not list.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections import ChainMap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import chain
from pathlib import Path
from typing import Literal, NamedTuple

from bsg_data.errors import ClassMapError
from bsg_data.files import AnyPath, write_bytes
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.records import Record
from bsg_data.scene.class_space import (
    DEFAULT_CLASS_SPACE,
    ClassSpace,
    parse_class_space,
    read_columns,
    read_published,
    read_rows,
)
from bsg_data.scene.synonyms import RULE_FILES, UNKNOWN, Rule, list_synonyms, read_real_words
from bsg_data.words.nearest import Spellings, ask_if_meant, nearest_names
from bsg_data.words.normal import (
    LONGEST,
    MOST_WORDS,
    change_number,
    drop_number,
    list_parts,
    list_tails,
    normalise_name,
    normalise_names,
    separate,
    take_apart,
)
from bsg_data.words.shown import SHOWN, show_value

DEFAULT_CLASS_MAP = "hm3d45-v1"
_RULES_VERSION = b"rules 1"  # of what is below: it is in the hash of every class map
_NAMELESS = re.compile(rf"\s*(?:{UNKNOWN})?\s*(?:/.*)?", re.IGNORECASE | re.DOTALL)
_MOST_RESOLVED = 2**16  # names that are not listed and whose class is kept: a robot's graph fits in
_SUFFIX = ".csv"
MAP_FILES = {"spellings": _SUFFIX, "classes": ".classes.csv", "structure": ".structure.csv"}
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


_UNMAPPED = Classified(None, None, "unmapped")


@dataclass(frozen=True)
class ClassMap:
    """A class map, ready to look names up.

    Names that it does not list are read by these rules, in this order; the deciding one is told:

    - separator: hyphens, underscores and spaces are alike, `CoffeeTable` and `coffeetable` are
      `coffee table`, and a number at the end says nothing: `TV-stand_3` is `tv stand`;
    - vocabulary: a word of a published vocabulary, as mappings/vocabularies-v1.csv lists;
    - synonym: another word for the same thing, as mappings/synonyms-v1.csv lists;
    - number: the last word in the singular or plural: `sofas` is `sofa`;
    - head noun: the last words alone, the longest first, or those before `of`, `with` or `for`:
      `leather armchair` is `armchair`. Only if that is a class;
    - phrase: what is said of a thing is left out: where it is, a score, what stands in brackets or
      behind a comma; of names with a slash between, the first with a class counts:
      `lamp on table`, `lamp (0.87)` and `lamp/table` are `lamp`;
    - spelling: one typo in one word that is no word of English: `toilett` is `toilet`.
    """

    version: str  # its name, e.g. `hm3d45-v1`
    # hash of its files (spellings, classes, structure), those of the rules, and the rules' version
    sha256: str
    space: ClassSpace
    definitions: tuple[str, ...]  # [C] one sentence per class
    structure: frozenset[str]  # categories that are parts of the building, not objects in it
    entries: Mapping[str, Classified]  # by spelling, as published
    normalised: Mapping[str, Classified]  # by normalised spelling (`normalise_name`)

    @property
    def classes(self) -> tuple[str, ...]:
        """The names of the classes, `[C]`, in the order of every histogram."""
        return self.space.classes

    @property
    def nameable(self) -> tuple[str, ...]:
        """The classes that some name of the map leads to; its source has no word for the others."""
        known = {entry.class_index for entry in self.entries.values()}
        return tuple(name for index, name in enumerate(self.classes) if index in known)

    @cached_property
    def words(self) -> Mapping[str, Classified]:
        """All that is known of names, normalised: the listed ones, and other words for them.

        Of a word whose last words mislead the role is `unmapped`.
        """
        class_of: dict[int | None, str] = {None: "", **dict(enumerate(self.classes))}
        listed = self.normalised.items()
        meanings = {
            name: (entry.category or "", class_of[entry.class_index]) for name, entry in listed
        }
        others = list_synonyms(meanings).items()
        read = {
            word: replace(self.normalised[name], rule=rule) if name else _UNMAPPED
            for word, (name, rule) in others
        }
        return {**self.normalised, **read}

    @cached_property
    def _most_words(self) -> int:
        return max((len(name.split()) for name in self.words), default=0)

    @cached_property
    def _spellings(self) -> Spellings:
        return Spellings(self.words)

    @cached_property
    def _resolved(self) -> dict[str, Classified]:
        return {}

    def lookup(self, name: str) -> Classified | None:
        """Look up a listed name, exact first, then normalised; None if it is not listed."""
        entry = self.entries.get(name)
        return entry if entry is not None else self.normalised.get(normalise_name(name))

    def lists(self, name: str) -> bool:
        """Say whether a name as a whole is listed, or is another word that leads to one or none."""
        forms = (separate(reading) for reading in _list_readings(name))
        return self.lookup(name) is not None or any(form in self.words for form in forms)

    def classify(self, name: str) -> Classified:
        """Return category, class and role of an annotated name; every lookup goes through here."""
        entry = self.lookup(name)
        if entry is not None:
            return entry
        if is_nameless(name):
            return Classified(UNKNOWN, None, "nameless")
        if len(name) > LONGEST:
            return _UNMAPPED
        found = self._resolved.get(name)
        if found is None:
            found = self._resolve(name)
            if len(self._resolved) >= _MOST_RESOLVED:  # strangers' words do not stay for good
                self._resolved.clear()
            self._resolved[name] = found
        return found

    def nearest(self, name: str) -> tuple[str, ...]:
        """Return the known spellings most like `name`, best first."""
        return nearest_names(name, self.normalised)

    def _resolve(self, name: str) -> Classified:
        """Read a name that is not listed by the rules."""
        readings, parts = _list_readings(name), list_parts(name)
        if parts == (name,) or self.lists(name):
            found = self._read(readings)
        elif (found := self._read(readings, is_whole=True)) is None:
            of_parts = [_list_readings(part) for part in parts]
            known = [*filter(None, map(self._read, of_parts))]
            if known:  # rule 5 of mappings/README.md: the first with a class, or the first
                best = min(known, key=lambda entry: entry.class_index is None)
                return replace(best, rule="phrase")
            readings = [*chain.from_iterable(of_parts)]
        return found or self._mend(readings) or _UNMAPPED

    def _read(self, readings: Iterable[str], *, is_whole: bool = False) -> Classified | None:
        """Return what the readings of a name stand for as they are, or else by their last words."""
        spoken = [drop_number(separate(reading)).split()[:MOST_WORDS] for reading in readings]
        for words in spoken:
            if found := self._read_words(words):
                return None if found.role == "unmapped" else found
        for tail in () if is_whole else chain.from_iterable(map(list_tails, spoken)):
            if found := self._read_words(tail):
                return None if found.class_index is None else replace(found, rule="head noun")
        return None

    def _read_words(self, words: Sequence[str]) -> Classified | None:
        if not 0 < len(words) <= self._most_words + 1:  # two words may be written as one
            return None
        spaced = " ".join(words)
        pairs = range(len(words) - 1)
        joined = (" ".join([*words[:i], words[i] + words[i + 1], *words[i + 2 :]]) for i in pairs)
        forms: list[tuple[str, Rule]] = [(form, "separator") for form in (spaced, *joined)]
        for form, rule in (*forms, *((form, "number") for form in change_number(spaced))):
            if found := self.words.get(form):
                is_plain = found.rule is None and found.role != "unmapped"
                return replace(found, rule=rule) if is_plain else found
        return None

    def _mend(self, readings: Iterable[str]) -> Classified | None:
        """Return what a name with one typo stands for; None if that is not one class."""
        real = read_real_words()
        near = {mended for name in readings for mended in self._spellings.mend(name, real=real)}
        found = [
            *filter(None, (self.lookup(mended) or self._read([mended]) for mended in sorted(near)))
        ]
        if len({entry.class_index for entry in found}) != 1 or found[0].class_index is None:
            return None
        return replace(min(found, key=lambda entry: len(str(entry.category))), rule="spelling")


class PublishedMap(NamedTuple):
    """A row of `mappings/class_maps.csv`."""

    class_map: str
    class_space: str
    source: str  # whose names it maps


class OwnMap(Record):
    """The files of a user's own class map, which datasets and checkpoints keep."""

    name: str  # of its file, without `.csv`
    spellings: bytes  # NAME.csv
    classes: bytes | None = None  # NAME.classes.csv; None: the default class space
    structure: bytes | None = None  # NAME.structure.csv


def _list_readings(name: str) -> list[str]:
    """Return the readings of a name, normalised: as it is, and taken apart."""
    return [*dict.fromkeys(map(normalise_name, (name, take_apart(name))))]


def is_nameless(name: str) -> bool:
    """Say whether a name is blank, `unknown` or `unknown/...`."""
    return _NAMELESS.fullmatch(name) is not None


@cache
def published_maps() -> Mapping[str, PublishedMap]:
    """Return the published maps by their names, in the order of `mappings/class_maps.csv`."""
    rows = map(PublishedMap, *read_columns("class_maps.csv").values())
    return {row.class_map: row for row in rows}


def map_into(class_space: str) -> str:
    """Return the published map of HM3D's names (everyday words) into a class space."""
    for row in published_maps().values():
        if row.class_space == class_space and row.source == "hm3d":
            return row.class_map
    raise ClassMapError(
        f"no published class map is for the class space {class_space!r}; published are "
        f"{', '.join(sorted(published_maps()))}. Read the graph in Python with your own NAME.csv: "
        "read_robot_graph(path, class_map='NAME.csv')"
    )


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
        known = sorted(published_maps())
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
    )


def is_own_map(name: str) -> bool:
    """Say whether the name of a class map is the path of a `NAME.csv`."""
    return name.casefold().endswith(_SUFFIX)


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
        name: read_bytes(file, error=ClassMapError)
        for name, suffix in MAP_FILES.items()
        if (file := path.with_suffix(suffix)).is_file()
    }
    return OwnMap(name=path.stem, **{"spellings": b"", **found})


def write_own_map(own: OwnMap, folder: Path) -> Path:
    """Write the files of a class map into a folder, and return the path of its `NAME.csv`."""
    for name, suffix in MAP_FILES.items():
        if (data := getattr(own, name)) is not None:
            write_bytes(folder / f"{own.name}{suffix}", data)
    return folder / f"{own.name}{_SUFFIX}"


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
    return replace(
        first,
        version=" + ".join(class_map.version for class_map in maps),
        sha256=hashlib.sha256("".join(class_map.sha256 for class_map in maps).encode()).hexdigest(),
        structure=frozenset().union(*(class_map.structure for class_map in maps)),
        entries=ChainMap(*(dict(class_map.entries) for class_map in maps)),
        normalised=ChainMap(*(dict(class_map.normalised) for class_map in maps)),
    )


def _parse_map(
    version: str, space_name: str, *, spellings: bytes, classes: bytes, structure: bytes
) -> ClassMap:
    space, definitions = parse_class_space(space_name, classes)
    rows = read_rows(f"{version}.structure.csv", structure, ("category",))
    building_parts = frozenset([row[0] for _, row in rows])
    entries, normalised = _parse_spellings(f"{version}.csv", spellings, space, building_parts)
    files = (spellings, classes, structure, *map(read_published, RULE_FILES), _RULES_VERSION)
    return ClassMap(
        version=version,
        sha256=hashlib.sha256(b"".join(files)).hexdigest(),
        space=space,
        definitions=definitions,
        structure=building_parts,
        entries=entries,
        normalised=normalised,
    )


def _parse_spellings(
    file: str, data: bytes, space: ClassSpace, structure: frozenset[str]
) -> tuple[dict[str, Classified], dict[str, Classified]]:
    entries: dict[str, Classified] = {}
    normalised: dict[str, Classified] = {}
    rows = read_rows(file, data, ("raw_category", "category", "class"))
    index = {name: number for number, name in enumerate(space.classes)}
    nameless = {*filter(_NAMELESS.fullmatch, {row[1] for _, row in rows})}
    spellings = normalise_names([row[0] for _, row in rows])
    for (line, (raw, category, name)), spelling in zip(rows, spellings, strict=True):
        role: Role = "structure" if category in structure else "left-out"
        role = "classified" if name else "nameless" if category in nameless else role
        entry = Classified(category, index.get(name), role)
        if name and name not in index:
            raise ClassMapError(
                f"{file}, line {line}: {show_value(name)} is no class of {space.name}"
            )
        earlier = normalised.setdefault(spelling, entry)
        if raw in entries or earlier.class_index != entry.class_index:
            raise ClassMapError(
                f"{file}, line {line}: {show_value(raw)} is listed before, as it is, or in other "
                "case or spaces with another class; keep one of the rows"
            )
        entries[raw] = entry
    return entries, normalised
