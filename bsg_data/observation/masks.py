"""Masks: what a robot has not seen yet, sampled at random (paper, section III-B).

A mask samples a `View`: where the robot was and which share of its objects each node hides. Then
the view's shares are taken from the objects. A mask is not shown the objects, so that what it tells
of them is true in the mean. Each mask is one row of `MASKS`:

- `uniform`, the paper's: every room is half seen. ⌊fraction · n⌋ of the n classified objects are
  hidden, uniformly without replacement.
- `rooms`: that fraction of the rooms is not entered, the rest shows everything.
- `frontier`: a connected set of rooms is entered. Half of what is hidden is rooms that were not
  entered, the other half is hidden in those that were.
- `explore`: what robots really have. Some rooms are searched, some half seen (each with a share of
  its own), some glimpsed through a door, the rest not entered. All masks above are corners of it:
  the same code with other values of `bsg_data.recipes.Exploration`, each written in its class.
- `search`, moments of an object search: every room is half seen, then from none to half of the
  rooms are searched. Its fraction is that of the rooms that were not.
- `mixed`: each draw of each building is one of the five above, which are equally likely. What is
  told says nothing of which: a model that is trained under it is for whatever a robot has seen.

Any of them may also withhold classes, and hide parts of things with the things (`MaskRecipe`).

Objects without a class are hidden apart, under the same view, so that a mask of the classified ones
does not depend on them. A mask depends on (recipe, scene_id, draw) alone: never on order, workers
or other scenes.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import chain, repeat
from typing import ClassVar

import numpy as np

from bsg_data.arrays import Bools, Counts
from bsg_data.observation.explored_rooms import (
    divide_share,
    find_beside,
    glimpse,
    spread_shares,
    walk,
)
from bsg_data.observation.hiding import Hiding
from bsg_data.observation.mask_streams import Stream, mask_generator, mask_generators
from bsg_data.observation.view import View
from bsg_data.recipes import Exploration, MaskRecipe
from bsg_data.registry import Registry
from bsg_data.scene.connections import Connections

# A room that is glimpsed shows something; rooms that are half seen hide so much more that the
# building hides the fraction. They give at most this part of what they show for it.
GLIMPSES_OF_SHOWN = 0.5


class Mask(ABC):
    """A way in which a robot comes to have seen a part of a building.

    Attributes:
        summary: what it hides, in one line.
        reads_connections: whether it asks which rooms connect.
        is_fixed: whether it sees a building of some rooms in one way alone, whatever is drawn.
    """

    summary: ClassVar[str]
    reads_connections: ClassVar[bool] = False
    is_fixed: ClassVar[bool] = False

    @abstractmethod
    def look(
        self,
        shape: tuple[int, int],
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> View:
        """Sample how much the robot has seen of each node; `View.of_rooms` makes it of rooms.

        Args:
            shape: (N, C), nodes and classes; node 0 is the building, the rest are its rooms.
            recipe: of the mask.
            connections: of the building's rooms; empty where none is known.
            rng: of this building and draw.
        """


class Exploring(Mask):
    """A robot that goes through a building as an `Exploration` says."""

    reads_connections = True

    def plan(self, recipe: MaskRecipe) -> Exploration:
        """Return how it goes."""
        return recipe.exploration

    def look(
        self,
        shape: tuple[int, int],
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> View:
        """Sample which rooms are not entered, searched, half seen and glimpsed, and their shares.

        With x of what is hidden in rooms that are not entered, and y of what is shown in rooms that
        are searched, R rooms are expected to be x·f·R not entered and y·(1 − f)·R searched ones.
        The rest hides b = f·(1 − x) / (f·(1 − x) + (1 − f)·(1 − y)), which makes f in all.
        """
        plan, fraction = self.plan(recipe), recipe.fraction
        number = shape[0] - 1
        if not number:
            return View.of_rooms(np.zeros(0), classes=shape[1], alone=fraction, exact=plan.exact)
        closed = rng.uniform(*plan.not_entered)
        bare = rng.uniform(*plan.searched)
        if plan.connected and fraction:  # the robot is in one room at least
            closed = min(closed, (number - 1) / (fraction * number))
        lot = rng.random()
        entered = number - math.floor(closed * fraction * number + lot)
        searched = min(entered, math.ceil(bare * (1 - fraction) * number - lot))
        order = walk(number, entered, plan, connections, rng)
        inside, outside = order[:entered], order[entered:]
        half = rng.permutation(inside)[searched:]
        mean = divide_share(fraction * (1 - closed), (1 - fraction) * (1 - bare), alone=fraction)
        shares = np.zeros(number)
        shares[outside] = 1.0
        if len(half):
            limit = GLIMPSES_OF_SHOWN * len(half) * (1 - mean)
            near = find_beside(inside, outside, number, connections)
            glimpsed, hide = glimpse(near, plan, limit, rng)
            shares[glimpsed] = hide
            more = float((1 - hide).sum()) / len(half)
            shares[half] = spread_shares(mean + more, len(half), plan, rng)
        was_there = np.zeros(number, dtype=bool)
        was_there[inside] = True
        return View.of_rooms(shares, classes=shape[1], entered=was_there, exact=plan.exact)


class ExploreMask(Exploring):
    """Search some rooms, see some by half, glimpse some, and enter no others."""

    summary = "what robots really have: rooms searched, half seen, glimpsed or not entered"


class Corner(Exploring):
    """An exploration whose values are fixed."""

    exploration: ClassVar[Exploration]

    def plan(self, recipe: MaskRecipe) -> Exploration:
        """Return the values of the corner."""
        return self.exploration


class UniformMask(Corner):
    """Hide ⌊fraction · n⌋ objects uniformly; every room is visited."""

    summary = "the paper's: single objects, uniformly; every room is visited"
    reads_connections = False
    is_fixed = True
    exploration = Exploration(
        not_entered=(0, 0), searched=(0, 0), glimpsed=0, spread=0, connected=False, exact=True
    )


class RoomsMask(Corner):
    """Leave out rooms at random, and show all of the others."""

    summary = "whole rooms at random; the others show everything"
    reads_connections = False
    exploration = Exploration(
        not_entered=(1, 1), searched=(1, 1), glimpsed=0, spread=0, connected=False
    )


class FrontierMask(Corner):
    """Visit a connected set of rooms, and hide objects in these rooms, too."""

    summary = "rooms beyond a connected set of visited ones, and objects in these"
    exploration = Exploration(not_entered=(0.5, 0.5), searched=(0, 0), glimpsed=0, spread=0)


class SearchMask(Mask):
    """Half see every room, then search from none to half of them, each number as likely.

    A building that was searched has nothing left to teach, hence half.
    """

    summary = "moments of a search: every room is half seen, then up to half are searched"

    def look(
        self,
        shape: tuple[int, int],
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> View:
        """Sample which rooms are searched; the others hide the fraction."""
        nodes, classes = shape
        half_seen = View.of_rooms(
            np.full(nodes - 1, recipe.fraction),
            classes=classes,
            entered=np.ones(nodes - 1, dtype=bool),
            alone=recipe.fraction,
        )
        rooms = np.zeros(nodes, dtype=bool)
        number = int(rng.integers((nodes - 1) // 2 + 1))
        rooms[1 + rng.permutation(nodes - 1)[:number]] = True
        return half_seen.search(rooms)


class MixedMask(Mask):
    """See each building as one of several other masks would, each as likely."""

    summary = "each draw one of uniform, rooms, frontier, explore and search, equally likely"
    reads_connections = True
    parts: ClassVar[tuple[str, ...]] = ("uniform", "rooms", "frontier", "explore", "search")

    def look(
        self,
        shape: tuple[int, int],
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> View:
        """Choose a mask, and sample its view.

        Each of them tells the truth in the mean, and which one it is does not ask for the objects:
        so does the mixture. Its building hides the fraction less what `search` shows of it.
        """
        chosen = MASKS[self.parts[int(rng.integers(len(self.parts)))]]
        return chosen.look(shape, recipe, connections=connections, rng=rng)


MASKS: Registry[Mask] = Registry(
    "mask",
    Mask,  # type: ignore[type-abstract]
    group="bsg_data.masks",
    rows={
        "uniform": "bsg_data.observation.masks:UNIFORM",
        "rooms": "bsg_data.observation.masks:ROOMS",
        "frontier": "bsg_data.observation.masks:FRONTIER",
        "explore": "bsg_data.observation.masks:EXPLORE",
        "search": "bsg_data.observation.masks:SEARCH",
        "mixed": "bsg_data.observation.masks:MIXED",
    },
)
UNIFORM, ROOMS, FRONTIER = UniformMask(), RoomsMask(), FrontierMask()
EXPLORE, SEARCH, MIXED = ExploreMask(), SearchMask(), MixedMask()


def sample_view(
    shape: tuple[int, int],
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    connections: Connections | None = None,
) -> View:
    """Sample how much a robot has seen of a building, and which classes are withheld.

    Args:
        shape: (N, C), nodes of interest and classes.
        recipe: of the mask.
        scene_id: of the building.
        draw: number of the draw.
        connections: between the rooms; None where none is known.

    Raises:
        RecipeError: if nobody knows the strategy.
    """
    (view,) = sample_views(shape, recipe, scene_id=scene_id, draws=(draw,), connections=connections)
    return view


def sample_views(
    shape: tuple[int, int],
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draws: Sequence[int],
    connections: Connections | None = None,
) -> Iterator[View]:
    """Yield what `sample_view` returns for each of some draws, in less time.

    A mask that sees every building in one way yields the same object again and again.
    """
    known = connections if connections is not None else Connections.of_pairs(())
    mask = MASKS[recipe.strategy]
    generators = partial(mask_generators, recipe, scene_id=scene_id)
    sampled = draws[:1] if mask.is_fixed else draws
    looks = (
        mask.look(shape, recipe, connections=known, rng=rng)
        for rng in generators(draws=sampled, stream="rooms")
    )
    views = chain.from_iterable(repeat(view, len(draws) // len(sampled)) for view in looks)
    if not recipe.withhold:
        yield from views
        return
    for view, rng in zip(views, generators(draws=draws, stream="withheld"), strict=True):
        yield view.withhold(rng.random(shape[1]) < recipe.withhold)


def sample_withheld(recipe: MaskRecipe, *, scene_id: str, draw: int, classes: int) -> Bools:
    """Sample which classes a mask withholds, `[C]`."""
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream="withheld")
    return rng.random(classes) < recipe.withhold


def sample_hidden(
    cells: Counts,
    view: View,
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    stream: Stream = "classified",
) -> Counts:
    """Sample how many objects of every cell are hidden.

    Args:
        cells: `[1 + R, K]` objects per room and kind, classified or not; row 0 the null region.
        view: from `sample_view`.
        recipe: of the mask.
        scene_id: of the building.
        draw: number of the draw.
        stream: which objects these are; each kind has a generator of its own.

    Returns:
        `[1 + R, K]`, nowhere above `cells`.
    """
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream=stream)
    hidden = Hiding.under(view, cells).draw(rng)
    return np.where(view.withheld, cells, hidden) if stream == "classified" else hidden


def sample_hidden_draws(
    cells: Counts,
    views: Sequence[View],
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draws: Sequence[int],
) -> Counts:
    """Sample what `sample_hidden` does of classified objects for some draws, in less time.

    Args:
        cells: `[1 + R, C]` classified objects, row 0 the null region.
        views: `[D]` from `sample_views`.
        recipe: of the mask.
        scene_id: of the building.
        draws: `[D]` numbers of the masks.

    Returns:
        `[D, 1 + R, C]`.
    """
    hidden = np.empty((len(views), *cells.shape), dtype=cells.dtype)
    rngs = mask_generators(recipe, scene_id=scene_id, draws=draws, stream="classified")
    hiding, same = None, None
    for place, (view, rng) in enumerate(zip(views, rngs, strict=True)):
        if hiding is None or view is not same:
            hiding, same = Hiding.under(view, cells), view
        hidden[place] = hiding.draw(rng)
        if recipe.withhold:
            np.copyto(hidden[place], cells, where=view.withheld)
    return hidden
