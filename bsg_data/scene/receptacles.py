"""Receptacles: pieces of furniture on or in which things lie, and where a kind of thing is kept.

Three tables of `mappings/` say it (`mappings/README.md`):

    receptacles-v1.csv        a piece, its names, the listed ones that it is like, if it is opened,
                              and whether it holds only what the table of keeping names
    receptacle-shares-v1.csv  share of people to whom things belong there, of all things together
    keeping-v1.csv            a kind of thing → the pieces where a person would look, by hand

The pieces that people were asked about are the columns of everything here, in the order of
`LISTED`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.scene.class_space import read_published, read_rows
from bsg_data.scene.name_rules import LONGEST, singulars, take_apart
from bsg_data.scene.things import find_thing, spell_names

_PIECES, _SHARES, _KEEPING = (
    "receptacles-v1.csv",
    "receptacle-shares-v1.csv",
    "keeping-v1.csv",
)
_SEPARATOR = "|"
_OPENED = {"yes": 1.0, "both": 0.5, "no": 0.0}


@dataclass(frozen=True, slots=True)
class Receptacle:
    """A piece of furniture on or in which things lie."""

    name: str
    like: tuple[int, ...]  # the listed pieces that it is like, numbers of `list_receptacles`
    closed: float  # share of what it holds that is not seen until it is opened
    only: bool  # whether it holds only what the table of keeping names


@dataclass(frozen=True, slots=True)
class Keeping:
    """Where a person would look for a kind of thing."""

    weights: Mapping[str, float]  # of pieces by name, per cent; none for what stands by itself

    def weigh(self, piece: Receptacle) -> float | None:
        """Return the weight of a piece; None if those that it is like say it."""
        if piece.name in self.weights or piece.only:
            return self.weights.get(piece.name, 0.0)
        return None


@dataclass(frozen=True, eq=False)
class Shares:
    """Shares of people, for K rooms and P listed pieces.

    Attributes:
        rooms: room labels.
        belongs: `[K, P]` to whom things belong there, all things together.
        untidy: `[K, P]` who say that they lie there when the home is untidy.
    """

    rooms: tuple[str, ...]
    belongs: Floats
    untidy: Floats


def list_receptacles() -> tuple[str, ...]:
    """Return the listed pieces, of which people were asked."""
    return _read_shares()[0]


def read_shares() -> Shares:
    """Return the shares of people."""
    return _read_shares()[1]


@lru_cache(maxsize=4096)  # the objects of a room are asked again and again
def find_receptacle(word: str) -> Receptacle | None:
    """Return the piece of furniture that a word names; None if things do not lie there.

    >>> [one.name for word in ("Night_Stand", "worktops") if (one := find_receptacle(word))]
    ['nightstand', 'counter']
    >>> find_receptacle("banana") is None
    True
    """
    if len(word) > LONGEST:
        return None
    listed = _read_receptacles()
    for key in dict.fromkeys(spell_names((word, take_apart(word)))):
        for form in (key, *singulars(key)):
            if form in listed:
                return listed[form]
    return None


@lru_cache(maxsize=256)
def find_keeping(word: str) -> Keeping | None:
    """Return where a person would look for a thing; None if the table does not say."""
    listed, words = _read_keeping(), spell_names((word,))[0].split(" ")
    for start in range(len(words)):  # running shoes lie where shoes do
        said = " ".join(words[start:])
        thing = find_thing(said)
        for name in (said, thing.name if thing else ""):
            if name in listed:
                return listed[name]
    return Keeping({}) if find_receptacle(word) else None


@cache
def _read_shares() -> tuple[tuple[str, ...], Shares]:
    rows = read_rows(
        _SHARES, read_published(_SHARES), ("room", "receptacle", "belongs", "untidy", "asked")
    )
    said = {(room, piece): (float(a), float(b)) for _, (room, piece, a, b, _) in rows}
    rooms, pieces = (tuple(dict.fromkeys(names)) for names in zip(*said, strict=True))
    both = np.array([[said[room, piece] for piece in pieces] for room in rooms])
    return pieces, Shares(rooms, both[..., 0], both[..., 1])


@cache
def _read_receptacles() -> Mapping[str, Receptacle]:
    header = ("receptacle", "spellings", "like", "opened", "only", "source")
    number = {piece: index for index, piece in enumerate(list_receptacles())}
    found: dict[str, Receptacle] = {}
    for _, (name, spellings, like, opened, only, _) in read_rows(
        _PIECES, read_published(_PIECES), header
    ):
        alike = tuple(number[one] for one in like.split(_SEPARATOR))
        piece = Receptacle(name, alike, _OPENED[opened], only == "yes")
        found |= dict.fromkeys(spell_names((name, *spellings.split(_SEPARATOR))), piece)
    return found


@cache
def _read_keeping() -> Mapping[str, Keeping]:
    rows = read_rows(_KEEPING, read_published(_KEEPING), ("kind", "things", "receptacles"))
    found: dict[str, Keeping] = {}
    for _, (_, things, where) in rows:
        parts = [part.partition(":") for part in filter(None, where.split(_SEPARATOR))]
        kept = Keeping({piece: float(weight) for piece, _, weight in parts})
        found |= dict.fromkeys(things.split(_SEPARATOR), kept)
    return found
