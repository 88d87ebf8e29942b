"""Sample the searches of a study by its recipe: artifacts, starts, masks and worlds."""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Bools, Counts, Floats, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.registry import require_known
from bsg_models.search.looks import USUAL_WAY, metres_of_look
from bsg_models.search.room_graphs import (
    MEASURED,
    WorldRecipe,
    measure_travel,
    sample_travel,
    world_generator,
)
from bsg_models.search.simulator import Episodes
from bsg_models.studies.search_request import StudyRecipe

_LOOKS = 4  # in a room, that may miss; the next one opens all, or some searches would never end
_NOT_MEASURED = {
    "layout": "no room layout says which of their rooms connect",
    "geometry": "no mesh says which of their rooms connect",
}


def sample_episodes(
    data: Dataset, scene_id: str, world: WorldRecipe, recipe: StudyRecipe
) -> Episodes | str:
    """Sample the searches of one building in one world, or return why there are none."""
    cells = data.cells(scene_id)
    nodes, episodes = len(cells), recipe.episodes
    if world.kind in MEASURED:
        travel, rooms = measure_travel(
            data.connections(scene_id), nodes=nodes, episodes=episodes, kind=world.kind
        )
        if not rooms.any():
            return _NOT_MEASURED[world.kind]
    else:
        rooms = np.arange(nodes) > 0
        travel = sample_travel(
            world, nodes=nodes, episodes=episodes, scene_id=scene_id, seed=recipe.seed
        )
    classes = data.manifest.class_space.classes
    require_known("class", recipe.artifacts or (), classes)
    pool = np.array([recipe.artifacts is None or name in recipe.artifacts for name in classes])
    drawn = _sample_searches(cells, rooms, pool, recipe, scene_id=scene_id)
    if drawn is None:
        return "no artifact that some room has and another has not"
    artifacts, starts = drawn
    instances = np.where(rooms[:, None], cells, 0)[:, artifacts].transpose(1, 0, 2)
    luck = None
    if recipe.chance < 1:
        draw = world_generator(recipe.seed, scene_id, "luck")
        luck = draw.random((episodes, nodes, _LOOKS))
    look = _cost_looks(data, scene_id, world, recipe)
    return Episodes(travel, rooms, starts, artifacts, instances, look, recipe.chance, luck)


def sample_starts(episodes: Episodes, recipe: StudyRecipe, scene_id: str) -> Ints:
    """Return the rooms where several robots start, `[E, K]`: the episode's, and any others."""
    draw = world_generator(recipe.seed, scene_id, "robots")
    others = draw.choice(np.flatnonzero(episodes.rooms), (len(episodes.starts), recipe.robots - 1))
    return np.concatenate([episodes.starts[:, None], others], axis=1)


def _cost_looks(
    data: Dataset, scene_id: str, world: WorldRecipe, recipe: StudyRecipe
) -> Floats | None:
    """Return the cost of a look in each room, `[N]`; None if a look is nothing."""
    areas = data.surroundings(scene_id).floor_area
    if recipe.look != "usual":
        return np.full(len(areas), recipe.look) if recipe.look else None
    metres = np.array([metres_of_look(None if np.isnan(a) else float(a)) for a in areas])
    way = USUAL_WAY if world.kind in MEASURED else (world.low + world.high) / 2
    return metres * way / USUAL_WAY


def _sample_searches(
    cells: Counts, rooms: Bools, pool: Bools, recipe: StudyRecipe, *, scene_id: str
) -> tuple[Ints, Ints] | None:
    """Sample artifacts `[E, 1]` and starts `[E]`; None if no search is possible.

    The artifact is uniform over the classes of the pool `[C]` that some room has and another has
    not. The start is uniform over the rooms without it, or over all rooms, as the recipe says.
    """
    present = (cells > 0) & rooms[:, None]
    sought = pool & present.any(axis=0)
    lacking = sought & ~present  # [N, C] what a search that starts in a room may look for
    lacking &= rooms[:, None]
    first = np.flatnonzero(lacking.any(axis=0))
    if not len(first):
        return None
    numbers = world_generator(recipe.seed, scene_id, "searches").random((recipe.episodes, 2))
    artifacts = first[(numbers[:, 0] * len(first)).astype(int)]
    starts = np.zeros(recipe.episodes, dtype=np.int64)
    for e, artifact in enumerate(artifacts):
        possible = np.flatnonzero(rooms if recipe.start == "anywhere" else lacking[:, artifact])
        starts[e] = possible[int(numbers[e, 1] * len(possible))]
    return artifacts[:, None], starts
