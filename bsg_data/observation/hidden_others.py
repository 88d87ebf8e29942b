"""Sample which objects outside the classes a mask hides."""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Bools, Counts, Ints
from bsg_data.observation.mask_streams import mask_generator
from bsg_data.observation.masks import sample_hidden
from bsg_data.observation.view import View
from bsg_data.recipes import MaskRecipe


def sample_hidden_others(
    cells: Counts,
    view: View,
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    there: Counts,
    hidden: Counts,
    wholes: Ints | None = None,
) -> Counts:
    """Sample how many objects outside the classes are hidden, by room and category.

    Parts of a thing are hidden with it, if the recipe says so: each part is attached to a random
    thing of its class in its room. Where the room has none, and in the null region, which is no
    room, it falls under the ordinary rule.

    Args:
        cells: `[N, K]` objects outside the classes, row 0 the null region.
        view: of the mask.
        recipe: of the mask.
        scene_id: of the building.
        draw: number of the draw.
        there: `[N, C]` classified objects.
        hidden: `[N, C]` those of them that are hidden.
        wholes: `[K]` class that each category is a part of, -1 for none
            (`bsg_data.scene.parts.find_wholes`); read with `recipe.parts` alone.

    Returns:
        `[N, K]`, nowhere above `cells`.
    """
    attached = np.zeros(cells.shape, dtype=bool)
    if recipe.parts and wholes is not None:
        attached = have_wholes(there, wholes)
    gone = sample_hidden(
        np.where(attached, 0, cells),
        view,
        recipe,
        scene_id=scene_id,
        draw=draw,
        stream="unclassified",
    )
    if wholes is None or not attached.any():
        return gone
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream="parts")
    rate = np.where(attached, hidden[:, wholes] / np.maximum(there[:, wholes], 1), 0.0)
    return gone + rng.binomial(np.where(attached, cells, 0), rate)


def have_wholes(there: Counts, wholes: Ints) -> Bools:
    """Return in which rooms a category has a thing to be a part of, `[N, K]`.

    Args:
        there: `[N, C]` classified objects.
        wholes: `[K]` class that each category is a part of; -1 for none.
    """
    attached = (wholes >= 0) & (there[:, wholes] > 0)
    attached[0] = False
    return attached
