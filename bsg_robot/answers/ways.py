"""Measure the ways between the rooms of a robot's graph, and what looks into them cost."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field, PlainValidator, WithJsonSchema

from bsg_data.arrays import Floats, Ints
from bsg_data.errors import RecipeError
from bsg_data.records import read_number
from bsg_data.words.shown import SHOWN, show_value
from bsg_models.belief.partial_graph import KnownRoom, Number, PartialGraph, spell_id
from bsg_models.search.knowledge import find_costs
from bsg_models.search.looks import USUAL_WAY, metres_of_look
from bsg_robot.answers.place import EXPLORE
from bsg_robot.answers.words import find_room

MOST_ROOMS = 2000  # limit of measured rooms: tables hold a number for each pair
MOST_PAIRS = 10_000  # of rooms, in a list of costs
_CLOSED = "closed"  # instead of a cost
Costs = Mapping[tuple[str, str], float]
AnyLook: TypeAlias = float | Mapping[str, float]  # cost of a look, into every room or some
_GivenCosts: TypeAlias = tuple[tuple[tuple[int, int], float], ...]  # of two rooms, by index
_DAY = 24.0  # hours after which half of what is sought may have come into a room
_MOST = 1e9
_MOST_USUAL = 4 * USUAL_WAY
_NOWHERE = (math.nan,) * 3
Unit = Literal["m", "rooms", "given"]  # metres, the number of rooms, or that of given costs


@dataclass(frozen=True, eq=False)
class Ways:
    """The edges between rooms, and the cheapest ways over them; the building is node 0."""

    edges: Floats  # [1 + R, 1 + R] costs ≥ 0, ∞ without an edge
    costs: Floats  # [1 + R, 1 + R] of the cheapest ways, ∞ if there is none
    unit: Unit
    usual: float  # cost of a way of which nothing is known
    metre: float  # cost of a way of one metre


def measure_ways(graph: PartialGraph, costs: Costs | None = None) -> Ways:
    """Return the costs of going from room to room.

    An edge joins rooms that the graph calls adjacent; without any adjacency, all rooms. Its cost is
    the straight distance between their positions in metres. If a position is unknown, it is the
    usual cost: the median of the others; if none is known, 1. Disconnected parts of the graph are
    joined between their nearest rooms, because a building is connected.

    `costs` of pairs of rooms replace the measured ones, in both directions; ∞ closes a way. What is
    guessed makes no way shorter than it was said.

    Raises:
        RecipeError: for too many rooms, and as `check_costs`.
    """
    if len(graph.rooms) > MOST_ROOMS:
        raise RecipeError(
            f"{graph.scene_id}: expected at most {MOST_ROOMS:,} rooms to measure ways between, "
            f"found {len(graph.rooms):,}; ask without the robot's room, or about a part of the "
            "building",
            code="rooms-too-many",
            where=graph.scene_id,
        )
    given = tuple(check_costs(graph, costs).items())
    return _measure(tuple(map(place_of, graph.rooms)), graph.adjacency, given)


@lru_cache(maxsize=2)  # one building is asked about again and again
def _measure(
    places: tuple[tuple[float, ...] | None, ...],
    adjacency: tuple[tuple[int, int], ...],
    given: _GivenCosts,
) -> Ways:
    """Return the ways between rooms at some places; `given` are costs that replace the measured."""
    lines = measure_lines(np.array([_NOWHERE, *(place or _NOWHERE for place in places)]))
    a, b = np.array(adjacency, dtype=np.int64).reshape(-1, 2).T
    if not adjacency:
        a, b = np.triu_indices(len(places), k=1) + np.ones((2, 1), dtype=np.int64)
    measured = lines[a, b][np.isfinite(lines[a, b])]
    positive = [cost for _, cost in given if 0 < cost < math.inf]
    usual = _usual_way(measured if adjacency else _nearest(lines), positive)
    certain = np.full(lines.shape, np.inf)  # edges without those that are guessed
    certain[a, b] = certain[b, a] = lines[a, b]
    edges = certain.copy()
    edges[a, b] = edges[b, a] = np.where(np.isfinite(lines[a, b]), lines[a, b], usual)
    if adjacency:
        _join_parts(edges, lines, usual)
    for (start, end), cost in given:
        for table in (edges, certain):
            table[start, end] = table[end, start] = cost
    costs = _shorten(edges, certain, given, is_joined=bool(adjacency))
    edges.flags.writeable = costs.flags.writeable = False  # others are answered by them, too
    unit: Unit = "m" if len(measured) else "given" if positive else "rooms"
    # Costs that are given beside positions are in metres, or the robot drives 1 m/s.
    return Ways(edges, costs, unit, usual, 1.0 if len(measured) else usual / USUAL_WAY)


def _shorten(edges: Floats, certain: Floats, given: _GivenCosts, *, is_joined: bool) -> Floats:
    """Return the costs of the cheapest ways; what is guessed shortens none that is certain.

    If rooms are said to be adjacent (`is_joined`), only those ways are certain that are given.
    """
    if not is_joined and not given:
        return np.where(np.eye(len(edges), dtype=bool), 0.0, edges)
    costs = find_costs(edges)
    if given:
        least = find_costs(certain)
        ends: Ints = np.argwhere(np.isfinite(least))
        if is_joined:
            ends = np.array([pair for pair, _ in given if np.isfinite(least[pair])], ends.dtype)
        a, b = ends.reshape(-1, 2).T
        costs[a, b] = costs[b, a] = least[a, b]
    return costs


def _usual_way(measured: Floats, given: list[float]) -> float:
    """Return the median of the ways that are measured, or else given; 1 if there are none.

    Of metres, it is not more than several usual ways: one garage far away says little.
    """
    lengths = measured if len(measured) else np.array(given)
    usual = float(np.quantile(lengths, 0.5, method="lower")) if len(lengths) else 1.0
    return min(usual, _MOST_USUAL) if len(measured) else usual


def _nearest(lines: Floats) -> Floats:
    """Return the distances of rooms to their nearest ones, of those with a position."""
    near = np.where(np.eye(len(lines), dtype=bool), np.inf, lines).min(axis=1, initial=np.inf)
    return np.asarray(near[np.isfinite(near)])


def check_costs(graph: PartialGraph, costs: Costs | None) -> dict[tuple[int, int], float]:
    """Return the costs of ways that a robot says, by the indices of two rooms.

    Raises:
        RecipeError: for what is no cost of 0 or more between two rooms of the graph.
    """
    is_table = isinstance(costs, Mapping | None)
    if not is_table or not all(isinstance(e, tuple) and len(e) == 2 for e in costs or ()):
        raise _refuse_costs(
            'expected two rooms → cost, such as {("hall", "kitchen"): 3.5}, found '
            f"{show_value(costs)}"
        )
    find = cache(partial(find_room, graph))  # a room that connects with many is said often
    found = {}
    for ends, cost in (costs or {}).items():
        what = f"costs: {show_value(ends[0])} to {show_value(ends[1])}"
        start, end = (find(str(room)) for room in ends)
        if start == end:
            raise _refuse_costs(f"{what}: expected two rooms; leave out the way to itself")
        found[start, end] = read_number(what, cost, most=cost if cost == math.inf else _MOST)
    return found


def add_places(ways: Ways, number: int) -> Ways:
    """Return ways with some more nodes, of which it is not known where they are.

    From anywhere, the usual way leads there. Back from there, it leads to a room in the middle of
    those that ways lead to.
    """
    rooms, known = len(ways.costs), ways.costs[1:, 1:]
    closed = ~np.isfinite(known)
    middle = np.nanmedian if closed.any() else np.median  # which is faster
    back = middle(np.where(closed, np.nan, known), axis=0) if rooms > 1 else np.zeros(0)
    costs = np.full((rooms + number, rooms + number), ways.usual)
    costs[:rooms, :rooms] = ways.costs
    costs[rooms:, 1:rooms] += back
    np.fill_diagonal(costs[rooms:, rooms:], 0.0)
    return replace(ways, costs=costs)


def list_lost(graph: PartialGraph) -> set[int]:
    """Return the nodes of rooms without place and connection, if other rooms have one."""
    joined = {end for pair in graph.adjacency for end in pair}
    lost = {
        node
        for node, room in enumerate(graph.rooms, 1)
        if node not in joined and place_of(room) is None
    }
    return lost if len(lost) < len(graph.rooms) else set()


def measure_lines(places: Floats) -> Floats:
    """Return the straight distances between places `[M, 3]`, `[M, M]`; ∞ where one is unknown."""
    squares = [(axis[:, None] - axis) ** 2 for axis in places.T]
    lines = np.sqrt(sum(squares))
    return np.where(np.isnan(lines), np.inf, lines)


def place_of(room: KnownRoom) -> tuple[float, ...] | None:
    """Return the position of a room, or the middle of its box; None if neither is known."""
    if room.position is not None or room.box is None:
        return room.position
    return tuple((np.add(room.box.minimum, room.box.maximum) / 2).tolist())


def _join_parts(edges: Floats, lines: Floats, usual: float) -> None:
    """Join the parts of a graph between their nearest rooms, by a minimum spanning tree.

    A part of which no place is known is joined to the first room.
    """
    joined, known = np.isfinite(edges), np.isfinite(lines)
    last = np.max(lines, where=known, initial=0) + np.arange(1.0, lines.size + 1)
    weights = np.where(known, lines, last.reshape(lines.shape)) + 1
    weights[joined] = 0.5  # an edge of the graph comes first
    weights = np.triu(weights, k=1)
    weights += weights.T
    near, nearest = weights[1].copy(), np.ones(len(weights), dtype=np.int64)
    near[[0, 1]] = np.inf
    for _ in range(len(weights) - 2):  # Prim's: the tree grows by the room that is nearest to it
        b = int(near.argmin())
        a = nearest[b]
        if not joined[a, b]:
            edges[a, b] = edges[b, a] = lines[a, b] if known[a, b] else 2 * usual
        closer = (weights[b] < near) & np.isfinite(near)
        near[closer], nearest[closer] = weights[b, closer], b
        near[b] = np.inf


def _check_look(look: Any) -> AnyLook | None:
    """Return what a robot says of the cost of its looks: a number, or room → number.

    Raises:
        RecipeError: for a cost that is no number of 0 or more.
    """
    if look is None:
        return None
    if not isinstance(look, Mapping):
        return read_number("look", look, most=_MOST)
    return {
        str(name): read_number(f"look: {str(name)[:SHOWN]!r}", cost, most=_MOST)
        for name, cost in look.items()
    }


def read_costs(rows: Any) -> Costs | None:
    """Return the costs of ways from a list of [room, room, cost]; `closed` is ∞.

    Raises:
        RecipeError: for another form, a cost that is no number of 0 or more, or two of one way.
    """
    if rows is None:
        return None
    form = f'[room, room, cost or "{_CLOSED}"]'
    if not isinstance(rows, list | tuple) or len(rows) > MOST_PAIRS:
        raise _refuse_costs(
            f"expected a list of at most {MOST_PAIRS:,} {form}, found {show_value(rows)}"
        )
    costs: dict[tuple[str, str], float] = {}
    for row in rows:
        ends = [*map(spell_id, row[:2])] if isinstance(row, list | tuple) else []
        if len(ends) != 2 or len(row) != 3 or not all(isinstance(room, str) for room in ends):
            raise _refuse_costs(f"expected {form}, found {show_value(row)}")
        what = " to ".join(map(show_value, ends))
        cost, wanted = row[2], f"0 to {_MOST:g}, or {_CLOSED!r}"
        if cost == _CLOSED:
            cost = math.inf
        else:
            cost = read_number(f"costs: {what}", cost, most=_MOST, wanted=wanted)
        start, end = ends
        if costs.get((start, end), cost) != cost or costs.get((end, start), cost) != cost:
            raise _refuse_costs(f"{what}: two different ones; leave one out")
        costs[start, end] = cost
    return costs


def _refuse_costs(what: str) -> RecipeError:
    return RecipeError(f"costs: {what}", code="costs-malformed", where="costs")


_COST = {"type": "number", "minimum": 0}
_WAY = {"type": "array", "minItems": 3, "maxItems": 3}
_WAY |= {"items": {"anyOf": [{"type": "string"}, _COST]}}
SaidCosts = Annotated[
    Costs | None,
    PlainValidator(read_costs),
    WithJsonSchema(
        {"anyOf": [{"type": "array", "maxItems": MOST_PAIRS, "items": _WAY}, {"type": "null"}]}
    ),
]
SaidCost = Annotated[float, Number, Field(ge=0, le=_MOST)]  # of a look at a piece, or of all
SaidSpeed = Annotated[float, Number, Field(ge=1e-6, le=_MOST)]  # metres a second
SaidLook = Annotated[  # as a field of what people and programs ask
    AnyLook | None,
    PlainValidator(_check_look),
    WithJsonSchema(
        {"anyOf": [_COST, {"type": "object", "additionalProperties": _COST}, {"type": "null"}]}
    ),
]


def cost_looks(graph: PartialGraph, ways: Ways, look: AnyLook | None = None) -> Floats:
    """Return the cost of a look in each room, and in one not found yet, `[1 + R + 1]`.

    The usual cost is that of `metres_of_look`, for the share of the room that was not seen. Where
    ways are not in metres, one between rooms that connect counts as long as in HM3D.

    Args:
        graph: what is known of the rooms.
        ways: between them.
        look: of every room; or by room id or label, and `explore` for rooms not found yet, where
            the others keep their usual cost; None for the usual costs.

    Raises:
        RecipeError: if a cost is not a number of 0 or more, or a name means no room.
    """
    look = _check_look(look)
    if look is not None and not isinstance(look, Mapping):
        return np.full(2 + len(graph.rooms), look)
    hidden = np.array([room.hidden_share for room in graph.rooms])
    shares = 1 - (1 - hidden) * graph.still_so(np.array(_DAY))
    metres = [metres_of_look(r.area, share=s) for r, s in zip(graph.rooms, shares, strict=True)]
    costs = np.array([0.0, *metres, metres_of_look(None)]) * ways.metre
    for name, cost in (look or {}).items():
        costs[-1 if name == EXPLORE else find_room(graph, name)] = cost
    return costs
