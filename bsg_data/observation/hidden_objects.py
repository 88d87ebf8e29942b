"""Sample which objects are hidden under a view: those of the classes, the others, and their parts.

Objects without a class are hidden separately, under the same view, so they do not change the mask
of the classified objects.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from bsg_data.arrays import Bools, Counts, Floats, Ints
from bsg_data.observation.mask_streams import Stream, mask_generator, mask_generators
from bsg_data.observation.view import View
from bsg_data.recipes import MaskRecipe


def sample_hidden(
    cells: Counts,
    view: View,
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    stream: Stream = "classified",
) -> Counts:
    """Sample how many objects of every cell are hidden, `[1 + R, K]`, never above `cells`.

    `cells` `[1 + R, K]` has the objects per room and kind, classified or not, row 0 the null
    region. Each kind of objects has its own stream of random numbers.
    """
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream=stream)
    hidden = _Hiding.under(view, cells).draw(rng)
    return np.where(view.withheld, cells, hidden) if stream == "classified" else hidden


def sample_hidden_draws(
    cells: Counts,
    views: Sequence[View],
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draws: Sequence[int],
) -> Counts:
    """Sample as `sample_hidden` does, for D views and draws, but faster.

    Of the nodes `[K, C]` that the views have of the building, those of one view after another.
    """
    ends = np.cumsum([len(view.nodes) for view in views])
    hidden = np.empty((ends[-1], cells.shape[1]), dtype=cells.dtype)
    rngs = mask_generators(recipe, scene_id=scene_id, draws=draws, stream="classified")
    hiding, same = None, None
    for view, rng, end in zip(views, rngs, ends.tolist(), strict=True):
        there, rows = view.cut(cells), slice(end - len(view.nodes), end)
        if hiding is None or view is not same:
            hiding, same = _Hiding.under(view, there), view
        hidden[rows] = hiding.draw(rng)
        if recipe.withhold or recipe.detector:
            np.copyto(hidden[rows], there, where=view.withheld)
    return hidden


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

    `cells` `[N, K]` are the objects outside the classes, row 0 the null region; `there` `[N, C]`
    the classified ones and `hidden` those of them that are hidden; `wholes` `[K]` the class that
    each category is a part of, -1 for none, which is read with `recipe.parts` alone. Returns
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

    `there` `[N, C]` has the classified objects, `wholes` `[K]` the class that each category is a
    part of, -1 for none.
    """
    attached = (wholes >= 0) & (there[:, wholes] > 0)
    attached[0] = False
    return attached


@dataclass(frozen=True, eq=False)
class _Hiding:
    """How the objects of some cells are hidden under a view, for one draw or many."""

    certain: Counts  # [1 + R, K] what is hidden whatever is drawn
    taken: tuple[tuple[_Some, int], ...]  # cells of a share that loses an exact number of objects
    rest: tuple[_Some, Floats] | None  # cells whose objects are each hidden by itself, with shares

    @classmethod
    def under(cls, view: View, cells: Counts) -> _Hiding:
        """Return how the objects of cells `[1 + R, K]` are hidden under a view of the 1 + R."""
        share = view.hidden_share
        if not view.exact:
            some = _Some.of(cells)
            return cls(np.zeros_like(cells), (), (some, share[some.places // cells.shape[1]]))
        taken = []
        for one in np.unique(share[(share > 0) & (share < 1)]).tolist():
            some = _Some.of(np.where((share == one)[:, None], cells, 0))
            if number := _count_exactly(one, int(some.counts.sum())):
                taken.append((some, number))
        return cls(np.where((share == 1)[:, None], cells, 0), tuple(taken), None)

    def draw(self, rng: np.random.Generator) -> Counts:
        """Sample how many objects of every cell are hidden, `[1 + R, K]`.

        Single objects taken without replacement, counted per cell, are multivariate hypergeometric.
        """
        hidden = self.certain.copy()
        flat = hidden.reshape(-1)
        for some, number in self.taken:
            flat[some.places] = rng.multivariate_hypergeometric(
                some.counts, number, method="marginals"
            )
        if self.rest is not None:
            some, shares = self.rest
            # Cells without objects take no random number: leaving them out changes nothing.
            flat[some.places] = rng.binomial(some.counts, shares)
        return hidden


@dataclass(frozen=True, eq=False, slots=True)
class _Some:
    """The cells that hold objects: their places in the flattened cells, and how many in each."""

    places: Ints
    counts: Counts

    @classmethod
    def of(cls, cells: Counts) -> _Some:
        flat = cells.ravel()
        places = np.flatnonzero(flat)
        return cls(places, flat[places])


def _count_exactly(share: float, number: int) -> int:
    """Return ⌊share · number⌋, exact in decimals: 0.29 of 100 is 29, not 28."""
    return math.floor(Decimal(repr(share)) * number)
