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

import hashlib
import math
from abc import ABC, abstractmethod
from decimal import Decimal
from typing import ClassVar, Literal

import numpy as np

from bsg_data.arrays import Bools, Counts, Floats, Ints
from bsg_data.observation.view import View
from bsg_data.recipes import Exploration, MaskRecipe
from bsg_data.registry import Registry
from bsg_data.scene.connections import Connections

# A room that is glimpsed shows something; rooms that are half seen hide so much more that the
# building hides the fraction. They give at most this part of what they show for it.
GLIMPSES_OF_SHOWN = 0.5
Stream = Literal["rooms", "classified", "unclassified", "withheld", "parts"]
_STREAM: dict[Stream, int] = {
    "rooms": 0,
    "classified": 1,
    "unclassified": 2,
    "withheld": 4,  # 3 was of a version before
    "parts": 5,
}


class Mask(ABC):
    """A way in which a robot comes to have seen a part of a building.

    Attributes:
        summary: what it hides, in one line.
        reads_connections: whether it asks which rooms connect.
    """

    summary: ClassVar[str]
    reads_connections: ClassVar[bool] = False

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
        order = _walk(number, entered, plan, connections, rng)
        inside, outside = order[:entered], order[entered:]
        half = rng.permutation(inside)[searched:]
        mean = _odds_share(fraction * (1 - closed), (1 - fraction) * (1 - bare), alone=fraction)
        shares = np.zeros(number)
        shares[outside] = 1.0
        if len(half):
            limit = GLIMPSES_OF_SHOWN * len(half) * (1 - mean)
            near = _beside(inside, outside, number, connections)
            glimpsed, hide = _glimpse(near, plan, limit, rng)
            shares[glimpsed] = hide
            more = float((1 - hide).sum()) / len(half)
            shares[half] = _spread(mean + more, len(half), plan, rng)
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
        if nodes > 1:
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


def mask_generator(
    recipe: MaskRecipe, *, scene_id: str, draw: int, stream: Stream
) -> np.random.Generator:
    """Return the generator of one part of one draw of one scene."""
    digest = np.frombuffer(hashlib.sha256(scene_id.encode()).digest()[:16], dtype="<u4")
    entropy = [recipe.seed, *digest.tolist(), draw, _STREAM[stream]]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy)))


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
    known = connections if connections is not None else Connections.of_pairs(())
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream="rooms")
    view = MASKS[recipe.strategy].look(shape, recipe, connections=known, rng=rng)
    if not recipe.withhold:
        return view
    return view.withhold(sample_withheld(recipe, scene_id=scene_id, draw=draw, classes=shape[1]))


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
    share = view.hidden_share
    if view.exact:
        hidden = np.where((share == 1)[:, None], cells, 0)
        for one in np.unique(share[(share > 0) & (share < 1)]):
            hidden += _take_exactly(np.where((share == one)[:, None], cells, 0), float(one), rng)
    else:
        hidden = rng.binomial(cells, share[:, None])
    return np.where(view.withheld, cells, hidden) if stream == "classified" else hidden


def _take_exactly(cells: Counts, share: float, rng: np.random.Generator) -> Counts:
    """Take ⌊share · n⌋ of n objects, exact in decimals: 0.29 of 100 is 29, not 28.

    Single objects taken without replacement, counted per cell, are multivariate hypergeometric.
    """
    taken = np.zeros_like(cells)
    number = math.floor(Decimal(repr(share)) * int(cells.sum()))
    candidates = np.flatnonzero(cells)
    if number and len(candidates):
        taken.ravel()[candidates] = rng.multivariate_hypergeometric(
            cells.ravel()[candidates], number, method="marginals"
        )
    return taken


def _odds_share(hidden: float, shown: float, *, alone: float) -> float:
    """Return hidden / (hidden + shown), or `alone` where there is neither."""
    return hidden / (hidden + shown) if hidden + shown else alone


def _walk(
    number: int,
    entered: int,
    plan: Exploration,
    connections: Connections,
    rng: np.random.Generator,
) -> Ints:
    """Return the rooms from 0, those that are entered first, in the order of entering them.

    Over connections the robot starts in a random room and goes on in a random one beside those that
    it was in; where a connected part is exhausted, in any other. Where nothing is known, every room
    neighbours every other.
    """
    if not (plan.connected and len(connections)):
        return rng.permutation(number)
    neighbours = _neighbours(number, connections)
    inside, frontier = np.zeros(number, dtype=bool), np.zeros(number, dtype=bool)
    order = []
    for _ in range(entered):
        reachable = frontier & ~inside
        room = int(rng.choice(np.flatnonzero(reachable if reachable.any() else ~inside)))
        inside[room] = True
        frontier |= neighbours[room]
        order.append(room)
    return np.concatenate([np.array(order, dtype=np.int64), np.flatnonzero(~inside)])


def _beside(inside: Ints, outside: Ints, number: int, connections: Connections) -> Ints:
    """Return the rooms outside that a door joins to one inside; all of them if none is known."""
    if not (len(inside) and len(connections)):
        return outside if len(inside) else outside[:0]
    reachable: Bools = np.asarray(_neighbours(number, connections)[inside].any(axis=0))
    return outside[reachable[outside]]


def _glimpse(
    near: Ints, plan: Exploration, limit: float, rng: np.random.Generator
) -> tuple[Ints, Floats]:
    """Sample which rooms are glimpsed and what they hide; they show `limit` in all at most."""
    chosen = rng.permutation(near)[rng.random(len(near)) < plan.glimpsed]
    hide = _as_told(rng.uniform(*plan.glimpsed_share, size=len(chosen)))
    within = np.cumsum(1 - hide) <= limit
    return chosen[within], hide[within]


def _spread(mean: float, number: int, plan: Exploration, rng: np.random.Generator) -> Floats:
    """Sample shares uniformly around a mean, as far from it as the plan says."""
    width = plan.spread * max(min(mean, 1 - mean), 0.0)
    if not width:
        return np.full(number, min(mean, 1.0))
    return _as_told(rng.uniform(mean - width, mean + width, size=number))


def _as_told(shares: Floats) -> Floats:
    """Return shares in the precision that they are told in: none that is less is told as 1."""
    return shares.astype(np.float32).astype(np.float64)


def _neighbours(number: int, connections: Connections) -> Bools:
    """Return which rooms connect, `[R, R]`, from 0."""
    matrix = np.zeros((number, number), dtype=bool)
    left, right = connections.pairs.T - 1
    matrix[left, right] = matrix[right, left] = True
    return matrix
