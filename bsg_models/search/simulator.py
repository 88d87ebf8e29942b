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
from bsg_models.search.looks import miss_all
from bsg_models.search.planners import ask_planner
from bsg_models.search.plans import plan_tours

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
    luck: Floats | None = (
        None  # `[E, N, L]` of the first L looks in a room, 0 to 1; later ones find
    )

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
# artifacts in unexplored rooms, both `[M, N, A]`; the share may be None with `shares=False`.
Answer: TypeAlias = tuple[Floats, Floats | None]
Beliefs: TypeAlias = Callable[..., Answer]


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
    answers: dict[_Key, Answer] = {}
    for shares in (True, False):
        asking = {
            key: run
            for key, run in runs.items()
            if len(run.rows)
            and run.robot.planner.reads == "belief"
            and run.robot.planner.shares == shares
        }
        if not asking:
            continue
        if beliefs is None:
            raise RecipeError(
                "this planner needs a belief: give the run of a model", code="belief-missing"
            )
        rows = np.concatenate([run.rows for run in asking.values()])
        explored = np.concatenate([run.explored[run.rows] for run in asking.values()])
        presence, share = beliefs(rows, explored, shares=shares)
        end = 0
        for key, run in asking.items():
            begin, end = end, end + len(run.rows)
            answers[key] = presence[begin:end], None if share is None else share[begin:end]
    return answers


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
        episodes, there, number = self.episodes, self.left[rows, place], self.looks[rows, place]
        if episodes.luck is None:
            return np.where(number[:, None] > 0, 0, there)
        most = episodes.luck.shape[2]
        lucky = episodes.luck[rows, place, np.minimum(number, most - 1)][:, None]
        chance = 1 - episodes.missed(number + 1) / episodes.missed(number)
        found = binom.ppf(lucky, there, chance[:, None]).astype(np.int64)
        return np.where(number[:, None] < most, found.clip(min=0), there)

    def _know(self, answer: Answer | None) -> Knowledge:
        """Return what the robot knows in its running searches."""
        rows, robot, episodes = self.rows, self.robot, self.episodes
        looks, look = self.looks[rows], episodes.look
        unexplored, again = episodes.rooms & (looks == 0), None
        presence, share = answer or (np.zeros((*looks.shape, episodes.artifacts.shape[1])),) * 2
        if episodes.luck is not None:
            # A look that finds all leaves nothing.
            unexplored = episodes.rooms & (looks <= episodes.luck.shape[2])
            if robot.planner.reads == "none":
                fewest = looks.min(axis=1, where=unexplored, initial=looks.max(), keepdims=True)
                unexplored = unexplored & (looks == fewest)
            share = None if share is None else self._doubt(rows, share, part=1)
            presence, again = self._expect(rows, presence)
        if robot.planner.reads == "truth":
            presence = (self.left[rows] > 0).astype(float)
            if episodes.luck is not None:
                unexplored = episodes.rooms & presence.any(axis=2)
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
            share=None if share is None else np.where(open_, share, 0.0),
            tour=None if self.tour is None else self.tour[rows],
            look=None if look is None else np.broadcast_to(look, unexplored.shape),
            again=again,
        )

    def _expect(self, rows: Ints, presence: Floats) -> tuple[Floats, Floats]:
        """Return P(the next look finds one), and for those after it, from P(there is one)."""
        there = self._doubt(rows, presence.clip(_LEAST), part=0)
        looks, missed = self.looks[rows, :, None], self.episodes.missed
        now = there / missed(looks)
        finds = [now * (missed(looks + n) - missed(looks + n + 1)) for n in range(1 + _AGAIN)]
        return finds[0], np.stack(finds[1:], axis=1)

    def _doubt(self, rows: Ints, now: Floats, *, part: int) -> Floats:
        """Return presence or share in all rooms, `[M, N, A]`, by Bayes' rule after looks."""
        looks = self.looks[rows, :, None]
        before = np.where(looks == 0, now, self.before[part, rows])
        self.before[part, rows] = before
        missed = self.episodes.missed(looks)
        return np.asarray(before * missed / (1 - before + before * missed))
