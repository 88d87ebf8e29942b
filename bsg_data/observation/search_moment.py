"""What a robot knows in the middle of a search (paper, section IV-D).

Before it starts, a mask hid a share of the objects, and *no* instance of the artifact was put into
the partial graph. A room that it entered shows everything. So that none of a class is seen means
nothing in a room that was not searched, if the class was *withheld* there, and is a fact in one
that was; models are told which is which.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bsg_data.arrays import Bools, Counts
from bsg_data.dataset.histograms import to_histograms
from bsg_data.observation.masks import mask_generator
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.connections import Connections, stack_connections


@dataclass(frozen=True, eq=False)
class MaskedCells:
    """The objects of one building, and what a mask left of them in each of E searches.

    Attributes:
        there: `[N, K]` all of them, row 0 the null region.
        left: `[E, N, K]` what the mask left.
    """

    there: Counts
    left: Counts

    def seen(self, searched: Bools) -> Counts:
        """Return what is seen, `[E, N, K]`, where `searched` `[E, N]` rooms show everything."""
        return np.where(searched[:, :, None], self.there, self.left)


def observe_search(
    scene_id: str,
    classified: MaskedCells,
    others: MaskedCells,
    *,
    searched: Bools,
    withheld: Bools,
    fraction: float,
    vocabulary: tuple[str, ...],
    connections: Connections,
) -> Observation:
    """Return what E searches of one building see, one building of the observation each.

    Args:
        scene_id: of the building.
        classified: `[N, C]` objects of the classes.
        others: `[N, V]` objects by the vocabulary.
        searched: `[E, N]` rooms that were entered; the building (0) is none.
        withheld: `[E, C]` classes of which the mask showed nothing.
        fraction: of the mask, which a room that was not searched still hides.
        vocabulary: `[V]`.
        connections: between the rooms.
    """
    searches, nodes = searched.shape
    seen = classified.seen(searched)
    without = withheld[:, None, :] & ~searched[:, :, None]
    seen[without] = 0
    rooms = nodes - 1
    share = np.where(searched, 0.0, fraction)
    share[:, 0] = fraction * (1 - searched[:, 1:].sum(axis=1) / rooms if rooms else 1.0)
    without[:, 0] &= (share[:, 0] > 0)[:, None]
    starts = np.arange(searches + 1) * nodes
    return Observation(
        scene_ids=(scene_id,) * searches,
        starts=starts,
        inputs=to_histograms(seen).reshape(searches * nodes, -1),
        hidden_share=share.astype(np.float32).ravel(),
        visited=np.ones(searches * nodes, dtype=bool),
        withheld=without.reshape(searches * nodes, -1),
        vocabulary=vocabulary,
        others=to_histograms(others.seen(searched)).reshape(searches * nodes, -1),
        connections=stack_connections([connections] * searches, starts[:-1].tolist()),
    )


def sample_search(
    recipe: MaskRecipe, *, scene_id: str, draw: int, shape: tuple[int, int], withhold: float
) -> tuple[Bools, Bools]:
    """Sample a moment of a search: which rooms were searched, and which classes are withheld.

    Args:
        recipe: of the mask, whose seed is used.
        scene_id: of the building.
        draw: number of the mask.
        shape: (N, C).
        withhold: share of the classes that are withheld, each by itself.

    Returns:
        `[N]` and `[C]`; every number of rooms from none to half of them is as likely: a room that
        was searched has nothing left to teach.
    """
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, stream="search")
    nodes, classes = shape
    searched = np.zeros(nodes, dtype=bool)
    if nodes > 1:
        number = int(rng.integers((nodes - 1) // 2 + 1))
        searched[1 + rng.permutation(nodes - 1)[:number]] = True
    return searched, rng.random(classes) < withhold
