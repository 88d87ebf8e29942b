"""Masks: what a robot has not seen yet, drawn at random (paper, section III-B).

A mask hides objects of a building. Its strategies:

- `uniform`, the paper's: ⌊fraction · n⌋ of the n classified objects, uniformly without
  replacement. Every room is visited.
- `rooms`: whole rooms stay unvisited, in random order, until at least the fraction is hidden. The
  null region is no room that one could leave out: it loses ⌈fraction · its objects⌉.
- `frontier`: the robot starts in a random room and grows a connected set of visited rooms over the
  room adjacency, until the unvisited ones hold at most half of the ⌊fraction · n⌋ objects to hide;
  the visited ones and the null region lose the rest, uniformly. Without adjacency every room
  neighbours every other; where a connected part is exhausted, it goes on in another room.

Objects without a class are drawn apart, by the same rule and the same visited rooms, so that a mask
of the classified ones does not depend on them.

A mask depends on (recipe, scene_id, draw) alone: never on order, workers or other scenes.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from decimal import Decimal
from typing import Literal

import numpy as np
import numpy.typing as npt

from bsg_data.dataset.histograms import Counts
from bsg_data.recipes import MaskRecipe

UNVISITED_SHARE = Decimal("0.5")  # of the objects that `frontier` hides, at most, by not visiting
Stream = Literal["rooms", "classified", "unclassified", "search"]
_STREAM: dict[Stream, int] = {"rooms": 0, "classified": 1, "unclassified": 2, "search": 3}

Visited = npt.NDArray[np.bool_]


def mask_generator(
    recipe: MaskRecipe, *, scene_id: str, draw: int, part: Stream
) -> np.random.Generator:
    """Return the generator of one part of one draw of one scene."""
    digest = np.frombuffer(hashlib.sha256(scene_id.encode()).digest()[:16], dtype="<u4")
    entropy = [recipe.seed, *digest.tolist(), draw, _STREAM[part]]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy)))


def sample_visited(
    cells: Counts,
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    adjacent: Sequence[tuple[int, int]] = (),
) -> Visited:
    """Draw which nodes of interest the robot visits.

    Args:
        cells: `[1 + R, C]` classified objects; row 0 is the null region.
        recipe: of the mask.
        scene_id: of the building.
        draw: number of the draw.
        adjacent: pairs of room indices; only `frontier` reads them.

    Returns:
        `[1 + R]`; the building itself (index 0) is always visited.
    """
    visited = np.ones(len(cells), dtype=bool)
    if recipe.strategy == "uniform" or len(cells) == 1:
        return visited
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, part="rooms")
    sizes = cells.sum(axis=1)
    if recipe.strategy == "rooms":
        order = 1 + rng.permutation(len(cells) - 1)
        needed = _share(recipe, sizes.sum(), math.ceil) - _share(recipe, sizes[0], math.ceil)
        hidden_before = np.cumsum(sizes[order]) - sizes[order]
        visited[order[hidden_before < needed]] = False
        return visited
    allowed = math.floor(_share(recipe, sizes.sum(), math.floor) * UNVISITED_SHARE)
    return _grow_frontier(sizes, adjacent, allowed=allowed, rng=rng)


def sample_hidden(
    cells: Counts,
    visited: Visited,
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    part: Stream = "classified",
) -> Counts:
    """Draw how many objects of every cell are hidden.

    A draw without replacement of single objects, seen per cell, is multivariate hypergeometric.

    Args:
        cells: `[1 + R, K]` objects per room and kind, classified or not.
        visited: `[1 + R]` from `sample_visited`.
        recipe: of the mask.
        scene_id: of the building.
        draw: number of the draw.
        part: which objects these are; each part has a generator of its own.

    Returns:
        `[1 + R, K]`, nowhere above `cells`.
    """
    hidden = np.where(visited[:, None], 0, cells)
    if recipe.strategy == "rooms":
        thinned = np.arange(len(cells)) == 0
        number = _share(recipe, cells[0].sum(), math.ceil)
    else:
        thinned = visited
        number = max(0, _share(recipe, cells.sum(), math.floor) - int(hidden.sum()))
    candidates = np.flatnonzero(np.where(thinned[:, None], cells, 0))
    if number and len(candidates):
        rng = mask_generator(recipe, scene_id=scene_id, draw=draw, part=part)
        drawn = rng.multivariate_hypergeometric(
            cells.ravel()[candidates], number, method="marginals"
        )
        hidden.ravel()[candidates] = drawn
    return hidden


def share_hidden(visited: Visited, recipe: MaskRecipe) -> npt.NDArray[np.float64]:
    """Return the share of its objects that each node hides, as a robot knows it, `[1 + R]`.

    It follows from the recipe and from where the robot was, never from the objects: all of an
    unvisited room; of a visited one `uniform` hides the fraction and `rooms` nothing. `frontier`
    hides at most half of the fraction f by not visiting; were it half, visited rooms would lose
    (f − f/2) / (1 − f/2). The building hides the fraction.

    >>> share_hidden(np.array([True, True, False]), MaskRecipe(strategy="rooms")).tolist()
    [0.5, 0.0, 1.0]
    """
    f = recipe.fraction
    of_visited = {"uniform": f, "rooms": 0.0, "frontier": f / (2 - f)}[recipe.strategy]
    share = np.where(visited, of_visited, 1.0)
    share[0] = f
    return share


def hidden_bounds(cells: Counts, recipe: MaskRecipe) -> tuple[int, int]:
    """Return the least and the most objects that any draw of a mask hides in a building.

    `uniform` and `frontier` hide exactly ⌊fraction · n⌋; `rooms` goes over by less than a room.
    """
    sizes = cells.sum(axis=1)
    if recipe.strategy != "rooms":
        exact = _share(recipe, sizes.sum(), math.floor)
        return exact, exact
    least = _share(recipe, sizes.sum(), math.ceil)
    return least, max(least, least + int(sizes[1:].max(initial=0)) - 1)


def _share(recipe: MaskRecipe, number: int, rounding: Callable[[Decimal], int]) -> int:
    """Return fraction · number, exact in decimals: 0.29 of 100 is 29, not 28."""
    return rounding(Decimal(repr(recipe.fraction)) * int(number))


def _grow_frontier(
    sizes: npt.NDArray[np.int64],
    adjacent: Sequence[tuple[int, int]],
    *,
    allowed: int,
    rng: np.random.Generator,
) -> Visited:
    neighbours = _neighbours(len(sizes), adjacent)
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


def _neighbours(nodes: int, adjacent: Sequence[tuple[int, int]]) -> npt.NDArray[np.bool_]:
    """Return the room adjacency `[1 + R, 1 + R]`; complete where none is known."""
    matrix = np.full((nodes, nodes), not adjacent)
    if adjacent:
        left, right = np.array(adjacent).T
        matrix[left, right] = matrix[right, left] = True
    return matrix
