"""An observation as tensors: the one form that networks read, in training and in answers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
import torch

from bsg_data.arrays import Counts, Floats, Ints
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_data.observation.observation import Observation
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.surroundings import BUILDING_KINDS, KNOWN_SOURCES, Surroundings
from bsg_models.inputs.edges import EdgeSet, list_edges

_SILENT_NEIGHBOURS = 4.0  # of features 0, added to each mean: one room says little of the next
_USUAL_AREA = 12.0  # m² of a room, whose logarithm counts as 0
# Of a building's kind and source, so that what is learned in shops stays there: restaurants have
# several refrigerators, and a home was believed to have another with .13, now with .05.
_LOUD = 4.0


_Form = TypeVar("_Form", bound="_Tensors")


class _Tensors:
    """A dataclass of tensors, which may be nested."""

    def to(self: _Form, device: torch.device) -> _Form:
        names = [one.name for one in fields(self)]  # type: ignore[arg-type]
        return type(self)(**{name: _move(getattr(self, name), device) for name in names})


@dataclass(frozen=True, eq=False, slots=True)
class Nodes(_Tensors):
    """N nodes of interest of B buildings, C classes; a building's rows are its own, then rooms."""

    x: torch.Tensor  # [N, C] counts that were seen
    y: torch.Tensor  # [N, C] true counts, `UNKNOWN` where there is none; [0, C] if not given
    edges: Any  # [2, E] from and to, or the form that the network takes
    building: torch.Tensor  # [N] number of each node's building
    first: torch.Tensor  # [B] row of each building's own node
    is_building: torch.Tensor  # [N]
    visited: torch.Tensor  # [N]
    hidden_share: torch.Tensor  # [N]
    withheld: torch.Tensor  # [N, C] classes that the node does not show, whatever its share
    others: torch.Tensor  # [N, V] seen objects outside the classes
    evidence: dict[str, torch.Tensor]  # [N, width] of rows of `EVIDENCE`

    @property
    def known(self) -> torch.Tensor:
        """Whether the true count is known, `[N, C]`: the source has a word for the class."""
        return self.y != MaskedBuildings.UNKNOWN

    @property
    def share(self) -> torch.Tensor:
        """The hidden share by node and class, `[N, C]`, as `Observation.cell_share`."""
        share = self.hidden_share[:, None].expand_as(self.x)
        return torch.where(self.withheld, torch.ones_like(share), share)


@dataclass(frozen=True)
class _Encoding:
    """How networks read what is known of a room, or of its building, besides objects."""

    width: int
    encode: Callable[[Surroundings], torch.Tensor]  # [N or B, width] of order one; 0 if unknown
    of_building: bool = False


def to_nodes(
    seen: Observation,
    *,
    edges: Any = None,
    targets: Counts | None = None,
    reads: Collection[str] = (),
) -> Nodes:
    """Return an observation as tensors, with true counts `[N, C]` and the evidence that is read."""
    building = torch.from_numpy(seen.building)
    evidence = {}
    for name in EVIDENCE.keys() & reads:
        values = EVIDENCE[name].encode(seen.surroundings)
        evidence[name] = values[building] if EVIDENCE[name].of_building else values
    return Nodes(
        x=_floats(seen.inputs),
        y=_floats(seen.inputs[:0] if targets is None else targets),
        edges=edges,
        building=building,
        first=torch.from_numpy(seen.starts[:-1]),
        is_building=torch.from_numpy(seen.is_building),
        visited=torch.from_numpy(seen.visited.copy()),
        hidden_share=torch.from_numpy(seen.hidden_share.copy()),
        withheld=torch.from_numpy(seen.withheld.copy()),
        others=_floats(seen.others),
        evidence=evidence,
    )


@dataclass(frozen=True, eq=False, slots=True)
class Neighbours(_Tensors):
    """The neighbours of every node, as weights of three sums instead of a list of edges.

    If every room sees every other, R rooms have R (R − 1) edges: 100 million for 10,000 rooms.
    Their means need none: mean of the others of i = (Σ_j h_j − h_i) / (R − 1 + s). The s silent
    neighbours shrink the mean of few, so that a network is not sure of a building after one room.
    """

    building: torch.Tensor  # [N] number of each node's building
    first: torch.Tensor  # [B] row of each building's own node
    of_rooms: torch.Tensor  # [N, 1] weight of the sum over all rooms of the building
    of_itself: torch.Tensor  # [N, 1] weight of the node itself
    of_building: torch.Tensor  # [N, 1] weight of the building's own node
    pairs: torch.Tensor  # [2, A] other edges, from and to
    of_pairs: torch.Tensor  # [A, 1] weight of the first node of each pair for the second

    @classmethod
    def of(cls, seen: Observation, edges: Sequence[EdgeSet]) -> Neighbours:
        """Return the same neighbours as those of `list_edges`."""
        rooms = np.diff(seen.starts)[seen.building] - 1
        complete = ~seen.is_building & ("complete" in edges)
        down = ~seen.is_building & ("down" in edges)
        up = seen.is_building & ("up" in edges)
        adjacent = "adjacent" in edges and "complete" not in edges
        pairs = list_edges(seen, ("adjacent",) if adjacent else ())
        number = np.where(complete, rooms - 1, 0) + down + np.where(up, rooms, 0)
        number += np.bincount(pairs[1], minlength=len(rooms))
        weight = 1 / (number + _SILENT_NEIGHBOURS)
        return cls(
            building=torch.from_numpy(seen.building),
            first=torch.from_numpy(seen.starts[:-1]),
            of_rooms=_column(weight * (complete | up)),
            of_itself=_column(-weight * complete),
            of_building=_column(weight * down),
            pairs=torch.from_numpy(pairs),
            of_pairs=_column(weight[pairs[1]]),
        )

    def mean(self, h: torch.Tensor) -> torch.Tensor:
        """Return the shrunk mean of every node's neighbours, `[N, W]` of `[N, W]`."""
        own = h.double()  # so that the difference of two large sums is exact
        buildings = own[self.first]
        rooms = torch.zeros_like(buildings).index_add_(0, self.building, own) - buildings
        mean = self.of_rooms * rooms[self.building] + self.of_itself * own
        mean += self.of_building * buildings[self.building]
        if self.pairs.shape[1]:
            mean.index_add_(0, self.pairs[1], self.of_pairs * own[self.pairs[0]])
        return mean.to(h.dtype)


def _encode_area(around: Surroundings) -> torch.Tensor:
    """Return log(area / usual area), 0 if unknown, and whether it is known."""
    area = _floats(np.nan_to_num(around.floor_area))
    known = (area > 0).float()
    return torch.stack([torch.log(area.clamp(min=1e-2) / _USUAL_AREA) * known, known], dim=1)


def _mark(index: Ints, width: int) -> torch.Tensor:
    """Return a mark in the column of each index `[B]`, `[B, width]`; none for an unknown, −1."""
    return _LOUD * _floats(index[:, None] == np.arange(width))


# By the name in `NetworkConfig.reads`. A network forgets in this order: add new ones at the end.
EVIDENCE = {
    "size": _Encoding(2, _encode_area),
    "labels": _Encoding(len(list_room_labels()), lambda around: _floats(around.labels)),
    # A home is marked like an unknown kind, and HM3D like an unknown source: most robots are in
    # real homes, and a graph says neither.
    "kind": _Encoding(
        len(BUILDING_KINDS) - 1,
        lambda around: _mark(around.building_kinds - 1, len(BUILDING_KINDS) - 1),
        of_building=True,
    ),
    "source": _Encoding(
        len(KNOWN_SOURCES) - 1,
        lambda around: _mark(around.sources - 1, len(KNOWN_SOURCES) - 1),
        of_building=True,
    ),
}


def _floats(values: np.ndarray[Any, Any]) -> torch.Tensor:
    return torch.from_numpy(values.astype(np.float32))


def _column(values: Floats) -> torch.Tensor:
    return torch.from_numpy(values[:, None])


def _move(value: Any, device: torch.device) -> Any:
    if isinstance(value, dict):
        return {name: one.to(device) for name, one in value.items()}
    return None if value is None else value.to(device)
