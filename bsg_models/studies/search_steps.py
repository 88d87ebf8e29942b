"""Keep searches of a study step by step, so that they can be replayed.

A caller may name one search by its number. Without a number, the study shows a search that is worth
watching. The rule does not favour a planner:

1. Eventful: at most `MOST_HOLDING` of the rooms hold an artifact, and every robot enters
   `LEAST_ENTERED` rooms or more.
2. Typical: its saving is within `TYPICAL` of that of all searches together, or as near as there
   is.
3. Of these searches, the one in which beliefs change most.

If no search is eventful, rules 2 and 3 choose among all. The saving of all searches is known only
at the end, so each building keeps `KEPT` searches by rules 1 and 3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.search.knowledge import Task
from bsg_models.search.simulator import Step

MOST_HOLDING = 0.25  # share of the rooms, without the start
LEAST_ENTERED = 4  # rooms, without the start
TYPICAL = 0.15
KEPT = 16


@dataclass(frozen=True, slots=True)
class KeepRequest:
    """Which searches of a study keep their steps."""

    # number of the search in its building, from 0; None for those worth watching
    episode: int | None
    task: Task  # when the search ends
    planner: str  # a planner of the study's recipe; the same search by `nearest` is kept, too
    scene_id: str | None = None  # of the building; None for all
    world: str | None = None  # name of the world; None for all

    def fits(self, scene_id: str, world: str) -> bool:
        """Return whether searches of this building and world are asked for."""
        return self.scene_id in (None, scene_id) and self.world in (None, world)


@dataclass(frozen=True, eq=False)
class KeptStep:
    """One decision of a planner in one search."""

    target: int  # room that the planner named
    entered: int  # room that the robot entered on the way there
    # nodes that it passed on the way into that room, which is the last of them
    way: tuple[int, ...]
    distance: Floats  # `[N]` cost of going to each node; infinite out of reach
    # `[N, A]` that the planner received, for rooms not yet entered; 0 for a planner that reads no
    # belief
    presence: Floats

    @property
    def cost(self) -> float:
        """Cost of going to the entered room."""
        return float(self.distance[self.entered])


@dataclass(frozen=True, eq=False)
class KeptSearch:
    """One search by one planner and by `nearest`: same start, artifacts and costs."""

    scene_id: str  # of the building
    world: str  # name of the world
    task: Task  # when it ended
    planner: str  # that was asked for
    episode: int  # number of the search in its building, from 0
    start: int  # room where it began
    artifacts: tuple[int, ...]  # classes that it looked for
    draw: int  # number of the mask
    eventful: bool  # whether few rooms hold an artifact and every robot enters many
    change: float  # of its beliefs, see `belief_changes`
    # planner → its steps, in order; the requested planner is the first
    walks: Mapping[str, tuple[KeptStep, ...]]

    def saved(self, baseline: str) -> float:
        """Return 1 − ratio of the planner's cost to that of another planner with kept steps."""
        ours, base = (
            sum(step.cost for step in self.walks[name]) for name in (self.planner, baseline)
        )
        return 1 - ours / base if base else 0.0


def walk_of(steps: Sequence[Step], episode: int) -> tuple[KeptStep, ...]:
    """Return the steps of one search out of those of many that ran in lockstep."""
    return tuple(
        KeptStep(
            target=int(step.target[row]),
            entered=int(step.entered[row]),
            way=_way_of(step, row),
            distance=step.known.distance[row].copy(),
            presence=step.known.presence[row].copy(),
        )
        for step in steps
        for row in np.flatnonzero(step.rows == episode).tolist()
    )


def _way_of(step: Step, row: int) -> tuple[int, ...]:
    """Return the nodes after the robot's own, up to the room that it enters."""
    towards = step.known.travel.steps[step.known.rows[row], :, step.target[row]]
    way = [int(towards[step.known.here[row]])]
    while way[-1] != step.entered[row]:
        way.append(int(towards[way[-1]]))
    return tuple(way)


def belief_changes(steps: Sequence[Step], searches: int) -> Floats:
    """Return how much beliefs changed in each of E searches in lockstep, `[E]`.

    The value sums over the steps. Each step adds the mean change of P(a room holds an artifact)
    since the step before, over the rooms not yet entered.
    """
    changes = np.zeros(searches)
    for before, after in pairwise(steps):
        same = np.searchsorted(before.rows, after.rows)  # searches may end, but none begins
        moved = np.abs(after.known.any_presence - before.known.any_presence[same])
        open_ = after.known.unexplored
        changes[after.rows] += (moved * open_).sum(axis=1) / np.maximum(open_.sum(axis=1), 1)
    return changes


def find_eventful(chance: Floats, entered: Sequence[Ints]) -> Bools:
    """Return in which searches few rooms hold an artifact and every robot enters many, `[E]`.

    `chance` is the share of the rooms that hold one `[E]`, `entered` the rooms of each robot `[E]`.
    """
    many = np.min(entered, axis=0) >= LEAST_ENTERED
    return np.asarray((chance <= MOST_HOLDING) & many)


def choose_kept(eventful: Bools, changes: Floats) -> Ints:
    """Return at most `KEPT` searches that a building keeps, `[KEPT]`, the most eventful first."""
    return np.lexsort((-changes, ~eventful))[:KEPT]


def choose_shown(kept: Sequence[KeptSearch], baseline: str, saved: float) -> KeptSearch:
    """Return the search to show: eventful, then typical, then with the most change of beliefs."""

    def rank(one: KeptSearch) -> tuple[bool, float, float]:
        beyond = max(0.0, abs(one.saved(baseline) - saved) - TYPICAL)
        return not one.eventful, beyond, -one.change

    return min(kept, key=rank)
