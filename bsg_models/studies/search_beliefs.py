"""Ask a model about the artifacts of searches, again after every room.

Many searches of a building reach the same state: the same mask, artifacts and explored rooms. The
model is asked once per state; answers are kept while the building is searched.
"""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Bools, Counts, Floats, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.masked_buildings import count_by_vocabulary
from bsg_data.observation.masks import Layout, sample_views
from bsg_data.observation.observation import Observation, observe_search, stack
from bsg_data.observation.view import hide_cells, see_unclassified
from bsg_data.recipes import MaskRecipe
from bsg_models.search.simulator import Answer
from bsg_models.zoo.model import BeliefModel

_NODES = 4096  # of all graphs in one call of the model


class ModelBeliefs:
    """The beliefs of one model about searches of one building.

    Args:
        model: that is asked.
        data: an open dataset.
        scene_id: the building.
        mask: that hid objects before the searches began.
        draws: `[E]` number of each search's mask.
        artifacts: `[E, A]` classes that each search looks for; they are withheld.
        is_missed: whether a look may miss them, so that a room that was looked into shows none.
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
        self._model, self._scene_id = model, scene_id
        self._is_missed = is_missed
        self._draws, self._artifacts = draws, artifacts
        self._cells = data.cells(scene_id)
        self._connections = data.connections(scene_id)
        self._surroundings = data.surroundings(scene_id)
        self._blind = ~data.nameable(scene_id)
        every, classes = data.unclassified(scene_id), data.manifest.class_space.classes
        self._unclassified = count_by_vocabulary(every, model.vocabulary)
        numbers: list[int] = np.unique(draws).tolist()
        many, recipes = len(numbers), [mask] * len(numbers)
        streams = MaskStreams(recipes, [scene_id] * many, numbers)
        layout = Layout(self._cells.shape, self._connections)
        drawn = sample_views([layout] * many, recipes, streams)
        views = [view.in_building(len(self._cells)) for view in drawn]
        there = np.concatenate([self._cells] * many)
        hidden = hide_cells(there, views, streams)
        seen = see_unclassified(
            [every] * many, views, recipes, streams, there=there, hidden=hidden, classes=classes
        )
        left = (there - hidden).reshape(many, *self._cells.shape)
        self._left = {
            number: (view, cells, count_by_vocabulary(unclassified, model.vocabulary))
            for number, view, cells, unclassified in zip(numbers, views, left, seen, strict=True)
        }
        self._remembered: dict[bytes, Answer] = {}

    def __call__(self, rows: Ints, explored: Bools, *, shares: bool = True) -> Answer:
        """Return presence and share of the artifacts; see `bsg_models.search.simulator.Beliefs`."""
        states = np.concatenate(
            [self._draws[rows, None], self._artifacts[rows], explored.astype(np.int64)], axis=1
        )
        distinct, inverse = np.unique(states, axis=0, return_inverse=True)
        keys = [state.tobytes() for state in distinct]
        old = {key: self._remembered[key] for key in keys if key in self._remembered}
        # An answer without its shares is none where they are needed.
        new = [
            i for i, key in enumerate(keys) if key not in old or (shares and old[key][1] is None)
        ]
        size = max(1, _NODES // len(self._cells))
        for start in range(0, len(new), size):
            some = new[start : start + size]
            presences, found = self._ask(distinct[some], shares=shares)
            for place, i in enumerate(some):
                self._remembered[keys[i]] = presences[place], found[place] if shares else None
        answers = [self._remembered[key] for key in keys]
        inverse = inverse.ravel()
        presence = np.stack([answer[0] for answer in answers])[inverse]
        if not shares:
            return presence, None
        return presence, np.stack([share for _, share in answers if share is not None])[inverse]

    def _ask(self, states: Counts, *, shares: bool) -> tuple[Floats, Floats]:
        """Return presence and share of the artifacts in states `[S, 1 + A + N]`, `[S, N, A]`.

        The model is asked about unexplored rooms only and, without `shares`, about the artifacts
        only. All other values are 0.
        """
        width = self._artifacts.shape[1]
        seen = self._observe(states, width)
        shape = (len(states), len(self._cells), width)
        open_ = states[:, 1 + width :] == 0
        open_[:, 0] = False  # node 0 is the building
        rows = np.flatnonzero(open_)
        columns = np.repeat(states[:, 1 : 1 + width], len(self._cells), axis=0)[rows]
        presence, share = np.zeros((2, open_.size, width))
        if not len(rows):  # every room was looked into, and the looks missed it
            return presence.reshape(shape), share.reshape(shape)
        hidden = self._model.expect_rooms(seen, rows, None if shares else columns)
        if shares:
            expected = seen.inputs[rows] + hidden.mean
            total = expected.sum(axis=1, keepdims=True)
            found = np.divide(expected, total, out=np.zeros_like(expected), where=total > 0)
            share[rows] = np.take_along_axis(found, columns, axis=1)
            hidden = hidden.take_classes(columns)
        presence[rows] = hidden.presence
        return presence.reshape(shape), share.reshape(shape)

    def _observe(self, states: Counts, width: int) -> Observation:
        """Return states as one observation, one building each."""
        return stack([self._observe_one(state, width) for state in states])

    def _observe_one(self, state: Counts, width: int) -> Observation:
        view, classified, unclassified = self._left[int(state[0])]
        return observe_search(
            self._scene_id,
            view,
            there=(self._cells, self._unclassified),
            left=(classified, unclassified),
            searched=state[1 + width :] > 0,
            artifacts=state[1 : 1 + width],
            blind=self._blind,
            is_missed=self._is_missed,
            vocabulary=self._model.vocabulary,
            connections=self._connections,
            surroundings=self._surroundings,
        )
