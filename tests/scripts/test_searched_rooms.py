"""Rooms that are searched one after another: the same as a robot's own graph, and what it gains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from fold_models import open_folds
from searched_rooms import (
    ALL,
    STARTS,
    STOPS,
    measure_searched_folds,
    search_rooms,
)

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.observation.masked_buildings import sample_masked
from bsg_data.observation.partial_graph import enter_room, mask_scene
from bsg_data.recipes import MaskRecipe

VOCABULARY = ("wall", "floor", "kitchen cabinet")


def test_rooms_are_searched_as_a_robot_enters_them(dataset: Path) -> None:
    data = Dataset.open(dataset)
    for scene in read_scene_graphs(dataset):
        mask = MaskRecipe(strategy="explore")
        graph = mask_scene(scene, mask, draw=0, class_space=data.manifest.class_space)
        rooms = [1, len(scene.rooms)]
        for room in rooms:
            graph = enter_room(graph, scene, room)
        ours, all_ = (
            sample_masked(data, [scene.scene_id], mask=m, draw=0, vocabulary=VOCABULARY).seen
            for m in (mask, ALL)
        )
        ours = search_rooms(ours, all_, np.isin(np.arange(len(scene.rooms) + 1), rooms))
        theirs = graph.observation(vocabulary=VOCABULARY)
        for name in ("inputs", "visited", "withheld", "others"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name), name)
        np.testing.assert_allclose(ours.hidden_share, theirs.hidden_share, atol=1e-6)


def test_starts_show_nothing_or_a_half_and_the_rest_everything(dataset: Path) -> None:
    data = Dataset.open(dataset)
    scene = data.scene_ids[-1:]
    nothing, half, all_ = (
        sample_masked(data, scene, mask=mask, draw=0)
        for mask in (STARTS["nothing"], STARTS["half"], ALL)
    )
    assert not nothing.seen.inputs.any()
    assert set(nothing.seen.hidden_share.tolist()) == {1.0}
    assert 0 < half.seen.inputs.sum() < half.targets.sum()
    np.testing.assert_array_equal(all_.seen.inputs, all_.targets)


def test_searching_the_others_tells_nothing_to_a_model_of_single_rooms(board: Path) -> None:
    """`gamma-poisson` reads a room alone: whatever is searched elsewhere, it gains nothing."""
    gains = measure_searched_folds(open_folds(board, "gamma-poisson@uniform"), orders=2)
    assert gains.evaluate() == dict.fromkeys(STOPS, 0.0)
    assert len(gains.scene_ids) == 10  # of 12 buildings, those of four rooms or more
    mixed = measure_searched_folds(open_folds(board, "mixture@rooms"), orders=2).evaluate()
    assert all(np.isfinite(value) and value != 0 for value in mixed.values())
