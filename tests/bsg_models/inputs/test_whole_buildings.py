"""Whole buildings for PyG: by hand, as PyG validates and batches them, and beside the tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch_geometric.transforms import ToUndirected
from whole_home import CLASSES, HOME

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import to_histograms
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.scene_graph import ADJACENCY_METHODS
from bsg_data.scene.surroundings import BUILDING_KINDS, KNOWN_SOURCES
from bsg_models.inputs.graphs import to_pyg

ADJACENT = ("room", "adjacent", "room")
NAN = float("nan")


def same(tensor: torch.Tensor, values: object) -> bool:
    assert tensor.dtype in (torch.float32, torch.int64)
    return torch.equal(tensor.nan_to_num(-999), torch.tensor(values).to(tensor).nan_to_num(-999))


def test_a_building_by_hand() -> None:
    graph = to_pyg(HOME, classes=CLASSES, categories=("clock", "tap"))
    building, room, thing = (graph[kind] for kind in ("building", "room", "object"))
    assert graph.scene_id == "home 1"
    assert [nodes.num_nodes for nodes in (building, room, thing)] == [1, 2, 3]
    assert same(building.x, [[0.0, 1.0]])
    assert same(building.building_kind, [BUILDING_KINDS.index("home")])
    assert same(building.source, [KNOWN_SOURCES.index("hm3d")])
    assert same(room.x, [[0.0, 0.0], [0.0, 1.0]])
    assert same(room.label, [list_room_labels().index("kitchen"), -1])
    assert same(room.floor_area, [6.0, NAN]), "of its footprint, a triangle"
    assert same(room.floor_index, [0, -1])
    assert same(room.floor_z, [NAN, NAN])
    assert same(room.pos, [[1.0, 2.0, 1.5], [NAN] * 3])
    assert same(room.box, [[NAN] * 6] * 2)
    assert same(room.region_id, [4, 9])
    assert same(thing.x, [[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    assert same(thing.class_index, [1, -1, -1])
    assert same(thing.category, [-1, -1, 0])
    assert same(thing.area, [NAN, NAN, 0.5])
    assert same(thing.pos, [[NAN] * 3] * 3)
    assert same(thing.box, [[0.0, 0.0, 0.0, 1.0, 2.0, 3.0], [NAN] * 6, [NAN] * 6])
    assert same(thing.instance_id, [3, 8, 9])
    assert {key: edges.tolist() for key, edges in graph.edge_index_dict.items()} == {
        ("building", "contains", "room"): [[0, 0], [0, 1]],
        ("building", "contains", "object"): [[0], [1]],
        ("room", "contains", "object"): [[1, 1], [0, 2]],
        ADJACENT: [[0], [1]],
    }
    assert same(graph[ADJACENT].distance_m, [3.5])
    assert ADJACENCY_METHODS == ("layout", "door", "stairs", "boxes", "robot", "given")
    assert same(graph[ADJACENT].method, [1])
    assert graph.validate()
    way_back = ToUndirected()(graph)[ADJACENT]
    assert way_back.edge_index.tolist() == [[0, 1], [1, 0]]
    assert same(way_back.distance_m, [3.5, 3.5])


def test_objects_are_those_of_the_histograms(dataset: Path) -> None:
    data = Dataset.open(dataset)
    classes = data.manifest.class_space.classes
    for scene in read_scene_graphs(dataset):
        graph = to_pyg(scene, classes=classes)
        assert graph.validate()
        histograms = to_histograms(data.cells(scene.scene_id))
        counted = torch.cat([graph["building"].x, graph["room"].x])
        assert np.array_equal(counted.numpy(), histograms)
        room, thing = graph["room", "contains", "object"].edge_index
        summed = torch.zeros_like(graph["room"].x).index_add(0, room, graph["object"].x[thing])
        assert torch.equal(summed, graph["room"].x), "a room has the objects that it leads to"
