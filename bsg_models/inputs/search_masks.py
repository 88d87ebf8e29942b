"""What a robot knows in the middle of a search (paper, section IV-D).

Before it starts, a mask hid a share of the objects, and *no* instance of the artifact was put into
the partial graph. A room that it entered shows everything. So that none of a class is seen means
nothing in a room that was not searched, if the class was *withheld* there, and is a fact in one
that was; models are told which is which.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bsg_data.dataset.histograms import Counts, to_histograms
from bsg_data.observation.masks import mask_generator
from bsg_data.recipes import MaskRecipe

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SearchView:
    """What E searches of one building see.

    Attributes:
        inputs: `[E, N, C]` histograms.
        share: `[E, N]` of its objects that a node hides, as far as the robot knows.
        withheld: `[E, N, C]` where a class is withheld: the node hides all of it.
    """

    inputs: Counts
    share: npt.NDArray[np.float64]
    withheld: Bools


def view_search(
    cells: Counts, left: Counts, *, searched: Bools, withheld: Bools, fraction: float
) -> SearchView:
    """Return what searches see.

    Args:
        cells: `[N, C]` objects of a building.
        left: `[E, N, C]` or `[N, C]` what the mask left of them.
        searched: `[E, N]` rooms that were entered; the building (0) is none.
        withheld: `[E, C]` classes of which the mask showed nothing.
        fraction: of the mask, which a room that was not searched still hides.
    """
    seen = np.where(searched[:, :, None], cells, left)
    hides = withheld[:, None, :] & ~searched[:, :, None]
    seen[hides] = 0
    rooms = searched.shape[1] - 1
    share = np.where(searched, 0.0, fraction)
    share[:, 0] = fraction * (1 - searched[:, 1:].sum(axis=1) / rooms if rooms else 1.0)
    hides[:, 0] &= (share[:, 0] > 0)[:, None]
    return SearchView(to_histograms(seen), share, hides)


def sample_search(
    recipe: MaskRecipe, *, scene_id: str, draw: int, shape: tuple[int, int], withhold: float
) -> tuple[Bools, Bools]:
    """Draw a moment of a search: which rooms were searched, and which classes are withheld.

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
    rng = mask_generator(recipe, scene_id=scene_id, draw=draw, part="search")
    nodes, classes = shape
    searched = np.zeros(nodes, dtype=bool)
    if nodes > 1:
        number = int(rng.integers((nodes - 1) // 2 + 1))
        searched[1 + rng.permutation(nodes - 1)[:number]] = True
    return searched, rng.random(classes) < withhold
