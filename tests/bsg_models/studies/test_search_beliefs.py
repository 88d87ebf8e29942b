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
from bsg_models.runs.checkpoint_file import BEST
from bsg_models.runs.predictor import Predictor
from bsg_models.studies.search_beliefs import ModelBeliefs
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config
from bsg_robot.graph.reports import enter

STOVE, MIRROR = 35, 21


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


@pytest.mark.parametrize(
    ("name", "mask"),
    [
        ("mixture", MaskRecipe(seed=4)),
        ("universal", MaskRecipe(seed=4)),
        ("gamma-poisson", MaskRecipe(strategy="explore", withhold=0.2, parts=True)),
    ],
)
def test_beliefs_are_those_of_the_partial_graph(
    name: str, mask: MaskRecipe, dataset: Path, tmp_path: Path
) -> None:
    """Room by room, also in rooms that it had searched before and of classes that are withheld."""
    config = find_config(name)
    few = config.training.model_copy(update={"epochs": 2, "validate_every": 1})
    data = config.data.model_copy(update={"min_scenes": 1})
    config = config.model_copy(update={"training": few, "data": data})
    list(train_run(config, dataset, tmp_path / "run"))
    path = tmp_path / "run" / BEST
    graph = max(read_scene_graphs(dataset), key=lambda graph: len(graph.rooms))
    searches = [(0, STOVE), (1, STOVE), (0, MIRROR)]
    draws, artifacts = np.array(searches).T
    beliefs = ModelBeliefs(
        restore_model(path, load_checkpoint(path)),
        data=Dataset.open(dataset),
        scene_id=graph.scene_id,
        mask=mask,
        draws=draws,
        artifacts=artifacts,
    )
    predictor, class_space = Predictor(path), read_manifest(dataset).class_space
    for row, (draw, artifact) in enumerate(searches):
        known = mask_scene(graph, mask, draw=draw, class_space=class_space)
        objects = tuple(obj for obj in known.objects if obj.class_index != artifact)
        known = replace(known, objects=objects)
        share = np.array([known.hidden_share, *(room.hidden_share for room in known.rooms)])
        classes = np.isin(np.arange(45), list_withheld(mask, known, draw=draw))
        withheld = classes & (share > 0)[:, None]
        withheld[:, artifact] = True
        explored = np.zeros((1, 1 + len(graph.rooms)), dtype=bool)
        for room in (3, 1, 5):
            explored[0, room] = True
            known, withheld[room] = enter_room(known, graph, room), False
            found, is_open = predictor(known, withheld=withheld), ~explored[0]
            is_open[0] = False  # the building, where no robot looks
            presence, share = beliefs(np.array([row]), explored)
            for shown, expected in ((presence, found.presence), (share, found.distribution)):
                np.testing.assert_allclose(
                    shown[0, is_open, 0], expected[is_open, artifact], rtol=1e-4, atol=1e-6
                )
