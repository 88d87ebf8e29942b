"""Masks: what a robot has not seen yet, sampled at random (paper, section III-B).

A mask hides objects of a building. Each strategy is one class here and one row of `MASKS`:

- `uniform`, the paper's: ⌊fraction · n⌋ of the n classified objects, uniformly without
  replacement. Every room is visited.
- `rooms`: whole rooms stay unvisited, in random order, until at least the fraction is hidden. The
  null region is no room that one could leave out: it loses ⌈fraction · its objects⌉.
- `frontier`: the robot starts in a random room and grows a connected set of visited rooms over the
  room adjacency, until the unvisited ones hold at most half of the ⌊fraction · n⌋ objects to hide;
  the visited ones and the null region lose the rest, uniformly. Without adjacency every room
  neighbours every other; where a connected part is exhausted, it goes on in another room.

Objects without a class are hidden apart, by the same rule and in the same visited rooms, so that a
mask of the classified ones does not depend on them.

A mask depends on (recipe, scene_id, draw) alone: never on order, workers or other scenes.
"""

from __future__ import annotations

import hashlib
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from decimal import Decimal
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Counts
from bsg_data.recipes import MaskRecipe
from bsg_data.registry import Registry
from bsg_data.scene.connections import Connections

UNVISITED_SHARE = Decimal("0.5")  # of the objects that `frontier` hides, at most, by not visiting
Stream = Literal["rooms", "classified", "unclassified", "search"]
_STREAM: dict[Stream, int] = {"rooms": 0, "classified": 1, "unclassified": 2, "search": 3}


class Mask(ABC):
    """A strategy of hiding objects.

    Attributes:
        summary: what it hides, in one line.
        reads_connections: whether it asks which rooms connect.
    """

    summary: ClassVar[str]
    reads_connections: ClassVar[bool] = False

    @abstractmethod
    def sample_visited(
        self,
        cells: Counts,
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> Bools:
        """Sample which nodes the robot visits, `[N]`; the building (0) is always visited.

        Args:
            cells: `[N, C]` classified objects, row 0 the null region; there is one room or more.
            recipe: of the mask.
            connections: of the building's rooms.
            rng: of this building and draw.
        """

    @abstractmethod
    def share_of_visited(self, fraction: float) -> float:
        """Return the share of its objects that a visited room hides, as a robot knows it."""

    def thin(self, cells: Counts, visited: Bools, recipe: MaskRecipe) -> tuple[Bools, int]:
        """Return the nodes `[N]` that lose single objects, and how many they lose together.

        Unvisited rooms lose everything besides.
        """
        gone = int(cells[~visited].sum())
        return visited, max(0, share_of(recipe, cells.sum(), math.floor) - gone)

    def hidden_bounds(self, cells: Counts, recipe: MaskRecipe) -> tuple[int, int]:
        """Return the least and the most objects that any draw hides in a building."""
        exact = share_of(recipe, cells.sum(), math.floor)
        return exact, exact


class UniformMask(Mask):
    """Hide ⌊fraction · n⌋ objects uniformly; every room is visited."""

    summary = "the paper's: single objects, uniformly; every room is visited"

    def sample_visited(
        self,
        cells: Counts,
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> Bools:
        """Visit every room."""
        return np.ones(len(cells), dtype=bool)

    def share_of_visited(self, fraction: float) -> float:
        """Return the fraction."""
        return fraction


class RoomsMask(Mask):
    """Hide all of some rooms, which stay unvisited, until the fraction is hidden."""

    summary = "whole rooms, until the fraction is hidden"

    def sample_visited(
        self,
        cells: Counts,
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> Bools:
        """Leave rooms out in random order."""
        sizes = cells.sum(axis=1)
        order = 1 + rng.permutation(len(cells) - 1)
        needed = share_of(recipe, sizes.sum(), math.ceil) - share_of(recipe, sizes[0], math.ceil)
        hidden_before = np.cumsum(sizes[order]) - sizes[order]
        visited = np.ones(len(cells), dtype=bool)
        visited[order[hidden_before < needed]] = False
        return visited

    def share_of_visited(self, fraction: float) -> float:
        """Return 0: a visited room shows everything."""
        return 0.0

    def thin(self, cells: Counts, visited: Bools, recipe: MaskRecipe) -> tuple[Bools, int]:
        """Take single objects from the null region alone."""
        return np.arange(len(cells)) == 0, share_of(recipe, cells[0].sum(), math.ceil)

    def hidden_bounds(self, cells: Counts, recipe: MaskRecipe) -> tuple[int, int]:
        """Return at least the fraction, and less than a room more."""
        sizes = cells.sum(axis=1)
        least = share_of(recipe, sizes.sum(), math.ceil)
        return least, max(least, least + int(sizes[1:].max(initial=0)) - 1)


class FrontierMask(Mask):
    """Visit a connected set of rooms, and hide objects in these rooms, too."""

    summary = "rooms beyond a connected set of visited ones, and objects in these"
    reads_connections = True

    def sample_visited(
        self,
        cells: Counts,
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> Bools:
        """Grow the set of visited rooms from a random one."""
        sizes = cells.sum(axis=1)
        allowed = math.floor(share_of(recipe, sizes.sum(), math.floor) * UNVISITED_SHARE)
        neighbours = _neighbours(len(sizes), connections)
        visited = np.zeros(len(sizes), dtype=bool)
        visited[0] = True
        room = 1 + int(rng.integers(len(sizes) - 1))
        while True:
            visited[room] = True
            if sizes[~visited].sum() <= allowed:
                return visited
            reachable = neighbours[visited].any(axis=0) & ~visited
            frontier = np.flatnonzero(reachable if reachable.any() else ~visited)
            room = int(rng.choice(frontier))

    def share_of_visited(self, fraction: float) -> float:
        """Return (f − f/2) / (1 − f/2): what is left to hide if half of f is not visited."""
        return fraction / (2 - fraction)


MASKS: Registry[Mask] = Registry(
    "mask",
    Mask,  # type: ignore[type-abstract]
    group="bsg_data.masks",
    rows={
        "uniform": "bsg_data.observation.masks:UNIFORM",
        "rooms": "bsg_data.observation.masks:ROOMS",
        "frontier": "bsg_data.observation.masks:FRONTIER",
    },
)
UNIFORM, ROOMS, FRONTIER = UniformMask(), RoomsMask(), FrontierMask()


def mask_generator(
    recipe: MaskRecipe, *, scene_id: str, draw: int, stream: Stream
) -> np.random.Generator:
    """Return the generator of one part of one draw of one scene."""
    digest = np.frombuffer(hashlib.sha256(scene_id.encode()).digest()[:16], dtype="<u4")
    entropy = [recipe.seed, *digest.tolist(), draw, _STREAM[stream]]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy)))


def sample_visited(
    cells: Counts,
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    connections: Connections | None = None,
) -> Bools:
    """Sample which nodes of interest the robot visits.

    Args:
        cells: `[1 + R, C]` classified objects; row 0 is the null region.
        recipe: of the mask.
        scene_id: of the building.
        draw: number of the draw.
        connections: between the rooms; None where none is known.

    Returns:
        `[1 + R]`; the building itself (index 0) is always visited.

    Raises:
        RecipeError: if nobody knows the strategy.
    """
    mask = MASKS[recipe.strategy]
    if len(cells) == 1:
        return np.ones(1, dtype=bool)
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream="rooms")
    known = connections if connections is not None else Connections.of_pairs(())
    return mask.sample_visited(cells, recipe, connections=known, rng=rng)


def sample_hidden(
    cells: Counts,
    visited: Bools,
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    stream: Stream = "classified",
) -> Counts:
    """Sample how many objects of every cell are hidden.

    Single objects taken without replacement, counted per cell, are multivariate hypergeometric.

    Args:
        cells: `[1 + R, K]` objects per room and kind, classified or not.
        visited: `[1 + R]` from `sample_visited`.
        recipe: of the mask.
        scene_id: of the building.
        draw: number of the draw.
        stream: which objects these are; each kind has a generator of its own.

    Returns:
        `[1 + R, K]`, nowhere above `cells`.
    """
    thinned, number = MASKS[recipe.strategy].thin(cells, visited, recipe)
    hidden = np.where(visited[:, None], 0, cells)
    candidates = np.flatnonzero(np.where(thinned[:, None], cells, 0))
    if number and len(candidates):
        rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream=stream)
        hidden.ravel()[candidates] = rng.multivariate_hypergeometric(
            cells.ravel()[candidates], number, method="marginals"
        )
    return hidden


def share_hidden(visited: Bools, recipe: MaskRecipe) -> npt.NDArray[np.float64]:
    """Return the share of its objects that each node hides, as a robot knows it, `[1 + R]`.

    It follows from the recipe and from where the robot was, never from the objects: all of an
    unvisited room, of a visited one what the mask says; the building hides the fraction.

    >>> share_hidden(np.array([True, True, False]), MaskRecipe(strategy="rooms")).tolist()
    [0.5, 0.0, 1.0]
    """
    of_visited = MASKS[recipe.strategy].share_of_visited(recipe.fraction)
    share = np.where(visited, of_visited, 1.0)
    share[0] = recipe.fraction
    return share


def share_of(recipe: MaskRecipe, number: int, rounding: Callable[[Decimal], int]) -> int:
    """Return fraction · number, exact in decimals: 0.29 of 100 is 29, not 28."""
    return rounding(Decimal(repr(recipe.fraction)) * int(number))


def _neighbours(nodes: int, connections: Connections) -> Bools:
    """Return which rooms connect, `[1 + R, 1 + R]`; all of them where nothing is known."""
    matrix = np.full((nodes, nodes), not len(connections))
    left, right = connections.pairs.T
    matrix[left, right] = matrix[right, left] = True
    return matrix
