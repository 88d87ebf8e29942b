"""Simulate object search (paper, section IV-D).

A robot starts in a room without the artifact. It goes to the room that a planner names, and enters
every room on the way. An entered room shows everything in it; then the belief and the planner are
asked again. A run ends with the first instance of each sought class (`single`), or when all are
found (`all`), which the simulator knows and the robot does not.

In a world where looks cost something, a robot looks into the room that it goes to, and into none on
the way. A look may miss an instance, and the next one does so for the same reasons
(`bsg_models.search.looks`). Then the room becomes less likely by Bayes' rule, as if it had at most
one. A robot that reads no belief looks into every room once before it looks into one again.

All searches of one building run in lockstep: one call of a planner moves each of its searches once,
and the beliefs of all robots are asked at once.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.stats import binom

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.errors import RecipeError
from bsg_models.search.catalogue import Planner
from bsg_models.search.knowledge import Knowledge, Task, Travel, find_ways
from bsg_models.search.looks import doubt, miss_all
from bsg_models.search.planners import ask_planner
from bsg_models.search.plans import plan_search, plan_tours, split_plan
from bsg_models.search.problem import LEAST, pose_search

_Key = TypeVar("_Key", bound=Hashable)
_AGAIN = 2  # further looks that are weighed
_LEAST = 1e-3  # P(a room has one), as long as looks may miss: a wrong belief must not end a search


@dataclass(frozen=True, eq=False)
class Episodes:
    """E searches of one building."""

    travel: Travel  # of each search
    rooms: Bools  # `[N]` rooms of the world
    starts: Ints  # `[E]` rooms; without the artifact, if looks cost nothing
    artifacts: Ints  # `[E, A]` classes that each search looks for
    instances: Ints  # `[E, N, A]` number of instances per node: the truth
    look: Floats | None = None  # `[N]` cost of a look; None: to enter is to have looked
    chance: float = 1.0  # P(a look finds an instance that is there)
    luck: Floats | None = None  # `[E, N, L]` of the first L looks in a room, 0 to 1; None: L is 0

    @property
    def may_miss(self) -> int:
        """Number L of the first looks in a room that may miss; later ones find all."""
        return 0 if self.luck is None else self.luck.shape[2]

    def missed(self, looks: Ints) -> Floats:
        """Return P(an instance that is there is missed) by some looks."""
        table = [miss_all([self.chance] * n) for n in range(int(looks.max(initial=0)) + 1)]
        return np.array(table)[looks]

    @property
    def random_success(self) -> Floats:
        """P(a room drawn at random holds an artifact), `[E]`; of those besides a start without."""
        others = self.rooms.sum() - (self.look is None)
        return np.asarray(self.instances.any(axis=2).sum(axis=1) / others)


# What is believed about the artifacts of E searches: a function of the numbers of some searches,
# `[M]`, and the rooms that each has entered, `[M, N]`. It returns the presence and the share of the
# artifacts in unexplored rooms, both `[M, N, A]`.
Answer: TypeAlias = tuple[Floats, Floats]
Beliefs: TypeAlias = Callable[[Ints, Bools], Answer]


@dataclass(frozen=True, slots=True)
class Robot:
    """What searches with one planner."""

    planner: Planner  # that names its rooms
    task: Task  # when a search ends


@dataclass(frozen=True, eq=False)
class Outcome:
    """How E searches ended.

    Attributes:
        costs: `[E]` total cost of travel and looks.
        entered: `[E]` number of rooms without the start; of looks, if they cost something.
    """

    costs: Floats
    entered: Ints


@dataclass(frozen=True, eq=False)
class Step:
    """One step of a robot's running searches."""

    rows: Ints  # `[M]` numbers of the searches
    known: Knowledge  # what they know
    target: Ints  # `[M]` rooms that the planner names
    entered: Ints  # `[M]` rooms that they enter on the way there
    towards: npt.NDArray[np.int16]  # `[M, N]` next node on the way to the target, from every node


def search(
    episodes: Episodes,
    robots: Mapping[_Key, Robot],
    *,
    beliefs: Beliefs | None = None,
    watch: Callable[[_Key, Step], None] | None = None,
) -> dict[_Key, Outcome]:
    """Run all searches with each of some robots, and return how they ended.

    Args:
        episodes: E searches of one building.
        robots: key → robot.
        beliefs: source of the presence; ignored for planners that read none, or the truth.
        watch: called with the key of a robot and each of its steps.
    """
    runs = {key: _Run(episodes, robot) for key, robot in robots.items()}
    while any(len(run.rows) for run in runs.values()):
        answers = _ask(runs, beliefs)
        for key, run in runs.items():
            if not len(run.rows):
                continue
            step = run.advance(answers.get(key))
            if watch is not None:
                watch(key, step)
    return {key: run.outcome for key, run in runs.items()}


def _ask(runs: Mapping[_Key, _Run], beliefs: Beliefs | None) -> dict[_Key, Answer]:
    """Return what is believed about the running searches of each robot that reads beliefs."""
    asking = {
        key: run
        for key, run in runs.items()
        if len(run.rows) and run.robot.planner.reads == "belief"
    }
    if not asking:
        return {}
    if beliefs is None:
        raise RecipeError(
            "this planner needs a belief: give the run of a model", code="belief-missing"
        )
    rows = np.concatenate([run.rows for run in asking.values()])
    explored = np.concatenate([run.explored[run.rows] for run in asking.values()])
    presence, share = beliefs(rows, explored)
    ends = np.cumsum([len(run.rows) for run in asking.values()])[:-1]
    parts = zip(np.split(presence, ends), np.split(share, ends), strict=True)
    return dict(zip(asking, parts, strict=True))


class _Run:
    """The searches of one robot, and where they are."""

    def __init__(self, episodes: Episodes, robot: Robot) -> None:
        number, nodes = episodes.instances.shape[:2]
        self.robot, self.tour = robot, None
        if robot.planner.reads == "truth":
            # Others do not see that a way through a third room may cost less than the edge.
            episodes = replace(episodes, travel=find_ways(episodes.travel.costs))
            if robot.task == "all":
                holds = episodes.instances.any(axis=2) & episodes.rooms
                self.tour = plan_tours(episodes.travel.costs, episodes.starts, holds)
        self.episodes, self.here = episodes, episodes.starts.copy()
        self.looks = np.zeros((number, nodes), dtype=np.int64)  # in each room
        # The start of a robot that finds what it enters was looked into; it holds nothing.
        self.looks[np.arange(number), self.here] = episodes.look is None
        # presence and share, when a room was looked into
        self.before = np.zeros((2, *episodes.instances.shape))
        self.left = episodes.instances.copy()  # instances that were not found, by room
        self.costs, self.entered = np.zeros(number), np.zeros(number, dtype=np.int64)
        self.unfound = episodes.instances.sum(axis=1)
        self.rows = np.arange(number)
        self._end()

    @property
    def outcome(self) -> Outcome:
        return Outcome(self.costs, self.entered)

    def _end(self) -> None:
        """Keep the searches that go on."""
        self.rows = self.rows[self.unfound[self.rows].any(axis=1)]

    @property
    def explored(self) -> Bools:
        """Rooms that were looked into, `[E, N]`."""
        return self.looks > 0

    def advance(self, answer: Answer | None) -> Step:
        """Move every search once."""
        known = self._know(answer)
        rows, travel, look = self.rows, self.episodes.travel, self.episodes.look
        target = place = ask_planner(self.robot.planner, known)
        if look is None:
            place = travel.first_on_the_way(rows, known.here, target, known.unexplored)
        else:
            self.costs[rows] += look[place]
        new = ~self.explored[rows, place]
        self.costs[rows] += travel.costs[rows, known.here, place]
        self.entered[rows] += new if look is None else 1
        seen = self._find(rows, place)
        left = self.unfound[rows]
        is_all = self.robot.task == "all"  # else one instance of a class completes it
        self.unfound[rows] = left - seen if is_all else np.where(seen > 0, 0, left)
        self.left[rows, place] -= seen
        self.looks[rows, place] += 1
        self.here[rows] = place
        self._end()
        return Step(rows, known, target, place, travel.steps[rows, :, target])

    def _find(self, rows: Ints, place: Ints) -> Ints:
        """Return the number of instances that looks find, `[M, A]`."""
        episodes, found, number = self.episodes, self.left[rows, place], self.looks[rows, place]
        some = np.flatnonzero(number < episodes.may_miss)
        if episodes.luck is None or not len(some):
            return found
        number = number[some]
        luck = episodes.luck[rows[some], place[some], number]
        chance = 1 - episodes.missed(number + 1) / episodes.missed(number)
        found[some] = binom.ppf(luck[:, None], found[some], chance[:, None]).clip(min=0)
        return found

    def _know(self, answer: Answer | None) -> Knowledge:
        """Return what the robot knows in its running searches."""
        rows, robot, episodes = self.rows, self.robot, self.episodes
        looks, look, again = self.looks[rows], episodes.look, None
        unexplored = episodes.rooms & (looks <= episodes.may_miss)
        if robot.planner.reads == "none":  # every room once before one again
            fewest = looks.min(axis=1, where=unexplored, initial=looks.max(), keepdims=True)
            unexplored = unexplored & (looks == fewest)
        presence, share = answer or (np.zeros((*looks.shape, episodes.artifacts.shape[1])),) * 2
        if episodes.may_miss:
            share = self._doubt(rows, share, part=1)
            presence, again = self._expect(rows, presence)
        if robot.planner.reads == "truth":
            presence = (self.left[rows] > 0).astype(float)
        open_ = unexplored[:, :, None]
        # For `all`, every class stays wanted: a robot does not know when it has found all of one
        wanted = (self.unfound[rows] > 0) | (robot.task == "all")
        return Knowledge(
            task=robot.task,
            here=self.here[rows],
            ways=episodes.travel.costs,
            rows=rows,
            unexplored=unexplored,
            wanted=wanted,
            presence=np.where(open_, presence, 0.0),
            share=np.where(open_, share, 0.0),
            tour=None if self.tour is None else self.tour[rows],
            look=None if look is None else np.broadcast_to(look, unexplored.shape),
            again=again,
        )

    def _expect(self, rows: Ints, presence: Floats) -> tuple[Floats, Floats]:
        """Return P(the next look finds one), and for those after it, from P(there is one)."""
        present = self._doubt(rows, presence.clip(_LEAST), part=0)
        looks, missed = self.looks[rows, :, None], self.episodes.missed
        now = present / missed(looks)
        finds = [now * (missed(looks + n) - missed(looks + n + 1)) for n in range(1 + _AGAIN)]
        return finds[0], np.stack(finds[1:], axis=1)

    def _doubt(self, rows: Ints, now: Floats, *, part: int) -> Floats:
        """Return presence or share in all rooms after looks, `[M, N, A]`."""
        looks = self.looks[rows, :, None]
        before = np.where(looks == 0, now, self.before[part, rows])
        self.before[part, rows] = before
        return doubt(before, self.episodes.missed(looks))


def search_together(episodes: Episodes, starts: Ints, *, beliefs: Beliefs | None) -> Outcome:
    """Run all searches by robots that share what they see; return the time that each took.

    A robot looks into its room, and gets the next one, to which no other is on its way. A search
    ends when one of them finds an instance. Looks miss nothing.

    Args:
        episodes: E searches of one building, in which looks cost something.
        starts: `[E, K]` rooms of the robots.
        beliefs: by which their plan is made; None: each goes to its nearest room.
    """
    ended = [_search_one(episodes, row, here.copy(), beliefs) for row, here in enumerate(starts)]
    times, looks = zip(*ended, strict=True)
    return Outcome(np.array(times), np.array(looks))


def _search_one(
    episodes: Episodes, row: int, place: Ints, beliefs: Beliefs | None
) -> tuple[float, int]:
    """Return the time and the looks of a search; `place` is where each robot is, or goes."""
    travel = episodes.travel.costs[row]
    legs = travel if episodes.look is None else travel + episodes.look
    free, going = np.zeros(len(place)), np.zeros(len(place), dtype=bool)
    looked = ~episodes.rooms
    while True:
        robot = int(free.argmin())
        if going[robot]:
            looked[place[robot]], going[robot] = True, False
            if episodes.instances[row, place[robot]].any():
                return float(free[robot]), int((looked & episodes.rooms).sum())
        rooms = ~looked
        rooms[place[going]] = False
        nodes = np.flatnonzero(rooms)
        if len(nodes) and beliefs is None:
            nodes = nodes[[travel[place[robot], nodes].argmin()]]
        elif len(nodes) and beliefs is not None:
            presence, _ = beliefs(np.array([row]), (looked & episodes.rooms)[None])
            nodes = _plan_robot(legs, presence, nodes, place, free, robot=robot)
        if not len(nodes):
            free[robot] = np.inf  # it has nothing left to do
            continue
        free[robot] += legs[place[robot], nodes[0]]
        place[robot], going[robot] = nodes[0], True


def _plan_robot(
    legs: Floats, presence: Floats, nodes: Ints, place: Ints, free: Floats, *, robot: int
) -> Ints:
    """Return the rooms of a robot, in order, of a plan for all that have something to do."""
    team = np.flatnonzero(np.isfinite(free))
    problem, _ = pose_search(
        legs[np.ix_([*nodes, *place[team]], nodes)][None],
        presence[None, :, nodes].clip(LEAST, 1),
        single=True,
        delay=(free - free[robot])[team][None],
    )
    looks = split_plan(plan_search(problem)[0], problem)[[*team].index(robot)]
    return nodes[looks]
