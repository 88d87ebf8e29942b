"""Class maps: map the free text of an annotation to a class of a class space.

A published map is a file of `mappings/`: `<version>.csv` with `raw_category,category,class`, one
row per spelling. `class_maps.csv` has its class space. Rules resolve names that it does not list.
"""

from __future__ import annotations

import hashlib
import os
import unicodedata
from collections import ChainMap
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache
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
    read_published,
    read_rows,
)
from bsg_data.scene.name_rules import (
    LONGEST,
    RULES_VERSION,
    Rule,
    change_number,
    index_words,
    list_parts,
    list_tails,
    mend,
    resolve,
    separate,
    take_apart,
)
from bsg_data.scene.vocabularies import VOCABULARIES, list_meanings
from bsg_data.spelling import SHOWN, ask_if_meant, nearest_names, show_value

DEFAULT_CLASS_MAP = "hm3d45-v1"
UNKNOWN = "unknown"  # the category of a nameless object
_SYNONYMS, _REAL_WORDS = "synonyms-v1.csv", "real-words-v1.csv"
_RULES = (_SYNONYMS, VOCABULARIES, _REAL_WORDS)  # the files of the rules
_MOST_RESOLVED = 2**16  # names that are not listed and whose class is kept: a robot's graph fits in
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


_UNMAPPED = Classified(None, None, "unmapped")


class _Synonyms:
    """Other words for what a map lists; they are read when a name is not listed."""

    def __init__(self, names: Mapping[str, Classified], classes: Sequence[str]) -> None:
        self._names, self._classes = names, classes

    @cached_property
    def listed(self) -> tuple[dict[str, str], frozenset[str]]:
        """Normalised name → listed name; and those of them that a vocabulary has."""
        return _list_synonyms(self._names, self._classes)

    @cached_property
    def most_words(self) -> int:
        """The number of words of the longest name that the map or its synonyms list."""
        return max((len(name.split()) for name in (*self._names, *self.listed[0])), default=0)


@dataclass(frozen=True, slots=True)
class ClassMap:
    """A class map, ready to look names up."""

    version: str  # its name, e.g. `hm3d45-v1`
    # hash of its files (spellings, classes, structure), those of the rules, and the rules' version
    sha256: str
    space: ClassSpace
    definitions: tuple[str, ...]  # [C] one sentence per class
    structure: frozenset[str]  # categories that are parts of the building, not objects in it
    entries: Mapping[str, Classified]  # by spelling, as published
    normalised: Mapping[str, Classified]  # by normalised spelling (`normalise_name`)
    rules: _Synonyms = field(repr=False, compare=False)
    _resolved: dict[str, Classified] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    _near: dict[str, list[str]] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def classes(self) -> tuple[str, ...]:
        """The names of the classes, `[C]`, in the order of every histogram."""
        return self.space.classes

    @property
    def nameable(self) -> tuple[str, ...]:
        """The classes that some name of the map leads to; its source has no word for the others."""
        known = {entry.class_index for entry in self.entries.values()}
        return tuple(name for index, name in enumerate(self.classes) if index in known)

    @property
    def synonyms(self) -> Mapping[str, str]:
        """Listed names by other words for them, normalised.

        The name is empty where the last word of the other one misleads.
        """
        return self.rules.listed[0]

    def lookup(self, name: str) -> Classified | None:
        """Look up a listed name, exact first, then normalised; None if it is not listed."""
        entry = self.entries.get(name)
        return entry if entry is not None else self.normalised.get(normalise_name(name))

    def lists(self, name: str) -> bool:
        """Say whether a name as a whole is listed, or is another word that leads to one or none."""
        forms = {separate(reading) for reading in _read_both(name)}
        known = (self.normalised, self.synonyms)
        return self.lookup(name) is not None or any(form in one for form in forms for one in known)

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

    def _resolve(self, name: str) -> Classified:
        """Resolve a name that is not listed by the rules."""
        readings, parts = _read_both(name), list_parts(name)
        if parts == (name,) or self.lists(name):
            found = self._follow(readings, self.rules)
        elif (found := self._follow(readings, self.rules, is_whole=True)) is None:
            of_parts = [_read_both(part) for part in parts]
            known = [*filter(None, (self._follow(one, self.rules) for one in of_parts))]
            if known:  # rule 5 of mappings/README.md: the first with a class, or the first
                best = min(known, key=lambda one: one.class_index is None)
                return replace(best, rule="phrase")
            readings = [*chain.from_iterable(of_parts)]
        return found or self._mend(readings, self.rules) or _UNMAPPED

    def classify_whole(self, name: str) -> Classified:
        """Classify a name without the rules of the head noun and of typos: much faster."""
        found = self.lookup(name)
        if found is None:
            found = self._follow(_read_both(name), self.rules, is_whole=True)
        return found or _UNMAPPED

    def _follow(
        self, readings: Sequence[str], rules: _Synonyms, *, is_whole: bool = False
    ) -> Classified | None:
        """Return what the rules make of a name, by its readings."""
        known, (synonyms, vocabulary) = self.normalised.__contains__, rules.listed
        for other, rule in resolve(
            readings,
            synonyms,
            known=known,
            vocabulary=vocabulary,
            most_words=rules.most_words,
            is_whole=is_whole,
        ):
            entry = self.normalised[normalise_name(other)]
            if rule != "head noun" or entry.class_index is not None:
                return replace(entry, rule=rule)
        return None

    def _mend(self, readings: Iterable[str], rules: _Synonyms) -> Classified | None:
        """Return what a name with one typo stands for; None if that is not one class."""
        if not self._near:
            self._near.update(index_words([*self.normalised, *rules.listed[0]]))
        near = {one for name in readings for one in mend(name, self._near, real=read_real_words())}
        entries = [self.lookup(one) or self._follow([one], rules) for one in sorted(near)]
        found = [entry for entry in entries if entry is not None]
        if len({entry.class_index for entry in found}) != 1 or found[0].class_index is None:
            return None
        return replace(min(found, key=lambda one: len(str(one.category))), rule="spelling")

    def nearest(self, name: str) -> tuple[str, ...]:
        """Return the known spellings most like `name`, best first."""
        return nearest_names(normalise_name(name), self.normalised)


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


def _read_both(name: str) -> list[str]:
    """Return the readings of a name: as it is, and taken apart."""
    return [*dict.fromkeys(map(normalise_name, (name, take_apart(name))))]


@lru_cache(maxsize=64)  # every rule normalises a name again
def normalise_name(name: str) -> str:
    """Return `name` as NFC, casefolded, trimmed, runs of white space as one space."""
    return normalise_names((name,))[0]


def normalise_names(names: Iterable[str]) -> list[str]:
    """Return what `normalise_name` makes of each name; a table has thousands."""
    composed = unicodedata.normalize
    return [" ".join(composed("NFC", name).casefold().split()) for name in names]


def is_nameless(name: str) -> bool:
    """Say whether a name is blank, `unknown` or `unknown/...`."""
    return bool(_find_nameless((name,)))


def _find_nameless(names: Collection[str]) -> set[str]:
    said = zip(names, normalise_names(names), strict=True)
    return {name for name, one in said if one.partition("/")[0].strip() in ("", UNKNOWN)}


@cache
def published_maps() -> Mapping[str, PublishedMap]:
    """Return the published maps by their names, in the order of `mappings/class_maps.csv`."""
    data = read_published("class_maps.csv")
    rows = read_rows("class_maps.csv", data, PublishedMap._fields)
    return {row[0]: PublishedMap(*row) for _, row in rows}


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
        name: read_bytes(file, error=ClassMapError)
        for name, suffix in _FILES.items()
        if (file := path.with_suffix(suffix)).is_file()
    }
    return OwnMap(name=path.stem, **{"spellings": b"", **found})


def write_own_map(own: OwnMap, folder: Path) -> Path:
    """Write the files of a class map into a folder, and return the path of its `NAME.csv`."""
    for name, suffix in _FILES.items():
        if (data := getattr(own, name)) is not None:
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
    return replace(
        first,
        version=" + ".join(one.version for one in maps),
        sha256=hashlib.sha256("".join(one.sha256 for one in maps).encode()).hexdigest(),
        structure=frozenset().union(*(one.structure for one in maps)),
        entries=ChainMap(*(dict(one.entries) for one in maps)),
        normalised=normalised,
        rules=_Synonyms(normalised, first.classes),
    )


def _parse_map(
    version: str, space_name: str, *, spellings: bytes, classes: bytes, structure: bytes
) -> ClassMap:
    space, definitions = parse_class_space(space_name, classes)
    rows = read_rows(f"{version}.structure.csv", structure, ("category",))
    building_parts = frozenset([row[0] for _, row in rows])
    entries, normalised = _parse_spellings(f"{version}.csv", spellings, space, building_parts)
    files = (spellings, classes, structure, *map(read_published, _RULES), RULES_VERSION)
    return ClassMap(
        version=version,
        sha256=hashlib.sha256(b"".join(files)).hexdigest(),
        space=space,
        definitions=definitions,
        structure=building_parts,
        entries=entries,
        normalised=normalised,
        rules=_Synonyms(normalised, space.classes),
    )


def _list_synonyms(
    listed: Mapping[str, Classified], classes: Sequence[str]
) -> tuple[dict[str, str], frozenset[str]]:
    """Return other words for what a map lists, and which of them a vocabulary has.

    A word leads to a listed name, or to the empty name if no words of it are to be taken alone. A
    map need not list HM3D's word: another listed name of the same category does, or for a word of a
    vocabulary the plural or the head noun, if both have one class of HM3D.
    """
    vocabulary = _read_vocabulary()
    called = _name_meanings(listed, classes)
    found = dict(called)
    for name, category in {**_parse_synonyms(_SYNONYMS), **vocabulary}.items():
        wider = _list_wider(name, category) if name in vocabulary else ()
        others = (one for one in (category, called.get(category), *wider) if one in listed)
        if (other := next(others, None)) or not category or name in vocabulary:
            found[name] = other or ""
    apart = {**{name: name for name in listed}, **found}
    for name, other in apart.items():  # `diningtable` is `dining table`
        if " " in name:
            found.setdefault(name.replace(" ", ""), other)
    found = {name: other for name, other in found.items() if name not in listed}
    return found, frozenset(vocabulary) & found.keys()


def _list_wider(word: str, category: str) -> Iterator[str]:
    """Yield plurals and last words of a word and of HM3D's, those of the same class there."""
    of_hm3d = _read_classes()
    for name in (category, word):
        tails = (" ".join(tail) for tail in list_tails(name.split()))
        for one in (*change_number(name), *tails):
            if of_hm3d.get(one) == of_hm3d[category] != "":
                yield one


@cache
def _read_classes() -> Mapping[str, str]:
    """Return the class of each name that the default map lists; empty without one."""
    file = f"{DEFAULT_CLASS_MAP}{SUFFIX}"
    rows = read_rows(file, read_published(file), ("raw_category", "category", "class"))
    names = normalise_names([row[0] for _, row in rows])
    return {name: row[2] for name, (_, row) in zip(names, rows, strict=True)}


def _name_meanings(listed: Mapping[str, Classified], classes: Sequence[str]) -> dict[str, str]:
    """Return a listed name for each category, class and synonym that is not listed itself."""
    synonyms, entries = _parse_synonyms(_SYNONYMS), listed.values()
    meanings = [one.category or "" for one in entries]
    meanings += ["" if one.class_index is None else classes[one.class_index] for one in entries]
    meanings += [synonyms.get(name, "") for name in listed]
    found: dict[str, str] = {}
    for said, name in zip(normalise_names(meanings), [*listed] * 3, strict=True):
        if said and said != UNKNOWN and said not in listed:
            found.setdefault(said, name)
    return found


@cache
def _parse_synonyms(file: str) -> Mapping[str, str]:
    rows = read_rows(file, read_published(file), ("name", "category"))
    columns = zip(*(row for _, row in rows), strict=True)
    return dict(zip(*map(normalise_names, columns), strict=True))


@cache
def _read_vocabulary() -> Mapping[str, str]:
    """Return HM3D's words by the words of all vocabularies, normalised, with spaces alone."""
    words, categories = map(normalise_names, zip(*list_meanings(), strict=True))
    return dict(zip(map(separate, words), categories, strict=True))


@cache
def read_real_words() -> frozenset[str]:
    """Return words of English that are one typo from a word of a name."""
    rows = read_rows(_REAL_WORDS, read_published(_REAL_WORDS), ("word",))
    return frozenset(row[0] for _, row in rows)


def _parse_spellings(
    file: str, data: bytes, space: ClassSpace, structure: frozenset[str]
) -> tuple[dict[str, Classified], dict[str, Classified]]:
    entries: dict[str, Classified] = {}
    normalised: dict[str, Classified] = {}
    rows = read_rows(file, data, ("raw_category", "category", "class"))
    said = normalise_names([row[0] for _, row in rows])
    nameless = _find_nameless({row[1] for _, row in rows})
    for (line, (raw, category, name)), spoken in zip(rows, said, strict=True):
        if name and name not in space.classes:
            raise ClassMapError(
                f"{file}, line {line}: {show_value(name)} is no class of {space.name}"
            )
        if raw in entries:
            raise ClassMapError(f"{file}, line {line}: {show_value(raw)} is listed twice")
        index = space.classes.index(name) if name else None
        role: Role = "structure" if category in structure else "left-out"
        role = "nameless" if category in nameless else role
        entries[raw] = Classified(category, index, role if index is None else "classified")
        if normalised.setdefault(spoken, entries[raw]).class_index != index:
            raise ClassMapError(
                f"{file}, line {line}: {show_value(raw)} differs from an earlier row only in case "
                "or spaces but has another class"
            )
    return entries, normalised
