"""Define the planners: functions from what a robot knows to the room where it goes next.

Each takes `Knowledge` of E searches at once and returns a node for each, `[E]`. `Knowledge` holds
nothing that a robot does not know. With several classes, a planner uses the probability that a room
holds any class still to be found. The orders of `expected-cost` and `routing` instead depend on
when all are found. Ties go to the room with the lowest index.
"""

from __future__ import annotations

from typing import NoReturn, get_args

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.errors import RecipeError
from bsg_data.words.shown import show_value
from bsg_models.search.catalogue import AnyPlanner, Planner, find_planner
from bsg_models.search.knowledge import Knowledge, Task, find_costs
from bsg_models.search.plans import by_number, plan_search, take_ways
from bsg_models.search.problem import LEAST, LEAST_FIND, pose_search

_ALIKE = 1e-4  # presence in every room, for one instance that may be anywhere


def nearest(known: Knowledge) -> Ints:
    """Go to the unexplored room that is cheapest to reach: the paper's Dijkstra on 𝒢."""
    return _best(known, -known.distance)


def greedy_share(known: Knowledge) -> Ints:
    """Go to the room with the greatest E″(α), the class's share of the objects expected there."""
    if known.share is None:
        raise RecipeError(
            "greedy-share reads E″(α), the share of the class in each room: give share",
            code="share-missing",
            where="greedy-share",
        )
    return _best(known, np.where(known.wanted[:, None], known.share, 0.0).sum(axis=2))


def greedy_belief(known: Knowledge) -> Ints:
    """Go to the room that most likely holds an instance."""
    return _best(known, known.any_presence)


def ratio(known: Knowledge) -> Ints:
    """Go to the room with the highest probability of an instance per cost of finding it there."""
    return _best(known, known.any_presence / np.maximum(_leg(known), 1e-9))


def expected_cost(known: Knowledge) -> Ints:
    """Go to the first room of the order with the least expected cost."""
    finds = known.presence[:, None]
    if known.again is None:
        finds = finds.clip(LEAST)
    else:
        finds = np.concatenate([finds, known.again], axis=1).clip(LEAST_FIND)
    return _plan_first(known, np.where(known.wanted[:, None, None], finds, 0.0))


def routing(known: Knowledge) -> Ints:
    """Do as `expected-cost` if one instance were equally likely in every room."""
    searches, nodes = known.unexplored.shape
    return _plan_first(known, np.full((searches, 1, nodes, 1), _ALIKE))


def oracle(known: Knowledge) -> Ints:
    """Go the cheapest way that finds what is sought, with knowledge of the truth.

    Its `presence` is the truth. For `single` it is exact, for one class; for `all` it follows a
    tour planned at the start.
    """
    way = _leg(known) if known.tour is None else known.tour
    return _best(known, np.where(known.any_presence > 0.5, -way, -np.inf))


NEAREST = Planner(nearest, "none", so_that="the next leg is short")
GREEDY_SHARE = Planner(greedy_share, "belief", so_that="the search follows the paper's rule")
GREEDY_BELIEF = Planner(greedy_belief, "belief", so_that="few rooms are entered, however far apart")
RATIO = Planner(ratio, "belief", so_that="each leg gains much for its cost")
EXPECTED_COST = Planner(expected_cost, "belief", so_that="the whole search is short")
ROUTING = Planner(routing, "none", so_that="you see how much good routes save without a belief")
ORACLE = Planner(oracle, "truth", so_that="no planner is better")


def next_room(
    edges: Floats,
    *,
    here: int,
    explored: Bools,
    presence: Floats,
    share: Floats | None = None,
    look: Floats | None = None,
    task: Task = "single",
    planner: AnyPlanner = "expected-cost",
) -> int | None:
    """Return where a robot should go next, in one search.

    Args:
        edges: `[N, N]` costs ≥ 0 between nodes, ∞ without an edge; the building is node 0.
        here: node of the robot.
        explored: `[N]` rooms that it has searched.
        presence: `[N]` or `[N, A]` P(a look finds at least one) of what it still looks for, such
            as a column of `Expectation.presence`.
        share: E″(α) in the same shape, such as a column of `Expectation.distribution`; only
            `greedy-share` reads it.
        look: `[N]` cost of a look in each room, in the unit of the edges; None if it is nothing.
        task: `single` or `all`.
        planner: a name of `PLANNERS`, a `Planner`, or a function of `Knowledge`; it must not read
            the truth.

    Returns:
        A room; None if no unexplored room can be reached.

    Raises:
        RecipeError: if the planner needs something that is not given, or names a room that is not
            unexplored; or if an array has another shape or invalid values.
    """
    edges, presence = np.asarray(edges, dtype=float), np.asarray(presence, dtype=float)
    nodes = len(edges)
    if edges.shape != (nodes, nodes) or not (edges >= 0).all():
        _refuse_array("edges", edges, "costs of 0 or more, [N, N]")
    if presence.shape[:1] != (nodes,) or not ((presence >= 0) & (presence <= 1)).all():
        _refuse_array("presence", presence, f"probabilities, [{nodes}, A]")
    if share is not None and np.shape(share) != presence.shape:
        _refuse_array("share", share, f"{list(presence.shape)}")
    if look is not None and (np.shape(look) != (nodes,) or not np.all(np.asarray(look) >= 0)):
        _refuse_array("look", look, f"costs of 0 or more, [{nodes}]")
    if np.shape(explored) != (nodes,) or not 0 <= here < nodes:
        _refuse_array("explored", explored, f"[{nodes}], and here, {here}, among them")
    require_task(task)
    return next_room_by(
        find_costs(edges),
        here=here,
        explored=np.asarray(explored, dtype=bool),
        presence=presence,
        share=share,
        look=look,
        task=task,
        planner=planner,
    )


def require_task(task: object) -> None:
    """Refuse what is no task."""
    if not isinstance(task, str) or task not in get_args(Task):
        raise RecipeError(
            f"task {show_value(task)}: expected single or all", code="task-unknown", where="task"
        )


def next_room_by(
    costs: Floats,
    *,
    here: int,
    explored: Bools,
    presence: Floats,
    share: Floats | None = None,
    look: Floats | None = None,
    task: Task = "single",
    planner: AnyPlanner = "expected-cost",
) -> int | None:
    """Return what `next_room` does, by the costs `[N, N]` of the cheapest ways in its graph."""
    chosen, nodes = find_planner(planner), len(explored)
    if chosen.reads == "truth":
        raise RecipeError(
            f"planner {planner!r} reads the truth, which no robot knows; use expected-cost instead",
            code="planner-reads-truth",
            where=planner,
        )
    unexplored = ~explored & np.isfinite(costs[here])
    unexplored[0] = False
    if not unexplored.any():
        return None
    open_ = unexplored[:, None]
    likely = np.where(open_, np.reshape(presence, (nodes, -1)), 0.0)
    if share is not None:
        share = np.where(open_, np.reshape(share, likely.shape), 0.0)[None]
    known = Knowledge(
        task=task,
        here=np.array([here]),
        ways=costs[None],
        rows=np.array([0]),
        unexplored=unexplored[None],
        wanted=np.ones((1, likely.shape[1]), dtype=bool),
        presence=likely[None],
        share=share,
        look=None if look is None else np.asarray(look, dtype=float)[None],
    )
    return int(ask_planner(chosen, known)[0])


def ask_planner(planner: Planner, known: Knowledge) -> Ints:
    """Return the rooms `[E]` that a planner names."""
    target = np.asarray(planner.choose(known))
    number, nodes = known.unexplored.shape
    right = target.shape == (number,) and np.issubdtype(target.dtype, np.integer)
    if right and ((target >= 0) & (target < nodes)).all():
        right = bool(known.unexplored[np.arange(number), target].all())
    else:
        right = False
    if not right:
        name = getattr(planner.choose, "__name__", repr(planner.choose))
        raise RecipeError(
            f"planner {name}: expected a room of `unexplored` for each of {number} searches, "
            f"found {show_value(target.tolist())}",
            code="planner-names-no-room",
            where=name,
        )
    return target


def _refuse_array(name: str, found: object, expected: str) -> NoReturn:
    shape = list(np.asarray(found).shape)
    raise RecipeError(f"{name} {shape}: expected {expected}", code="array-misshapen", where=name)


def _leg(known: Knowledge) -> Floats:
    """Return the cost of going to each node and looking there, `[E, N]`."""
    return known.distance if known.look is None else known.distance + known.look


def _best(known: Knowledge, score: Floats) -> Ints:
    """Return the unexplored room with the highest score; ties go to the lowest index."""
    return np.asarray(np.where(known.unexplored, score, -np.inf).argmax(axis=1))


def _plan_first(known: Knowledge, finds: Floats) -> Ints:
    """Return the first rooms of the plans that cost least, `[E]`; −1 without rooms.

    Args:
        known: about E searches.
        finds: `[E, L, N, A]` P(the first look into a room finds it; only the second does; …).
    """
    first = np.full(len(known.here), -1)
    look = np.zeros(known.unexplored.shape) if known.look is None else known.look
    for some, rooms in by_number(known.unexplored):
        problem, place = pose_search(
            take_ways(known.ways, known.here[some], known.rows[some], rooms),
            np.take_along_axis(finds[some], rooms[:, None, :, None], axis=2),
            look=look[some[:, None], rooms],
            single=known.task == "single",
        )
        every = np.arange(len(some))
        first[some] = rooms[every, place[every, plan_search(problem)[:, 0]]]
    return first
