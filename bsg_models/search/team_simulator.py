"""Simulate object search by several robots that share what they see.

Every robot goes to a room and looks there. When it is done, it gets the next room, which no other
robot is on its way to. A search ends when one of them finds an instance. Looks miss nothing.
"""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Ints
from bsg_models.search.plans import plan_search, split_plan
from bsg_models.search.problem import LEAST, pose_search
from bsg_models.search.simulator import Beliefs, Episodes, Outcome


def search_together(episodes: Episodes, starts: Ints, *, beliefs: Beliefs | None) -> Outcome:
    """Run all searches, and return the time that each took, and the rooms looked into.

    Args:
        episodes: E searches of one building, in which looks cost something.
        starts: `[E, K]` rooms of the robots.
        beliefs: by which their plan is made; None: each goes to its nearest room.
    """
    ended = [_search_one(episodes, row, here, beliefs) for row, here in enumerate(starts)]
    times, looks = zip(*ended, strict=True)
    return Outcome(np.array(times), np.array(looks))


def _search_one(
    episodes: Episodes, row: int, here: Ints, beliefs: Beliefs | None
) -> tuple[float, int]:
    travel = episodes.travel.costs[row]
    legs = travel if episodes.look is None else travel + episodes.look
    holds = episodes.instances[row].any(axis=1)
    place, free = here.copy(), np.zeros(len(here))
    target: list[int | None] = [None] * len(here)
    looked = ~episodes.rooms
    for _ in range(2 * len(looked) + len(here)):
        robot = int(free.argmin())
        found = target[robot]
        if found is not None:
            place[robot], looked[found] = found, True
            if holds[found]:
                return float(free[robot]), int((looked & episodes.rooms).sum())
        taken = [one for other, one in enumerate(target) if other != robot and one is not None]
        rooms = ~looked
        rooms[taken] = False
        if not rooms.any():
            node = -1
        elif beliefs is None:
            node = int(np.where(rooms, travel[place[robot]], np.inf).argmin())
        else:
            there = [one if one is not None else at for one, at in zip(target, place, strict=True)]
            there[robot] = place[robot]
            presence, _ = beliefs(np.array([row]), (looked & episodes.rooms)[None], shares=False)
            team = np.flatnonzero(np.isfinite(free))  # without those that have nothing left to do
            which, at = np.flatnonzero(rooms), np.array(there)[team]
            problem, _ = pose_search(
                legs[np.ix_([*which, *at], which)][None],
                presence[None, :, which].clip(LEAST, 1),
                single=True,
                delay=(free - free[robot])[team][None],
            )
            mine = split_plan(plan_search(problem)[0], problem)[[*team].index(robot)]
            node = int(which[mine[0]]) if mine else -1
        target[robot] = None if node < 0 else node
        free[robot] = np.inf if node < 0 else free[robot] + legs[place[robot], node]
    raise AssertionError("an instance is in some room")
