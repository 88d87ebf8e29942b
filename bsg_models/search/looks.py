"""Say what a look costs, and what looks that are repeated miss.

**Cost.** The simulator pyrobosim measured it (`scripts/measure/robot.py` at commit 0b7c073c): a
robot that searches the furniture of a room, piece by piece, at 5 s a detection and 1 m/s between
them, needs 3.1 · A^0.57 seconds for a room of A square metres (20 storeys made from HM3D). In that
time it would drive as many metres. The walks through ProcTHOR's rooms that `estimate_hidden_share`
rests on come near: until a camera has seen 80 % of what is in 12 m², they take 9 s, this rule says
13.

**Misses.** A second look overlooks things for the same reasons as the first. A share h of places
of a thing is overlooked by all such looks, because they are closed, or behind something; in the
others, looks are independent. So looks that find it with the chances cᵢ all miss it with

    h + (1 − h) Π (1 − cᵢ / (1 − h))

whatever their order; if the best of them misses less than h, with what that misses. In rooms of
ProcTHOR, a camera overlooked .12 by looks that found 70 and 80 %, and that is h of a room: of looks
that find 80 %, the second finds .36 of what the first missed (the camera: .35). At a piece of
furniture, where a second look is from the same place, h is taken for .16, and it finds .19
(docs/results/looks.md).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache
from typing import TypeVar

from bsg_data.arrays import Floats

_Share = TypeVar("_Share", float, Floats)
USUAL_WAY = 4.2  # metres between rooms that connect: the mean of 688 in 50 layouts of HM3D
USUAL_AREA = 12.0  # square metres of a room of unknown size: the median of 712 in these layouts
ROOM, PIECE = 0.12, 0.16  # h of looks into a room, and at a piece of furniture
_FIRST, _GROWTH = 3.1, 0.57
_LEAST = 1.0  # metre: a robot stops to look


def metres_of_look(area: float | None, *, share: float = 1.0) -> float:
    """Return what a look costs, as the length of a way, in metres.

    Args:
        area: of the room, square metres; None if unknown.
        share: of the room that is left to be searched, 0 to 1.

    Examples:
        >>> round(metres_of_look(12.0), 1), round(metres_of_look(12.0, share=0.25), 1)
        (12.8, 3.2)
    """
    return max(_LEAST, share * _FIRST * math.pow(area or USUAL_AREA, _GROWTH))


def miss_all(chances: Iterable[float], *, overlooked: float = ROOM) -> float:
    """Return P(looks into one place all miss a thing that is there).

    Args:
        chances: P(a look finds it), of each look alone.
        overlooked: h, of looks into a room (`ROOM`) or at a piece of furniture (`PIECE`).

    Examples:
        >>> round(miss_all([0.8]), 2), round(miss_all([0.8, 0.8]), 2)
        (0.2, 0.13)
    """
    some, seen = list(chances), 1 - overlooked
    surest = max(some, default=0.0)
    if surest >= seen:
        return 1 - surest
    return overlooked + seen * math.prod(1 - chance / seen for chance in some)


def doubt(presence: _Share, missed: _Share) -> _Share:
    """Return P(it is there), by Bayes' rule, once looks missed what they miss with P(`missed`)."""
    return presence * missed / (1 - presence + presence * missed)


def overlooked_at(piece: str | None) -> float:
    """Return h of looks at a piece of furniture; None for a whole room."""
    return ROOM if piece is None else PIECE


@lru_cache(maxsize=1024)
def look_again(
    before: tuple[float, ...], chance: float, *, looks: int, overlooked: float = ROOM
) -> tuple[float, ...]:
    """Return P(a thing that looks have missed is found) by the first 1, 2, … more looks together.

    Args:
        before: chances of the looks that missed it.
        chance: of each further look.
        looks: their number.
        overlooked: of `miss_all`.
    """
    so_far = miss_all(before, overlooked=overlooked)
    if not so_far:
        return (0.0,) * looks
    more = (miss_all([*before, *[chance] * n], overlooked=overlooked) for n in range(1, looks + 1))
    return tuple(1 - missed / so_far for missed in more)
