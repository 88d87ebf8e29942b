"""A view: what a robot knows of how much of a building it has seen, before what it saw."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Floats


@dataclass(frozen=True, eq=False)
class View:
    """How much a robot has seen of each node of a building, and what was left out of that.

    It is all that a mask samples without looking at the objects, and all that a model is told of
    the mask. Given the view, each object of node n is hidden with the probability
    `hidden_share[n]`, so that what is told is true in the mean, whatever is in the building.

    Attributes:
        visited: `[N]` where the robot was; it is in the building (0).
        hidden_share: `[N]` share of its objects that a node hides; the building's is the mean of
            its rooms', for the robot knows how many rooms there are, and not what is in them.
        withheld: `[N, C]` where a class is left out of what was seen.
        exact: whether nodes of one share s lose together ⌊s · their objects⌋; otherwise each object
            is hidden by itself.
    """

    visited: Bools
    hidden_share: Floats
    withheld: Bools
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
        """Return the view of a building from what its rooms hide.

        Args:
            shares: `[R]` that each room hides.
            classes: their number C.
            entered: `[R]` rooms where the robot was; None for all that do not hide everything.
            alone: share that a building without rooms hides.
            exact: as the attribute.

        >>> View.of_rooms(np.array([0.0, 0.5, 1.0]), classes=45).hidden_share.tolist()
        [0.5, 0.0, 0.5, 1.0]
        """
        inside = shares < 1 if entered is None else entered
        share = np.concatenate([[alone], shares])
        share[0] = share_of_building(share)
        withheld = np.zeros((len(share), classes), dtype=bool)
        return cls(np.concatenate([[True], inside]), share, withheld, exact)

    def take(self, first: int, last: int) -> View:
        """Return the view of the nodes from `first` to before `last`."""
        rows = slice(first, last)
        return replace(
            self,
            visited=self.visited[rows],
            hidden_share=self.hidden_share[rows],
            withheld=self.withheld[rows],
        )

    def search(self, rooms: Bools) -> View:
        """Return the view once some rooms `[N]` were searched, which show all that is in them."""
        if not rooms.any():
            return self
        share = np.where(rooms, 0.0, self.hidden_share)
        share[0] = share_of_building(share)
        withheld = self.withheld & ~rooms[:, None]
        withheld[0] &= share[0] > 0
        return replace(self, visited=self.visited | rooms, hidden_share=share, withheld=withheld)

    def withhold(self, classes: Bools) -> View:
        """Return the view with some classes `[C]` left out, wherever anything is hidden."""
        without = classes & (self.hidden_share > 0)[:, None]
        return replace(self, withheld=self.withheld | without)

    def agrees(self, other: View) -> bool:
        """Say whether two views are told in the same words, shares in single precision."""
        return (
            np.array_equal(self.visited, other.visited)
            and np.array_equal(self.told, other.told)
            and np.array_equal(self.withheld, other.withheld)
        )

    @property
    def told(self) -> npt.NDArray[np.float32]:
        """The shares as models read them and pairs store them, `[N]`."""
        return self.hidden_share.astype(np.float32)


def share_of_building(share: Floats) -> float:
    """Return the share that a building hides: the mean of its rooms `[1 + R]`, or its own."""
    rooms = share[1:]
    if not len(rooms):
        return float(share[0])
    if (rooms == rooms[0]).all():
        return float(rooms[0])  # exactly, as a mean of floats is not
    return float(rooms.mean())
