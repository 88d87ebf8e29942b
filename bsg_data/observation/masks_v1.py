"""The masks of format 1, whose pairs store only which rooms were visited.

The rest of their view followed from the recipe, and was biased. `rooms` hid room after room until
at least the fraction was hidden, but reported the fraction. `frontier` hid exactly the fraction,
but reported that visited rooms lose f / (2 − f). Pairs of format 1 are read with that view, and
`bsg-data check` still compares them with their recipe. New pairs never use these masks. `uniform`
is the same in both formats.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal

import numpy as np

from bsg_data.arrays import Bools, Counts
from bsg_data.errors import RecipeError
from bsg_data.observation.mask_streams import Stream, mask_generator
from bsg_data.observation.view import View
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.connections import Connections

STRATEGIES = ("uniform", "rooms", "frontier")
_UNVISITED_SHARE = Decimal("0.5")  # of what `frontier` hid, at most, by not visiting


def view_of_format_1(
    visited: Bools, recipe: MaskRecipe, *, is_building: Bools, classes: int
) -> View:
    """Return the view that format 1 told of stored pairs, of one building or of many.

    Args:
        visited: `[N]` as stored.
        recipe: of the pairs.
        is_building: `[N]` which rows are buildings.
        classes: their number.

    Raises:
        RecipeError: if format 1 had no such mask.
    """
    _require_known(recipe)
    fraction = recipe.fraction
    of_visited = {"rooms": 0.0, "frontier": fraction / (2 - fraction)}.get(
        recipe.strategy, fraction
    )
    share = np.where(visited, of_visited, 1.0)
    share[is_building] = fraction
    return View(visited, share, np.zeros((len(visited), classes), dtype=bool))


def sample_visited_of_format_1(
    cells: Counts,
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    connections: Connections,
) -> Bools:
    """Sample which nodes `[N]` the robot visited, as format 1 did.

    Raises:
        RecipeError: if format 1 had no such mask.
    """
    _require_known(recipe)
    visited = np.ones(len(cells), dtype=bool)
    if len(cells) == 1 or recipe.strategy == "uniform":
        return visited
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream="rooms")
    if recipe.strategy == "rooms":
        sizes = cells.sum(axis=1)
        order = 1 + rng.permutation(len(cells) - 1)
        needed = _share_of(recipe, sizes.sum(), math.ceil) - _share_of(recipe, sizes[0], math.ceil)
        visited[order[np.cumsum(sizes[order]) - sizes[order] < needed]] = False
        return visited
    return _grow(cells.sum(axis=1), recipe, connections, rng)


def sample_hidden_of_format_1(
    cells: Counts,
    visited: Bools,
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    stream: Stream = "classified",
) -> Counts:
    """Sample how many objects of every cell `[N, K]` are hidden, as format 1 did.

    Raises:
        RecipeError: if format 1 had no such mask.
    """
    _require_known(recipe)
    thinned, number = visited, _share_of(recipe, cells.sum(), math.floor)
    number = max(0, number - int(cells[~visited].sum()))
    if recipe.strategy == "rooms":
        thinned = np.arange(len(cells)) == 0
        number = _share_of(recipe, cells[0].sum(), math.ceil)
    hidden = np.where(visited[:, None], 0, cells)
    candidates = np.flatnonzero(np.where(thinned[:, None], cells, 0))
    if number and len(candidates):
        rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream=stream)
        hidden.ravel()[candidates] = rng.multivariate_hypergeometric(
            cells.ravel()[candidates], number, method="marginals"
        )
    return hidden


def _grow(
    sizes: Counts, recipe: MaskRecipe, connections: Connections, rng: np.random.Generator
) -> Bools:
    allowed = math.floor(_share_of(recipe, sizes.sum(), math.floor) * _UNVISITED_SHARE)
    neighbours = np.full((len(sizes), len(sizes)), not len(connections))
    left, right = connections.pairs.T
    neighbours[left, right] = neighbours[right, left] = True
    visited = np.zeros(len(sizes), dtype=bool)
    visited[0] = True
    room = 1 + int(rng.integers(len(sizes) - 1))
    while True:
        visited[room] = True
        if sizes[~visited].sum() <= allowed:
            return visited
        reachable = neighbours[visited].any(axis=0) & ~visited
        room = int(rng.choice(np.flatnonzero(reachable if reachable.any() else ~visited)))


def _share_of(recipe: MaskRecipe, number: int, rounding: Callable[[Decimal], int]) -> int:
    return rounding(Decimal(repr(recipe.fraction)) * int(number))


def _require_known(recipe: MaskRecipe) -> None:
    if recipe.strategy not in STRATEGIES:
        raise RecipeError(
            f"pairs of format 1 by the mask {recipe.strategy!r}: expected one of "
            f"{', '.join(STRATEGIES)}; `bsg-data pairs --force` draws them anew"
        )
