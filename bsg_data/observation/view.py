"""A view: how much a robot has seen of each node of a building; and what is hidden under it.

A view says nothing of the objects. Objects outside the classes, and parts of things, are hidden
under it by other random numbers, so they do not change the mask of the classified ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import cycle, pairwise

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Counts, Floats, Ints
from bsg_data.dataset.histograms import Unclassified
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.class_space import find_wholes

_NO_KINDS: Ints = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class View:
    """How much a robot has seen of each node of a building.

    A mask samples the view without looking at the objects, and a model learns nothing else of the
    mask. Given the view, each object of node n is hidden with the probability `hidden_share[n]`. So
    the shares are right in the mean, for any building.

    Attributes:
        visited: `[N]` whether the robot was there; always true for the building (0).
        hidden_share: `[N]` hidden share of each node. The building's is the mean of its rooms',
            because the robot knows the number of rooms but not their objects.
        nodes: `[N]` index in the building of each node, rising from 0; rooms that the robot has not
            found are missing.
        withheld: `[N, C]` whether a class is withheld at a node.
        exact: whether the nodes of one share s lose exactly ⌊s · their objects⌋ together;
            otherwise each object is hidden independently.
    """

    visited: Bools
    hidden_share: Floats
    withheld: Bools
    nodes: Ints
    exact: bool = False

    @classmethod
    def of_rooms(
        cls,
        shares: Floats,
        *,
        classes: int,
        entered: Bools | bool | None = None,
        alone: float = 0.0,
        exact: bool = False,
    ) -> View:
        """Return the view of a building from the hidden shares of its rooms `[R]`.

        Args:
            shares: `[R]` hidden share of each room.
            classes: number C of the classes.
            entered: `[R]` or one for all, whether the robot was there; None: where a share is
                below 1.
            alone: hidden share of a building without rooms.
            exact: see the attribute.
        """
        nodes = 1 + len(shares)
        share, visited = np.empty(nodes), np.empty(nodes, dtype=bool)
        share[0], share[1:] = _average_rooms(shares, alone), shares
        visited[0], visited[1:] = True, shares < 1 if entered is None else entered
        return cls(visited, share, np.zeros((nodes, classes), dtype=bool), np.arange(nodes), exact)

    def cut(self, cells: Counts) -> Counts:
        """Return the rows of cells `[1 + R, K]` that are in the robot's graph, `[N, K]`.

        Objects in no room are only in the graph of a robot that has found all rooms.
        """
        if len(self.nodes) == len(cells):
            return cells
        found = cells[self.nodes]
        found[0] = 0
        return found

    def in_building(self, nodes: int) -> View:
        """Return the view with all nodes of a building; rooms that were not found hide all."""
        if len(self.nodes) == nodes:
            return self
        share, visited = np.ones(nodes), np.zeros(nodes, dtype=bool)
        withheld = np.tile(self.withheld.any(axis=0), (nodes, 1))
        share[self.nodes], visited[self.nodes] = self.hidden_share, self.visited
        share[0], withheld[self.nodes] = _average_rooms(share[1:], share[0]), self.withheld
        return View(visited, share, withheld, np.arange(nodes), self.exact)

    def take(self, first: int, last: int) -> View:
        """Return the view of the nodes from `first` to before `last`."""
        names = ("visited", "hidden_share", "withheld", "nodes")
        return replace(self, **{name: getattr(self, name)[first:last] for name in names})

    def withhold(self, classes: Bools, *, unknown: Bools | bool = False) -> View:
        """Return the view with classes `[C]` withheld at all nodes that hide anything.

        Those `unknown` to the robot's detector are withheld at all nodes.
        """
        hidden = classes & (self.hidden_share > 0)[:, None]
        return replace(self, withheld=self.withheld | hidden | unknown)

    def agrees(self, other: View) -> bool:
        """Say whether two views are equal, with shares in single precision."""
        names = ("nodes", "visited", "shares_float32", "withheld")
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in names)

    @property
    def shares_float32(self) -> npt.NDArray[np.float32]:
        """The hidden shares `[N]` in single precision, as models read and pairs store them."""
        return self.hidden_share.astype(np.float32)


def _average_rooms(shares: Floats, alone: float) -> float:
    """Return the hidden share of a building from those of its rooms `[R]`; `alone` without any."""
    if len(set(shares.tolist())) == 1:
        return float(shares[0])  # exact; a mean of floats would not be
    return float(shares.sum() / len(shares)) if len(shares) else alone


def hide_cells(cells: Counts, views: Sequence[View], streams: MaskStreams) -> Counts:
    """Sample how many objects of every cell are hidden, `[D · K, C]`, never above `cells`.

    `cells` `[K, C]` has the classified objects of the nodes of M views, one building after another,
    row 0 of each the null region. The D · M streams are those of D draws, one draw after another.
    """
    draws, width = len(streams) // len(views), cells.shape[1]
    share = np.concatenate([view.hidden_share for view in views])
    filled, flat = np.flatnonzero(cells), cells.reshape(-1)
    ends = filled.searchsorted(np.cumsum([0, *(len(view.nodes) * width for view in views)]))
    hidden = np.zeros((draws, flat.size), dtype=cells.dtype)
    hidden[:, filled] = _hide(
        flat[filled], share[filled // width], ends, views, streams.of("classified")
    )
    withheld = np.concatenate([view.withheld for view in views]).reshape(-1)
    if withheld.any():
        hidden = np.where(withheld, flat, hidden)
    return hidden.reshape(-1, width)


def _hide(
    counts: Counts,
    share: Floats,
    ends: Ints,
    views: Sequence[View],
    generators: Iterable[np.random.Generator],
) -> Counts:
    """Sample how many of some objects `[P]` are hidden in D draws, `[D, P]`.

    `share` `[P]` is that of their nodes. Each view is of the objects between two `ends` `[M + 1]`;
    the generators are those of all views for one draw after another.
    """
    ways = [
        _way_to_hide(counts[first:last], share[first:last], exact=view.exact)
        for view, (first, last) in zip(views, pairwise(ends.tolist()), strict=True)
    ]
    drawn = [way(rng) for way, rng in zip(cycle(ways), generators, strict=False)]
    return np.concatenate(drawn).reshape(len(drawn) // len(ways), -1)


def _way_to_hide(
    counts: Counts, share: Floats, *, exact: bool
) -> Callable[[np.random.Generator], Counts]:
    """Return a function that samples how many of the objects `[P]` of a building are hidden.

    Single objects taken without replacement, counted per cell, are multivariate hypergeometric.
    """
    if not exact:
        return lambda rng: rng.binomial(counts, share)
    lots = list[tuple[Ints, Counts, int]]()
    for common in sorted(set(share.tolist()) - {0.0, 1.0}):
        some = np.flatnonzero((share == common) & (counts > 0))
        # Exact in decimals: 0.29 of 100 is 29, not 28.
        if number := math.floor(Decimal(repr(common)) * int(counts[some].sum())):
            lots.append((some, counts[some], number))
    if len(lots) == 1 and len(lots[0][0]) == len(counts):
        _, _, number = lots[0]
        return lambda rng: rng.multivariate_hypergeometric(counts, number)

    def draw(rng: np.random.Generator) -> Counts:
        hidden = np.where(share == 1, counts, 0)
        for some, colours, number in lots:
            hidden[some] = rng.multivariate_hypergeometric(colours, number)
        return hidden

    return draw


def sample_unknown(
    rng: np.random.Generator, recipe: MaskRecipe, *, classes: int, kinds: Ints = _NO_KINDS
) -> tuple[Bools, Ints]:
    """Sample which classes `[C]` the robot's detector does not know, and which of other kinds.

    The generator is that of the stream `detector`; with it the classes are the same at every call.
    """
    if rng.random() >= recipe.detector:
        return np.zeros(classes, dtype=bool), _NO_KINDS
    known = rng.random()
    return rng.random(classes) > known, kinds[rng.random(len(kinds)) > known]


def see_unclassified(
    unclassified: Sequence[Unclassified],
    views: Sequence[View],
    streams: MaskStreams,
    *,
    present: Counts,
    hidden: Counts,
    classes: Sequence[str],
) -> list[Unclassified]:
    """Sample which objects outside the classes are seen in each of M buildings.

    Parts of a thing are hidden with it, if the recipe says so: each part is attached to a random
    thing of its class in its room. Where the room has none, and in the null region, which is no
    room, it falls under the ordinary rule. What the robot's detector does not know is not seen.

    `unclassified` are the objects outside the classes of the buildings, `present` `[K, C]` the
    classified ones of the robots' graphs, and `hidden` those of them that are hidden; both may be
    cells or histograms.
    """
    recipes = streams.recipes
    found = [objects.cut(view.nodes) for objects, view in zip(unclassified, views, strict=True)]
    counts = np.concatenate([objects.counts for objects in found])
    share = [view.hidden_share[objects.rows] for view, objects in zip(views, found, strict=True)]
    ends = np.cumsum([0, *(len(objects.counts) for objects in found)])
    spans = [slice(*span) for span in pairwise(ends.tolist())]
    rate = np.full(len(counts), np.nan)  # at which parts of a thing are hidden
    if any(recipe.parts for recipe in recipes):
        rate = _find_rates(found, views, recipes, present=present, hidden=hidden, classes=classes)
    is_part = ~np.isnan(rate)
    alone = np.where(is_part, 0, counts)
    (gone,) = _hide(alone, np.concatenate(share), ends, views, streams.of("unclassified"))
    if is_part.any():
        for rng, span in zip(streams.of("parts"), spans, strict=True):
            parts = span.start + np.flatnonzero(is_part[span])
            gone[parts] = rng.binomial(counts[parts], rate[parts])
    seen = counts - gone
    if any(recipe.detector for recipe in recipes):
        every = zip(streams.of("detector"), recipes, unclassified, found, spans, strict=True)
        for rng, recipe, whole, objects, span in every:
            kinds = np.unique(whole.kinds)
            _, unknown = sample_unknown(rng, recipe, classes=len(classes), kinds=kinds)
            seen[span][np.isin(objects.kinds, unknown)] = 0
    return [replace(objects, counts=seen[span]) for objects, span in zip(found, spans, strict=True)]


def _find_rates(
    found: Sequence[Unclassified],
    views: Sequence[View],
    recipes: Sequence[MaskRecipe],
    *,
    present: Counts,
    hidden: Counts,
    classes: Sequence[str],
) -> Floats:
    """Return the hidden share of the things that objects are parts of, `[P]`; NaN for no part."""
    rates, first = [], 0
    for objects, view, recipe in zip(found, views, recipes, strict=True):
        rows = slice(first, first + len(view.nodes))
        first = rows.stop
        whole = find_wholes(objects.names, classes)[objects.kinds]
        things, gone = (counts[rows][objects.rows, whole] for counts in (present, hidden))
        attached = (whole >= 0) & (things > 0) & (objects.rows > 0) & recipe.parts
        rates.append(np.where(attached, gone / np.maximum(things, 1), np.nan))
    return np.concatenate(rates)
