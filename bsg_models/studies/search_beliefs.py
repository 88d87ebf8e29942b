"""What a model believes about the artifacts of searches, asked again after every room.

Many searches of a building come through the same state: the same mask, artifacts and explored
rooms. Each state is asked once, and remembered as long as the building is worked on.
"""

from __future__ import annotations

import numpy as np
import torch
from torch_geometric.data import Data

from bsg_data.dataset.histograms import Counts
from bsg_data.observation.masks import sample_hidden
from bsg_data.recipes import MaskRecipe
from bsg_models.errors import PredictionError
from bsg_models.inputs.graphs import Buildings, EdgeSet, connect, see_others
from bsg_models.inputs.search_masks import view_search
from bsg_models.search.shortest_paths import Bools, Floats, Ints
from bsg_models.zoo.model import BeliefModel

_NODES = 4096  # of all graphs that a model is asked about at once


class ModelBeliefs:
    """The beliefs of one model about searches of one building.

    Args:
        model: that is asked.
        edges: of the graphs that it was trained on.
        data: an open dataset.
        scene_id: the building.
        mask: that hid objects before the searches began.
        draws: `[E]` number of the mask of each.
        artifacts: `[E, A]` classes that each looks for, which are withheld.
    """

    def __init__(
        self,
        model: BeliefModel,
        *,
        edges: tuple[EdgeSet, ...],
        data: Buildings,
        scene_id: str,
        mask: MaskRecipe,
        draws: Ints,
        artifacts: Ints,
    ) -> None:
        self._model, self._mask, self._scene_id = model, mask, scene_id
        self._draws, self._artifacts = draws, artifacts
        self._cells = data.cells[scene_id]
        nodes = len(self._cells)
        visited = np.ones(nodes, dtype=bool)
        self._all_others = see_others(
            data, scene_id, MaskRecipe(fraction=0.0), 0, visited, model.vocabulary
        )
        self._left, self._others = {}, {}
        for draw in np.unique(draws).tolist():
            hidden = sample_hidden(self._cells, visited, mask, scene_id=scene_id, draw=draw)
            self._left[draw] = self._cells - hidden
            self._others[draw] = see_others(data, scene_id, mask, draw, visited, model.vocabulary)
        adjacent = data.adjacency.get(scene_id, [])
        self._edges = connect(nodes, edges, adjacent=adjacent)
        self._adjacent = connect(nodes, ("adjacent",), adjacent=adjacent)
        self._remembered: dict[bytes, tuple[Floats, Floats]] = {}

    def __call__(self, rows: Ints, explored: Bools) -> tuple[Floats, Floats]:
        """Return presence and share of the artifacts; see `bsg_models.search.simulator.Beliefs`."""
        states = np.concatenate(
            [self._draws[rows, None], self._artifacts[rows], explored.astype(np.int64)], axis=1
        )
        distinct, inverse = np.unique(states, axis=0, return_inverse=True)
        keys = [state.tobytes() for state in distinct]
        new = [i for i, key in enumerate(keys) if key not in self._remembered]
        size = max(1, _NODES // len(self._cells))
        for start in range(0, len(new), size):
            some = new[start : start + size]
            found = self._ask(distinct[some])
            for i, presence, share in zip(some, *found, strict=True):
                self._remembered[keys[i]] = presence, share
        answers = [self._remembered[key] for key in keys]
        presence = np.stack([answer[0] for answer in answers])[inverse.ravel()]
        return presence, np.stack([answer[1] for answer in answers])[inverse.ravel()]

    def _ask(self, states: Counts) -> tuple[Floats, Floats]:
        """Return presence and share of the artifacts in states `[S, 1 + A + N]`, `[S, N, A]`."""
        width = self._artifacts.shape[1]
        found = self._model.expect(self._to_graphs(states, width))
        shape = (len(states), len(self._cells), -1)
        columns = np.repeat(states[:, 1 : 1 + width], len(self._cells), axis=0)
        presence = found.hidden_counts.take_classes(columns).presence
        share = np.take_along_axis(found.distribution, columns, axis=1)
        if not np.isfinite(presence).all():  # of a finite answer: only by overflow
            raise PredictionError(f"{self._scene_id}: a presence is not finite; train it again")
        return presence.reshape(shape), share.reshape(shape)

    def _to_graphs(self, states: Counts, width: int) -> Data:
        """Return states as one batch of graphs."""
        count, nodes = len(states), len(self._cells)
        draws, searched = states[:, 0].tolist(), states[:, 1 + width :] > 0
        withheld = np.zeros((count, self._cells.shape[1]), dtype=bool)
        np.put_along_axis(withheld, states[:, 1 : 1 + width], True, axis=1)
        view = view_search(
            self._cells,
            np.stack([self._left[draw] for draw in draws]),
            searched=searched,
            withheld=withheld,
            fraction=self._mask.fraction,
        )
        others = np.stack([self._others[draw] for draw in draws])
        others = np.where(searched[:, :, None], self._all_others, others)
        others[:, 0] = self._null_others(draws) + others[:, 1:].sum(axis=1)
        return Data(
            x=_rows(view.inputs).float(),
            edge_index=_repeat(self._edges, count, nodes),
            adjacent_index=_repeat(self._adjacent, count, nodes),
            is_building=torch.arange(nodes).repeat(count) == 0,
            visited=torch.ones(count * nodes, dtype=torch.bool),
            fraction=_rows(view.share).float(),
            withheld=_rows(view.withheld),
            others=_rows(others).float(),
        )

    def _null_others(self, draws: list[int]) -> Counts:
        """Return what is visible outside the classes and in no room, `[S, V]`."""
        return np.stack([self._others[d][0] - self._others[d][1:].sum(axis=0) for d in draws])


class FixedBeliefs:
    """Beliefs that no exploration changes: presence, and share if it differs, `[E, N, A]`."""

    def __init__(self, presence: Floats, share: Floats | None = None) -> None:
        self._presence = presence
        self._share = presence if share is None else share

    def __call__(self, rows: Ints, explored: Bools) -> tuple[Floats, Floats]:
        """Return presence and share of the artifacts; see `bsg_models.search.simulator.Beliefs`."""
        return self._presence[rows], self._share[rows]


def _rows(values: np.ndarray[tuple[int, ...], np.dtype[np.generic]]) -> torch.Tensor:
    """Return values `[S, N, ...]` of S graphs as rows of a batch, `[S · N, ...]`."""
    shape = (values.shape[0] * values.shape[1], *values.shape[2:])
    return torch.from_numpy(np.ascontiguousarray(values.reshape(shape)))


def _repeat(edges: torch.Tensor, count: int, nodes: int) -> torch.Tensor:
    """Return the edges of `count` graphs of the same edges in one batch."""
    shifts = torch.arange(count).repeat_interleave(edges.shape[1]) * nodes
    return edges.repeat(1, count) + shifts
