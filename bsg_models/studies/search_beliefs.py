"""Ask a model about the artifacts of searches, again after every room.

Before a search, a mask hides some objects, and all instances of the artifact are *withheld* (paper,
section IV-D). A room that the search entered shows everything. So the absence of the artifact is a
fact in a searched room, and says nothing in any other, not even in one that the mask shows whole.

Many searches of a building reach the same state: the same mask, artifact and explored rooms. The
model is asked once per state; answers are kept while the building is searched.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import to_histograms
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.masks import Layout, sample_views
from bsg_data.observation.observation import Observation
from bsg_data.observation.view import hide_cells, see_unclassified
from bsg_data.recipes import MaskRecipe
from bsg_models.arrays import take_columns
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.run_folder import checkpoint_of
from bsg_models.search.simulator import Answer, Episodes
from bsg_models.studies.search_request import StudyRecipe
from bsg_models.zoo.model import BeliefModel

_COUNT = np.int32  # of the objects that many states show
_NODES = 512  # of all graphs in one call of the model, so that its arrays stay in a fast cache


def ask_run(
    run: Path, data: Dataset, scene_id: str, recipe: StudyRecipe, episodes: Episodes, draws: Ints
) -> ModelBeliefs:
    """Return the beliefs of a run about searches of a building, each with its draw of the mask."""
    path = checkpoint_of(run)
    return ModelBeliefs(
        _restore(path, path.stat().st_mtime_ns if path.exists() else 0),
        data=data,
        scene_id=scene_id,
        mask=recipe.mask,
        draws=draws,
        artifacts=episodes.artifacts[:, 0],
        is_missed=recipe.chance < 1,
    )


@lru_cache(maxsize=8)
def _restore(checkpoint: Path, changed: int) -> BeliefModel:
    return restore_model(checkpoint, load_checkpoint(checkpoint))


class ModelBeliefs:
    """The beliefs of one model about searches of one building.

    Args:
        model: that is asked.
        data: an open dataset.
        scene_id: the building.
        mask: that hid objects before the searches began.
        draws: `[E]` number of each search's mask.
        artifacts: `[E]` class that each search looks for; it is withheld.
        is_missed: whether a look may miss it, so that a room that was looked into shows none.
    """

    def __init__(
        self,
        model: BeliefModel,
        *,
        data: Dataset,
        scene_id: str,
        mask: MaskRecipe,
        draws: Ints,
        artifacts: Ints,
        is_missed: bool = False,
    ) -> None:
        self._model, self._is_missed = model, is_missed
        self._blind = ~data.nameable(scene_id)
        self._cells, unclassified = data.cells(scene_id), data.unclassified(scene_id)
        outside = unclassified.count(model.vocabulary)
        numbers, self._draws = np.unique(draws, return_inverse=True)
        self._artifacts = artifacts
        many = len(numbers)
        streams = MaskStreams([mask] * many, [scene_id] * many, numbers.tolist())
        layout = Layout(self._cells.shape, data.connections(scene_id))
        looked = sample_views([layout] * many, streams)
        views = [view.in_building(len(self._cells)) for view in looked]
        present = np.concatenate([self._cells] * many)
        hidden = hide_cells(present, views, streams)
        classes = data.manifest.class_space.classes
        seen = see_unclassified(
            [unclassified] * many,
            views,
            streams,
            present=present,
            hidden=hidden,
            classes=classes,
        )
        # of each draw of the mask, D in all
        self._left = (present - hidden).reshape(many, *self._cells.shape).astype(_COUNT)
        left = [some.count(model.vocabulary).astype(_COUNT) for some in seen]
        self._left_unclassified = np.stack(left)
        self._views = [
            np.stack([getattr(view, name) for view in views])
            for name in ("visited", "hidden_share", "withheld")
        ]
        self._first = Observation.of_views(
            [scene_id],
            views[:1],
            to_histograms(self._cells),
            to_histograms(outside),
            vocabulary=model.vocabulary,
            connections=[data.connections(scene_id)],
            surroundings=[data.surroundings(scene_id)],
        )
        self._cells, self._unclassified = self._cells.astype(_COUNT), outside.astype(_COUNT)
        self._remembered: dict[bytes, Floats] = {}

    def __call__(self, rows: Ints, explored: Bools) -> Answer:
        """Return presence and share of the artifacts; see `bsg_models.search.simulator.Beliefs`."""
        about = np.stack([self._draws[rows], self._artifacts[rows]], axis=1)
        states = np.concatenate([about, explored], axis=1, dtype=np.int64)
        distinct, inverse = np.unique(states, axis=0, return_inverse=True)
        keys = [state.tobytes() for state in distinct]
        new = [i for i, key in enumerate(keys) if key not in self._remembered]
        size = max(1, _NODES // len(self._cells))
        for start in range(0, len(new), size):
            some = new[start : start + size]
            for i, answer in zip(some, self._ask(distinct[some]), strict=True):
                self._remembered[keys[i]] = answer
        found = np.stack([self._remembered[key] for key in keys])[inverse.ravel(), ..., None]
        return found[:, 0], found[:, 1]

    def _ask(self, states: Ints) -> Floats:
        """Return presence and share of the artifact in states `[S, 2 + N]`, `[S, 2, N]`.

        A state is a draw, an artifact and the explored rooms. The model is asked about unexplored
        rooms only. All other values are 0.
        """
        open_ = states[:, 2:] == 0
        open_[:, 0] = False  # node 0 is the building
        rows = np.flatnonzero(open_)
        columns = np.repeat(states[:, 1], len(self._cells))[rows, None]
        presence, share = np.zeros((2, open_.size))
        if len(rows):  # else every room was looked into, and the looks missed it
            seen = self._observe(states)
            hidden = self._model.expect_rooms(seen, rows)
            expected = seen.inputs[rows] + hidden.mean
            total = expected.sum(axis=1, keepdims=True)
            found = np.divide(expected, total, out=np.zeros_like(expected), where=total > 0)
            share[rows] = take_columns(found, columns)[:, 0]
            presence[rows] = hidden.take_classes(columns).presence[:, 0]
        return np.stack([presence.reshape(open_.shape), share.reshape(open_.shape)], axis=1)

    def _observe(self, states: Ints) -> Observation:
        """Return what is seen in some states, one building each."""
        draw, searched = states[:, 0], states[:, 2:] > 0
        visited, share, withheld = (views[draw] for views in self._views)
        outside = ~searched[:, :, None]
        wanted = np.arange(self._cells.shape[1]) == states[:, 1, None]  # [S, C]
        withheld = (withheld | wanted[:, None]) & outside
        seen = np.where(outside, self._left[draw], self._cells)
        seen[withheld | wanted[:, None] if self._is_missed else withheld] = 0
        share = np.where(searched, 0.0, share)
        share[:, 0] = _average_rooms(share[:, 1:])
        withheld[:, 0] &= share[:, :1] > 0
        unclassified = np.where(outside, self._left_unclassified[draw], self._unclassified)
        number, nodes = searched.shape
        return replace(
            self._first.take([0] * number),
            inputs=to_histograms(seen).reshape(number * nodes, -1),
            hidden_share=share.astype(np.float32).ravel(),
            visited=(visited | searched).ravel(),
            withheld=(withheld | self._blind).reshape(number * nodes, -1),
            unclassified=to_histograms(unclassified).reshape(number * nodes, -1),
        )


def _average_rooms(shares: Floats) -> Floats:
    """Return the hidden share of a building from those of its rooms, `[S]` of `[S, R]`."""
    first = shares[:, 0]
    is_one = (shares == first[:, None]).all(axis=1)  # exact; a mean of floats would not be
    return np.where(is_one, first, shares.sum(axis=1) / shares.shape[1])
