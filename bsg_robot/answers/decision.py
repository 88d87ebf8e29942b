"""Decide which room a robot looks into next, to find things at the least expected cost.

This is optimal search (Koopman 1957, Stone 1975): it is believed where a thing is, a look finds it
with a chance if it is there, and going and looking cost something. A plan looks into every room
once, and is made anew after every look. `bsg_models.search.orders` says what it costs.

- A thing of which one is known for sure is found. If all are, the robot goes where they are; there
  it need not search.
- A room in which a look has missed waits for others (`leave_out`).
- To find `all`, those that are known for sure do not count, because nobody has to look for them.
- What is behind a closed door does not count, as long as something else is left, and a thing that
  is nearly sure to be there does not count beside others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.errors import RecipeError
from bsg_models.search.catalogue import AnyPlanner, find_planner
from bsg_models.search.knowledge import Task
from bsg_models.search.looks import leave_out
from bsg_models.search.orders import order_search
from bsg_models.search.planners import next_room_by
from bsg_models.search.teams import send_team
from bsg_robot.answers.missed_looks import Looked
from bsg_robot.answers.thing_belief import ThingBelief
from bsg_robot.answers.ways import Ways

_FAR = 1e9  # cost of a way that is closed to one of several robots
_LATER = 1e6  # cost of another look by the robot that has just looked there
_PLANS = 8  # that are made in turn: only the first room binds
_NOTHING = 1e-12  # a smaller probability is rounding
_LEAST_REACHED = 0.1  # share of P(a look anywhere finds a thing)


@dataclass(frozen=True, eq=False)
class Decision:
    """What a decision depends on, for N nodes and A things that are still to be found.

    Attributes:
        finds: `[N, A]` P(a look finds at least one); 0 where nothing is left to look for.
        missed, again: `[N, A]` what looks for each have missed; see `Looked`.
        task: `single` or `all`.
        things: which of the things these are.
        is_known: whether all things are known for sure, so that the robot only has to go there.
    """

    finds: Floats
    missed: Floats
    again: Bools
    task: Task
    things: tuple[int, ...]
    is_known: bool = False

    @property
    def rooms(self) -> Bools:
        """The rooms that are left to search, `[N]`."""
        return np.asarray((self.finds > _NOTHING).any(axis=1))

    def candidates(self, *here: int, among: Bools | None = None) -> Bools:
        """Return the rooms that may be named, `[N]`, for robots in some rooms.

        A room that waits for another, to which one robot may go, does not wait for the next robot.
        """
        left = self.rooms if among is None else among.copy()
        missed = np.where(self.finds > _NOTHING, self.missed, 0.0).max(axis=1)
        free = leave_out(left, missed, self.likely, again=left & self.just_looked(*here))
        for _ in here[1:]:
            left[np.where(free & left, self.likely, -1.0).argmax()] = False
            free |= leave_out(left, missed, self.likely, again=np.zeros_like(left))
        return free

    def just_looked(self, *here: int) -> Bools:
        """Return the rooms of robots that looked there last, `[N]`."""
        beside = np.isin(np.arange(len(self.finds)), here)
        return beside & (self.again | (self.finds <= _NOTHING)).all(axis=1)

    @property
    def likely(self) -> Floats:
        """P(a look finds any of the things), `[N]`."""
        return np.asarray(1 - (1 - self.finds).prod(axis=1))


def weigh(
    beliefs: Sequence[ThingBelief],
    looked: Sequence[Looked],
    *,
    here: Sequence[int],
    open_: Bools,
    chance: float,
    task: Task,
) -> Decision:
    """Return what a decision about some things depends on.

    Args:
        beliefs: of A things.
        looked: what looks for each have missed.
        here: nodes of the robots.
        open_: `[N]` nodes that a way leads to, for any of the robots.
        chance: P(a look finds a thing that is there).
        task: `single` or `all`.

    Raises:
        RecipeError: if rooms are left, and no way leads to any of them.
    """
    missed = np.stack([one.missed for one in looked], axis=1)
    again = np.stack([one.again for one in looked], axis=1)
    sure = np.stack([one.is_sure & open_ for one in beliefs], axis=1)
    unknown = np.asarray(~sure.any(axis=0)) if task == "single" else np.ones(len(beliefs), bool)
    if not unknown.any():
        beside = sure[list(here)].any(axis=0)
        left = sure[:, ~beside] if not beside.all() else sure
        none = np.zeros(left.shape, dtype=bool)
        every = tuple(range(len(beliefs)))
        return Decision(left.astype(float), np.ones(left.shape), none, task, every, is_known=True)
    finds = np.stack([one.finds(chance, unsure=task == "all") for one in beliefs], axis=1)
    reached = np.where(open_[:, None], finds, 0.0)
    if (finds[:, unknown] > _NOTHING).any() and not (reached[:, unknown] > _NOTHING).any():
        raise RecipeError(
            "no way leads to a room that is left to search; give `costs` that are finite",
            code="rooms-unreachable",
        )
    every, left = (1 - (1 - part).prod(axis=0) for part in (finds, reached))
    near = unknown & (left >= _LEAST_REACHED * every)
    kept = near if near.any() else unknown
    things = tuple(np.flatnonzero(kept).tolist())
    return Decision(reached[:, kept], missed[:, kept], again[:, kept], task, things)


def choose_room(
    decision: Decision, ways: Ways, look: Floats, *, here: int, planner: AnyPlanner
) -> int | None:
    """Return the node to go to; None if nothing is left to look for.

    Args:
        decision: about N nodes.
        ways: between them.
        look: `[N]` cost of a look.
        here: the robot's node.
        planner: as `find_planner` takes it.

    Raises:
        RecipeError: if the planner cannot be used.
    """
    return next_room_by(
        ways.costs,
        here=here,
        explored=~decision.candidates(here),
        presence=decision.finds,
        look=_look(decision, look),
        task=decision.task,
        planner=find_planner(planner),
    )


def choose_likeliest(decision: Decision) -> int | None:
    """Return the node of the likeliest room, wherever it is; None if nothing is left."""
    rooms = decision.candidates()
    return int(np.where(rooms, decision.likely, -1.0).argmax()) if rooms.any() else None


def order_rooms(decision: Decision, ways: Ways, look: Floats, *, here: int) -> list[int]:
    """Return the nodes in the order in which a robot looks into them; see `choose_room`.

    Whenever other rooms have to wait, the rest is ordered anew, `_PLANS` times at most.
    """
    costs, single = ways.costs + _look(decision, look), decision.task == "single"
    left, order, plans = decision.rooms, list[int](), 0
    free = decision.candidates(here)
    while left.any():
        plans += 1
        free = free if plans <= _PLANS else left.copy()
        at = order[-1] if order else here
        for node in order_search(costs, at, free, decision.finds, single=single).tolist():
            order.append(node)
            left[node] = free[node] = False
            now = decision.candidates(among=left)
            if plans <= _PLANS and (now != free).any():
                free = now
                break
    return order


def choose_rooms(
    decision: Decision, ways: Ways, look: Floats, *, here: Sequence[int]
) -> list[int | None]:
    """Return the node that each robot goes to, so that the time until one finds it is least."""
    if len(here) == 1:
        return [choose_room(decision, ways, look, here=here[0], planner="expected-cost")]
    rooms, single = decision.candidates(*here), decision.task == "single"
    costs = np.minimum(ways.costs, _FAR) + _look(decision, look)
    # Who has just looked there leaves it to another.
    costs += np.diag(np.where(decision.just_looked(*here), _LATER, 0.0))
    chosen = send_team(costs, np.array(here), rooms, decision.finds, single=single)
    named = zip(here, chosen.tolist(), strict=True)
    return [node if node >= 0 and np.isfinite(ways.costs[at, node]) else None for at, node in named]


def _look(decision: Decision, look: Floats) -> Floats:
    return np.zeros_like(look) if decision.is_known else look
