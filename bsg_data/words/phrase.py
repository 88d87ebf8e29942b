"""What a phrase is about: the `lamp` of `lamp on table`, the `basket` of a `basket of towels`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache

from bsg_data.words.normal import LONGEST, MARKS

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
    pieces = (_drop_place(one).strip(MARKS) for one in _EITHER.split(bare))
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
