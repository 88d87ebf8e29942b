"""The forms in which names are compared: normal, singular, and what a phrase is about.

A phrase is about the `lamp` of `lamp on table`, and the `basket` of a `basket of towels`.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Sequence
from functools import lru_cache

LONGEST = 100  # characters of a name: a longer one names nothing that we know
MARKS = " ?!.,;:…*\"'`“”„‘’«»‹›()[]{}<>¿¡？"  # around a name that was copied from a sentence
_END = "\0"  # of a name in a text of many
# Between the words of `CoffeeTable` and of `TVStand`, but not of `DVDs`.
_CAMEL = re.compile(r"(?<=[^\W_A-Z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})")
# (ending of the plural, ending of the singular)
_ENDINGS = (("ies", "y"), ("ves", "f"), ("ves", "fe"), ("es", ""), ("s", ""))
_IRREGULAR = {"children": "child", "people": "person"}
MOST_WORDS = 12  # no name of a thing has more
# What follows one of these tells what kind of the thing before it is meant.
_PREPOSITION = re.compile(r"\s(?:with|without|for|of|to)\s")
# A number of things is of the things' class (rule 3 of mappings/README.md).
_COLLECTION = re.compile(
    r"^(?:an? )?(?:sets?|pairs?|piles?|stacks?|bunch|group|row|pieces?|slices?) of "
)
# What is said of a thing: behind a comma or in brackets, how sure it is, and where it is.
_REMARK = re.compile(r"[(\[{<][^)\]}>]*[)\]}>]?|(?:,|;\s).*")
_SCORE = re.compile(r"[\s_:=@]+(?:[01]?\.[0-9]+|[0-9]{1,3} ?%)\s*$")
_EITHER = re.compile(r"[/|](?!\d)|(?<!\d)[/|]")
_WITH = re.compile(r"\bw/(?=\W*\w)|/w\b", re.IGNORECASE)
_PLACE = re.compile(
    r"\s(?:(?:is|are|hanging|lying|standing|sitting|placed|mounted|leaning|resting|stacked)\s)*"
    r"(?:on|in|under|underneath|beneath|below|behind|beside|near|next to|by|at|from|above|over"
    r"|against|between|inside|outside|atop|upon|within|along|around|opposite|in front of|close to"
    r")\s(?=\w)",
    re.IGNORECASE,
)
# Words that make one word with `in` or `on`: a carry on bag is on nothing.
# fmt: off
_ONE_WORD = frozenset({
    "add", "all", "built", "carry", "clip", "drop", "fold", "hands", "left", "lift", "log", "plug",
    "pop", "pull", "push", "ride", "roll", "screw", "sit", "slip", "snap", "stand", "step", "stick",
    "trade", "tuck", "walk",
})
# fmt: on


@lru_cache(maxsize=64)  # every rule normalises a name again
def normalise_name(name: str) -> str:
    """Return `name` as NFC, casefolded, trimmed, runs of white space as one space."""
    return " ".join(unicodedata.normalize("NFC", name).casefold().split())


def normalise_names(names: Sequence[str]) -> list[str]:
    """Return the names of a table, normalised all at once."""
    text = _END.join(names)
    if text.count(_END) + 1 != len(names):  # none, or a name that has such a character
        return [*map(normalise_name, names)]
    spelled = unicodedata.normalize("NFC", text).casefold()
    return [" ".join(name.split()) for name in spelled.split(_END)]


def separate(name: str) -> str:
    """Return a normalised name with spaces for hyphens and underscores.

    >>> separate("TV_monitor")
    'tv monitor'
    """
    return normalise_name(name.replace("-", " ").replace("_", " "))


def separate_names(names: Sequence[str]) -> list[str]:
    """Separate the names of a table, all at once."""
    return normalise_names([name.replace("-", " ").replace("_", " ") for name in names])


def drop_number(name: str) -> str:
    """Return a name without the number at its end, as of `chair #3` and `chair.003`."""
    return name.rstrip(" .").rstrip("0123456789").rstrip(" .#")


@lru_cache(maxsize=64)  # every rule asks again
def take_apart(name: str) -> str:
    """Return a name with spaces for its brackets, and between the words of its camel case.

    >>> take_apart("CoffeeTable"), take_apart("TVStand"), take_apart("TV (old)")
    ('Coffee Table', 'TV Stand', 'TV  old ')
    """
    return split_camel(re.sub(r"[()]", " ", name))


def split_camel(name: str) -> str:
    """Return a name with spaces between the words of its camel case."""
    return _CAMEL.sub(" ", name)


def singulars(name: str) -> Iterator[str]:
    """Yield what can be the singular of a name; not each is a word."""
    for plural, ending in _ENDINGS:
        if name.endswith(plural) and len(name) > len(plural) + 1:
            yield name.removesuffix(plural) + ending


def change_number(name: str) -> tuple[str, ...]:
    """Return what can be the singular or the plural of a name; not each is a word."""
    return (*singulars(name), f"{name}s")


@lru_cache(maxsize=1024)  # the words of names of rooms are few
def make_singular(word: str) -> str:
    """Return the likeliest singular of a word; itself if it is one.

    >>> [make_singular(word) for word in ("children", "studies", "benches", "boxes", "office")]
    ['child', 'study', 'bench', 'box', 'office']
    """
    if word.endswith("ies"):
        return f"{word[:-3]}y"
    if word.endswith(("ches", "shes", "sses", "xes")):
        return word[:-2]
    is_plural = len(word) > 3 and word.endswith("s") and not word.endswith(("ss", "us", "is"))
    return _IRREGULAR.get(word, word[:-1] if is_plural else word)


@lru_cache(maxsize=4096)  # the objects of a map are asked again and again
def list_parts(name: str) -> tuple[str, ...]:
    """Return the names of what a name is about, without what it says of them; itself if no more.

    >>> list_parts("box under bed"), list_parts("Cabinet/shelf"), list_parts("chair(0.87)")
    (('box',), ('Cabinet', 'shelf'), ('chair',))
    >>> list_parts("mug, red"), list_parts("walk in closet"), list_parts("end of bed bench")
    (('mug',), ('walk in closet',), ('end of bed bench',))
    """
    if len(name) > LONGEST:
        return (name,)
    bare = _REMARK.sub(" ", _SCORE.sub("", _WITH.sub(" with ", name)))
    pieces = (_drop_place(piece).strip(MARKS) for piece in _EITHER.split(bare))
    return tuple(filter(None, pieces)) or (name.strip(MARKS),)


def _drop_place(name: str) -> str:
    spaced = name.replace("_", " ")
    for found in _PLACE.finditer(spaced):
        before = spaced[: found.start()].split()
        if before and before[-1].casefold() not in _ONE_WORD:
            return name[: found.start()]
    return name


def drop_kind(name: str) -> str:
    """Return what a normalised name is about, without what kind of it is meant.

    >>> drop_kind("basket of towels"), drop_kind("a pile of towels"), drop_kind("key to the shed")
    ('basket', 'towels', 'key')
    """
    return _PREPOSITION.split(_COLLECTION.sub("", name), maxsplit=1)[0]


def list_tails(words: list[str]) -> Iterator[list[str]]:
    """Yield the last words of what a name is about, the longest first, but not the whole name."""
    head = drop_kind(" ".join(words)).split()
    yield from (head[i:] for i in range(int(head == words), len(head)))
