"""Make worlds: the room graphs that a robot travels in, with their costs.

The paper draws the cost of every edge at random, but does not say of which graph. That decides how
much a belief saves. So there are several kinds:

- `star`: every room is joined to the building node, the paper's scene graph read literally.
- `complete`: an edge between any two rooms, and the robot takes that edge.
- `tree`: every room but the first is joined to a random one before it.
- `layout`: the rooms that connect in a room layout; costs are metres between their centroids.
- `geometry`: the same for connections found in a mesh.

The costs of the first three are uniform between `low` and `high`. A world has the rooms that can be
reached from each other. If a layout falls into parts, it is the part with the most rooms.
"""

from __future__ import annotations

import hashlib
from typing import Literal, get_args

import numpy as np
from pydantic import Field, model_validator

from bsg_data.arrays import Bools
from bsg_data.errors import RecipeError
from bsg_data.records import Record
from bsg_data.registry import require_known
from bsg_data.scene.connections import Connections
from bsg_data.words.shown import SHOWN
from bsg_models.search.knowledge import Travel, find_ways, go_straight

WorldKind = Literal["star", "complete", "tree", "layout", "geometry"]
MEASURED: tuple[Literal["layout", "geometry"], ...] = ("layout", "geometry")
METHODS = {"layout": ("layout",), "geometry": ("door", "stairs", "boxes")}


class WorldRecipe(Record):
    """The recipe for the room graphs of a building.

    Attributes:
        kind: one of the kinds above.
        low: least cost of an edge; measured kinds ignore it.
        high: greatest cost of an edge; measured kinds ignore it.
    """

    kind: WorldKind
    low: float = Field(default=1.0, ge=0, allow_inf_nan=False)
    high: float = Field(default=10.0, gt=0, allow_inf_nan=False)

    @model_validator(mode="after")
    def _costs_rise(self) -> WorldRecipe:
        if self.low > self.high:
            raise ValueError(f"costs must rise, found {self.low:g} to {self.high:g}")
        return self

    @property
    def name(self) -> str:
        """The recipe as `parse_world` reads it, e.g. `star:1-10`."""
        return self.kind if self.kind in MEASURED else f"{self.kind}:{self.low:g}-{self.high:g}"


DEFAULT_WORLDS = (
    WorldRecipe(kind="star"),
    WorldRecipe(kind="complete", low=5.0),
    WorldRecipe(kind="tree"),
)


def parse_world(text: str) -> WorldRecipe:
    """Return the recipe that a text like `complete:5-10` or `layout` names."""
    kind, has_costs, costs = text.strip().partition(":")
    require_known("world", [kind], get_args(WorldKind))
    if not has_costs:
        usual = (world for world in DEFAULT_WORLDS if world.kind == kind)
        return next(usual, WorldRecipe.model_validate({"kind": kind}))
    low, _, high = costs.partition("-")
    try:
        if kind in MEASURED:
            raise ValueError("its costs are metres")
        return WorldRecipe.model_validate({"kind": kind, "low": low, "high": high})
    except ValueError as error:
        shown = text[:SHOWN]
        raise RecipeError(
            f"world {shown!r}: expected KIND or KIND:LOW-HIGH with 0 ≤ LOW ≤ HIGH, and HIGH above "
            f"0; {' and '.join(MEASURED)} have no LOW-HIGH, because their costs are metres",
            code="world-unknown",
            where=shown,
        ) from error


def measure_travel(
    connections: Connections, *, nodes: int, episodes: int, kind: Literal["layout", "geometry"]
) -> tuple[Travel, Bools]:
    """Return the same travel for E episodes, over connections whose lengths are known, in metres.

    Also the rooms `[N]` of the largest connected part; none if no connection is known.
    """
    edges = np.full((nodes, nodes), np.inf)
    known = np.isin(connections.methods, METHODS[kind]) & ~np.isnan(connections.lengths)
    left, right = connections.pairs[known].T
    edges[left, right] = edges[right, left] = connections.lengths[known]
    travel = find_ways(edges[None])
    reached = np.isfinite(travel.costs[0])
    rooms = reached[reached.sum(axis=1).argmax()]
    shape = (episodes, nodes, nodes)
    travel = Travel(np.broadcast_to(travel.costs, shape), np.broadcast_to(travel.steps, shape))
    return travel, rooms & (rooms.sum() > 1)


def sample_travel(
    recipe: WorldRecipe, *, nodes: int, episodes: int, scene_id: str, seed: int
) -> Travel:
    """Sample the travel of a building's episodes, which depends only on these arguments.

    The travel of an episode does not depend on their number.
    """
    rng = world_generator(seed, scene_id, recipe.name)
    edges = np.full((episodes, nodes, nodes), np.inf)
    if recipe.kind == "star":
        costs = rng.uniform(recipe.low, recipe.high, (episodes, nodes - 1))
        edges[:, 0, 1:] = edges[:, 1:, 0] = costs
        return find_ways(edges)
    left, right = 1 + np.stack(np.triu_indices(nodes - 1, 1))
    for graph in edges:  # drawing for all at once would take as much memory as the edges
        graph[left, right] = graph[right, left] = rng.uniform(recipe.low, recipe.high, len(left))
    if recipe.kind == "complete":
        return go_straight(edges)
    joins = world_generator(seed, scene_id, f"{recipe.name} joins")
    edges[~_sample_trees(joins, episodes, nodes)] = np.inf
    return find_ways(edges)


def world_generator(seed: int, scene_id: str, part: str) -> np.random.Generator:
    """Return the random generator for one part of the episodes of a building."""
    hashes = (
        np.frombuffer(hashlib.sha256(t.encode()).digest()[:16], "<u4") for t in (scene_id, part)
    )
    entropy = [seed, *np.concatenate(list(hashes)).tolist()]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy)))


def _sample_trees(rng: np.random.Generator, episodes: int, nodes: int) -> Bools:
    """Return random trees of the rooms, `[E, N, N]`."""
    rooms = nodes - 1
    drawn = rng.random((episodes, 2 * rooms))
    joined = np.zeros((episodes, nodes, nodes), dtype=bool)
    order = 1 + np.argsort(drawn[:, :rooms], axis=1)
    every = np.arange(episodes)
    for place in range(1, rooms):
        a, b = order[:, place], order[every, (drawn[:, rooms + place] * place).astype(int)]
        joined[every, a, b] = joined[every, b, a] = True
    return joined
