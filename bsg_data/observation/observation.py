"""What a robot has seen, as arrays: the input of every model.

A robot's own graph, a masked building and a moment of a search all become observations. An
observation has one building or several. The rows of a building are consecutive, its own row first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Counts, Floats, Ints
from bsg_data.observation.view import View
from bsg_data.scene.connections import Connections, stack_connections
from bsg_data.scene.surroundings import Surroundings, stack_surroundings

# arrays of a row a node
_OF_NODES = ("inputs", "hidden_share", "visited", "withheld", "unclassified")


@dataclass(frozen=True, eq=False)
class Observation:
    """What was seen of B buildings, with N nodes of interest in all and C classes.

    Attributes:
        scene_ids: `[B]` ids; a building may occur several times.
        starts: `[B + 1]` row of each building's first node, and N.
        inputs: `[N, C]` histograms of what was seen, E′ × O′.
        hidden_share: `[N]` hidden share of each node, as far as the robot knows.
        visited: `[N]` whether the robot was there; always true for the building.
        withheld: `[N, C]` whether a class is withheld at a node: then all of it is hidden there,
            whatever the hidden share.
        vocabulary: `[V]` categories outside the classes.
        unclassified: `[N, V]` seen objects outside the classes, by the vocabulary.
        connections: connections between rooms, by rows.
        surroundings: what is known of nodes and buildings besides objects.
    """

    scene_ids: tuple[str, ...]
    starts: Ints
    inputs: Counts
    hidden_share: npt.NDArray[np.float32]
    visited: Bools
    withheld: Bools
    vocabulary: tuple[str, ...]
    unclassified: Counts
    connections: Connections
    surroundings: Surroundings

    @classmethod
    def of_views(
        cls,
        scene_ids: Sequence[str],
        views: Sequence[View],
        inputs: Counts,
        unclassified: Counts,
        *,
        vocabulary: tuple[str, ...],
        connections: Sequence[Connections],
        surroundings: Sequence[Surroundings],
    ) -> Observation:
        """Return what is seen of B buildings under a view each: histograms `[N, C]`, `[N, V]`."""
        starts = np.cumsum([0, *(len(view.nodes) for view in views)])
        return cls(
            scene_ids=tuple(scene_ids),
            starts=starts,
            inputs=inputs,
            hidden_share=np.concatenate([view.shares_float32 for view in views]),
            visited=np.concatenate([view.visited for view in views]),
            withheld=np.concatenate([view.withheld for view in views]),
            vocabulary=vocabulary,
            unclassified=unclassified,
            connections=stack_connections(connections, starts[:-1].tolist()),
            surroundings=stack_surroundings(surroundings),
        )

    def __len__(self) -> int:
        """Return the number of buildings B."""
        return len(self.scene_ids)

    @cached_property
    def is_building(self) -> Bools:
        """Whether each node is a building, `[N]`."""
        marks = np.zeros(len(self.inputs), dtype=bool)
        marks[self.starts[:-1]] = True
        return marks

    @cached_property
    def building(self) -> Ints:
        """Number of each node's building, `[N]` from 0."""
        return np.repeat(np.arange(len(self)), np.diff(self.starts))

    @cached_property
    def looked_into(self) -> Bools:
        """Whether the robot saw anything of each node, `[N]`: visited, or glimpsed by a door."""
        return self.hidden_share < 1

    @cached_property
    def cell_share(self) -> Floats:
        """Hidden share by node and class, `[N, C]`.

        It is the hidden share of the node, and 1 for a withheld class, such as a search's artifact.
        """
        return np.where(self.withheld, 1.0, self.hidden_share[:, None].astype(np.float64))

    def take(self, buildings: Sequence[int] | Ints) -> Observation:
        """Return the buildings with these numbers, in this order."""
        numbers = np.asarray(buildings, dtype=np.int64)
        rows, starts = self.rows_of(numbers)
        return replace(
            self,
            scene_ids=tuple(self.scene_ids[number] for number in numbers.tolist()),
            starts=starts,
            connections=self._take_connections(numbers, starts),
            surroundings=self.surroundings.take(rows, buildings=numbers),
            **{name: getattr(self, name)[rows] for name in _OF_NODES},
        )

    def rows_of(self, buildings: Ints) -> tuple[Ints, Ints]:
        """Return the rows `[K]` of some buildings `[M]`, and their starts in these `[M + 1]`."""
        return _spread_rows(self.starts, buildings)

    def _take_connections(self, buildings: Ints, starts: Ints) -> Connections:
        """Return the connections of some buildings, renumbered for new starts."""
        if not len(self.connections):
            return self.connections
        of_building = self.building[self.connections.pairs[:, 0]]
        firsts = np.searchsorted(of_building, np.arange(len(self) + 1))
        rows, ends = _spread_rows(firsts, buildings)
        taken = self.connections.take(rows)
        moved = np.repeat(starts[:-1] - self.starts[buildings], np.diff(ends))
        return replace(taken, pairs=taken.pairs + moved[:, None])

    def without(self, *evidence: str) -> Observation:
        """Return a copy with some surroundings unknown; see `Surroundings.without`."""
        return replace(self, surroundings=self.surroundings.without(*evidence))


def _spread_rows(starts: Ints, numbers: Ints) -> tuple[Ints, Ints]:
    """Return the rows `[K]` of some blocks in order, and where each block starts `[M + 1]`."""
    sizes = starts[numbers + 1] - starts[numbers]
    ends = np.concatenate([[0], np.cumsum(sizes)])
    moved = np.repeat(starts[numbers] - ends[:-1], sizes)
    return np.arange(ends[-1]) + moved, ends


def stack(observations: Sequence[Observation]) -> Observation:
    """Return one observation with the buildings of several, in order.

    Raises:
        ValueError: if there is none, or their vocabularies differ.
    """
    if len({seen.vocabulary for seen in observations}) != 1:
        raise ValueError("expected one or more observations of the same vocabulary")
    sizes = np.concatenate([np.diff(seen.starts) for seen in observations])
    offsets = np.cumsum([0, *(len(seen.inputs) for seen in observations)])[:-1]
    return Observation(
        scene_ids=tuple(scene for seen in observations for scene in seen.scene_ids),
        starts=np.concatenate([[0], np.cumsum(sizes)]),
        vocabulary=observations[0].vocabulary,
        connections=stack_connections(
            [seen.connections for seen in observations], offsets.tolist()
        ),
        surroundings=stack_surroundings([seen.surroundings for seen in observations]),
        **{
            name: np.concatenate([getattr(seen, name) for seen in observations])
            for name in _OF_NODES
        },
    )
