"""Say what a look costs, and which rooms come before another look.

The simulator pyrobosim measured it (`scripts/measure/robot.py` at commit 0b7c073c): a robot that
searches the furniture of a room, piece by piece, at 5 s a detection and 1 m/s between them, needs
3.1 · A^0.57 seconds for a room of A square metres (20 storeys made from HM3D;
docs/results/search.md has the searches). In that time it would drive as many metres. The walks
through ProcTHOR's rooms that `estimate_hidden_share` rests on come near: until a camera has seen
80 % of what is in 12 m², they take 9 s, and this rule says 13.
"""

from __future__ import annotations

import math

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_models.belief.partial_graph import LOOK_CHANCE

USUAL_WAY = 4.2  # metres between rooms that connect: the mean of 688 in 50 layouts of HM3D
USUAL_AREA = 12.0  # square metres of a room of unknown size: the median of 712 in these layouts
_WAITS = 2.0  # a room that had a look waits for others, unless it is so many times likelier
_FAR_LIKELIER = 10.0  # than any other, so that a glance at a room is followed by a look
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


def leave_out(rooms: Bools, missed: Floats, likely: Floats, *, again: Bools) -> Bools:
    """Return the rooms that may be looked into next, `[..., N]`, if looks may miss.

    A room in which a look has missed waits as long as another, which had fewer looks, is half as
    likely. The room of the last look waits in any case while another is left: a look that is
    repeated at once misses for the same reason. A mere glance does not count where nothing else
    comes near.

    Args:
        rooms: `[..., N]` that are left.
        missed: `[..., N]` P(all looks so far miss a thing that is there); 1 without a look.
        likely: `[..., N]` P(a look finds it).
        again: `[..., N]` rooms of the last look, where the robot still is.
    """
    looks = np.floor(np.log(np.maximum(missed, 1e-300)) / math.log(1 - LOOK_CHANCE) + 1e-6)
    others = rooms & ~again
    fresh = others & (looks == np.where(others, looks, np.inf).min(axis=-1, keepdims=True))
    best = _most(likely, fresh)
    free = np.where(_most(likely, others) <= _WAITS * best, fresh, others)
    free |= rooms & again & (looks == 0) & (likely > _FAR_LIKELIER * best)
    return np.asarray(np.where(others.any(axis=-1, keepdims=True), free, rooms))


def _most(likely: Floats, some: Bools) -> Floats:
    return np.asarray(np.where(some, likely, 0.0).max(axis=-1, keepdims=True))
