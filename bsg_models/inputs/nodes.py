"""An observation as arrays: the one form that networks read, in training and in answers.

They are arrays of NumPy in an answer, and tensors of torch in a training (`Nodes.to`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np

from bsg_data.arrays import Counts, Ints
from bsg_data.observation.observation import Observation
from bsg_data.scene.surroundings import BUILDING_KINDS, KNOWN_SOURCES, Surroundings
from bsg_models.arrays import Array, add_rows, doubles, floats, library_of

_SILENT_NEIGHBOURS = 4.0  # of features 0, added to each mean: one room says little of the next
_USUAL_AREA = 12.0  # m² of a room, whose logarithm counts as 0
# Of a building's kind and source, so that what is learned in shops stays there: restaurants have
# several refrigerators, and a home was believed to have another with .13, now with .05.
_MARK_SCALE = 4.0
_Form = TypeVar("_Form", bound="_Arrays")


class _Arrays:
    """A dataclass of arrays, which may be nested."""

    def to(self: _Form, device: Any) -> _Form:
        """Return it as tensors of torch on a device."""
        names = [field.name for field in fields(self)]  # type: ignore[arg-type]
        return type(self)(**{name: _move(getattr(self, name), device) for name in names})


@dataclass(frozen=True, eq=False, slots=True)
class Nodes(_Arrays):
    """N nodes of interest of B buildings, C classes; a building's rows are its own, then rooms."""

    x: Array  # [N, C] counts that were seen
    y: Array  # [N, C] true counts, below 0 where there is none; [0, C] if not given
    hiding: Array  # [P] places, of N · C, of the cells of which objects are hidden
    neighbours: Neighbours
    building: Array  # [N] number of each node's building
    first: Array  # [B] row of each building's own node
    is_building: Array  # [N]
    visited: Array  # [N]
    hidden_share: Array  # [N]
    share: Array  # [N, C] hidden share by node and class, as `Observation.cell_share`
    unclassified: Array  # [N, V] seen objects outside the classes
    evidence: dict[str, Array]  # [N, width] of rows of `EVIDENCE`

    @property
    def known(self) -> Array:
        """Whether the true count is known, `[N, C]`: the source has a word for the class."""
        return self.y >= 0


@dataclass(frozen=True)
class _Encoding:
    """How networks read what is known of a room, or of its building, besides objects."""

    encode: Callable[[Surroundings], Array]  # [N or B, width] of order one; 0 if unknown
    of_building: bool = False

    def width(self) -> int:
        """Return the number of features."""
        return int(self.encode(Surroundings.unknown(nodes=1)).shape[1])


def to_nodes(
    seen: Observation,
    *,
    edges: Collection[str] = (),
    targets: Counts | None = None,
    reads: Collection[str] = (),
) -> Nodes:
    """Return an observation as arrays, with true counts `[N, C]` and the evidence that is read.

    Edges are `up` from rooms to the building, `down` from it to rooms, both ways between rooms that
    are known to connect (`adjacent`), or between all rooms of a building (`complete`).
    """
    building = seen.building
    evidence = {}
    for name in EVIDENCE.keys() & reads:
        values = EVIDENCE[name].encode(seen.surroundings)
        evidence[name] = values[building] if EVIDENCE[name].of_building else values
    return Nodes(
        x=floats(seen.inputs),
        y=floats(seen.inputs[:0] if targets is None else targets),
        hiding=np.flatnonzero(() if targets is None else targets > seen.inputs),
        neighbours=Neighbours.of(seen, edges),
        building=building,
        first=seen.starts[:-1],
        is_building=seen.is_building,
        visited=seen.visited,
        hidden_share=seen.hidden_share,
        share=floats(seen.cell_share),
        unclassified=floats(seen.unclassified),
        evidence=evidence,
    )


def list_edges(seen: Observation, edges: Collection[str]) -> Ints:
    """Return the directed edges of all buildings by row, `[2, E]`, sorted and each once."""
    rooms, nodes = np.flatnonzero(~seen.is_building), len(seen.inputs)
    buildings = seen.starts[seen.building[rooms]]
    parts = [np.zeros((2, 0), dtype=np.int64)]
    if "up" in edges:
        parts.append(np.stack([rooms, buildings]))
    if "down" in edges:
        parts.append(np.stack([buildings, rooms]))
    if "adjacent" in edges:
        pairs = seen.connections.pairs.T
        parts += [pairs, pairs[::-1]]
    if "complete" in edges:
        others, starts = seen.rows_of(seen.building[rooms])
        every = np.stack([rooms.repeat(np.diff(starts)), others])
        parts.append(every[:, (every[0] != others) & ~seen.is_building[others]])
    source, target = np.concatenate(parts, axis=1)
    numbers = np.sort(source * nodes + target, kind="stable")  # fast, as they are nearly sorted
    is_first = np.diff(numbers, prepend=-1) > 0
    return np.stack(np.divmod(numbers[is_first], nodes))


@dataclass(frozen=True, eq=False, slots=True)
class Neighbours(_Arrays):
    """The neighbours of every node, as weights of three sums instead of a list of edges.

    If every room sees every other, R rooms have R (R − 1) edges: 9 million for 3,000 rooms.
    Their means need none: mean of the others of i = (Σ_j h_j − h_i) / (R − 1 + s). The s silent
    neighbours shrink the mean of few, so that a network is not sure of a building after one room.
    """

    building: Array  # [N] number of each node's building
    first: Array  # [B] row of each building's own node
    of_rooms: Array  # [N, 1] weight of the sum over all rooms of the building
    of_itself: Array  # [N, 1] weight of the node itself
    of_building: Array  # [N, 1] weight of the building's own node
    pairs: Array  # [2, A] other edges, from and to
    of_pairs: Array  # [A, 1] weight of the first node of each pair for the second

    @classmethod
    def of(cls, seen: Observation, edges: Collection[str]) -> Neighbours:
        """Return the same neighbours as those of `list_edges`."""
        adjacent = "adjacent" in edges and "complete" not in edges
        return cls.weigh(
            building=seen.building,
            first=seen.starts[:-1],
            is_building=seen.is_building,
            rooms=np.diff(seen.starts)[seen.building] - 1,
            pairs=list_edges(seen, ("adjacent",)) if adjacent else np.zeros((2, 0), np.int64),
            edges=edges,
        )

    @classmethod
    def weigh(
        cls,
        *,
        building: Array,
        first: Array,
        is_building: Array,
        rooms: Array,
        pairs: Array,
        edges: Collection[str],
    ) -> Neighbours:
        """Return the neighbours of nodes of buildings with some `rooms` each, `[N]`."""
        xp = library_of(is_building)
        complete = ~is_building & ("complete" in edges)
        down = ~is_building & ("down" in edges)
        up = is_building & ("up" in edges)
        number = xp.where(complete, rooms - 1, 0) + xp.where(up, rooms, 0) + doubles(down)
        if pairs.shape[1]:
            number = add_rows(number, pairs[1], xp.ones_like(doubles(pairs[1])))
        weight = 1 / (number + _SILENT_NEIGHBOURS)
        return cls(
            building=building,
            first=first,
            of_rooms=floats(weight * (complete | up))[:, None],
            of_itself=floats(-weight * complete)[:, None],
            of_building=floats(weight * down)[:, None],
            pairs=pairs,
            of_pairs=floats(weight[pairs[1]])[:, None],
        )

    def mean(self, h: Array, rows: Any = slice(None)) -> Array:
        """Return the shrunk mean of the neighbours of every node, or some, `[N, W]` of `[N, W]`."""
        buildings = h[self.first]
        rooms = floats(sum_buildings(h, self, exactly=True) - buildings)[self.building][rows]
        mean = self.of_rooms[rows] * rooms + self.of_itself[rows] * h[rows]
        mean = mean + self.of_building[rows] * buildings[self.building][rows]
        if self.pairs.shape[1]:
            heard = add_rows(0 * h, self.pairs[1], self.of_pairs * h[self.pairs[0]])
            mean = mean + heard[rows]
        return mean


def sum_buildings(values: Array, nodes: Nodes | Neighbours, *, exactly: bool = False) -> Array:
    """Return the sum over the nodes of each building, `[B, W]` of `[N, W]`.

    `exactly` adds in double precision: of a sum over many rooms, one room is taken away.
    """
    if not isinstance(values, np.ndarray):
        values = values.double() if exactly else values
        if len(nodes.first) == 1:
            return values.sum(axis=0, keepdims=True)
        return add_rows(0 * values[nodes.first], nodes.building, values)
    return np.add.reduceat(values, nodes.first, dtype=np.float64 if exactly else None)


def encode_area(area: Array) -> Array:
    """Return log(area / usual area) of areas `[N]` in m², 0 if unknown, and whether it is known."""
    xp, known = library_of(area), floats(area > 0)
    return xp.stack([xp.log(area.clip(min=1e-2) / _USUAL_AREA) * known, known], axis=1)


def mark(index: Array, width: int) -> Array:
    """Return a mark in the column of each index `[B]`, `[B, width]`; none for one below 0."""
    columns = library_of(index).arange(width)
    return floats(_MARK_SCALE * (index[:, None] == columns))


# By the name in `NetworkConfig.reads`. A network forgets in this order: add new ones at the end.
EVIDENCE = {
    "size": _Encoding(lambda around: encode_area(floats(np.nan_to_num(around.floor_area)))),
    "labels": _Encoding(lambda around: floats(around.labels)),
    # A home is marked like an unknown kind, and HM3D like an unknown source: most robots are in
    # real homes, and a graph says neither.
    "kind": _Encoding(
        lambda around: mark(around.building_kinds - 1, len(BUILDING_KINDS) - 1),
        of_building=True,
    ),
    "source": _Encoding(
        lambda around: mark(around.sources - 1, len(KNOWN_SOURCES) - 1),
        of_building=True,
    ),
}


def _move(value: Any, device: Any) -> Any:
    """Return an array as a tensor on a device; also each of a dictionary, and records of ours.

    A GPU copies from pinned memory while it computes, and nobody waits for it.
    """
    if isinstance(value, dict):
        return {name: _move(part, device) for name, part in value.items()}
    if isinstance(value, _Arrays):
        return value.to(device)
    if isinstance(value, np.ndarray):
        import torch  # only trainings come here

        value = torch.from_numpy(value if value.flags.writeable else value.copy())
    if value is not None and device.type == "cuda" and value.device.type == "cpu":
        value = value.pin_memory()
    return None if value is None else value.to(device, non_blocking=True)
