"""Say what a look costs, and what looks that are repeated miss.

**Cost.** The simulator pyrobosim measured it (`scripts/measure/robot.py` at commit 0b7c073c): a
robot that searches the furniture of a room, piece by piece, at 5 s a detection and 1 m/s between
them, needs 3.1 · A^0.57 seconds for a room of A square metres (20 storeys made from HM3D). In that
time it would drive as many metres. The walks through ProcTHOR's rooms that `estimate_hidden_share`
rests on come near: until a camera has seen 80 % of what is in 12 m², they take 9 s, this rule says
13.

**Misses.** A second look overlooks things for the same reasons as the first: they lie behind or in
something. So the places of a thing are seen at rates that are spread by a gamma distribution of the
shape b: looks that find a thing with the chances cᵢ all miss it with the probability

    (1 + Σ ((1 − cᵢ)^(−1/b) − 1))^(−b)

whatever their order. Into a room, b = 1: the odds of looks add. Of looks that find 80 %, the second
finds .44 of what the first missed, then .31, .24 and .19. A camera in rooms of ProcTHOR and
Matterport found .47, .31, .21 and .15, in the mean of things in the open, behind and in furniture,
from the same door and from another (.33 to .61 the second time; docs/results/looks.md). At a piece
of furniture, where a second look is from the same place, b = 0.4, as in these rooms of what is in
furniture: .24, .15, .11.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache

USUAL_WAY = 4.2  # metres between rooms that connect: the mean of 688 in 50 layouts of HM3D
USUAL_AREA = 12.0  # square metres of a room of unknown size: the median of 712 in these layouts
ROOM, PIECE = 1.0, 0.4  # b of looks into a room, and at a piece of furniture
_SURE = 1 - 1e-12  # a chance that misses nothing
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


def miss_all(chances: Iterable[float], *, shape: float = ROOM) -> float:
    """Return P(looks into one place all miss a thing that is there).

    Args:
        chances: P(a look finds it), of each look alone.
        shape: b, of looks into a room (`ROOM`) or at a piece of furniture (`PIECE`).

    Examples:
        >>> round(miss_all([0.8]), 2), round(miss_all([0.8, 0.8]), 2)
        (0.2, 0.11)
    """
    some = [chance for chance in chances if chance]
    if not all(chance < _SURE for chance in some):
        return 0.0
    return float((1 + sum((1 - chance) ** (-1 / shape) - 1 for chance in some)) ** -shape)


@lru_cache(maxsize=1024)
def look_again(
    before: tuple[float, ...], chance: float, *, looks: int, shape: float = ROOM
) -> tuple[float, ...]:
    """Return P(a thing that looks have missed is found) by the first 1, 2, … more looks together.

    Args:
        before: chances of the looks that missed it.
        chance: of each further look.
        looks: their number.
        shape: of `miss_all`.
    """
    so_far = miss_all(before, shape=shape)
    if not so_far:
        return (0.0,) * looks
    more = (miss_all([*before, *[chance] * n], shape=shape) for n in range(1, looks + 1))
    return tuple(1 - missed / so_far for missed in more)
