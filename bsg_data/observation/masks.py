"""Masks: choose at random which objects a robot has not seen (paper, section III-B).

A mask samples a `View`: which rooms the robot visited, and the hidden share of each node. It does
not look at the objects, so the shares are right in the mean, and it depends only on (recipe,
scene_id, draw): never on order, workers or other scenes. `MASKS` has one row for each mask;
docs/format.md compares them. All but `uniform` and `search` are explorations with other numbers.
"""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from bsg_data.arrays import Bools, Counts, Floats, Ints
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.view import View, hide_cells, sample_unknown
from bsg_data.recipes import Exploration, MaskRecipe
from bsg_data.registry import Registry
from bsg_data.scene.connections import NO_CONNECTIONS, Connections

# A glimpsed room shows something, so partly seen rooms hide more to keep the building's fraction.
# They give up at most this fraction of what they show.
_GLIMPSES_OF_SHOWN = 0.5
_TOURS = 0.6  # of the draws of `mixed`
_BESIDE = 2  # places in the list of rooms: sources list rooms that are near one after the other


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """What a mask may know of a building.

    Attributes:
        shape: (N, C), nodes and classes; node 0 is the building, the others are its rooms.
        connections: between rooms; empty if none is known.
        nameable: `[C]` classes that the building's source can name; None: all. The others are
            withheld at all nodes, as from a detector that does not know them.
    """

    shape: tuple[int, int]
    connections: Connections = NO_CONNECTIONS
    nameable: Bools | None = None

    @property
    def rooms(self) -> int:
        """Return the number of rooms R = N − 1."""
        return self.shape[0] - 1

    @property
    def classes(self) -> int:
        """Return the number of classes C."""
        return self.shape[1]


@dataclass(frozen=True)
class Mask:
    """A way to choose what a robot has seen of a building.

    Attributes:
        summary: what it hides, in one line.
        look: samples how much the robot has seen of each node (`View.of_rooms`) from the layout of
            a building, the recipe, and the generator of this building and draw.
        reads_connections: whether it uses the connections between rooms.
        varies: whether the views of a building differ from draw to draw.
    """

    summary: str
    look: Callable[[Layout, MaskRecipe, np.random.Generator], View]
    reads_connections: bool = False
    varies: bool = True


def sample_masks(
    cells: Sequence[Counts], layouts: Sequence[Layout], streams: MaskStreams
) -> tuple[list[View], Counts, Counts]:
    """Sample M masks of buildings of cells `[N, C]`.

    Return their views, the cells in the robots' graphs `[K, C]`, those of one after another, and
    how many of each are hidden.
    """
    views = sample_views(layouts, streams)
    present = np.concatenate([view.cut(counts) for view, counts in zip(views, cells, strict=True)])
    return views, present, hide_cells(present, views, streams)


def sample_views(layouts: Sequence[Layout], streams: MaskStreams) -> list[View]:
    """Sample how much a robot has seen in M draws; all layouts have the same classes."""
    recipes = streams.recipes
    looks = {name: MASKS[name].look for name in {recipe.strategy for recipe in recipes}}
    looked = [
        looks[recipe.strategy](layout, recipe, rng)
        for layout, recipe, rng in zip(layouts, recipes, streams.of("rooms"), strict=True)
    ]
    withheld, unknown = np.zeros((2, len(looked), layouts[0].classes), dtype=bool)
    if any(recipe.withhold for recipe in recipes):
        for row, rng, recipe in zip(withheld, streams.of("withheld"), recipes, strict=True):
            row[:] = rng.random(len(row)) < recipe.withhold
    if any(recipe.detector for recipe in recipes):
        for row, rng, recipe in zip(unknown, streams.of("detector"), recipes, strict=True):
            row[:] = sample_unknown(rng, recipe, classes=len(row))[0]
    for row, layout in zip(unknown, layouts, strict=True):
        if layout.nameable is not None:
            row |= ~layout.nameable
    for number in np.flatnonzero((withheld | unknown).any(axis=1)).tolist():
        looked[number] = looked[number].withhold(withheld[number], unknown=unknown[number])
    return looked


def _see_partly(layout: Layout, recipe: MaskRecipe, _: np.random.Generator) -> View:
    """See every room partly: the mask of the paper."""
    shares = np.full(layout.rooms, recipe.fraction)
    return View.of_rooms(
        shares, classes=layout.classes, entered=True, alone=recipe.fraction, exact=True
    )


def _search(layout: Layout, recipe: MaskRecipe, rng: np.random.Generator) -> View:
    """See every room partly, then search none to half of them, each number equally likely.

    At most half, because a building that is fully searched has nothing left to predict.
    """
    shares = np.full(layout.rooms, recipe.fraction)
    number = int(rng.integers(layout.rooms // 2 + 1))
    shares[rng.permutation(layout.rooms)[:number]] = 0
    return View.of_rooms(shares, classes=layout.classes, entered=True, alone=recipe.fraction)


def _explore(
    layout: Layout,
    fraction: float,
    plan: Exploration,
    rng: np.random.Generator,
    *,
    closed: float | None = None,
) -> View:
    """Sample which rooms are not entered, searched, partly seen or glimpsed, and their shares.

    Let x be the share of the hidden objects in rooms not entered, and y the share of the shown
    objects in searched rooms. Of R rooms, x·f·R are then not entered and y·(1 − f)·R searched, in
    the mean. The others hide b = f·(1 − x) / (f·(1 − x) + (1 − f)·(1 − y)), which gives f in all.
    `closed` is x, if it is known.
    """
    number, classes = layout.rooms, layout.classes
    if not number:
        return View.of_rooms(np.zeros(0), classes=classes, alone=fraction, exact=plan.exact)
    low, high = plan.not_entered if closed is None else (closed, closed)
    closed = rng.uniform(low, high)
    bare = rng.uniform(*plan.searched)
    if plan.connected and fraction:  # the robot is in one room at least
        closed = min(closed, (number - 1) / (fraction * number))
    lot = rng.random()
    entered = number - math.floor(closed * fraction * number + lot)
    searched = min(entered, math.ceil(bare * (1 - fraction) * number - lot))
    order = _walk(number, entered, plan, layout.connections, rng)
    inside, outside = order[:entered], order[entered:]
    half = rng.permutation(inside)[searched:]
    hide, show = fraction * (1 - closed), (1 - fraction) * (1 - bare)
    mean = hide / (hide + show) if hide + show else fraction
    shares, was_there = np.zeros(number), np.zeros(number, dtype=bool)
    shares[outside], was_there[inside] = 1.0, True
    if len(half):
        limit = _GLIMPSES_OF_SHOWN * len(half) * (1 - mean)
        near = _find_beside(inside, outside, number, layout.connections)
        glimpsed, hidden = _glimpse(near, plan, limit, rng)
        shares[glimpsed] = hidden
        more = float((1 - hidden).sum()) / len(half)
        shares[half] = _spread_shares(mean + more, len(half), plan, rng)
    return View.of_rooms(shares, classes=classes, entered=was_there, exact=plan.exact)


def _tour(layout: Layout, recipe: MaskRecipe, rng: np.random.Generator) -> View:
    """Find the fraction of the rooms that the recipe says, at least one, or its number."""
    number = recipe.rooms or max(1, round(recipe.fraction * layout.rooms))
    hidden = float(rng.uniform(*recipe.exploration.hidden))
    return _find_rooms(number, layout, hidden, recipe.exploration, rng)


def _find_rooms(
    number: int, layout: Layout, fraction: float, plan: Exploration, rng: np.random.Generator
) -> View:
    """Find a number of rooms, and enter none to all of them, each number equally likely.

    A robot that has entered none was told of them. The fraction is hidden of those entered.
    """
    ways, nodes = layout.connections, np.arange(layout.shape[0])
    if number < layout.rooms:
        ways = ways if len(ways) else _follow_list(layout.rooms)
        walked = _walk(layout.rooms, number, plan, ways, rng)[:number]
        nodes = np.concatenate([[0], 1 + np.sort(walked)])
        ways = ways.among(nodes)
    found = len(nodes) - 1
    entered = int(rng.integers(found + 1))
    if found and not entered:
        view = View.of_rooms(np.ones(found), classes=layout.classes, entered=False)
        return replace(view, nodes=nodes)
    hidden = (found - entered + entered * fraction) / max(found, 1)
    closed = (found - entered) / (hidden * found) if hidden else 0.0
    part = Layout((len(nodes), layout.classes), ways)
    return replace(_explore(part, hidden, plan, rng, closed=closed), nodes=nodes)


def _mix(layout: Layout, recipe: MaskRecipe, rng: np.random.Generator) -> View:
    """Look by another mask, most often a tour of k rooms, log k uniform: robots begin with one.

    The shares of each mask are right in the mean, and the choice does not look at the objects. So
    the shares of the mixture are right, too. The building hides the fraction, less what `search`
    shows.
    """
    if rng.random() < _TOURS and layout.rooms:
        number = int(layout.shape[0] ** rng.random())
        return _find_rooms(number, layout, recipe.fraction, recipe.exploration, rng)
    masks = UNIFORM, ROOMS, FRONTIER, EXPLORE, SEARCH
    return masks[int(rng.integers(len(masks)))].look(layout, recipe, rng)


_WHOLE = Exploration(not_entered=(1, 1), searched=(1, 1), glimpsed=0, spread=0, connected=False)
_BEYOND = Exploration(not_entered=(0.5, 0.5), searched=(0, 0), glimpsed=0, spread=0)
UNIFORM = Mask(
    "the paper's: single objects, uniformly; every room is visited", _see_partly, varies=False
)
ROOMS = Mask(
    "whole rooms at random; the others show everything",
    lambda layout, recipe, rng: _explore(layout, recipe.fraction, _WHOLE, rng),
)
FRONTIER = Mask(
    "rooms beyond a connected set of visited ones, and objects in these",
    lambda layout, recipe, rng: _explore(layout, recipe.fraction, _BEYOND, rng),
    reads_connections=True,
)
EXPLORE = Mask(
    "what robots really have: rooms searched, half seen, glimpsed or not entered",
    lambda layout, recipe, rng: _explore(layout, recipe.fraction, recipe.exploration, rng),
    reads_connections=True,
)
SEARCH = Mask("moments of a search: every room is half seen, then up to half are searched", _search)
TOUR = Mask(
    "a building that is being found: rooms that were not are not in the graph",
    _tour,
    reads_connections=True,
)
MIXED = Mask(
    "six draws in ten tour, the others uniform, rooms, frontier, explore or search",
    _mix,
    reads_connections=True,
)
MASKS: Registry[Mask] = Registry(
    "mask",
    Mask,
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
