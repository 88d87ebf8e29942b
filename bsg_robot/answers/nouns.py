"""Say where a thing may be that no model counts, from what its name means.

A noun has a vector v and a base b, distilled from word vectors, a taxonomy of things, and counts of
other words (`scripts/measure/nouns.py` at commit a82ef191). In a room with the expected content E
`[C]` its rate is

    λ = share exp(b + v · s),   s = P log(E + ε) + c

where `share` is the part of the content that was not seen. The count is negative binomial: its
dispersion is what held-out words leave uncertain, so a noun is never as sure as a counted class.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from safetensors.numpy import load

from bsg_data.arrays import Bools, Floats
from bsg_data.words.normal import MOST_WORDS, drop_kind, list_parts, normalise_name, singulars
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.expectation import Expectation
from bsg_robot.tables.table import read_file, read_table

_NOUNS = "nouns-v1.safetensors"  # a file of the package `bsg_mappings`
EPSILON = 0.005  # objects, added to an expected count before its logarithm
HEAD = 0.5  # weight of the head of a compound; the words before it share the rest
_SHORT = 4  # letters: shorter parts of a word are chance
_WORDS = "words-v1.csv"
# Kinds of words that say nothing of where a thing is. Those of one kind tell things apart: a red
# mug is no blue one, but it may be the big one.
_APPEARANCES = ("colour", "size", "state")
_LOOKS = (*_APPEARANCES, "brand")
_DETERMINERS = re.compile(
    r"^(?:(?:an?|the|my|your|his|her|its|our|their|this|that|some|any)(?: |$))+"
)


def split_head(name: str) -> tuple[list[str], str]:
    """Return the words before the head of a name, and the head; empty if there is none.

    Words that say how it looks, who made it, or of what, are left out; see `looks_of`.

    >>> split_head("my cup of tea"), split_head("a pair of red running shoes")
    (([], 'cup'), (['running'], 'shoes'))
    """
    before, head = _split_head(name)
    return [*before], head


@lru_cache(maxsize=4096)  # every rule splits a name again
def _split_head(name: str) -> tuple[tuple[str, ...], str]:
    plain = normalise_name(list_parts(name)[0]).replace("’", "'")
    spoken = re.sub(r"[^\w']|_", " ", plain).rstrip(" 0123456789")
    words = [word.removesuffix("'s").strip("'") for word in spoken.split()[:MOST_WORDS]]
    words = drop_kind(_DETERMINERS.sub("", " ".join(words))).split()
    known = _list_words(*_LOOKS, "make")
    before = tuple(word for word in words[:-1] if word not in known)
    return (before, words[-1]) if words else ((), "")


@lru_cache(maxsize=4096)
def looks_of(name: str) -> frozenset[str]:
    """Return the words of a name that say how the thing looks, or who made it.

    >>> sorted(looks_of("the big red mug"))
    ['big', 'red']
    """
    return _list_words(*_LOOKS) & {*normalise_name(name).split()[:MOST_WORDS]}


def may_be_one(first: frozenset[str], second: frozenset[str]) -> bool:
    """Return whether what is told of two things can be true of one.

    >>> [may_be_one(frozenset({"nokia"}), frozenset({one})) for one in ("black", "samsung")]
    [True, False]
    """
    looks = _list_words(*_APPEARANCES)
    mine, theirs = first - looks, second - looks  # brands, and kinds of the thing
    if mine and theirs and mine.isdisjoint(theirs):
        return False
    shared = ((first & kind, second & kind) for kind in map(_list_words, _APPEARANCES))
    return not any(mine and theirs and mine.isdisjoint(theirs) for mine, theirs in shared)


@cache
def _list_words(*kinds: str) -> frozenset[str]:
    """Return the words of some kinds."""
    table = read_table(_WORDS)
    rows = zip(table["word"], table["kind"], strict=True)
    return frozenset(word for word, kind in rows if kind in kinds)


@lru_cache(maxsize=4096)  # all that is sought is compared with all that was seen
def _take_sets(name: str) -> tuple[frozenset[str], frozenset[str]]:
    """Return the words before the head of a name, and what may be the head's singular."""
    before, head = _split_head(name)
    return frozenset(before), frozenset((head, *singulars(head)))


@dataclass(frozen=True, eq=False)
class Noun:
    """A thing, by what its name means.

    Attributes:
        name: as it was asked.
        head: the word that decides what it is.
        like: counted things that are most like it, which it is judged by.
        base: b, log of the rate in a room of the mean state.
        vector: v `[K]`.
    """

    name: str
    head: str
    like: tuple[str, ...]
    base: float
    vector: Floats

    def names(self, category: str) -> bool:
        """Return whether a robot's name for an object is this noun, or says more about one.

        A mug may be the red mug, as long as nobody calls it blue.
        """
        (before, heads), (told, called) = _take_sets(self.name), _take_sets(category)
        if heads.isdisjoint(called) or not before <= told:
            return False
        return may_be_one(looks_of(self.name), looks_of(category))

    def includes(self, name: str) -> bool:
        """Return whether all things of a name are this noun: mugs include red mugs."""
        return self.names(name) and looks_of(self.name) <= looks_of(name)


@dataclass(frozen=True, eq=False)
class NounTable:
    """What V words mean, by the contents that a model of the default class space expects.

    Attributes:
        rows: word → row.
        things: `[V]` whether the word is a thing; others only occur before a head.
        vectors: `[V, K]` in units of `scale`.
        scale: `[K]`.
        bases: `[V]`.
        near: `[V, 3]` rows of `counted` that are most like the word.
        counted: the words that some dataset counts.
        projection: P `[C, K]`.
        centre: c `[K]`.
        dispersion: of the counts.
    """

    rows: dict[str, int]
    things: Bools
    vectors: Floats
    scale: Floats
    bases: Floats
    near: Floats
    counted: tuple[str, ...]
    projection: Floats
    centre: Floats
    dispersion: float

    @property
    def known(self) -> list[str]:
        """The things, the most frequent first."""
        return [word for word, row in self.rows.items() if self.things[row]]

    def knows(self, words: Iterable[str]) -> bool:
        """Return whether all words are of the table; brands are not."""
        return all(self._row(word) is not None for word in words)

    def find(self, name: str) -> Noun | None:
        """Return what a name means; None if its head is no known thing.

        A compound goes by its head; known words before the head move it: a bath mat is a mat that
        is in bathrooms.
        """
        before, head = self._split(name)
        row = self._row(head, things=True)
        if row is None:
            return None
        found = [known for word in before if (known := self._row(word)) is not None]
        rows = np.array([row, *found])
        weights = np.array([1.0] if not found else [HEAD, *[(1 - HEAD) / len(found)] * len(found)])
        like = tuple(self.counted[row] for row in self.near[row].astype(int))
        vector = weights @ (self.vectors[rows] * self.scale)
        return Noun(name, head, like, float(weights @ self.bases[rows]), vector)

    def _split(self, name: str) -> tuple[list[str], str]:
        """Return the words before the head of a name, and the head: the last word that is a thing.

        A word that is unknown is taken apart: a dishtowel is a towel, and a laminator laminates.
        """
        before, head = split_head(name)
        words = [part for word in (*before, head) for part in self._take_apart(word)]
        while len(words) > 1 and self._row(words[-1], things=True) is None:
            words = words[:-1]
        return words[:-1], words[-1] if words else ""

    def _take_apart(self, word: str) -> list[str]:
        if self._row(word) is None:
            for agent in ("er", "or"):  # a laminator is what laminates
                stems = [word.removesuffix(agent) + end for end in ("", "e")]
                if word.endswith(agent) and (
                    found := [s for s in stems if self._row(s, things=True) is not None]
                ):
                    return found[:1]
            for end in range(_SHORT, len(word) - _SHORT + 1):
                parts = [word[:end], word[end:]]
                if all(self._row(part) is not None for part in parts):
                    return parts
        return [word]

    def _row(self, word: str, *, things: bool = False) -> int | None:
        forms = () if word in _list_words("plural") else singulars(word)
        rows = (self.rows.get(spelling) for spelling in (*forms, word))
        return next((r for r in rows if r is not None and (self.things[r] or not things)), None)

    def expect(self, noun: Noun, belief: Expectation) -> CountDistribution:
        """Return the hidden counts of a noun at every node, `[N, 1]`.

        Node 0, the building, holds what its rooms do; a building without rooms is one.
        """
        rates = np.exp(noun.base + self.states(belief.expected) @ noun.vector)
        hidden, all_ = belief.hidden.sum(axis=1), belief.expected.sum(axis=1)
        rates *= np.divide(hidden, all_, out=np.zeros_like(hidden), where=all_ > 0)
        if len(rates) > 1:
            rates[0] = rates[1:].sum()
        means = rates[None, :, None]
        same = np.full_like(means, self.dispersion)
        return CountDistribution(means, same, np.ones_like(means))

    def states(self, expected: Floats) -> Floats:
        """Return s `[N, K]` of expected contents `[N, C]`."""
        logs = np.log(np.maximum(expected, 0.0) + EPSILON)
        return np.asarray(logs @ self.projection + self.centre)


@cache
def read_nouns() -> NounTable:
    """Read the table that is shipped; a process reads it once."""
    arrays = load(read_file(_NOUNS))
    words, counted = (
        tuple(arrays[name].tobytes().decode().split("\n")) for name in ("words", "counted")
    )
    return NounTable(
        rows={word: row for row, word in enumerate(words)},
        things=np.unpackbits(arrays["things"], count=len(words)).astype(bool),
        vectors=arrays["vectors"],
        scale=arrays["scale"],
        bases=arrays["bases"].astype(np.float32),
        near=arrays["near"],
        counted=counted,
        projection=arrays["projection"],
        centre=arrays["centre"],
        dispersion=float(arrays["dispersion"][0]),
    )
