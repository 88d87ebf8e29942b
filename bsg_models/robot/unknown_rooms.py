"""Ask a model of a graph with rooms of which nothing is known, so that they empty no other room.

A network hears all rooms of a building, and twenty rooms that nobody entered would take from the
kitchen what it surely has. So the rooms of which something is known are asked about alone; the
others, beside them. The building has what either have.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bsg_data.arrays import Bools, Ints
from bsg_data.observation.partial_graph import PartialGraph
from bsg_models.belief.expectation import Expectation, join

_LEAST = 1e-9


def expect_beside(
    graph: PartialGraph, known: Bools, model: Callable[[PartialGraph], Expectation]
) -> Expectation:
    """Return what a model believes of a graph of R rooms; `known` `[R]` are those it is told of."""
    every = model(graph)
    if known.all() or not known.any():
        return every
    rows = np.flatnonzero(known)
    alone = model(keep_rooms(graph, rows))
    order = np.empty(1 + len(known), dtype=np.int64)
    order[[0, *(1 + rows)]] = np.arange(1 + len(rows))
    unknown = 1 + np.flatnonzero(~known)
    order[unknown] = 1 + len(rows) + np.arange(len(unknown))
    both = join([alone, every.take(unknown)]).take(order)
    none = 1 - both.presence
    whole = 1 - none[0] * (1 - every.presence[unknown]).prod(axis=0)
    wanted = np.maximum(whole, both.presence[1:].max(axis=0)).clip(_LEAST, 1 - _LEAST)
    before = both.presence[0].clip(_LEAST, 1 - _LEAST)
    factor = np.zeros(both.inputs.shape)
    factor[0] = np.log(1 - wanted) - np.log(wanted) - np.log(1 - before) + np.log(before)
    return replace(
        both, inputs=every.inputs, hidden_counts=both.hidden_counts.with_none_likelier(factor)
    )


def keep_rooms(graph: PartialGraph, rows: Ints) -> PartialGraph:
    """Return a graph with some of its rooms, 0..R−1, and what is in none."""
    number = {0: 0} | {int(row) + 1: index for index, row in enumerate(rows, 1)}
    rooms = tuple(graph.rooms[row] for row in rows)
    return replace(
        graph,
        rooms=rooms,
        objects=tuple(
            replace(obj, room_index=number[obj.room_index])
            for obj in graph.objects
            if obj.room_index in number
        ),
        adjacency=tuple(
            (number[one], number[two])
            for one, two in graph.adjacency
            if one in number and two in number
        ),
        looks=(),
        hidden_share=float(np.mean([room.hidden_share for room in rooms])),
    )
