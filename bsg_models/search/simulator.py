"""Object search (paper, section IV-D): the simulator.

A robot starts in a room without the artifact. It goes to the room that a planner names, entering
every room on the way; a room that is entered shows all that is in it, the belief is asked again,
and the planner too. The run ends with the first instance of each class that is sought (`single`),
or when all are found (`all`), which the simulator knows and the robot does not; or, with `stop_at`,
when the robot believes that nothing is left.

All searches of one building go on in lockstep: one call of the planner moves each of them once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from bsg_data.errors import RecipeError
from bsg_models.search.catalogue import Planner
from bsg_models.search.knowledge import Knowledge, Task
from bsg_models.search.planners import ask_planner, plan_tour
from bsg_models.search.shortest_paths import Bools, Floats, Ints, Travel, find_ways


@dataclass(frozen=True, eq=False)
class Episodes:
    """E searches of one building.

    Attributes:
        travel: of each.
        rooms: `[N]` that belong to the world.
        starts: `[E]` rooms without the artifact.
        artifacts: `[E, A]` classes that each looks for.
        instances: `[E, N, A]` how many of them are where: the truth.
        lots: `[E, N]` random numbers.
    """

    travel: Travel
    rooms: Bools
    starts: Ints
    artifacts: Ints
    instances: Ints
    lots: Floats

    def take(self, rows: Ints) -> Episodes:
        """Return some of the searches."""
        return Episodes(
            self.travel.take(rows),
            self.rooms,
            self.starts[rows],
            self.artifacts[rows],
            self.instances[rows],
            self.lots[rows],
        )


class Beliefs(Protocol):
    """What is believed about the artifacts of E searches."""

    def __call__(self, rows: Ints, explored: Bools) -> tuple[Floats, Floats]:
        """Return presence and share of the artifacts.

        Args:
            rows: `[M]` numbers of the searches.
            explored: `[M, N]` rooms that each has entered.

        Returns:
            both `[M, N, A]`.
        """


@dataclass(frozen=True, eq=False)
class Outcome:
    """How E searches ended.

    Attributes:
        costs: `[E]` of all that each travelled.
        entered: `[E]` rooms, without the one where it started.
        missed: `[E]` instances that it did not find; in `single`, those of classes of which it
            found none.
    """

    costs: Floats
    entered: Ints
    missed: Ints


@dataclass(frozen=True, eq=False)
class Step:
    """A moment of searches that go on, as `watch` of `search` is given.

    Attributes:
        rows: `[M]` numbers of the searches.
        known: what they know.
        target: `[M]` rooms that the planner names.
        entered: `[M]` rooms that they enter on the way there.
    """

    rows: Ints
    known: Knowledge
    target: Ints
    entered: Ints


def search(
    episodes: Episodes,
    planner: Planner,
    *,
    task: Task,
    beliefs: Beliefs | None = None,
    stop_at: float | None = None,
    watch: Callable[[Step], None] | None = None,
) -> Outcome:
    """Run all searches with one planner.

    Args:
        episodes: E searches of one building.
        planner: a row of `PLANNERS`, or any other.
        task: when a search ends.
        beliefs: whose presence the planner is given; not read by planners without a belief, nor by
            one that is given the truth.
        stop_at: the robot itself ends the search, once it believes that anything is left with at
            most this probability; None leaves that to the simulator.
        watch: called at each step.

    Raises:
        RecipeError: if the planner needs a belief and there is none, or names another room than an
            unexplored one.
    """
    if planner.reads == "belief" and beliefs is None:
        raise RecipeError("this planner needs a belief: give the run of a model")
    if planner.reads == "truth":
        # Others do not see that a way through a third room may cost less than the edge.
        episodes = replace(episodes, travel=find_ways(episodes.travel.costs))
    tour = None
    if planner.reads == "truth" and task == "all":
        holds = (episodes.instances > 0).any(axis=2) & episodes.rooms
        tour = plan_tour(episodes.travel, episodes.starts, holds)
    number = len(episodes.starts)
    explored = np.zeros(episodes.lots.shape, dtype=bool)
    explored[np.arange(number), episodes.starts] = True
    here, costs, entered = episodes.starts.copy(), np.zeros(number), np.zeros(number, np.int64)
    unfound = episodes.instances.sum(axis=1)  # where it starts is none
    going, rooms = np.ones(number, dtype=bool), int(episodes.rooms.sum()) - 1
    while True:
        if stop_at is None:
            going &= unfound.any(axis=1)
        going &= entered < rooms
        rows = np.flatnonzero(going)
        if not len(rows):
            return Outcome(costs, entered, unfound.sum(axis=1))
        known = _look(episodes, rows, here, explored, unfound, planner, task, beliefs)
        if tour is not None:
            known = replace(known, tour=tour[rows])
        if stop_at is not None and (sure := known.left <= stop_at).any():
            going[rows[sure]] = False
            continue
        target = ask_planner(planner, known)
        place = episodes.travel.first_on_the_way(rows, known.here, target, known.unexplored)
        if watch is not None:
            watch(Step(rows, known, target, place))
        costs[rows] += episodes.travel.costs[rows, known.here, place]
        entered[rows] += ~explored[rows, place]
        unfound[rows] = still_to_find(
            unfound[rows],
            np.where(explored[rows, place][:, None], 0, episodes.instances[rows, place]),
            task=task,
        )
        explored[rows, place] = True
        here[rows] = place


def still_to_find(before: Ints, seen: Ints, *, task: Task) -> Ints:
    """Return the instances still to be found after some were seen, all `[E, A]`.

    In `single` one instance of a class is as good as all of them.
    """
    if task == "all":
        return before - seen
    return np.where(seen > 0, 0, before)


def _look(
    episodes: Episodes,
    rows: Ints,
    here: Ints,
    explored: Bools,
    unfound: Ints,
    planner: Planner,
    task: Task,
    beliefs: Beliefs | None,
) -> Knowledge:
    """Return what the robots of some searches know."""
    unexplored = episodes.rooms & ~explored[rows]
    presence = share = np.zeros((*unexplored.shape, episodes.artifacts.shape[1]))
    open_ = unexplored[:, :, None]
    if planner.reads == "truth":
        presence = ((episodes.instances[rows] > 0) & open_).astype(float)
    elif planner.reads == "belief" and beliefs is not None:
        presence, share = (np.where(open_, p, 0.0) for p in beliefs(rows, explored[rows]))
    # What is wanted in `all` is every class: a robot does not know when it has found all of one.
    wanted = unfound[rows] > 0 if task == "single" else np.ones_like(unfound[rows], dtype=bool)
    return Knowledge(
        task=task,
        here=here[rows],
        travel=episodes.travel,
        rows=rows,
        unexplored=unexplored,
        wanted=wanted,
        presence=presence,
        share=share,
        lots=episodes.lots[rows],
    )
