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

from bsg_models.planners import Knowledge, Planner, Task
from bsg_models.travel import Bools, Floats, Ints, Travel, find_ways


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

    def take(self, which: Ints) -> Episodes:
        """Return some of the searches."""
        return Episodes(
            self.travel.take(which),
            self.rooms,
            self.starts[which],
            self.artifacts[which],
            self.instances[which],
            self.lots[which],
        )


class Beliefs(Protocol):
    """What is believed about the artifacts of E searches."""

    def __call__(self, which: Ints, explored: Bools) -> tuple[Floats, Floats]:
        """Return presence and share of the artifacts.

        Args:
            which: `[M]` numbers of the searches.
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
        missed: `[E]` instances that it did not find; of `single`, classes.
    """

    costs: Floats
    entered: Ints
    missed: Ints


@dataclass(frozen=True, eq=False)
class Step:
    """A moment of searches that go on, as `watch` of `search` is given.

    Attributes:
        which: `[M]` numbers of the searches.
        known: what they know.
        target: `[M]` rooms that the planner names.
        entered: `[M]` rooms that they enter on the way there.
    """

    which: Ints
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
        planner: of `PLANNERS`.
        task: when a search ends.
        beliefs: whose presence the planner is given; not read by planners without a belief, nor by
            one that is given the truth.
        stop_at: the robot itself ends the search, once it believes that anything is left with at
            most this probability; None leaves that to the simulator.
        watch: called at each step.
    """
    if planner.source == "truth":
        # Others do not see that a way through a third room may cost less than the edge.
        episodes = replace(episodes, travel=find_ways(episodes.travel.costs))
    number = len(episodes.starts)
    every = np.arange(number)
    explored = np.zeros(episodes.lots.shape, dtype=bool)
    explored[every, episodes.starts] = True
    here, costs, entered = episodes.starts.copy(), np.zeros(number), np.zeros(number, np.int64)
    going = np.ones(number, dtype=bool)
    while True:
        unfound = missing(episodes, explored, task=task)
        going &= (episodes.rooms & ~explored).any(axis=1)
        if stop_at is None:
            going &= unfound.any(axis=1)
        which = np.flatnonzero(going)
        if not len(which):
            return Outcome(costs, entered, unfound.sum(axis=1))
        known = _look(episodes.take(which), which, here, explored, unfound, planner, task, beliefs)
        if stop_at is not None:
            sure = known.left <= stop_at
            going[which[sure]] = False
            if sure.any():
                continue
        target = planner.choose(known)
        place = episodes.travel.take(which).first_on_the_way(here[which], target, known.unexplored)
        if watch is not None:
            watch(Step(which, known, target, place))
        costs[which] += episodes.travel.costs[which, here[which], place]
        explored[which, place] = True
        entered[which] += 1
        here[which] = place


def missing(episodes: Episodes, explored: Bools, *, task: Task) -> Ints:
    """Return what is still to be found, `[E, A]`: instances, or classes as 0 and 1."""
    unseen = np.where(explored[:, :, None], 0, episodes.instances)
    if task == "all":
        return np.asarray(unseen.sum(axis=1))
    return np.asarray(unseen.sum(axis=1) == episodes.instances.sum(axis=1)).astype(np.int64)


def _look(
    some: Episodes,
    which: Ints,
    here: Ints,
    explored: Bools,
    unfound: Ints,
    planner: Planner,
    task: Task,
    beliefs: Beliefs | None,
) -> Knowledge:
    """Return what the robots of some searches know."""
    unexplored = some.rooms & ~explored[which]
    presence = np.zeros(some.instances.shape)
    share = presence
    if planner.source == "truth":
        presence = (some.instances > 0).astype(float)
    elif planner.source == "belief" and beliefs is not None:
        presence, share = beliefs(which, explored[which])
    # What is wanted in `all` is every class: a robot does not know when it has found all of one.
    wanted = unfound[which] > 0 if task == "single" else np.ones(some.artifacts.shape, dtype=bool)
    return Knowledge(
        task=task,
        here=here[which],
        costs=some.travel.costs,
        unexplored=unexplored,
        wanted=wanted,
        presence=np.where(unexplored[:, :, None], presence, 0.0),
        share=np.where(unexplored[:, :, None], share, 0.0),
        lots=some.lots,
    )
