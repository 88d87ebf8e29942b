"""A view: how much a robot has seen of each node of a building; and what is hidden under it.

A view says nothing of the objects. Under it are hidden the objects of the classes, the others, and
parts of things. Objects without a class are hidden separately, so they do not change the mask of
the classified objects.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Counts, Floats, Ints
from bsg_data.dataset.histograms import OtherObjects
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.class_space import find_wholes

# 3 was of a version before
_STREAM = {"rooms": 0, "classified": 1, "unclassified": 2, "withheld": 4, "parts": 5, "detector": 6}


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
        entered: Bools | None = None,
        alone: float = 0.0,
        exact: bool = False,
    ) -> View:
        """Return the view of a building from the hidden shares of its rooms `[R]`.

        Args:
            shares: `[R]` hidden share of each room.
            classes: number C of the classes.
            entered: `[R]` whether the robot entered each room; None: all with a share below 1.
            alone: hidden share of a building without rooms.
            exact: see the attribute.
        """
        inside = shares < 1 if entered is None else entered
        share = np.concatenate([[alone], shares])
        share[0] = _share_of_building(share)
        withheld = np.zeros((len(share), classes), dtype=bool)
        visited = np.concatenate([[True], inside])
        return cls(visited, share, withheld, np.arange(len(share)), exact)

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
        shares, entered = np.ones(nodes), np.zeros(nodes, dtype=bool)
        shares[self.nodes], entered[self.nodes] = self.hidden_share, self.visited
        whole = View.of_rooms(
            shares[1:], classes=self.withheld.shape[1], entered=entered[1:], exact=self.exact
        )
        whole = whole.withhold(np.asarray(self.withheld.any(axis=0)))
        whole.withheld[self.nodes] = self.withheld
        return whole

    def take(self, first: int, last: int) -> View:
        """Return the view of the nodes from `first` to before `last`."""
        rows = slice(first, last)
        return replace(
            self,
            visited=self.visited[rows],
            hidden_share=self.hidden_share[rows],
            withheld=self.withheld[rows],
            nodes=self.nodes[rows],
        )

    def search(self, rooms: Bools) -> View:
        """Return the view after some rooms `[N]` were searched; they hide nothing."""
        share = np.where(rooms, 0.0, self.hidden_share)
        share[0] = _share_of_building(share)
        withheld = self.withheld & ~rooms[:, None]
        withheld[0] &= share[0] > 0
        return replace(self, visited=self.visited | rooms, hidden_share=share, withheld=withheld)

    def withhold(self, classes: Bools) -> View:
        """Return the view with some classes `[C]` withheld at all nodes that hide anything."""
        without = classes & (self.hidden_share > 0)[:, None]
        return replace(self, withheld=self.withheld | without)

    def blind(self, classes: Bools) -> View:
        """Return the view of a robot whose detector does not know some classes `[C]`."""
        return replace(self, withheld=self.withheld | classes)

    def agrees(self, other: View) -> bool:
        """Say whether two views are equal, with shares in single precision."""
        return (
            np.array_equal(self.nodes, other.nodes)
            and np.array_equal(self.visited, other.visited)
            and np.array_equal(self.told, other.told)
            and np.array_equal(self.withheld, other.withheld)
        )

    @property
    def told(self) -> npt.NDArray[np.float32]:
        """The hidden shares `[N]` in single precision, as models read and pairs store them."""
        return self.hidden_share.astype(np.float32)


def _share_of_building(share: Floats) -> float:
    """Return the hidden share of a building `[1 + R]`: the mean of its rooms, or its own."""
    rooms = share[1:]
    if not len(rooms):
        return float(share[0])
    if (rooms == rooms[0]).all():
        return float(rooms[0])  # exact; a mean of floats would not be
    return float(rooms.mean())


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
