"""Pose a robot's question as a search, and say where its plan goes.

It is believed where a thing is, a look finds it with a chance if it is there, and going and looking
cost something (Koopman 1957, Stone 1975). `bsg_models.search.problem` has the law and what a plan
costs; a plan is made anew after every look.

- A thing of which one is known for sure is found. If all are, robots go where they are; there, they
  need not search.
- To find `all`, those that are known for sure do not count, because nobody has to look for them.
- What is behind a closed door does not count, as long as something else is left, and a thing that
  is nearly sure to be there does not count beside others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.errors import RecipeError
from bsg_models.search.catalogue import AnyPlanner, find_planner
from bsg_models.search.knowledge import Task
from bsg_models.search.looks import look_again, miss_all, overlooked_at
from bsg_models.search.planners import next_room_by
from bsg_models.search.plans import plan_search, split_plan
from bsg_models.search.problem import LEAST_FIND, SearchProblem, pose_search
from bsg_robot.answers.evidence import Chances
from bsg_robot.answers.thing_belief import ThingBelief

_LOOKS = 3  # into a place, that a plan may have; one if a look misses nothing
_NOTHING = 1e-12  # a smaller probability is rounding
_LEAST_REACHED = 0.1  # share of P(a look anywhere finds a thing)


class Plan(NamedTuple):
    """A plan of K robots; a robot that can reach no place has none."""

    problem: SearchProblem
    looks: Sequence[Sequence[int]]  # of each robot, by their numbers in the problem
    places: Sequence[Sequence[int]]  # the same, by their places


@dataclass(frozen=True, eq=False)
class Decision:
    """What a decision depends on, for N places and A things that are still to be found.

    Attributes:
        finds: `[L, N, A]` P(the first look into a place finds it; only the second does; …).
        scale: `[A]` Z, of the tilt of the building.
        missed: `[N]` P(all looks miss what is there), of the thing with the most; 1 without a look.
        task: `single` or `all`.
        things: which of the things these are.
        is_known: whether all are known for sure, so that a robot only has to go there.
        rooms: `[N]` number of the room of each place; None if each is of its own.
    """

    finds: Floats
    scale: Floats
    missed: Floats
    task: Task
    things: tuple[int, ...]
    is_known: bool = False
    rooms: Floats | None = None

    @property
    def left(self) -> Bools:
        """The places that are left to search, `[N]`."""
        return np.asarray((self.finds[0] > _NOTHING).any(axis=1))

    @property
    def likely(self) -> Floats:
        """P(the next look finds any of the things), `[N]`."""
        return np.asarray(1 - (1 - self.finds[0]).prod(axis=1))

    def plan(
        self, costs: Floats, look: Floats, *, here: Sequence[int], budget: float | None = None
    ) -> Plan:
        """Return the plan of some robots.

        Args:
            costs: `[N, N]` of the ways between places.
            look: `[N]` cost of a look.
            here: places of the robots.
            budget: of each robot.
        """
        able = [k for k, at in enumerate(here) if np.isfinite(costs[at, self.left]).any()]
        problem, place = self._pose(costs, look, [here[k] for k in able], budget)
        looks = [list[int]() for _ in here]
        if len(place) and able:
            parts = split_plan(plan_search(problem)[0], problem)
            for robot, (k, part) in enumerate(zip(able, parts, strict=True)):
                open_ = [number for number in part if np.isfinite(costs[here[k], place[number]])]
                looks[k] = problem.cut(open_, robot=robot)
        return Plan(problem, looks, [place[part].tolist() for part in looks])

    def _pose(
        self, costs: Floats, look: Floats, here: list[int], budget: float | None
    ) -> tuple[SearchProblem, Ints]:
        """Return the search of some robots, and the place of each of its looks."""
        places = np.flatnonzero(self.left)
        # Nobody sends two robots into one room; and who looks for all looks everywhere once.
        again = self.task == "single" and len(here) == 1
        looks = self.finds if again else self.finds[:1]
        rows = np.array([*places, *here], dtype=np.int64)
        problem, place = pose_search(
            costs[np.ix_(rows, places)][None],
            (looks * self.scale)[:, places].clip(LEAST_FIND, 1.0)[None],
            look=0.0 if self.is_known else look[places][None],
            single=self.task == "single",
            rooms=None if self.rooms is None else self.rooms[places],
            scale=None if (self.scale == 1).all() else self.scale[None],
            budget=budget,
        )
        return problem, places[place[0]]

    def choose(self, costs: Floats, look: Floats, *, here: int, planner: AnyPlanner) -> int | None:
        """Return the place that a planner goes to; None if nothing is left to look for.

        Arguments are those of `plan`. A planner that reads no belief looks into every room once
        before it looks into one again.

        Raises:
            RecipeError: if the planner cannot be used.
        """
        chosen, left = find_planner(planner), self.left
        if chosen.reads == "none" and left.any():
            left &= np.isclose(self.missed, self.missed[left].max())
        return next_room_by(
            costs,
            here=here,
            explored=~left,
            presence=self.finds[0],
            look=np.zeros_like(look) if self.is_known else look,
            task=self.task,
            planner=chosen,
        )

    def choose_likeliest(self) -> int | None:
        """Return the likeliest place, wherever it is; None if nothing is left."""
        return int(self.likely.argmax()) if self.left.any() else None


def weigh(
    beliefs: Sequence[ThingBelief],
    looks: Sequence[Mapping[int, Chances]],
    *,
    here: Sequence[int],
    open_: Bools,
    chance: float,
    task: Task,
) -> Decision:
    """Return what a decision about some things depends on.

    Args:
        beliefs: of A things.
        looks: node → what was looked at there for each thing.
        here: nodes of the robots.
        open_: `[N]` nodes that a way leads to, for any of the robots.
        chance: P(a look finds a thing that is there).
        task: `single` or `all`.

    Raises:
        RecipeError: if rooms are left, and no way leads to any of them.
    """
    sure = np.stack([belief.is_sure & open_ for belief in beliefs], axis=1)
    unknown = np.asarray(~sure.any(axis=0)) if task == "single" else np.ones(len(beliefs), bool)
    nodes, every = len(open_), tuple(range(len(beliefs)))
    if not unknown.any():
        beside = sure[list(here)].any(axis=0)
        left = sure[:, ~beside] if not beside.all() else sure
        finds = left[None].astype(float)
        return Decision(finds, np.ones(left.shape[1]), np.ones(nodes), task, every, is_known=True)
    finds = np.stack(
        [
            _find(belief, chances, chance, unsure=task == "all")
            for belief, chances in zip(beliefs, looks, strict=True)
        ],
        axis=2,
    )
    reached = np.where(open_[:, None], finds, 0.0)
    if (finds[0, :, unknown] > _NOTHING).any() and not (reached[0, :, unknown] > _NOTHING).any():
        raise RecipeError(
            "no way leads to a room that is left to search; give `costs` that are finite",
            code="rooms-unreachable",
        )
    anywhere, left = (1 - (1 - part[0]).prod(axis=0) for part in (finds, reached))
    near = unknown & (left >= _LEAST_REACHED * anywhere)
    sought = near if near.any() else unknown
    things = tuple(np.flatnonzero(sought).tolist())
    scale = np.array([beliefs[thing].tilt for thing in things])
    missed = np.ones(nodes)
    for thing in things:
        for node, chances in looks[thing].items():
            missed[node] = min(missed[node], miss_all(chances.get(None, ())))
    return Decision(reached[..., sought], scale, missed, task, things)


def _find(
    belief: ThingBelief, looks: Mapping[int, Chances], chance: float, *, unsure: bool
) -> Floats:
    """Return P(the first look finds a thing; only the second; …) at each node, `[L, N]`."""
    nodes = len(belief.seen)
    found = np.tile(np.array(found_by((), chance))[:, None], nodes)
    for node, chances in looks.items():
        found[:, node] = found_by(chances.get(None, ()), chance)
    by_then = [belief.finds(some, unsure=unsure) for some in found]
    return np.diff(by_then, axis=0, prepend=0.0).clip(min=0.0)


def found_by(
    before: tuple[float, ...], chance: float, *, piece: str | None = None
) -> tuple[float, ...]:
    """Return P(the first 1, 2, … looks find a thing that looks `before` have missed)."""
    return look_again(
        before, chance, looks=1 if chance == 1 else _LOOKS, overlooked=overlooked_at(piece)
    )
