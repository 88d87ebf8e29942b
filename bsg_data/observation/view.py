"""A view: how much a robot has seen of each node of a building, without what it saw."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Counts, Floats, Ints


@dataclass(frozen=True, eq=False)
class View:
    """How much a robot has seen of each node of a building.

    A mask samples the view without looking at the objects, and a model learns nothing else of the
    mask. Given the view, each object of node n is hidden with the probability `hidden_share[n]`. So
    the shares are right in the mean, for any building.

    Attributes:
        visited: `[N]` whether the robot was there; always true for the building (0).
        hidden_share: `[N]` hidden share of each node. The building's is the mean of its rooms',
            because the robot knows the number of rooms but not their objects.
        nodes: `[N]` index in the building of each node, rising from 0; rooms that the robot has not
            found are missing.
        withheld: `[N, C]` whether a class is withheld at a node.
        exact: whether the nodes of one share s lose exactly ⌊s · their objects⌋ together;
            otherwise each object is hidden independently.
    """

    visited: Bools
    hidden_share: Floats
    withheld: Bools
    nodes: Ints
    exact: bool = False

    @classmethod
    def of_rooms(
        cls,
        shares: Floats,
        *,
        classes: int,
        entered: Bools | None = None,
        alone: float = 0.0,
        exact: bool = False,
    ) -> View:
        """Return the view of a building from the hidden shares of its rooms `[R]`.

        Args:
            shares: `[R]` hidden share of each room.
            classes: number C of the classes.
            entered: `[R]` whether the robot entered each room; None: all with a share below 1.
            alone: hidden share of a building without rooms.
            exact: see the attribute.
        """
        inside = shares < 1 if entered is None else entered
        share = np.concatenate([[alone], shares])
        share[0] = _share_of_building(share)
        withheld = np.zeros((len(share), classes), dtype=bool)
        visited = np.concatenate([[True], inside])
        return cls(visited, share, withheld, np.arange(len(share)), exact)

    def cut(self, cells: Counts) -> Counts:
        """Return the rows of cells `[1 + R, K]` that are in the robot's graph, `[N, K]`.

        Objects in no room are only in the graph of a robot that has found all rooms.
        """
        if len(self.nodes) == len(cells):
            return cells
        found = cells[self.nodes]
        found[0] = 0
        return found

    def in_building(self, nodes: int) -> View:
        """Return the view with all nodes of a building; rooms that were not found hide all."""
        if len(self.nodes) == nodes:
            return self
        shares, entered = np.ones(nodes), np.zeros(nodes, dtype=bool)
        shares[self.nodes], entered[self.nodes] = self.hidden_share, self.visited
        whole = View.of_rooms(
            shares[1:], classes=self.withheld.shape[1], entered=entered[1:], exact=self.exact
        )
        whole = whole.withhold(np.asarray(self.withheld.any(axis=0)))
        whole.withheld[self.nodes] = self.withheld
        return whole

    def take(self, first: int, last: int) -> View:
        """Return the view of the nodes from `first` to before `last`."""
        rows = slice(first, last)
        return replace(
            self,
            visited=self.visited[rows],
            hidden_share=self.hidden_share[rows],
            withheld=self.withheld[rows],
            nodes=self.nodes[rows],
        )

    def search(self, rooms: Bools) -> View:
        """Return the view after some rooms `[N]` were searched; they hide nothing."""
        share = np.where(rooms, 0.0, self.hidden_share)
        share[0] = _share_of_building(share)
        withheld = self.withheld & ~rooms[:, None]
        withheld[0] &= share[0] > 0
        return replace(self, visited=self.visited | rooms, hidden_share=share, withheld=withheld)

    def withhold(self, classes: Bools) -> View:
        """Return the view with some classes `[C]` withheld at all nodes that hide anything."""
        without = classes & (self.hidden_share > 0)[:, None]
        return replace(self, withheld=self.withheld | without)

    def blind(self, classes: Bools) -> View:
        """Return the view of a robot whose detector does not know some classes `[C]`."""
        return replace(self, withheld=self.withheld | classes)

    def agrees(self, other: View) -> bool:
        """Say whether two views are equal, with shares in single precision."""
        return (
            np.array_equal(self.nodes, other.nodes)
            and np.array_equal(self.visited, other.visited)
            and np.array_equal(self.told, other.told)
            and np.array_equal(self.withheld, other.withheld)
        )

    @property
    def told(self) -> npt.NDArray[np.float32]:
        """The hidden shares `[N]` in single precision, as models read and pairs store them."""
        return self.hidden_share.astype(np.float32)


def _share_of_building(share: Floats) -> float:
    """Return the hidden share of a building `[1 + R]`: the mean of its rooms, or its own."""
    rooms = share[1:]
    if not len(rooms):
        return float(share[0])
    if (rooms == rooms[0]).all():
        return float(rooms[0])  # exact; a mean of floats would not be
    return float(rooms.mean())
