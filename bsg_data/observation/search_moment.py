"""Make the observation of a robot during a search (paper, section IV-D).

Before the search, a mask hides some objects, and all instances of the artifact are *withheld* from
the partial graph. A room that the search entered shows everything. So the absence of a withheld
class is a fact in a searched room, and says nothing in any other. Models are told which is which.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bsg_data.arrays import Bools, Counts, Ints
from bsg_data.dataset.histograms import to_histograms
from bsg_data.observation.hidden_others import have_wholes
from bsg_data.observation.observation import Observation
from bsg_data.observation.view import View
from bsg_data.scene.connections import Connections, stack_connections
from bsg_data.scene.surroundings import Surroundings, repeat_surroundings


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
    views: Sequence[View],
    searched: Bools,
    withheld: Bools,
    vocabulary: tuple[str, ...],
    connections: Connections,
    wholes: Ints | None = None,
    surroundings: Surroundings | None = None,
) -> Observation:
    """Return what E searches of one building see, one building of the observation each.

    Args:
        scene_id: of the building.
        classified: `[N, C]` objects of the classes.
        others: `[N, V]` objects by the vocabulary.
        views: `[E]` of the masks before the searches began.
        searched: `[E, N]` rooms that were entered since; the building (0) is none.
        withheld: `[E, C]` classes of which nothing is shown elsewhere, not even in rooms that the
            robot had searched before.
        vocabulary: `[V]`.
        connections: between the rooms.
        wholes: `[V]` class that each category is a part of, -1 for none, where parts of what is
            withheld are, too; None where they are not.
        surroundings: of the building; None where nothing is known.
    """
    searches, nodes = searched.shape
    share = np.where(searched, 0.0, np.stack([view.hidden_share for view in views]))
    if nodes > 1:
        share[:, 0] = share[:, 1:].mean(axis=1)
    outside = ~searched[:, :, None]
    before = np.stack([view.withheld for view in views])
    without = (withheld[:, None, :] | before) & outside
    seen, seen_others = classified.seen(searched), others.seen(searched)
    seen[without] = 0
    if wholes is not None:
        seen_others[have_wholes(classified.there, wholes) & withheld[:, None, wholes] & outside] = 0
    without[:, 0] &= (share[:, 0] > 0)[:, None]
    starts = np.arange(searches + 1) * nodes
    visited = np.stack([view.visited for view in views]) | searched
    around = Surroundings.unknown(nodes=nodes) if surroundings is None else surroundings
    return Observation(
        scene_ids=(scene_id,) * searches,
        starts=starts,
        inputs=to_histograms(seen).reshape(searches * nodes, -1),
        hidden_share=share.astype(np.float32).ravel(),
        visited=visited.ravel(),
        withheld=without.reshape(searches * nodes, -1),
        vocabulary=vocabulary,
        others=to_histograms(seen_others).reshape(searches * nodes, -1),
        connections=stack_connections([connections] * searches, starts[:-1].tolist()),
        surroundings=repeat_surroundings(around, searches),
    )
