"""An opened dataset: its tables by hand, beside a plain loop, and what it refuses."""

from __future__ import annotations

import shutil
from collections import Counter
from dataclasses import replace
from multiprocessing.reduction import ForkingPickler
from pathlib import Path

import numpy as np
import pytest
from conftest import annotation_text, write_scene
from one_building import same_surroundings
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.dataset.dataset import Dataset, _open_once, read_cells
from bsg_data.dataset.histograms import NO_CATEGORY
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.recipes import MaskRecipe, SplitRecipe
from bsg_data.scene.class_map import ClassMap, is_nameless
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.scene_graph import Box, Edge, SceneGraph
from bsg_data.scene.surroundings import BUILDING_KINDS, KNOWN_SOURCES, UNKNOWN
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.source import SceneRef
from bsg_models.belief.masked_graph import mask_scene

HOUSE, SHED, LAWN, RUIN = (f"0000{k}-abcdefghi0{k}" for k in range(4))


class Estate(HM3DFolder):
    """A house of three rooms, a shed of two without objects, a lawn without rooms, nothing.

    Rooms of the house have their areas from three places; those of the shed have none that can be.
    """

    def read(self, ref: SceneRef, class_map: ClassMap) -> SceneGraph:
        """Return a building with its adjacency, or without its objects or its rooms."""
        reading = super().read(ref, class_map)
        graph = reading.graph
        if ref.scene_id == HOUSE:
            edges = (
                Edge(1, 2, "adjacent", "layout", 2.5),
                Edge(1, 3, "adjacent", "door"),
                Edge(2, 3, "adjacent", "stairs", 4.0),
            )
            one, two, three = graph.rooms
            one = replace(one, floor_area=5.5, box=Box((0, 0, 0), (9, 9, 3)), label="kitchen")
            two = replace(two, footprint=((0, 0), (3, 0), (3, 2), (0, 2)), label="no such room")
            three = replace(three, box=Box((0, 0, 0), (4, 2, 3)))
            graph = replace(graph, adjacency=edges, rooms=(one, two, three), building_kind="home")
        elif ref.scene_id == SHED:
            edges = (Edge(1, 2, "adjacent", "boxes", 1.0),)
            rooms = tuple(replace(room, floor_area=1e6) for room in graph.rooms)
            graph = replace(graph, objects=(), adjacency=edges, rooms=rooms, building_kind="castle")
        elif ref.scene_id == LAWN:
            outside = tuple(obj._replace(room_index=0) for obj in graph.objects)
            graph = replace(graph, rooms=(), objects=outside)
        else:
            graph = replace(graph, rooms=(), objects=())
        return replace(reading, graph=graph)


@pytest.fixture(scope="module")
def estate(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("estate")
    rooms = {
        HOUSE: {0: ["bed", "bed", "wall"], 1: ["chair", "unknown", ""], 2: ["wall", "floor"]},
        SHED: {0: ["chair"], 1: ["wall"]},
        LAWN: {0: ["chair", "chair", "floor"]},
        RUIN: {0: ["wall"]},
    }
    for scene, objects in rooms.items():
        write_scene(folder / "hm3d", scene, annotation_text(objects))
    build_dataset(Estate(folder / "hm3d"), folder / "estate", scenes_per_shard=2)
    return Dataset.open(folder / "estate")


def test_an_estate_by_hand(estate: Dataset) -> None:
    assert estate.scene_ids == (HOUSE, SHED, LAWN, RUIN)
    assert estate.splits == {}
    house = estate.connections(HOUSE)
    assert house.methods.tolist() == ["layout", "door", "stairs"]
    np.testing.assert_array_equal(house.lengths, [2.5, np.nan, 4.0])
    assert estate.connection_methods == {"layout", "door", "stairs", "boxes"}
    assert estate.count_unconnected() == 2
    around = estate.surroundings(HOUSE)
    np.testing.assert_array_equal(around.floor_area, [np.nan, 5.5, 6, 8])
    kitchen = list_room_labels().index("kitchen")
    assert np.argwhere(around.labels).tolist() == [[1, kitchen]]
    assert around.building_kinds.tolist() == [BUILDING_KINDS.index("home")]
    assert around.sources.tolist() == [KNOWN_SOURCES.index("hm3d")]
    shed = estate.surroundings(SHED)
    assert np.isnan(shed.floor_area).all(), "no room has a square kilometre"
    assert shed.building_kinds.tolist() == [UNKNOWN]


@pytest.mark.parametrize("name", ["estate", "dataset"])
def test_a_dataset_is_what_a_plain_loop_counts(name: str, request: pytest.FixtureRequest) -> None:
    """Also of buildings without rooms, without objects, or without either."""
    made = request.getfixturevalue(name)
    data = made if isinstance(made, Dataset) else Dataset.open(made)
    graphs = list(read_scene_graphs(data.path))
    assert list(data.scene_ids) == [graph.scene_id for graph in graphs]
    cells, space = read_cells(data.path), data.manifest.class_space
    for graph in graphs:
        scene = graph.scene_id
        counted = np.zeros((1 + len(graph.rooms), 45), dtype=int)
        unclassified: Counter[tuple[int, str]] = Counter()
        for obj in graph.objects:
            if obj.class_index is not None:
                counted[obj.room_index, obj.class_index] += 1
                continue
            nameless = obj.category is None or is_nameless(obj.category)
            unclassified[obj.room_index, NO_CATEGORY if nameless else str(obj.category)] += 1
        for ours in (data.cells(scene), cells[scene]):
            np.testing.assert_array_equal(ours, counted)
        others = data.unclassified(scene)
        assert list(others.categories) == sorted({name for _, name in unclassified})
        assert {
            (int(room), others.categories[kind]): int(others.cells[room, kind])
            for room, kind in np.argwhere(others.cells)
        } == unclassified
        robots = mask_scene(graph, MaskRecipe(), draw=0, class_space=space).observation()
        assert same_surroundings(data.surroundings(scene), robots.surroundings)
        pairs = [[edge.source, edge.target] for edge in graph.adjacency]
        assert data.connections(scene).pairs.tolist() == pairs
        assert data.connections(scene).pairs.shape == (len(pairs), 2)


def test_a_changed_dataset_is_opened_again_and_the_old_one_is_not_called_damaged(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(dataset.parent)
    first = Dataset.open(dataset)
    assert Dataset.open(dataset) is Dataset.open(dataset.name) is first
    assert ForkingPickler.loads(ForkingPickler.dumps(first)) is first
    split_dataset(dataset, SplitRecipe(seed=1), force=True)
    second = Dataset.open(dataset)
    with refuses(DatasetError, "dataset-replaced", dataset):
        _ = first.splits
    _open_once.cache_clear()  # as in another process
    with refuses(DatasetError, "dataset-replaced", dataset):
        Dataset.open(dataset, sha256=first.sha256)
    with pytest.raises(DatasetError, match="nowhere"):
        second.cells("nowhere")
    shutil.rmtree(dataset / "objects")
    with refuses(DatasetError, "file-missing"):
        second.cells(second.scene_ids[0])
