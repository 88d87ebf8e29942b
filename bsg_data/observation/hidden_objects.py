"""Sample which objects are hidden under a view: those of the classes, the others, and their parts.

Objects without a class are hidden separately, under the same view, so they do not change the mask
of the classified objects.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from decimal import Decimal
from typing import Any, Literal

import numpy as np

from bsg_data.arrays import Bools, Counts, Ints
from bsg_data.dataset.histograms import OtherObjects
from bsg_data.observation.view import View
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.class_space import find_wholes

# 3 was of a version before
_STREAM = {"rooms": 0, "classified": 1, "unclassified": 2, "withheld": 4, "parts": 5, "detector": 6}


def mask_generator(
    recipe: MaskRecipe, *, scene_id: str, draw: int, stream: str
) -> np.random.Generator:
    """Return the generator of one part of one draw of one building: a key of `_STREAM`.

    Its seed depends only on these, never on order, workers or other buildings.
    """
    building = np.frombuffer(hashlib.sha256(scene_id.encode()).digest()[:16], dtype="<u4")
    entropy = [recipe.seed, *building.tolist(), draw, _STREAM[stream]]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy)))


def sample_hidden(
    cells: Counts,
    view: View,
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    stream: Literal["classified", "unclassified"] = "classified",
) -> Counts:
    """Sample how many objects of every cell are hidden, `[1 + R, K]`, never above `cells`.

    `cells` `[1 + R, K]` has the objects per room and kind, classified or not, row 0 the null
    region. Each kind of objects has its own stream of random numbers.
    """
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream=stream)
    hidden = _hide_exactly(cells, view, rng) if view.exact else _hide_each(cells, view, rng)
    return np.where(view.withheld, cells, hidden) if stream == "classified" else hidden


def sample_unknown(
    recipe: MaskRecipe, *, scene_id: str, draw: int, classes: int, words: int = 0
) -> tuple[Bools, Bools]:
    """Sample which classes `[C]` and other words `[K]` the robot's detector does not know."""
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream="detector")
    limited, known = rng.random() < recipe.detector, rng.random()
    return limited & (rng.random(classes) > known), limited & (rng.random(words) > known)


def _hide_each(cells: Counts, view: View, rng: np.random.Generator) -> Counts:
    """Hide every object by itself, with the share of its node."""
    return rng.binomial(cells, view.hidden_share[:, None])


def _hide_exactly(cells: Counts, view: View, rng: np.random.Generator) -> Counts:
    """Hide an exact number of the objects of all nodes of one share.

    Single objects taken without replacement, counted per cell, are multivariate hypergeometric.
    """
    share = view.hidden_share
    hidden = np.where((share == 1)[:, None], cells, 0)
    for one in np.unique(share[(share > 0) & (share < 1)]).tolist():
        there = np.where((share == one)[:, None], cells, 0)
        # Exact in decimals: 0.29 of 100 is 29, not 28.
        if number := math.floor(Decimal(repr(one)) * int(there.sum())):
            places = np.nonzero(there)
            hidden[places] = rng.multivariate_hypergeometric(
                there[places], number, method="marginals"
            )
    return hidden


def sample_others(
    others: OtherObjects,
    view: View,
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    there: Counts,
    hidden: Counts,
    classes: Sequence[str],
) -> Counts:
    """Sample how many objects outside the classes are seen, by room and category.

    Parts of a thing are hidden with it, if the recipe says so: each part is attached to a random
    thing of its class in its room. Where the room has none, and in the null region, which is no
    room, it falls under the ordinary rule. What the robot's detector does not know is not seen.

    `others` are the objects outside the classes of the building, `there` `[N, C]` the classified
    ones of the robot's graph, and `hidden` those of them that are hidden. Returns what is left of
    the others in the graph, `[N, K]`.
    """
    which: Any = {"scene_id": scene_id, "draw": draw}
    cells = view.cut(others.cells)
    wholes = find_wholes(others.categories, classes)
    attached = have_wholes(there, wholes) & recipe.parts
    alone, parts = np.where(attached, 0, cells), np.where(attached, cells, 0)
    gone = sample_hidden(alone, view, recipe, **which, stream="unclassified")
    if attached.any():
        rng = mask_generator(recipe, **which, stream="parts")
        rate = np.where(attached, hidden[:, wholes] / np.maximum(there[:, wholes], 1), 0.0)
        gone += rng.binomial(parts, rate)
    if recipe.detector:
        size = {"classes": len(classes), "words": cells.shape[1]}
        _, unknown = sample_unknown(recipe, **which, **size)
        gone[:, unknown] = cells[:, unknown]
    return cells - gone


def have_wholes(there: Counts, wholes: Ints) -> Bools:
    """Return in which rooms a category has a thing to be a part of, `[N, K]`.

    `there` `[N, C]` has the classified objects, `wholes` `[K]` the class that each category is a
    part of, -1 for none.
    """
    attached = (wholes >= 0) & (there[:, wholes] > 0)
    attached[0] = False
    return attached
