"""Planners: from what a robot knows to the room where it goes next.

Each is a function of `Knowledge` of E searches at once that returns a node for each, `[E]`. What a
robot does not know is not in `Knowledge`. What each optimises:

| planner | goes to | reads |
|---|---|---|
| `nearest` | the unexplored room that is cheapest to reach (the paper's Dijkstra on 𝒢) | costs |
| `random` | the unexplored rooms in random order | nothing |
| `greedy-share` | the room with the greatest E″(α), the paper's rule literally | belief |
| `greedy-belief` | the room that most likely holds an instance | belief |
| `ratio` | the room with the most probability of an instance per cost of going there | both |
| `expected-cost` | the first room of the order with the least expected cost | both |
| `routing` | the same if one instance were anywhere with the same probability: no belief | costs |
| `oracle` | the first room of the cheapest way that finds what is sought | the truth |

With several classes the first six work on the probability that a room holds any that is still to
be found, and the orders on when all are found. Ties go to the room with the lowest index.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from bsg_data.errors import RecipeError
from bsg_models.search.orders import choose_cover, choose_rooms, plan_tours
from bsg_models.search.shortest_paths import Bools, Floats, Ints, Travel, find_ways

Task = Literal["single", "all"]
Reads = Literal["none", "belief", "truth"]
_ALIKE = 1e-4  # presence of one instance that may be anywhere
_ORACLE_EXACT, _ORACLE_KICKS = 12, 200


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What E robots know in the middle of their searches of one building.

    Attributes:
        task: whether one instance of each class is enough, or all are to be found.
        here: `[E]` node of the robot.
        travel: of all searches of the building.
        rows: `[E]` which of them these are.
        unexplored: `[E, N]` rooms that it can reach and has not entered.
        wanted: `[E, A]` classes still to be found.
        presence: `[E, N, A]` believed P(at least one instance); of unexplored rooms alone.
        share: `[E, N, A]` believed E″(α), the class's share of the room's objects.
        lots: `[E, N]` random numbers, for a planner that draws lots.
        tour: `[E, N]` places of the rooms in the oracle's tour; nobody else is given one.
    """

    task: Task
    here: Ints
    travel: Travel
    rows: Ints
    unexplored: Bools
    wanted: Bools
    presence: Floats
    share: Floats
    lots: Floats
    tour: Ints | None = None

    @property
    def distance(self) -> Floats:
        """Cost of going to each node, `[E, N]`."""
        return np.asarray(self.travel.costs[self.rows, self.here])

    @property
    def costs(self) -> Floats:
        """Cost of the cheapest way between any two nodes, `[E, N, N]`."""
        return np.asarray(self.travel.costs[self.rows])

    @property
    def any_presence(self) -> Floats:
        """P(at least one instance of any class that is still to be found), `[E, N]`."""
        return np.asarray(1 - np.where(self.wanted[:, None], 1 - self.presence, 1.0).prod(axis=2))

    @property
    def left(self) -> Floats:
        """P(at least one instance in the unexplored rooms), rooms being independent, `[E]`."""
        return np.asarray(1 - np.where(self.unexplored, 1 - self.any_presence, 1.0).prod(axis=1))


def nearest(known: Knowledge) -> Ints:
    """Go to the unexplored room that is cheapest to reach."""
    return _best(known, -known.distance)


def random_order(known: Knowledge) -> Ints:
    """Go to the unexplored rooms in random order."""
    return _best(known, known.lots)


def greedy_share(known: Knowledge) -> Ints:
    """Go to the room with the greatest share of the class in the expected histogram, max E″(α)."""
    return _best(known, np.where(known.wanted[:, None], known.share, 0.0).sum(axis=2))


def greedy_belief(known: Knowledge) -> Ints:
    """Go to the room that most likely holds an instance."""
    return _best(known, known.any_presence)


def ratio(known: Knowledge) -> Ints:
    """Go to the room with the most probability of an instance per cost."""
    return _best(known, known.any_presence / np.maximum(known.distance, 1e-9))


def expected_cost(known: Knowledge) -> Ints:
    """Go to the first room of the order that minimises the expected cost of the search."""
    return choose_rooms(
        known.costs,
        known.here,
        known.unexplored,
        known.presence,
        wanted=known.wanted,
        single=known.task == "single",
    )


def routing(known: Knowledge) -> Ints:
    """Do as `expected_cost` would if no room were likelier than another: what routes alone save."""
    return choose_rooms(
        known.costs,
        known.here,
        known.unexplored,
        np.full((*known.unexplored.shape, 1), _ALIKE),
        wanted=np.ones((len(known.here), 1), dtype=bool),
        single=known.task == "single",
    )


def oracle(known: Knowledge) -> Ints:
    """Go the cheapest way that finds what is sought; `presence` is the truth.

    In `single` it is exact, in `all` it follows the tour that it planned at the start.
    """
    if known.tour is not None:
        return _best(known, np.where(known.any_presence > 0.5, -known.tour, -np.inf))
    return choose_cover(known.costs, known.here, known.presence > 0.5, wanted=known.wanted)


def plan_tour(travel: Travel, here: Ints, holds: Bools) -> Ints:
    """Return the places `[E, N]` of the rooms that hold an artifact `[E, N]` in the oracle's tour.

    Exact up to twelve rooms; beyond, the best of 200 improved orders.
    """
    return plan_tours(travel.costs, here, holds, exact=_ORACLE_EXACT, kicks=_ORACLE_KICKS)


def next_room(
    edges: Floats,
    *,
    here: int,
    explored: Bools,
    presence: Floats,
    task: Task = "single",
    planner: str = "expected-cost",
) -> int | None:
    """Return where a robot should go next, for one search of its own.

    Args:
        edges: `[N, N]` costs ≥ 0 between nodes, ∞ where there is no edge; the building is node 0.
        here: node of the robot.
        explored: `[N]` rooms that it has searched.
        presence: `[N]` or `[N, A]` P(at least one hidden instance) of what it still looks for, such
            as a column of `Expectation.presence`.
        task: `single` or `all`.
        planner: that reads presence or costs alone.

    Returns:
        a room; None if no unexplored one can be reached.

    Raises:
        RecipeError: for a planner that needs what is not given here, and for arrays of other shapes
            or values.
    """
    edges, presence = np.asarray(edges, dtype=float), np.asarray(presence, dtype=float)
    nodes = len(edges)
    if edges.shape != (nodes, nodes) or not (edges >= 0).all():
        raise RecipeError(f"edges {list(edges.shape)}: expected costs of 0 or more, [N, N]")
    if presence.shape[:1] != (nodes,) or not ((presence >= 0) & (presence <= 1)).all():
        raise RecipeError(f"presence {list(presence.shape)}: expected probabilities, [{nodes}, A]")
    if np.shape(explored) != (nodes,) or not 0 <= here < nodes:
        raise RecipeError(
            f"explored {list(np.shape(explored))}, here {here}: expected {nodes} nodes"
        )
    if task not in ("single", "all"):
        raise RecipeError(f"task {task!r}: give single or all")
    if planner not in PLANNERS or planner in ("random", "greedy-share", "oracle"):
        raise RecipeError(
            f"planner {planner!r}: give nearest, greedy-belief, ratio, routing or expected-cost"
        )
    travel = find_ways(edges[None])
    unexplored = ~np.asarray(explored, dtype=bool) & np.isfinite(travel.costs[0, here])
    unexplored[0] = False
    if not unexplored.any():
        return None
    likely = np.where(unexplored[:, None], np.reshape(presence, (len(unexplored), -1)), 0.0)
    known = Knowledge(
        task=task,
        here=np.array([here]),
        travel=travel,
        rows=np.array([0]),
        unexplored=unexplored[None],
        wanted=np.ones((1, likely.shape[1]), dtype=bool),
        presence=likely[None],
        share=likely[None],
        lots=np.zeros((1, len(unexplored))),
    )
    return int(PLANNERS[planner].choose(known)[0])


def _best(known: Knowledge, score: Floats) -> Ints:
    """Return the unexplored room with the highest score, the lowest index among equals."""
    return np.asarray(np.where(known.unexplored, score, -np.inf).argmax(axis=1))


@dataclass(frozen=True, slots=True)
class Planner:
    """A planner of the table above: its function, and whose presence it is given."""

    choose: Callable[[Knowledge], Ints]
    reads: Reads


PLANNERS: Mapping[str, Planner] = MappingProxyType(
    {
        "nearest": Planner(nearest, "none"),
        "random": Planner(random_order, "none"),
        "greedy-share": Planner(greedy_share, "belief"),
        "greedy-belief": Planner(greedy_belief, "belief"),
        "ratio": Planner(ratio, "belief"),
        "expected-cost": Planner(expected_cost, "belief"),
        "routing": Planner(routing, "none"),
        "oracle": Planner(oracle, "truth"),
    }
)
