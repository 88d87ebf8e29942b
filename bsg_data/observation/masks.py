"""Masks: choose at random which objects a robot has not seen (paper, section III-B).

A mask first samples a `View`: which rooms the robot visited, and the hidden share of each node. It
then hides these shares of the objects. The view is sampled without looking at the objects, so its
shares are right in the mean. `MASKS` has one row for each mask:

- `uniform`, the paper's mask: every room is partly seen. ⌊fraction · n⌋ of the n classified objects
  are hidden, uniformly without replacement.
- `rooms`: the fraction of the rooms is not entered; the other rooms show everything.
- `frontier`: the robot enters a connected set of rooms. Half of the hidden objects are in rooms
  that it did not enter, the other half in rooms that it entered.
- `explore`: a realistic exploration. Some rooms are searched, some partly seen (each with its own
  share), some glimpsed through a door, and the others not entered. The masks above are special
  cases: they use the same code with other values of `bsg_data.recipes.Exploration`.
- `search`: moments of an object search. Every room is partly seen, then none to half of the rooms
  are searched. The fraction applies to the rooms that are not searched.
- `tour`: a building that is being found. The robot goes from room to room, and has found some
  rooms; the others are not in its graph. Those that it found it explored as under `explore`. The
  fraction is that of the rooms that it found.
- `mixed`: six draws in ten use `tour`, with any number of rooms, the others one of the five masks
  above it, with equal probability. The view does not say which. A model trained under it fits any
  way of exploring.

Each mask can also withhold classes, give the robot a detector that knows few words, and hide parts
of objects with the objects (`MaskRecipe`).

Objects without a class are hidden separately, under the same view, so they do not change the mask
of the classified objects. A mask depends only on (recipe, scene_id, draw): never on order, workers
or other scenes.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from bisect import insort
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.view import View, sample_unknown
from bsg_data.recipes import Exploration, MaskRecipe
from bsg_data.registry import Registry
from bsg_data.scene.connections import NO_CONNECTIONS, Connections

# A glimpsed room shows something, so partly seen rooms hide more to keep the building's fraction.
# They give up at most this fraction of what they show.
_GLIMPSES_OF_SHOWN = 0.5
_TOURS = 0.6  # of the draws of `mixed`
_BESIDE = (
    2  # positions in the list of rooms: a source lists rooms that are near one after the other
)


class Mask(ABC):
    """A way to choose what a robot has seen of a building.

    Attributes:
        summary: what it hides, in one line.
        reads_connections: whether it uses the connections between rooms.
        varies: whether the views of a building differ from draw to draw.
    """

    summary: str
    reads_connections: bool = False
    varies: bool = True

    @abstractmethod
    def look(
        self,
        shape: tuple[int, int],
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> View:
        """Sample how much the robot has seen of each node; see `View.of_rooms`.

        Args:
            shape: (N, C), nodes and classes; node 0 is the building, the others are its rooms.
            recipe: recipe of the mask.
            connections: connections between the rooms; empty if none is known.
            rng: generator for this building and draw.
        """


class _Uniform(Mask):
    """See every room partly; the mask of the paper."""

    summary = "the paper's: single objects, uniformly; every room is visited"
    varies = False

    def look(
        self,
        shape: tuple[int, int],
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> View:
        """Return the view of a robot that was in every room."""
        rooms = shape[0] - 1
        return View.of_rooms(
            np.full(rooms, recipe.fraction),
            classes=shape[1],
            entered=np.ones(rooms, dtype=bool),
            alone=recipe.fraction,
            exact=True,
        )


@dataclass(frozen=True)
class _Exploring(Mask):
    """A mask of a robot that explores a building by an `Exploration`; None: that of the recipe."""

    summary: str
    exploration: Exploration | None = None
    reads_connections: bool = True

    def look(
        self,
        shape: tuple[int, int],
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> View:
        """Explore by the exploration of the mask, or of the recipe, and hide the fraction."""
        plan = self.exploration or recipe.exploration
        return self.explore(shape, recipe.fraction, plan, connections=connections, rng=rng)

    @staticmethod
    def explore(
        shape: tuple[int, int],
        fraction: float,
        plan: Exploration,
        *,
        closed: float | None = None,
        connections: Connections,
        rng: np.random.Generator,
    ) -> View:
        """Sample which rooms are not entered, searched, partly seen or glimpsed, and their shares.

        Let x be the share of the hidden objects in rooms not entered, and y the share of the shown
        objects in searched rooms. Of R rooms, x·f·R are then not entered and y·(1 − f)·R searched,
        in the mean. The others hide b = f·(1 − x) / (f·(1 − x) + (1 − f)·(1 − y)), which gives f in
        all. `closed` is x, if it is known.
        """
        number = shape[0] - 1
        if not number:
            return View.of_rooms(np.zeros(0), classes=shape[1], alone=fraction, exact=plan.exact)
        low, high = plan.not_entered if closed is None else (closed, closed)
        closed = rng.uniform(low, high)
        bare = rng.uniform(*plan.searched)
        if plan.connected and fraction:  # the robot is in one room at least
            closed = min(closed, (number - 1) / (fraction * number))
        lot = rng.random()
        entered = number - math.floor(closed * fraction * number + lot)
        searched = min(entered, math.ceil(bare * (1 - fraction) * number - lot))
        order = _walk(number, entered, plan, connections, rng)
        inside, outside = order[:entered], order[entered:]
        half = rng.permutation(inside)[searched:]
        hide, show = fraction * (1 - closed), (1 - fraction) * (1 - bare)
        mean = hide / (hide + show) if hide + show else fraction
        shares = np.zeros(number)
        shares[outside] = 1.0
        if len(half):
            limit = _GLIMPSES_OF_SHOWN * len(half) * (1 - mean)
            near = _find_beside(inside, outside, number, connections)
            glimpsed, hidden = _glimpse(near, plan, limit, rng)
            shares[glimpsed] = hidden
            more = float((1 - hidden).sum()) / len(half)
            shares[half] = _spread_shares(mean + more, len(half), plan, rng)
        was_there = np.zeros(number, dtype=bool)
        was_there[inside] = True
        return View.of_rooms(shares, classes=shape[1], entered=was_there, exact=plan.exact)


class _Search(Mask):
    """See every room partly, then search none to half of them, each number equally likely.

    At most half, because a building that is fully searched has nothing left to predict.
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
        nodes = shape[0]
        half_seen = UNIFORM.look(shape, recipe, connections=connections, rng=rng)
        rooms = np.zeros(nodes, dtype=bool)
        number = int(rng.integers((nodes - 1) // 2 + 1))
        rooms[1 + rng.permutation(nodes - 1)[:number]] = True
        return replace(half_seen.search(rooms), exact=False)


class _Tour(Mask):
    """Find some rooms of a building, and explore these."""

    summary = "a building that is being found: rooms that were not are not in the graph"
    reads_connections = True

    def look(
        self,
        shape: tuple[int, int],
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> View:
        """Find the fraction of the rooms that the recipe says, at least one, or its number."""
        number = max(1, round(recipe.fraction * (shape[0] - 1)))
        hidden, plan = float(rng.uniform(*recipe.exploration.hidden)), recipe.exploration
        return self.find(
            recipe.rooms or number, shape, hidden, plan, connections=connections, rng=rng
        )

    def find(
        self,
        number: int,
        shape: tuple[int, int],
        fraction: float,
        plan: Exploration,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> View:
        """Find a number of rooms, and enter none to all of them, each number equally likely.

        A robot that has entered none was told of them. The fraction is hidden of those entered.
        """
        rooms = shape[0] - 1
        ways, nodes = connections, np.arange(shape[0])
        if number < rooms:
            ways = connections if len(connections) else _follow_list(rooms)
            walked = _walk(rooms, number, plan, ways, rng)[:number]
            nodes = np.concatenate([[0], 1 + np.sort(walked)])
            ways = ways.among(nodes)
        found = len(nodes) - 1
        entered = int(rng.integers(found + 1))
        if not entered and found:
            nobody = np.zeros(found, dtype=bool)
            heard_of = View.of_rooms(np.ones(found), classes=shape[1], entered=nobody)
            return replace(heard_of, nodes=nodes)
        outside = found - entered
        hidden = (outside + entered * fraction) / max(found, 1)
        closed = outside / (hidden * found) if hidden else 0.0
        size = len(nodes), shape[1]
        seen = EXPLORE.explore(size, hidden, plan, closed=closed, connections=ways, rng=rng)
        return replace(seen, nodes=nodes)


class _Mixed(Mask):
    """See each building under one of several other masks, most often `tour`."""

    summary = "six draws in ten tour, the others uniform, rooms, frontier, explore or search"
    reads_connections = True

    def look(
        self,
        shape: tuple[int, int],
        recipe: MaskRecipe,
        *,
        connections: Connections,
        rng: np.random.Generator,
    ) -> View:
        """Choose a mask, and sample its view.

        The shares of each mask are right in the mean, and the choice does not look at the objects.
        So the shares of the mixture are right, too. The building hides the fraction, less what
        `search` shows. A tour finds k rooms with log k uniform: robots begin with one.
        """
        if rng.random() < _TOURS and shape[0] > 1:
            number = int(shape[0] ** rng.random())
            plan = recipe.exploration
            return TOUR.find(number, shape, recipe.fraction, plan, connections=connections, rng=rng)
        masks: tuple[Mask, ...] = (UNIFORM, ROOMS, FRONTIER, EXPLORE, SEARCH)
        chosen = masks[int(rng.integers(len(masks)))]
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
        "tour": "bsg_data.observation.masks:TOUR",
        "mixed": "bsg_data.observation.masks:MIXED",
    },
)
UNIFORM = _Uniform()
ROOMS = _Exploring(
    "whole rooms at random; the others show everything",
    Exploration(not_entered=(1, 1), searched=(1, 1), glimpsed=0, spread=0, connected=False),
    reads_connections=False,
)
FRONTIER = _Exploring(
    "rooms beyond a connected set of visited ones, and objects in these",
    Exploration(not_entered=(0.5, 0.5), searched=(0, 0), glimpsed=0, spread=0),
)
EXPLORE = _Exploring("what robots really have: rooms searched, half seen, glimpsed or not entered")
SEARCH, TOUR, MIXED = _Search(), _Tour(), _Mixed()


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """What a mask may know of a building.

    Attributes:
        shape: (N, C), nodes and classes.
        connections: between rooms, as far as they are known.
        nameable: `[C]` classes that the building's source can name; None: all. The others are
            withheld at all nodes, as from a detector that does not know them.
    """

    shape: tuple[int, int]
    connections: Connections = NO_CONNECTIONS
    nameable: Bools | None = None


def sample_view(
    shape: tuple[int, int],
    recipe: MaskRecipe,
    *,
    scene_id: str,
    draw: int,
    connections: Connections | None = None,
) -> View:
    """Sample how much a robot has seen of a building of `shape` (N, C), and what is withheld.

    Without connections, none between rooms is known.
    """
    layout = Layout(shape, NO_CONNECTIONS if connections is None else connections)
    (view,) = sample_views([layout], [recipe], MaskStreams([recipe], [scene_id], [draw]))
    return view


def sample_views(
    layouts: Sequence[Layout], recipes: Sequence[MaskRecipe], streams: MaskStreams
) -> list[View]:
    """Sample the views of M draws, each of one building by one recipe; see `sample_view`."""
    masks = {name: MASKS[name] for name in {recipe.strategy for recipe in recipes}}
    looked = [
        masks[recipe.strategy].look(layout.shape, recipe, connections=layout.connections, rng=rng)
        for layout, recipe, rng in zip(layouts, recipes, streams.of("rooms"), strict=True)
    ]
    return _withhold(looked, layouts, recipes, streams)


def _withhold(
    views: list[View],
    layouts: Sequence[Layout],
    recipes: Sequence[MaskRecipe],
    streams: MaskStreams,
) -> list[View]:
    """Return views with what their recipes and sources withhold of the classes."""
    classes = layouts[0].shape[1]
    withheld, blind = np.zeros((2, len(views), classes), dtype=bool)
    if any(recipe.withhold for recipe in recipes):
        for row, rng, recipe in zip(withheld, streams.of("withheld"), recipes, strict=True):
            row[:] = rng.random(classes) < recipe.withhold
    if any(recipe.detector for recipe in recipes):
        for row, rng, recipe in zip(blind, streams.of("detector"), recipes, strict=True):
            row[:] = sample_unknown(rng, recipe, classes=classes)[0]
    for row, layout in zip(blind, layouts, strict=True):
        if layout.nameable is not None:
            row |= ~layout.nameable
    changed = np.flatnonzero((withheld | blind).any(axis=1)).tolist()
    for number in changed:
        views[number] = views[number].withhold(withheld[number]).blind(blind[number])
    return views


def _walk(
    number: int,
    entered: int,
    plan: Exploration,
    connections: Connections,
    rng: np.random.Generator,
) -> Ints:
    """Return the rooms from 0, those that are entered first, in the order of entering them.

    Over connections the robot starts in a random room and goes on in a random one beside those that
    it was in; where these are exhausted, in any other. Where nothing is known, every room
    neighbours every other.
    """
    if not (plan.connected and len(connections)):
        return rng.permutation(number)
    beside: list[list[int]] = [[] for _ in range(number)]
    for left, right in (connections.pairs - 1).tolist():
        beside[left].append(right)
        beside[right].append(left)
    left_over, frontier, was_near = list(range(number)), list[int](), [False] * number
    order: list[int] = []
    for _ in range(entered):
        rooms = frontier or left_over  # both rise
        room = rooms[int(rng.integers(len(rooms)))]
        for near in (room, *beside[room]):
            if not was_near[near]:
                was_near[near] = True
                insort(frontier, near)
        frontier.remove(room)
        left_over.remove(room)
        order.append(room)
    return np.array(order + left_over, dtype=np.int64)


@lru_cache(maxsize=256)
def _follow_list(rooms: int) -> Connections:
    """Return connections between rooms that are near in the list of a building's rooms."""
    return Connections.of_pairs(
        (room, other)
        for room in range(1, rooms + 1)
        for other in range(room + 1, min(room + _BESIDE, rooms) + 1)
    )


def _find_beside(inside: Ints, outside: Ints, number: int, connections: Connections) -> Ints:
    """Return the rooms outside that a door joins to one inside; all of them if none is known."""
    if not (len(inside) and len(connections)):
        return outside if len(inside) else outside[:0]
    left, right = connections.pairs.T - 1
    entered, reachable = np.zeros((2, number), dtype=bool)
    entered[inside] = True
    reachable[left[entered[right]]] = True
    reachable[right[entered[left]]] = True
    return outside[reachable[outside]]


def _glimpse(
    near: Ints, plan: Exploration, limit: float, rng: np.random.Generator
) -> tuple[Ints, Floats]:
    """Sample which rooms are glimpsed and what they hide; they show `limit` in all at most."""
    chosen = rng.permutation(near)[rng.random(len(near)) < plan.glimpsed]
    hide = _to_float32(rng.uniform(*plan.glimpsed_share, size=len(chosen)))
    within = np.cumsum(1 - hide) <= limit
    return chosen[within], hide[within]


def _spread_shares(mean: float, number: int, plan: Exploration, rng: np.random.Generator) -> Floats:
    """Sample shares uniformly around a mean, as far from it as the plan says."""
    width = plan.spread * max(min(mean, 1 - mean), 0.0)
    if not width:
        return np.full(number, min(mean, 1.0))
    return _to_float32(rng.uniform(mean - width, mean + width, size=number))


def _to_float32(shares: Floats) -> Floats:
    """Return shares in the precision of `View.shares_float32`: there, none below 1 becomes 1."""
    return shares.astype(np.float32).astype(np.float64)
