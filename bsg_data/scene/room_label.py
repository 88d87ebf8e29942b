"""Room labels: common words for kinds of rooms, and what the names of rooms mean.

`mappings/room-labels-v3.csv` has `source,source_label,label`. Rows of the source `any` hold
everyday words and count for every source. A row without a label marks a word that names no kind of
room. Models were trained with the labels of `list_room_labels`; a row of the source `nearest` has
the one of these by which they read another, such as an infirmary for an examination room. A row of
the source `building` has the kind of building that a room tells.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import chain
from typing import Literal

import numpy as np
import numpy.typing as npt

from bsg_data.errors import RecipeError
from bsg_data.recipes import read_number
from bsg_data.scene.class_map import load_class_map, normalise_names
from bsg_data.scene.class_space import read_published, read_rows
from bsg_data.spelling import nearest_names, show_value

RoomType = str | Mapping[str, float]  # a label, or labels with their probabilities
RoomRule = Literal["head noun", "misspelt"]  # that a reader should know of
LAYOUTS = "layouts"  # the source name of labels in room layouts, for scenes of any source
NO_KIND = frozenset({"", "other", "unknown"})  # words that name no kind of room or building
_FILE = "room-labels-v3.csv"
_ANY_SOURCE, _NEAREST, _BUILDING = "any", "nearest", "building"
_NUMBER = re.compile(r"[\s#]*[0-9]+$")
_ROUNDING = 1e-6  # by which probabilities may add up to more than 1
_MOST_LABELS = 1000  # of one room
_LONGEST = 100  # characters of a name that rules read
_HEAD = 3  # last words of a longer name that may be a kind of room
# Letters of a name from which one may be missing, too many or misplaced, and from which another.
_MENDED, _REPLACED = 6, 7
_MARKS = re.compile(r"['’ʼ`´]|(?<=\b\w)\.|[\u0300-\u036f]")  # of possession, short forms, accents
_HUMP = re.compile(r"(?<=[^\W\d_A-Z])(?=[A-Z])")
_WORDS = re.compile(r"\d+(?:st|nd|rd|th)\b|[^\W\d_]+")
_BETWEEN = re.compile(r"[/&+(),;:|]|\b(?:and|or|of|for|on|in|at|by|near|with)\b")
_PLURALS = {"children": "child", "people": "person"}
# Words beside the kind of a room that say which one it is.
_WHICH = (
    r"\w|one|two|three|four|five|six|seven|eight|nine|ten"
    r"|first|second|third|fourth|fifth|sixth|seventh|eighth|ninth|tenth|ii|iii|iv|vi"
    r"|the|my|our|no|nr|number|left|right|north|south|east|west|upstair|downstair"
)
_BEFORE = re.compile(_WHICH)
_BEHIND = re.compile(
    rf"{_WHICH}|area|block|boy|building|child|family|floor|gent|girl|ground|guest|kid|lady|level|main"
    r"|master|men|parent|private|public|space|staff|storey|unit|visitor|wing|women|zone"
)
# Words of any room, which do not name its kind.
_NO_NAMES = re.compile("area|cell|node|place|region|room|segment|space|zone")
# Words for rooms that other things end with, too: a towel bar, a cassette deck, a cold store.
_NO_HEADS = re.compile(
    "bar|bath|chemist|child|deck|den|exam|kid|living|market|master|meeting|record|salon|shop|store"
    "|suite|surgery"
)


@dataclass(frozen=True, slots=True)
class ReadRoom:
    """What the name of a room was read as."""

    label: str | None  # None if it names no kind of room, or is unknown
    word: str | None = None  # the listed word; None if it is unknown
    rule: RoomRule | None = None  # None for a word that is listed, in any spelling


class Understood(str):
    """A label, or a kind of building, with what it was read from. Only notes read that."""

    said: str  # a word, a name, or names
    by_name: bool  # the name of a room said it, and not its `room_type`

    def __new__(cls, label: str, said: str = "", *, by_name: bool = False) -> Understood:
        """Add to a label what it was read from."""
        made = super().__new__(cls, label)
        made.said, made.by_name = said, by_name
        return made


def label_of(source: str, source_label: str | None) -> str | None:
    """Return the common label of a room; None if the word names no kind of room or is unknown.

    >>> label_of("mp3d", "b"), label_of("mp3d", "B"), label_of("table", "Master_Bedroom 2")
    ('bedroom', 'bar', 'bedroom')
    """
    return None if source_label is None else read_room(source_label, source=source).label


@lru_cache(maxsize=20_000)
def read_room(name: str, *, source: str = _ANY_SOURCE) -> ReadRoom:
    """Read the name of a room; every name is read here.

    The rows of the kind of source count first, exactly as written: in Matterport3D `b` is a bedroom
    and `B` a bar. Then everyday words count, in any spelling: with a number, in the plural, joined.
    Then the last words of a name, and at last a word with one wrong letter.

    >>> [read_room(name).label for name in ("2nd bath room", "Kid's room", "R7")]
    ['bathroom', 'bedroom', None]
    >>> read_room("staff kichen")
    ReadRoom(label='kitchen', word='kitchen', rule='misspelt')
    """
    rows, spoken = _read_labels(), normalise_room(name)
    for key in ((source, name), (source, spoken), (_ANY_SOURCE, spoken)):
        if key in rows:
            return ReadRoom(rows[key], key[1])
    if spoken in NO_KIND or len(name) > _LONGEST:
        return ReadRoom(None)
    word, rule = _find_word(name) or (None, None)
    return ReadRoom(word and rows[_ANY_SOURCE, word], word, rule)


def _find_word(name: str) -> tuple[str, RoomRule | None] | None:
    """Return the listed word that a name stands for, and the rule that a reader should know of."""
    listed, forms = _list_keys(), [*dict.fromkeys(_list_forms(name))]
    for words in forms:
        if word := listed.get("".join(words)):
            return word, None
    if load_class_map().lookup(name) is not None:
        return None  # the name of a thing, and not of a room that is spelt like it
    tails = [words[-most:] for words in forms for most in range(_HEAD, 0, -1) if most < len(words)]
    for words in tails:
        if (word := listed.get("".join(words))) and not _NO_HEADS.fullmatch(words[-1]):
            return word, "head noun"
    for words in (*forms, *tails):
        if word := _mend("".join(words)):
            return word, "misspelt"
    return None


def _list_forms(name: str) -> Iterator[tuple[str, ...]]:
    """Yield the words of a name, without what says which room it is, and of each of its pieces."""
    plain = _make_plain(name)
    for piece in dict.fromkeys((plain, *_BETWEEN.split(plain))):
        said = [word for word in _WORDS.findall(piece) if not word[0].isdecimal()]
        words = tuple(map(_singular, said))
        yield words
        while words and _BEHIND.fullmatch(words[-1]):
            words = words[:-1]
        while words and _BEFORE.fullmatch(words[0]):
            words = words[1:]
        yield words


def _make_plain(name: str) -> str:
    """Return a name in small letters, without accents."""
    return _MARKS.sub("", unicodedata.normalize("NFKD", _HUMP.sub(" ", name))).casefold()


@lru_cache(maxsize=1024)  # the words of names of rooms are few
def _singular(word: str) -> str:
    if word.endswith("ies"):
        return f"{word[:-3]}y"
    if word.endswith(("ches", "shes", "sses", "xes")):
        return word[:-2]
    is_plural = len(word) > 3 and word.endswith("s") and not word.endswith(("ss", "us", "is"))
    return _PLURALS.get(word, word[:-1] if is_plural else word)


def _mend(key: str) -> str | None:
    """Return the listed word from which a key differs by one letter, not the first, if it is one.

    A letter is missing, too many or misplaced; in longer names it may also be another letter.
    """
    if len(key) < _MENDED:
        return None
    rows, size = _read_labels(), len(key)
    same = _group_keys().get((key[0], size), [])
    near_sizes = (_group_keys().get((key[0], n), []) for n in (size - 1, size + 1))
    shifted = [*same, *chain.from_iterable(near_sizes)]
    replaced = same if size >= _REPLACED else []
    for listed, differs in ((shifted, _is_shifted), (replaced, _is_replaced)):
        near = [word for one, word in listed if differs(*_cut_common(one, key))]
        if len({rows[_ANY_SOURCE, word] for word in near}) == 1:
            return near[0]
    return None


def _is_shifted(a: str, b: str) -> bool:
    return a[1:] == b or a == b[1:] or (a[:2] == b[1::-1] and a[2:] == b[2:])


def _is_replaced(a: str, b: str) -> bool:
    return a[1:] == b[1:]


def _cut_common(a: str, b: str) -> tuple[str, str]:
    pairs = enumerate(zip(a, b, strict=False))
    start = next((at for at, (x, y) in pairs if x != y), min(len(a), len(b)))
    return a[start:], b[start:]


@cache
def list_room_labels() -> tuple[str, ...]:
    """Return the common room labels that models read, sorted."""
    rows = _read_labels().items()
    labels = {label for (source, _), label in rows if source != _BUILDING and label is not None}
    return tuple(sorted(label for label in labels if known_label(label) == label))


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
    told = (rows.get((_BUILDING, word)) for word in (found.word, found.label) if word)
    return next(filter(None, told), None)


def is_name(text: str) -> bool:
    """Say whether a room's id or label has words to be understood: R7 and room 5 have none."""
    if normalise_room(text) in NO_KIND or len(text) > _LONGEST:
        return False
    words = next(iter(_list_forms(text)))
    return any(
        (len(word) > 2 or not word.isascii()) and not _NO_NAMES.fullmatch(word) for word in words
    )


def is_understood(source: str, source_label: str) -> bool:
    """Say whether we know what a source calls a room, or it has no words to be understood.

    >>> [is_understood("table", name) for name in ("Wohnzimmer", "kitchen 2", "other", "R7")]
    [False, True, True, True]
    """
    known = read_room(source_label, source=source)
    return known.word is not None or not is_name(source_label)


def normalise_room(name: str) -> str:
    """Return a room's name in lower case, with spaces for `_` and `-`, without its number.

    >>> normalise_room("Walk-in_Closet_2")
    'walk in closet'
    """
    return _normalise_rooms([name])[0]


def _normalise_rooms(names: Sequence[str]) -> list[str]:
    spaced = [name.replace("_", " ").replace("-", " ") for name in names]
    return [_NUMBER.sub("", name) for name in normalise_names(spaced)]


def check_room_type(said: RoomType | None) -> RoomType | None:
    """Return the type of a room in common labels; probabilities of equal labels are summed.

    A word that no label is known for stays, and counts as unknown; see `list_unknown`.

    >>> check_room_type("Hallway"), check_room_type({"hall": 0.5, "corridor": 0.25})
    ('corridor', {'corridor': 0.75})

    Raises:
        RecipeError: for an impossible probability or a sum above 1.
    """
    if said is None or isinstance(said, str):
        return None if said is None else _find_label(said)
    if not isinstance(said, Mapping) or not all(isinstance(word, str) for word in said):
        raise RecipeError(
            f"expected a room label, or labels with their probabilities, found {show_value(said)}"
        )
    if not 1 <= len(said) <= _MOST_LABELS:
        raise RecipeError(
            f"expected 1 to {_MOST_LABELS} labels, found {len(said)}; leave it out, or give null"
        )
    found: dict[str, float] = {}
    for word, probability in said.items():
        most, wanted = 1 + _ROUNDING, "a probability, 0 to 1"
        probability = read_number(show_value(word), probability, most=most, wanted=wanted)
        label = _find_label(word)
        if label is not None and probability > 0:
            found[label] = found.get(label, 0.0) + probability
    total = math.fsum(said.values())
    if total > 1 + _ROUNDING:
        raise RecipeError(f"expected probabilities that add up to 1 or less, found {total:g}")
    return next(iter(found)) if list(found.values()) == [1.0] else found or None


def list_unknown(said: RoomType | None) -> list[str]:
    """Return the words of a type that models do not know.

    >>> list_unknown({"Küche": 0.5, "pharmacy": 0.25, "hall": 0.25})
    ['Küche', 'pharmacy']
    """
    known = _index_labels()
    return [str(w) for w in _list_words(said) if w not in known or known_label(w) != w]


def explain_label(word: str) -> str:
    """Return how models read a word that they do not know.

    >>> explain_label("Küche"), explain_label("pharmacy")
    ('unknown (nearest: kitchen)', 'storage room')
    """
    read = known_label(word)
    return read if read in _index_labels() else f"unknown{name_nearest(word)}"


def explain_rules(said: RoomType | None) -> dict[str, str]:
    """Return word → label and rule, of the words of a type that a rule has read.

    >>> explain_rules("staff kitchen")
    {'staff kitchen': 'kitchen (head noun)'}
    """
    read = {
        word.said: (word, read_room(word.said).rule)
        for word in _list_words(said)
        if isinstance(word, Understood)
    }
    return {name: f"{label} ({rule})" for name, (label, rule) in read.items() if rule}


def _list_words(said: RoomType | None) -> tuple[str, ...]:
    known = check_room_type(said)
    return () if known is None else (known,) if isinstance(known, str) else tuple(known)


def name_nearest(word: str) -> str:
    """Return the labels that are spelt like a word, in brackets; empty if none is."""
    near = nearest_names(normalise_room(word), list_room_labels())
    return f" (nearest: {', '.join(near)})" if near else ""


@cache
def _index_labels() -> dict[str, int]:
    return {label: index for index, label in enumerate(list_room_labels())}


def spread_labels(said: RoomType | None) -> npt.NDArray[np.float32]:
    """Return a type as a distribution over the labels `[L]`; all 0 if it says nothing.

    What its probabilities leave is spread evenly over all labels.

    Raises:
        RecipeError: as `check_room_type`.
    """
    known, index = check_room_type(said), _index_labels()
    row = np.zeros(len(index))
    for label, probability in ({known: 1.0} if isinstance(known, str) else known or {}).items():
        if (read := known_label(label)) in index:
            row[index[read]] += probability
    if row.any():
        row += max(0.0, 1 - row.sum()) / len(row)
        row /= row.sum()
    return row.astype(np.float32)


def _find_label(word: str) -> str | None:
    """Return the common label of a word; the word itself if none is known; None if it says none."""
    if isinstance(word, Understood):
        return word
    if normalise_room(word) in NO_KIND:
        return None
    label = label_of(_ANY_SOURCE, word) or word
    return label if label == word else Understood(label, word)


@cache
def _read_labels() -> Mapping[tuple[str, str], str | None]:
    """Read the published rows, each exact and normalised."""
    header = ("source", "source_label", "label")
    rows = [row for _, row in read_rows(_FILE, read_published(_FILE), header)]
    sources, words, labels = zip(*rows, strict=True)
    said: dict[tuple[str, str], str] = {}
    for names in (_normalise_rooms(words), words):
        said |= dict(zip(zip(sources, names, strict=True), labels, strict=True))
    return {key: label or None for key, label in said.items()}


@cache
def _list_keys() -> Mapping[str, str]:
    """Return the words of all sources by their letters, in the singular: `kidroom` → `kids room`.

    Of two words with the same letters, the singular counts: a store is a shop, stores are not.
    """
    words = [word for source, word in _read_labels() if source == _ANY_SOURCE]
    lines = _make_plain("\n".join(words)).split("\n")
    said = ([one for one in _WORDS.findall(line) if not one[0].isdecimal()] for line in lines)
    keyed = {word: "".join(map(_singular, one)) for word, one in zip(words, said, strict=True)}
    plain_last = sorted(words, key=lambda word: keyed[word] == word.replace(" ", ""))
    return {keyed[word]: word for word in plain_last}


@cache
def _group_keys() -> Mapping[tuple[str, int], list[tuple[str, str]]]:
    """Return what `_list_keys` does, by the first letter and the number of letters."""
    found = defaultdict[tuple[str, int], list[tuple[str, str]]](list)
    for key, word in _list_keys().items():
        found[key[:1], len(key)].append((key, word))
    return found
