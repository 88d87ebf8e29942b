"""Ask a model of a graph with rooms of which nothing is known, so that they empty no other room.

A network hears all rooms of a building, and twenty rooms that nobody entered would take from the
kitchen what it surely has. So the rooms of which something is known are asked about alone; one of
the others, beside them, for all of its kind. The building has what either have.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph
from bsg_robot.graph import reports

_LEAST = 1e-12  # least P(none) of which a logarithm is taken


@dataclass(frozen=True, eq=False)
class Apart:
    """What a model believes of the known rooms of a building, and of the others beside them.

    Attributes:
        every: of all nodes, `[1 + R, C]`, the building first.
        nodes: of each of the groups of rooms, one or two.
        none: `[C]` P(a group hides none), of each.
    """

    every: Expectation
    nodes: tuple[Ints, ...]
    none: tuple[Floats, ...]

    def take_classes(self, columns: Ints) -> Apart:
        """Return what it believes of some classes, `columns` `[A]`."""
        none = tuple(of_group[columns] for of_group in self.none)
        return Apart(self.every.take_classes(columns), self.nodes, none)


def expect_apart(graph: PartialGraph, known: Bools, model: Callable[..., Expectation]) -> Apart:
    """Return what a model believes of a graph of R rooms; `known` `[R]` are those it is told of.

    The model is asked about both parts at once (`bsg_models.runs.predictor`).
    """
    nodes = 1 + np.flatnonzero(known), 1 + np.flatnonzero(~known)
    if known.all() or not known.any():
        every = model(graph)
        return Apart(every, (1 + np.arange(len(known)),), (1 - every.presence[0],))
    some = _keep_rooms(graph, nodes[0] - 1)
    beside = reports.discover(some, KnownRoom("(unknown)", 1.0, visited=False))
    asked = model(some, beside)
    rows = np.zeros(1 + len(known), dtype=np.int64)
    rows[nodes[0]] = 1 + np.arange(len(nodes[0]))
    rows[nodes[1]] = len(asked.inputs) - 1  # the unknown room beside the others
    both = asked.take(rows)
    none = 1 - both.presence[0], (1 - both.presence[nodes[1]]).prod(axis=0)
    factor = np.zeros(both.inputs.shape)
    factor[0] = log_odds(none[0] * none[1]) - log_odds(none[0])
    hidden = both.hidden_counts.with_none_likelier(factor)
    inputs = graph.histograms().astype(both.inputs.dtype)
    return Apart(replace(both, inputs=inputs, hidden_counts=hidden), nodes, none)


def log_odds(probability: Floats) -> Floats:
    """Return the log odds of probabilities, also of 0 and 1."""
    certain = probability.clip(_LEAST, 1 - _LEAST)
    return np.asarray(np.log(certain) - np.log1p(-certain))


def _keep_rooms(graph: PartialGraph, rows: Ints) -> PartialGraph:
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
            (number[first], number[second])
            for first, second in graph.adjacency
            if first in number and second in number
        ),
        looks=(),
        hidden_share=float(np.mean([room.hidden_share for room in rooms])),
    )
