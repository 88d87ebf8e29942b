"""Simulate object search (paper, section IV-D).

A robot starts in a room without the artifact. It goes to the room that a planner names, and enters
every room on the way. An entered room shows everything in it; then the belief and the planner are
asked again. A run ends with the first instance of each sought class (`single`), or when all are
found (`all`), which the simulator knows and the robot does not. With `stop_at`, it ends when the
robot believes that nothing is left.

All searches of one building run in lockstep: one call of the planner moves each of them once.
Several planners also run together (`search_together`), and their questions are asked at once.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, replace
from typing import Protocol, TypeAlias, TypeVar

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
        travel: of each search.
        rooms: `[N]` rooms of the world.
        starts: `[E]` rooms without the artifact.
        artifacts: `[E, A]` classes that each search looks for.
        instances: `[E, N, A]` number of instances per node: the truth.
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

    def __call__(self, rows: Ints, explored: Bools, *, shares: bool = True) -> Answer:
        """Return presence and share of the artifacts.

        Args:
            rows: `[M]` numbers of the searches.
            explored: `[M, N]` rooms that each has entered.
            shares: whether the share is needed.

        Returns:
            Both `[M, N, A]`, of unexplored rooms; the second may be None without `shares`.
        """


Answer: TypeAlias = "tuple[Floats, Floats | None]"


@dataclass(frozen=True, eq=False)
class Outcome:
    """How E searches ended.

    Attributes:
        costs: `[E]` total cost of travel.
        entered: `[E]` number of rooms, without the start.
        missed: `[E]` instances that were not found; for `single`, those of classes of which none
            was found.
    """

    costs: Floats
    entered: Ints
    missed: Ints


@dataclass(frozen=True, eq=False)
class Question:
    """What a planner must be told before it can continue: the arguments of `Beliefs`."""

    rows: Ints
    explored: Bools
    shares: bool


Going: TypeAlias = "Generator[Question, Answer, Outcome]"  # searches, up to the next question
_Key = TypeVar("_Key")


@dataclass(frozen=True, eq=False)
class Step:
    """One step of the running searches, as `watch` of `search` receives it.

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
        beliefs: source of the presence; ignored by planners that read none, or the truth.
        stop_at: the robot ends the search itself once P(anything is left) is at most this; None
            leaves the end to the simulator.
        watch: called at each step.

    Raises:
        RecipeError: if the planner needs a belief and there is none, or names a room that is not
            unexplored.
    """
    going = begin_search(episodes, planner, task=task, stop_at=stop_at, watch=watch)
    return search_together({None: going}, beliefs=beliefs)[None]


def search_together(
    begun: Mapping[_Key, Going], *, beliefs: Beliefs | None = None
) -> dict[_Key, Outcome]:
    """Run the searches of several planners to their ends, and ask all their questions at once.

    Args:
        begun: key → started searches, from `begin_search`.
        beliefs: about the searches of all of them; ignored by planners without a belief.

    Raises:
        RecipeError: as for `search`.
    """
    outcomes: dict[_Key, Outcome] = {}
    answers: dict[_Key, Answer | None] = dict.fromkeys(begun)
    while answers:
        questions: dict[_Key, Question] = {}
        for key, answer in answers.items():
            try:
                going = begun[key]
                questions[key] = next(going) if answer is None else going.send(answer)
            except StopIteration as end:
                outcomes[key] = end.value
        if questions and beliefs is None:
            raise RecipeError("this planner needs a belief: give the run of a model")
        answers = {}
        for shares in (True, False):
            some = {key: one for key, one in questions.items() if one.shares == shares}
            if some and beliefs is not None:
                answers |= _ask_at_once(some, beliefs, shares=shares)
    return {key: outcomes[key] for key in begun}


def _ask_at_once(
    questions: Mapping[_Key, Question], beliefs: Beliefs, *, shares: bool
) -> dict[_Key, Answer | None]:
    """Return the answers to several questions, asked as one."""
    rows = np.concatenate([one.rows for one in questions.values()])
    explored = np.concatenate([one.explored for one in questions.values()])
    presence, share = beliefs(rows, explored, shares=shares)
    ends = np.cumsum([len(one.rows) for one in questions.values()])
    answers: dict[_Key, Answer | None] = {}
    for key, one, end in zip(questions, questions.values(), ends.tolist(), strict=True):
        part = slice(end - len(one.rows), end)
        answers[key] = presence[part], None if share is None else share[part]
    return answers


def begin_search(
    episodes: Episodes,
    planner: Planner,
    *,
    task: Task,
    stop_at: float | None = None,
    watch: Callable[[Step], None] | None = None,
) -> Going:
    """Yield the question before each step of the searches; return their outcome.

    Arguments and errors are those of `search`.
    """
    if planner.reads == "truth":
        # Other planners do not see that a way through a third room may cost less than the edge.
        episodes = replace(episodes, travel=find_ways(episodes.travel.costs))
    tour = None
    if planner.reads == "truth" and task == "all":
        holds = (episodes.instances > 0).any(axis=2) & episodes.rooms
        tour = plan_tour(episodes.travel, episodes.starts, holds)
    number = len(episodes.starts)
    explored = np.zeros(episodes.lots.shape, dtype=bool)
    explored[np.arange(number), episodes.starts] = True
    here, costs, entered = episodes.starts.copy(), np.zeros(number), np.zeros(number, np.int64)
    unfound = episodes.instances.sum(axis=1)  # the start holds none
    going, rooms = np.ones(number, dtype=bool), int(episodes.rooms.sum()) - 1
    while True:
        if stop_at is None:
            going &= unfound.any(axis=1)
        going &= entered < rooms
        rows = np.flatnonzero(going)
        if not len(rows):
            return Outcome(costs, entered, unfound.sum(axis=1))
        answer: Answer | None = None
        if planner.reads == "belief":
            answer = yield Question(rows, explored[rows], planner.shares)
        known = _look(episodes, rows, here, explored, unfound, planner, task, answer)
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

    For `single`, one instance of a class completes the class.
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
    answer: Answer | None,
) -> Knowledge:
    """Return what the robots of some searches know."""
    unexplored = episodes.rooms & ~explored[rows]
    presence = np.zeros((*unexplored.shape, episodes.artifacts.shape[1]))
    share: Floats | None = presence
    open_ = unexplored[:, :, None]
    if planner.reads == "truth":
        presence = ((episodes.instances[rows] > 0) & open_).astype(float)
    elif answer is not None:
        presence = np.where(open_, answer[0], 0.0)
        share = None if answer[1] is None else np.where(open_, answer[1], 0.0)
    # For `all`, every class stays wanted: a robot does not know when it has found all of one
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
