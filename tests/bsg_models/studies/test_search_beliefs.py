"""The beliefs of a search are those of the model about the partial graph that the robot holds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.scene_graph import SceneGraph
from bsg_models.belief.hidden_share import ShareBelief
from bsg_models.belief.masked_graph import list_withheld, mask_scene
from bsg_models.belief.partial_graph import PartialGraph, SeenObject
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.predictor import Predictor
from bsg_models.runs.run_folder import BEST
from bsg_models.studies.search_beliefs import ModelBeliefs
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config
from bsg_robot.graph.reports import enter


def enter_room(known: PartialGraph, graph: SceneGraph, room_index: int) -> PartialGraph:
    """Return the partial graph after the robot has seen all objects of a room."""
    others = (obj for obj in known.objects if obj.room_index != room_index)
    inside = (
        SeenObject(
            str(obj.instance_id), room_index, obj.raw_category, obj.category, obj.class_index
        )
        for obj in graph.objects
        if obj.room_index == room_index
    )
    known = replace(known, objects=(*others, *inside))
    return enter(known, room_index, hidden_share=ShareBelief(0.0))


@pytest.mark.parametrize("name", ["mixture", "universal"])
def test_beliefs_are_those_of_the_partial_graph(name: str, dataset: Path, tmp_path: Path) -> None:
    config = find_config(name)
    few = config.training.model_copy(update={"epochs": 2, "validate_every": 1})
    config = config.model_copy(
        update={"training": few, "data": config.data.model_copy(update={"min_scenes": 1})}
    )
    list(train_run(config, dataset, tmp_path / "run"))
    path = tmp_path / "run" / BEST
    data, mask, stove = Dataset.open(dataset), MaskRecipe(seed=4), 35
    graph = max(read_scene_graphs(dataset), key=lambda one: len(one.rooms))
    model = restore_model(path, load_checkpoint(path))
    beliefs = ModelBeliefs(
        model,
        data=data,
        scene_id=graph.scene_id,
        mask=mask,
        draws=np.array([0, 1, 0]),
        artifacts=np.array([stove, stove, 3]),
    )
    nodes = 1 + len(graph.rooms)
    explored = np.zeros((3, nodes), dtype=bool)
    explored[:, 2] = explored[1, 4] = True
    presence, share = beliefs(np.arange(3), explored)
    predictor, class_space = Predictor(path), read_manifest(dataset).class_space
    for e, (draw, artifact) in enumerate([(0, stove), (1, stove), (0, 3)]):
        known = mask_scene(graph, mask, draw=draw, class_space=class_space)
        kept = tuple(obj for obj in known.objects if obj.class_index != artifact)
        known = replace(known, objects=kept)
        for room in np.flatnonzero(explored[e]).tolist():
            known = enter_room(known, graph, room)
        found = predictor(known, withheld=[artifact])
        open_ = ~explored[e]
        open_[0] = False  # the building, where no robot looks
        np.testing.assert_allclose(
            presence[e, open_, 0], found.presence[open_, artifact], rtol=1e-4, atol=1e-6
        )
        np.testing.assert_allclose(
            share[e, open_, 0], found.distribution[open_, artifact], rtol=1e-4, atol=1e-6
        )
    again, _ = beliefs(np.array([1]), explored[[1]])
    np.testing.assert_array_equal(again[0], presence[1])


def test_under_any_mask_beliefs_are_those_of_what_the_robot_holds(dataset: Path, run: Path) -> None:
    """Also in rooms that it had searched before, and of classes that the mask withheld."""
    data, mirror, draw = Dataset.open(dataset), 21, 1
    mask = MaskRecipe(strategy="explore", withhold=0.2, parts=True)
    graph = max(read_scene_graphs(dataset), key=lambda one: len(one.rooms))
    class_space = read_manifest(dataset).class_space
    known = mask_scene(graph, mask, draw=draw, class_space=class_space)
    kept = tuple(obj for obj in known.objects if obj.class_index != mirror)
    known = replace(known, objects=kept)
    share = np.array([known.hidden_share, *(room.hidden_share for room in known.rooms)])
    classes = np.isin(np.arange(45), list_withheld(mask, known, draw=draw))
    withheld = classes & (share > 0)[:, None]
    withheld[:, mirror] = True
    beliefs = ModelBeliefs(
        restore_model(run / BEST, load_checkpoint(run / BEST)),
        data=data,
        scene_id=graph.scene_id,
        mask=mask,
        draws=np.array([draw]),
        artifacts=np.array([mirror]),
    )
    explored = np.zeros((1, 1 + len(graph.rooms)), dtype=bool)
    for room in (3, 1, 5):
        explored[0, room] = True
        known, withheld[room] = enter_room(known, graph, room), False
        found = Predictor(run)(known, withheld=withheld).presence[:, mirror]
        presence, _ = beliefs(np.array([0]), explored)
        open_ = ~explored[0] & (np.arange(explored.shape[1]) > 0)
        np.testing.assert_allclose(presence[0, open_, 0], found[open_], rtol=1e-4)
