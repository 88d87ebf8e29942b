"""Measure the costs of going from room to room in a robot's graph."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, shortest_path
from scipy.spatial.distance import cdist

from bsg_data.arrays import Floats
from bsg_data.errors import RecipeError
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph
from bsg_data.recipes import read_number
from bsg_models.robot.rooms import find_room

MOST_ROOMS = 2000  # limit of measured rooms: tables hold a number for each pair
Unit = Literal["m", "rooms", "given"]
Costs = Mapping[tuple[str, str], float]


@dataclass(frozen=True, eq=False)
class Ways:
    """The edges between rooms, and the cheapest ways over them.

    Attributes:
        edges: `[1 + R, 1 + R]` costs ≥ 0, ∞ without an edge; the building is node 0.
        costs: `[1 + R, 1 + R]` of the cheapest way; ∞ if there is none.
        unit: metres, the number of rooms, or the unit of the given costs.
    """

    edges: Floats
    costs: Floats
    unit: Unit


def measure_ways(graph: PartialGraph, costs: Costs | None = None) -> Ways:
    """Return the costs of going from room to room.

    An edge joins rooms that the graph calls adjacent; without any adjacency, all rooms. Its cost is
    the straight distance between their positions in metres. If a position is unknown, the cost is
    the mean of the known edges; if none is known, 1. Disconnected parts of the graph are joined
    between their nearest rooms, because a building is connected.

    Args:
        graph: with R rooms.
        costs: (room, room) → cost of the edge between them in both directions, replacing the
            measured one; ∞ closes a way.

    Raises:
        RecipeError: if a room is unknown, a cost is not 0 or more, or there are more than 2,000
            rooms.
    """
    rooms = len(graph.rooms)
    if rooms > MOST_ROOMS:
        raise RecipeError(
            f"{graph.scene_id}: expected at most {MOST_ROOMS:,} rooms to measure ways between, "
            f"found {rooms:,}; ask without the robot's room, or about a part of the building",
            code="rooms-too-many",
            where=graph.scene_id,
        )
    lines = _straight_lines(graph)
    pairs = np.array(graph.adjacency, dtype=np.int64).reshape(-1, 2)
    if not len(pairs):
        pairs = np.argwhere(np.triu(np.ones((rooms, rooms), dtype=bool), k=1)) + 1
    lengths = lines[pairs[:, 0], pairs[:, 1]]
    known = lengths[np.isfinite(lengths)]
    usual = float(np.mean(known)) if len(known) else 1.0
    lengths = np.where(np.isfinite(lengths), lengths, usual)
    edges = np.full(lines.shape, np.inf)
    edges[pairs[:, 0], pairs[:, 1]] = edges[pairs[:, 1], pairs[:, 0]] = lengths
    _join_parts(edges, lines, usual)
    if costs is not None:
        _lay_over(edges, graph, costs)
    unit: Unit = "given" if costs else "m" if len(known) else "rooms"
    straight = not graph.adjacency and costs is None
    ways = _go_straight(edges, lines, usual) if straight else _find_cheapest(edges)
    return Ways(edges, ways, unit)


def _go_straight(edges: Floats, lines: Floats, usual: float) -> Floats:
    """Return the costs of the cheapest ways where all rooms connect and nothing is in the way.

    A straight line is the cheapest way. Only a room whose place is unknown can shorten it: it is
    `usual` from every room.
    """
    some_unknown = np.isinf(np.diagonal(lines)[1:]).any()
    ways = np.minimum(edges, 2 * usual) if some_unknown and len(edges) > 3 else edges.copy()
    ways[0, 1:] = ways[1:, 0] = np.inf
    np.fill_diagonal(ways, 0)
    return ways


def _find_cheapest(edges: Floats) -> Floats:
    """Return the costs of the cheapest ways over edges `[N, N]`; ∞ if there is none."""
    source, target = np.nonzero(np.isfinite(edges))  # an edge may cost 0
    listed = csr_array((edges[source, target], (source, target)), shape=edges.shape)
    return np.asarray(shortest_path(listed))


def _lay_over(edges: Floats, graph: PartialGraph, costs: Costs) -> None:
    for ends, cost in costs.items():
        a, b = (find_room(graph, end) for end in ends)
        what = f"costs: {ends[0]!r} to {ends[1]!r}"
        edges[a, b] = edges[b, a] = read_number(what, cost, most=math.inf)


def _straight_lines(graph: PartialGraph) -> Floats:
    """Return the metres between the positions of rooms, `[1 + R, 1 + R]`; ∞ if one is unknown."""
    places = np.full((len(graph.rooms) + 1, 3), np.nan)
    for number, room in enumerate(graph.rooms, 1):
        places[number] = _place_of(room)
    lines = cdist(places, places)
    return np.where(np.isnan(lines), np.inf, lines)


def _place_of(room: KnownRoom) -> tuple[float, ...]:
    """Return the position of a room, else the middle of its box; NaN if both are unknown."""
    if room.position is not None:
        return room.position
    if room.box is None:
        return (np.nan, np.nan, np.nan)
    return tuple((np.add(room.box.minimum, room.box.maximum) / 2).tolist())


def _join_parts(edges: Floats, lines: Floats, usual: float) -> None:
    """Join the parts of a graph between their nearest rooms, one part after another.

    This is Prim's algorithm over parts: it looks at each pair of rooms once. Of pairs that are
    equally near, the one with the lowest numbers is joined.
    """
    if len(edges) < 2:
        return
    part = np.append(-1, connected_components(np.isfinite(edges[1:, 1:]), directed=False)[1])
    outside = part >= 0
    nearest = np.full(len(edges), np.inf)  # metres from the joined rooms to each room
    via = np.full(len(edges), len(edges))  # the joined room that is so near
    joined = part == part[1]
    while True:
        for room in np.flatnonzero(joined):
            closer = lines[room] < nearest
            closer |= (lines[room] == nearest) & (via > room)
            nearest[closer], via[closer] = lines[room, closer], room
        outside &= ~joined
        if not outside.any():
            return
        length = float(nearest[outside].min())
        if np.isfinite(length):
            tied = np.flatnonzero(outside & (nearest == length))
            b = tied[via[tied].argmin()]
            a = via[b]
        else:
            a, b, length = 1, outside.argmax(), 2 * usual
        edges[a, b] = edges[b, a] = length
        joined = part == part[b]
