"""Searches of a study that are kept step by step, so that they can be replayed.

One search may be asked for by its number. Without a number the study shows one that is worth
watching, by a rule that does not favour a planner:

1. it is eventful: at most `MOST_HOLDING` of the rooms hold an artifact, and every robot enters
   `LEAST_ENTERED` rooms or more;
2. it is typical: its saving is within `TYPICAL` of that of all searches together, or as near as
   there is;
3. of all such searches it is the one in which beliefs change most.

Where no search is eventful, rules 2 and 3 choose among all. The saving of all searches is known
only when all are done, so each building keeps `KEPT` searches by rules 1 and 3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bsg_models.search.knowledge import Task
from bsg_models.search.shortest_paths import Bools, Floats, Ints
from bsg_models.search.simulator import Step

MOST_HOLDING = 0.25  # share of the rooms, without the one where it starts
LEAST_ENTERED = 4  # rooms, without the one where it starts
TYPICAL = 0.15
KEPT = 16


@dataclass(frozen=True, slots=True)
class KeepRequest:
    """Which searches of a study keep their steps.

    Attributes:
        episode: number of the search in its building, from 0; None for those that are most worth
            watching.
        task: when it ends.
        planner: that decides, of the study's recipe; the same search by `nearest` is kept, too.
        scene_id: of the building; None for every one.
        world: the name of the world; None for every one.
    """

    episode: int | None
    task: Task
    planner: str
    scene_id: str | None = None
    world: str | None = None

    def fits(self, scene_id: str, world: str) -> bool:
        """Say whether searches of this building and world are asked for."""
        return self.scene_id in (None, scene_id) and self.world in (None, world)


@dataclass(frozen=True, eq=False)
class KeptStep:
    """One decision of a planner in one search.

    Attributes:
        target: room that it named.
        entered: room that the robot entered on the way there.
        way: nodes that it came through on the way into that room, which is the last of them.
        distance: `[N]` cost of going to each node, infinite out of reach.
        presence: `[N, A]` that the planner was given, of rooms that the robot had not entered; 0
            for a planner that reads no belief.
    """

    target: int
    entered: int
    way: tuple[int, ...]
    distance: Floats
    presence: Floats

    @property
    def cost(self) -> float:
        """What it cost to go to the room that was entered."""
        return float(self.distance[self.entered])


@dataclass(frozen=True, eq=False)
class KeptSearch:
    """One search as it ran, by one planner and by `nearest`: same start, artifacts and costs.

    Attributes:
        scene_id: of the building.
        world: the name of the world.
        task: when it ended.
        planner: that was asked for.
        episode: number of the search in its building, from 0.
        start: room where it began.
        artifacts: classes that it looked for.
        draw: number of the mask.
        eventful: whether few rooms hold an artifact, and every robot enters many.
        change: of its beliefs, see `belief_changes`.
        walks: planner → its steps, in order; the one that was asked for is the first.
    """

    scene_id: str
    world: str
    task: Task
    planner: str
    episode: int
    start: int
    artifacts: tuple[int, ...]
    draw: int
    eventful: bool
    change: float
    walks: Mapping[str, tuple[KeptStep, ...]]

    def saved(self, baseline: str) -> float:
        """Return 1 − ratio of the costs of the planner and of another whose steps are kept."""
        ours, base = (
            sum(step.cost for step in self.walks[name]) for name in (self.planner, baseline)
        )
        return 1 - ours / base if base else 0.0


def walk_of(steps: Sequence[Step], episode: int) -> tuple[KeptStep, ...]:
    """Return the steps of one search out of those of many that went on in lockstep."""
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
    """Return the nodes after the one where a robot is, up to the room that it enters."""
    towards = step.known.travel.steps[step.known.rows[row], :, step.target[row]]
    way = [int(towards[step.known.here[row]])]
    while way[-1] != step.entered[row]:
        way.append(int(towards[way[-1]]))
    return tuple(way)


def belief_changes(steps: Sequence[Step], searches: int) -> Floats:
    """Return by how much beliefs changed in each of E searches in lockstep, `[E]`.

    At each step it is by how much P(a room holds an artifact) moved since the step before, a mean
    over the rooms that are not entered yet; these are added up.
    """
    changes = np.zeros(searches)
    for before, after in pairwise(steps):
        same = np.searchsorted(before.rows, after.rows)  # searches end, and none begins
        moved = np.abs(after.known.any_presence - before.known.any_presence[same])
        open_ = after.known.unexplored
        changes[after.rows] += (moved * open_).sum(axis=1) / np.maximum(open_.sum(axis=1), 1)
    return changes


def find_eventful(chance: Floats, entered: Sequence[Ints]) -> Bools:
    """Return in which searches few rooms hold an artifact and every robot enters many, `[E]`.

    Args:
        chance: `[E]` share of the rooms that hold one.
        entered: of each robot `[E]` rooms.
    """
    many = np.min(entered, axis=0) >= LEAST_ENTERED
    return np.asarray((chance <= MOST_HOLDING) & many)


def choose_kept(eventful: Bools, changes: Floats) -> Ints:
    """Return the searches that a building keeps, `[KEPT]` at most, the most eventful one first."""
    return np.lexsort((-changes, ~eventful))[:KEPT]


def choose_shown(kept: Sequence[KeptSearch], baseline: str, saved: float) -> KeptSearch:
    """Return the search to show: an eventful one, a typical one, one in which beliefs change.

    Args:
        kept: searches of one world, one at least.
        baseline: planner that savings are beside.
        saved: by all searches.
    """

    def rank(one: KeptSearch) -> tuple[bool, float, float]:
        beyond = max(0.0, abs(one.saved(baseline) - saved) - TYPICAL)
        return not one.eventful, beyond, -one.change

    return min(kept, key=rank)
