"""Room labels: common words for kinds of rooms, and what the names of rooms mean.

`mappings/room-labels-v1.csv` has `source,source_label,label`. Rows of the source `any` hold
everyday words and count for every source. A row without a label marks a word that names no kind of
room. Models were trained with the labels of `list_room_labels`; a row of the source `nearest` has
the one of these by which they read another, such as an infirmary for an examination room. A row of
the source `building` has the kind of building that a room tells, one of the source `kind` what a
word for a building means. Rows of a kind of building, such as `hotel`, count in these buildings
before those of `any`; `#` stands there for a number of three or four digits. Rows of `real` are
words of English that are no typo of a word for a room.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from itertools import islice
from typing import Literal

import numpy as np
import numpy.typing as npt

from bsg_data.errors import RecipeError
from bsg_data.records import read_number
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.class_space import read_columns
from bsg_data.scene.synonyms import read_real_words
from bsg_data.words.nearest import Spellings, ask_if_meant
from bsg_data.words.normal import (
    LONGEST,
    drop_number,
    make_singular,
    separate,
    separate_names,
    split_camel,
)
from bsg_data.words.shown import show_value

RoomType = str | Mapping[str, float]  # a label, or labels with their probabilities
RoomRule = Literal["head noun", "first words", "misspelt"]  # that a reader should know of
LAYOUTS = "layouts"  # the source name of labels in room layouts, for scenes of any source
_NO_KIND = frozenset({"", "other", "unknown"})  # words that name no kind of room or building
_FILE, _ROLES = "room-labels-v1.csv", "room-words-v1.csv"
_ANY_SOURCE, _NEAREST, _BUILDING, _KIND = "any", "nearest", "building", "kind"
_ROUNDING = 1e-6  # by which probabilities may add up to more than 1
_MOST_LABELS = 1000  # of one room
_HEAD = 3  # first or last words of a longer name that may be a kind of room
# Letters of a name from which one may be missing, too many or misplaced, and from which another.
_MENDED, _REPLACED = 6, 7
_MISSPELT = 5  # letters of the word in it that is wrong: a shorter one is rather another word
_MARKS = re.compile(r"['’ʼ`´]|(?<=\b\w)\.|[\u0300-\u036f]")  # of possession, short forms, accents
_WORDS = re.compile(r"\d+(?:st|nd|rd|th)\b|[^\W\d_]+")
_BETWEEN = re.compile(r"[/&+(),;:|]|\b(?:and|or|of|for|on|in|at|by|near|with)\b")
# Words beside the kind of a room that say which one it is.
_HOUSE_NUMBER = re.compile(r"\s*\d{3,4}\s*")  # of a room of a hotel
_POSSESSOR = re.compile(r"\b([^\W\d_]{2,})['’´`](?:s\b|(?<=s['’´`])(?=\s))")
_OWNED = ("bedroom", "child's bedroom", "office")
_AFTER_KIND = re.compile(r"[\W\d_]*([A-Z][^\W\d_]{2,})[\W_]*")  # Emma, in "Bedroom - Emma"


@dataclass(frozen=True, slots=True)
class ReadRoom:
    """What the name of a room was read as."""

    label: str | None  # None if it names no kind of room, or is unknown
    word: str | None = None  # the listed word; None if it is unknown
    rule: RoomRule | None = None  # None for a word that is listed, in any spelling


@dataclass(frozen=True, slots=True)
class Origin:
    """What a label, or a kind of building, was read from; notes tell it."""

    label: str
    said: str  # a word, a name, or names
    rule: RoomRule | None = None
    by_name: bool = False  # the name of a room said it, and not its `room_type`


@dataclass(frozen=True, slots=True)
class ReadType:
    """What was read of the type of a room."""

    labels: RoomType | None  # common labels; None if it says nothing
    unread: tuple[str, ...] = ()  # its words that name no known kind of room
    origins: tuple[Origin, ...] = ()  # of labels that are not its words themselves


def label_of(source: str, source_label: str | None) -> str | None:
    """Return the common label of a room; None if the word names no kind of room or is unknown.

    >>> label_of("mp3d", "b"), label_of("mp3d", "B"), label_of("table", "Master_Bedroom 2")
    ('bedroom', 'bar', 'bedroom')
    """
    return None if source_label is None else read_room(source_label, source=source).label


@dataclass(frozen=True)
class RoomReader:
    """How the rooms of one building are read.

    Attributes:
        own: words of the user, each with its label, None for no kind of room; as written, or else
            in any case and without a number.
        kind: kind of the building; None if it is unknown.
    """

    own: tuple[tuple[str, str | None], ...] = ()
    kind: str | None = None

    def __call__(self, name: str) -> ReadRoom:
        """Read the name of a room: by the user's words, else by ours."""
        word = self.find_own(name)
        if word is not None:
            return ReadRoom(self._labels[word], word)
        return read_room(name, source=self.kind or _ANY_SOURCE)

    def find_own(self, name: str) -> str | None:
        """Return the user's word that a name is; None if the user lists none."""
        if not self.own:
            return None
        return next(
            (spelling for spelling in (name, normalise_room(name)) if spelling in self._labels),
            None,
        )

    @cached_property
    def _labels(self) -> dict[str, str | None]:
        """The label of each word, and of its other spellings."""
        spoken = {normalise_room(word): label for word, label in self.own}
        return {word: label for word, label in spoken.items() if word} | dict(self.own)


def check_own_label(word: str, label: str | None) -> str | None:
    """Return the label that a user gives a word; None if the word names no kind of room.

    Raises:
        RecipeError: if the label is none of ours.
    """
    meant = label_of(_ANY_SOURCE, label)
    if not label or meant == label:
        return label or None
    near = f"did you mean {meant}?" if meant else ask_if_meant(label, list_all_labels())
    hint = near or f"known are {', '.join(list_all_labels())}"
    raise RecipeError(
        f"expected a label that we know for {show_value(word)}, or none if it names no kind of "
        f"room; found {show_value(label)}; {hint}",
        code="room-label-unknown",
    )


@lru_cache(maxsize=20_000)
def read_room(name: str, *, source: str = _ANY_SOURCE) -> ReadRoom:
    """Read the name of a room; every name is read here.

    The rows of the source count first, exactly as written: in Matterport3D `b` is a bedroom and `B`
    a bar. A kind of building is a source, too. Then everyday words count, in any spelling: with a
    number, in the plural, joined. Then the last words of a name, its first words, and at last a
    word with one wrong letter.

    >>> [read_room(name).label for name in ("2nd bath room", "Kid's room", "R7")]
    ['bathroom', "child's bedroom", None]
    >>> read_room("staff kichen")
    ReadRoom(label='kitchen', word='kitchen', rule='misspelt')
    >>> read_room("101", source="hotel").label, read_room("101").label
    ('hotel room', None)
    """
    rows, spoken = _read_labels(), normalise_room(name)
    number = "#" if _HOUSE_NUMBER.fullmatch(name) else name
    for key in ((source, name), (source, spoken), (source, number), (_ANY_SOURCE, spoken)):
        if key in rows:
            return ReadRoom(rows[key], key[1])
    if spoken in _NO_KIND or len(name) > LONGEST:
        return ReadRoom(None)
    word, rule = _find_word(name) or (None, None)
    label = word and rows.get((source, word), rows[_ANY_SOURCE, word])
    return ReadRoom(label, word, rule)


def _find_word(name: str) -> tuple[str, RoomRule | None] | None:
    """Return the listed word that a name stands for, and the rule that a reader should know of."""
    listed, forms = _list_keys(), [*dict.fromkeys(_list_forms(name))]
    for words in forms:
        if word := listed.get("".join(words)):
            return word, None
    if load_class_map().lookup(name) is not None:
        return None  # the name of a thing, and not of a room that is spelt like it
    sizes = [(words, size) for words in forms for size in range(_HEAD, 0, -1) if size < len(words)]
    tails = [words[-size:] for words, size in sizes]
    for words in tails:
        if (word := listed.get("".join(words))) and not _is_of(words[-1], "other head"):
            return word, "head noun"
    for words, size in sizes:
        word = listed.get("".join(words[:size]))
        if word and _may_follow(words[size - 1], words[size:]):
            return word, "first words"
    for words in (*forms, *tails):
        if (word := _mend("".join(words))) and _is_misspelt(words):
            return word, "misspelt"
    return None


def _is_misspelt(words: Sequence[str]) -> bool:
    wrong = [word for word in words if word not in _list_known()]
    return bool(wrong) and len(min(wrong, key=len)) >= _MISSPELT


def _may_follow(kind: str, behind: Sequence[str]) -> bool:
    """Say whether words behind a kind of room leave it one: Alpha, but not door or tool store."""
    if _is_of(kind, "other head") or _is_of(behind[-1], "other head"):
        return False
    lookup = load_class_map().lookup
    return all(lookup(" ".join(behind[start:])) is None for start in range(len(behind)))


def _list_forms(name: str) -> Iterator[tuple[str, ...]]:
    """Yield the words of a name, without what says which room it is, and of each of its pieces."""
    plain = _make_plain(name)
    for piece in dict.fromkeys((plain, *_BETWEEN.split(plain))):
        spoken = [word for word in _WORDS.findall(piece) if not word[0].isdecimal()]
        words = tuple(map(make_singular, spoken))
        yield words
        while words and _is_of(words[-1], "which", "whose"):
            words = words[:-1]
        while words and _is_of(words[0], "which"):
            words = words[1:]
        yield words


def _is_of(word: str, *roles: str) -> bool:
    """Say whether a word has one of some roles; one letter always says which room it is."""
    return ("which" in roles and len(word) == 1) or any(word in _read_roles()[r] for r in roles)


@cache
def _read_roles() -> Mapping[str, frozenset[str]]:
    """Return the words beside the kind of a room, by what they say."""
    rows = zip(*read_columns(_ROLES).values(), strict=True)
    return {role: frozenset(words.split("|")) for role, words in rows}


def _make_plain(name: str) -> str:
    """Return a name in small letters, without accents."""
    return _MARKS.sub("", unicodedata.normalize("NFKD", split_camel(name))).casefold()


def _mend(key: str) -> str | None:
    """Return the listed word of which a key is a typo, if that is one kind of room."""
    rows, listed = _read_labels(), _list_keys()
    near = _read_spellings().near(key) if len(key) >= _MENDED else []
    shifted = [other for other in near if len(other) != len(key) or sorted(other) == sorted(key)]
    keys = shifted or (near if len(key) >= _REPLACED else [])
    words = [listed[other] for other in keys]
    kinds = {str(rows[_ANY_SOURCE, word]) for word in words}
    # A "badroom" is rather a bedroom than a band room: a rare kind must be all that is near.
    is_usual = all(known_label(kind) == kind for kind in kinds)
    is_alone = kinds == {rows[_ANY_SOURCE, listed[other]] for other in near}
    return words[0] if len(kinds) == 1 and (is_usual or is_alone) else None


@cache
def list_room_labels() -> tuple[str, ...]:
    """Return the common room labels that models read, sorted."""
    return tuple(label for label in list_all_labels() if known_label(label) == label)


@cache
def list_all_labels() -> tuple[str, ...]:
    """Return the common room labels, sorted, also those that models read as another one."""
    of_buildings = (_BUILDING, _KIND)
    rows = _read_labels().items()
    return tuple(sorted({label for (s, _), label in rows if label and s not in of_buildings}))


def known_label(label: str) -> str:
    """Return the label by which models read a common label: itself, or the nearest they know.

    >>> known_label("kitchen"), known_label("examination room")
    ('kitchen', 'infirmary')
    """
    return _read_labels().get((_NEAREST, label)) or label


def tell_building(name: str) -> str | None:
    """Return the kind of building that the name of a room tells; None if any may have such a room.

    >>> tell_building("patient room 2"), tell_building("office"), tell_building("Living Room")
    ('hospital', None, 'home')
    """
    found, rows = read_room(name), _read_labels()
    kinds = (rows.get((_BUILDING, word)) for word in (found.word, found.label) if word)
    return next(filter(None, kinds), None)


def read_building_kind(word: str) -> str | None:
    """Return the kind of building that a word means, or its last words; None if it is unknown.

    >>> read_building_kind("Apartment"), read_building_kind("factory"), read_building_kind("castle")
    ('home', 'warehouse', None)
    """
    rows, words = _read_labels(), normalise_room(word[:LONGEST]).split()
    ends = (" ".join(words[start:]) for start in range(len(words)))
    return next(filter(None, (rows.get((_KIND, end)) for end in ends)), None)


@lru_cache(maxsize=2**16)  # the rooms and objects of a map are asked again and again
def owner_of(name: str) -> str | None:
    """Return who owns a thing or a room by its name, in small letters; None if nobody is named.

    A name is a word before 's, or one with a capital letter behind a kind of room. `men's`,
    `child's` and `nurse's` name nobody.

    >>> [owner_of(name) for name in ("Emma's teddy bear", "Bedroom - Emma", "men's room")]
    ['emma', 'emma', None]
    """
    if len(name) > LONGEST:
        return None
    ends = (match.end() for match in islice(_WORDS.finditer(name), _HEAD))
    owned = (end for end in ends if read_room(name[:end]).label in _OWNED)
    behind = (_AFTER_KIND.fullmatch(name, end) for end in owned)
    names = (match.group(1).casefold() for match in (_POSSESSOR.search(name), *behind) if match)
    return next(filter(_is_owner, names), None)


def _is_owner(word: str) -> bool:
    is_other = _is_of(word, "owner of any name") or _is_of(make_singular(word), "which", "whose")
    return not is_other and load_class_map().lookup(word) is None


def is_name(text: str) -> bool:
    """Say whether a room's id or label has words to be understood: R7 and room 5 have none."""
    if normalise_room(text) in _NO_KIND or len(text) > LONGEST:
        return False
    words = next(iter(_list_forms(text)))
    return any(
        (len(word) > 2 or not word.isascii()) and not _is_of(word, "any place") for word in words
    )


def is_understood(source: str, source_label: str) -> bool:
    """Say whether we know what a source calls a room, or it has no words to be understood.

    >>> [is_understood("table", name) for name in ("Kajüte", "kitchen 2", "other", "R7")]
    [False, True, True, True]
    """
    known = read_room(source_label, source=source)
    return known.word is not None or not is_name(source_label)


def normalise_room(name: str) -> str:
    """Return a room's name in lower case, with spaces for `_` and `-`, without its number.

    >>> normalise_room("Walk-in_Closet_2")
    'walk in closet'
    """
    return drop_number(separate(name))


def check_room_type(room_type: RoomType | None) -> RoomType | None:
    """Return the type of a room as it was said; see `read_room_type`.

    Raises:
        RecipeError: for an impossible probability or a sum above 1.
    """
    if room_type is None or isinstance(room_type, str):
        return room_type
    if not isinstance(room_type, Mapping) or not all(isinstance(word, str) for word in room_type):
        raise RecipeError(
            "expected a room label, or labels with their probabilities, "
            f"found {show_value(room_type)}"
        )
    if not 1 <= len(room_type) <= _MOST_LABELS:
        raise RecipeError(
            f"expected 1 to {_MOST_LABELS} labels, found {len(room_type)}; leave it out, or give "
            "null"
        )
    upper_bound, wanted = 1 + _ROUNDING, "a probability, 0 to 1"
    found = {
        word: read_number(show_value(word), probability, most=upper_bound, wanted=wanted)
        for word, probability in room_type.items()
    }
    total = math.fsum(found.values())
    if total > 1 + _ROUNDING:
        raise RecipeError(f"expected probabilities that add up to 1 or less, found {total:g}")
    return found


def read_room_type(
    room_type: RoomType | None, *, read: Callable[[str], ReadRoom] = read_room
) -> ReadType:
    """Return the type of a room in common labels; probabilities of equal labels are summed.

    >>> read_room_type("Hallway").labels, read_room_type({"hall": 0.5, "corridor": 0.25}).labels
    ('corridor', {'corridor': 0.75})
    >>> read_room_type({"hall": 0.5, "zzz": 0.5}).unread
    ('zzz',)

    Args:
        room_type: a word, or words with their probabilities.
        read: reads each word.

    Raises:
        RecipeError: as `check_room_type`.
    """
    checked = check_room_type(room_type)
    found: dict[str, float] = {}
    unread: list[str] = []
    origins: dict[str, Origin] = {}
    for word, probability in weigh_labels(checked).items():
        known = read(word)
        if known.label is None:
            unread += [] if normalise_room(word) in _NO_KIND else [word]
        elif probability > 0:
            found[known.label] = found.get(known.label, 0.0) + probability
            if known.label != word:
                origins.setdefault(known.label, Origin(known.label, word, known.rule))
    is_sure = list(found.values()) == [1.0]
    labels = next(iter(found)) if is_sure else found or None
    return ReadType(labels, tuple(unread), tuple(origins.values()))


def say_again(labels: RoomType | None, origins: Iterable[Origin]) -> RoomType | None:
    """Return what was said of a type, from the labels that were read; None if nobody said it."""
    spoken = {origin.label: None if origin.by_name else origin.said for origin in origins}
    if labels is None or isinstance(labels, str):
        return spoken.get(labels, labels) if labels else None
    return {spoken.get(label) or label: likely for label, likely in labels.items()}


def weigh_labels(room_type: RoomType | None) -> Mapping[str, float]:
    """Return the labels of a type with their probabilities."""
    return {room_type: 1.0} if isinstance(room_type, str) else room_type or {}


def spread_labels(room_type: RoomType | None) -> npt.NDArray[np.float32]:
    """Return a type as a distribution over the labels `[L]`; all 0 if it says nothing.

    What its probabilities leave is spread evenly over all labels.

    Raises:
        RecipeError: as `check_room_type`.
    """
    return _spread(tuple(weigh_labels(check_room_type(room_type)).items()))


@lru_cache(maxsize=4096)  # every observation asks again
def _spread(labels: tuple[tuple[str, float], ...]) -> npt.NDArray[np.float32]:
    index = {label: number for number, label in enumerate(list_room_labels())}
    row = np.zeros(len(index))
    for label, probability in weigh_labels(read_room_type(dict(labels) or None).labels).items():
        if (read := known_label(label)) in index:
            row[index[read]] += probability
    if row.any():
        row += max(0.0, 1 - row.sum()) / len(row)
        row /= row.sum()
    spread = row.astype(np.float32)
    spread.setflags(write=False)
    return spread


@cache
def _read_labels() -> Mapping[tuple[str, str], str | None]:
    """Read the published rows, each exact and normalised."""
    sources, words, labels = read_columns(_FILE).values()
    spoken = [
        drop_number(name) or word for name, word in zip(separate_names(words), words, strict=True)
    ]
    return {
        (source, name): label or None
        for names in (spoken, words)
        for source, name, label in zip(sources, names, labels, strict=True)
    }


@cache
def _list_keys() -> Mapping[str, str]:
    """Return the words of all sources by their letters, in the singular: `kidroom` → `kids room`.

    Of two words with the same letters, the singular counts: a store is a shop, stores are not.
    """
    words = [word for source, word in _read_labels() if source == _ANY_SOURCE]
    lines = _make_plain("\n".join(words)).split("\n")
    spoken = ([word for word in _WORDS.findall(line) if not word[0].isdecimal()] for line in lines)
    keyed = {
        word: "".join(map(make_singular, letters))
        for word, letters in zip(words, spoken, strict=True)
    }
    plain = [word for word in words if keyed[word] == word.replace(" ", "")]
    return {keyed[word]: word for word in (*words, *plain)}


@cache
def _list_known() -> frozenset[str]:
    """Return words of English: none of them is a typo of another word for a room."""
    names = [*load_class_map().entries, *(word for _, word in _read_labels())]
    return read_real_words() | set(
        map(make_singular, {*_WORDS.findall(_make_plain("\n".join(names)))})
    )


@cache
def _read_spellings() -> Spellings:
    return Spellings(_list_keys())
