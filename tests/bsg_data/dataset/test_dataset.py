"""An opened dataset: its tables by hand, beside a plain loop, and what it refuses."""

from __future__ import annotations

import shutil
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
from bsg_data.dataset.histograms import NO_CATEGORY, choose_vocabulary
from bsg_data.dataset.manifest import hash_manifest, read_manifest
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


@pytest.fixture
def estate(tmp_path: Path) -> Dataset:
    rooms = {
        HOUSE: {0: ["bed", "bed", "wall"], 1: ["chair", "unknown", ""], 2: ["wall", "floor"]},
        SHED: {0: ["chair"], 1: ["wall"]},
        LAWN: {0: ["chair", "chair", "floor"]},
        RUIN: {0: ["wall"]},
    }
    for scene, objects in rooms.items():
        write_scene(tmp_path / "hm3d", scene, annotation_text(objects))
    build_dataset(Estate(tmp_path / "hm3d"), tmp_path / "estate", scenes_per_shard=2)
    return Dataset.open(tmp_path / "estate")


def test_the_cells_of_an_estate_by_hand(estate: Dataset) -> None:
    assert estate.scene_ids == (HOUSE, SHED, LAWN, RUIN)
    classes = estate.manifest.class_space.classes
    bed, chair = classes.index("bed"), classes.index("chair")
    house = estate.cells(HOUSE)
    assert house.shape == (4, 45)
    assert house[:, bed].tolist() == [0, 2, 0, 0]
    assert house[:, chair].tolist() == [0, 0, 1, 0]
    assert house.sum() == 3
    assert estate.cells(SHED).tolist() == [[0] * 45] * 3  # rooms without objects
    lawn = estate.cells(LAWN)
    assert lawn.shape == (1, 45)
    assert (lawn[0, chair], lawn.sum()) == (2, 2)  # objects without rooms
    assert estate.cells(RUIN).tolist() == [[0] * 45]


def test_the_other_objects_of_an_estate_by_hand(estate: Dataset) -> None:
    house = estate.unclassified(HOUSE)
    assert house.categories == (NO_CATEGORY, "floor", "wall")
    assert house.cells.tolist() == [[0, 0, 0], [0, 0, 1], [2, 0, 0], [0, 1, 1]]
    shed, ruin = estate.unclassified(SHED), estate.unclassified(RUIN)
    assert (shed.categories, shed.cells.shape) == ((), (3, 0))
    lawn = estate.unclassified(LAWN)
    assert (lawn.categories, lawn.cells.tolist()) == (("floor",), [[1]])
    assert (ruin.categories, ruin.cells.shape) == ((), (1, 0))


def test_the_connections_of_an_estate_by_hand(estate: Dataset) -> None:
    house = estate.connections(HOUSE)
    assert house.pairs.tolist() == [[1, 2], [1, 3], [2, 3]]
    assert house.methods.tolist() == ["layout", "door", "stairs"]
    np.testing.assert_array_equal(house.lengths, [2.5, np.nan, 4.0])
    assert estate.connections(SHED).pairs.tolist() == [[1, 2]]
    for scene in (LAWN, RUIN):
        assert len(estate.connections(scene)) == 0
        assert estate.connections(scene).pairs.shape == (0, 2)
    assert estate.connection_methods == {"layout", "door", "stairs", "boxes"}
    assert estate.count_unconnected() == 2


def test_the_surroundings_of_an_estate_by_hand(estate: Dataset) -> None:
    house = estate.surroundings(HOUSE)
    np.testing.assert_array_equal(house.floor_area, [np.nan, 5.5, 6, 8])
    kitchen = list_room_labels().index("kitchen")
    assert np.argwhere(house.labels).tolist() == [[1, kitchen]]
    assert house.building_kinds.tolist() == [BUILDING_KINDS.index("home")]
    assert house.sources.tolist() == [KNOWN_SOURCES.index("hm3d")]
    shed = estate.surroundings(SHED)
    assert np.isnan(shed.floor_area).all(), "no room has a square kilometre"
    assert shed.building_kinds.tolist() == [UNKNOWN]
    for scene in (LAWN, RUIN):
        assert len(estate.surroundings(scene)) == 1
        assert estate.surroundings(scene).building_kinds.tolist() == [UNKNOWN]


def test_a_dataset_without_rooms_has_surroundings(tmp_path: Path) -> None:
    write_scene(tmp_path / "hm3d", LAWN, annotation_text({0: ["chair"]}))
    build_dataset(Estate(tmp_path / "hm3d"), tmp_path / "lawn")
    assert np.isnan(Dataset.open(tmp_path / "lawn").surroundings(LAWN).floor_area).all()


def test_a_dataset_is_what_a_plain_loop_counts(estate: Dataset, dataset: Path) -> None:
    assert_alike(estate)
    assert_alike(Dataset.open(dataset))


def assert_alike(data: Dataset) -> None:
    """Compare a dataset with a loop over the scene graphs that its shards hold."""
    graphs = list(read_scene_graphs(data.path))
    assert list(data.scene_ids) == [graph.scene_id for graph in graphs]
    cells = read_cells(data.path)
    for graph in graphs:
        scene = graph.scene_id
        assert scene in data
        counted = np.zeros((1 + len(graph.rooms), 45), dtype=int)
        unclassified: dict[tuple[int, str], int] = {}
        for obj in graph.objects:
            if obj.class_index is not None:
                counted[obj.room_index, obj.class_index] += 1
                continue
            nameless = obj.category is None or is_nameless(obj.category)
            key = obj.room_index, NO_CATEGORY if nameless else str(obj.category)
            unclassified[key] = unclassified.get(key, 0) + 1
        np.testing.assert_array_equal(data.cells(scene), counted)
        np.testing.assert_array_equal(cells[scene], counted)
        one = data.unclassified(scene)
        assert list(one.categories) == sorted({name for _, name in unclassified})
        there = {
            (int(room), one.categories[kind]): int(one.cells[room, kind])
            for room, kind in np.argwhere(one.cells)
        }
        assert there == unclassified
        space, ours = data.manifest.class_space, data.surroundings(scene)
        robots = mask_scene(graph, MaskRecipe(), draw=0, class_space=space).observation()
        assert same_surroundings(ours, robots.surroundings)
        pairs = [(edge.source, edge.target) for edge in graph.adjacency]
        assert [tuple(pair) for pair in data.connections(scene).pairs.tolist()] == pairs
        assert data.connections(scene).pairs.tolist() == [list(pair) for pair in pairs]


def test_scenes_that_are_not_there(estate: Dataset) -> None:
    assert "nowhere" not in estate
    assert 7 not in estate
    with pytest.raises(DatasetError, match="nowhere"):
        estate.cells("nowhere")
    assert estate.splits == {}


def test_a_changed_dataset_is_opened_again(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(dataset.parent)
    first = Dataset.open(dataset)
    assert Dataset.open(dataset) is Dataset.open(dataset.name) is first
    before = first.splits
    split_dataset(dataset, SplitRecipe(seed=1), force=True)
    second = Dataset.open(dataset)
    assert second.splits != before
    assert second.sha256 != first.sha256
    assert first.splits == before  # what was open stays what it was


def test_who_opened_a_dataset_reads_it_as_it_was(dataset: Path) -> None:
    kept = Dataset.open(dataset)
    graphs = [*read_scene_graphs(dataset)]
    reading = read_scene_graphs(dataset)
    first = next(reading)
    for name in ("scenes", "rooms", "objects", "edges", "splits"):  # as a command that rebuilds it
        shutil.rmtree(dataset / name)
    assert [first, *reading] == graphs
    assert sum(map(len, kept.splits.values())) == len(kept.scene_ids) == len(read_cells(dataset))


def test_another_dataset_than_the_one_asked_for_is_refused(dataset: Path) -> None:
    asked = Dataset.open(dataset).sha256
    split_dataset(dataset, SplitRecipe(seed=1), force=True)
    _open_once.cache_clear()  # as in another process
    with refuses(DatasetError, "dataset-replaced", dataset):
        Dataset.open(dataset, sha256=asked)


def test_a_large_dataset_that_another_command_replaces_is_not_called_damaged(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bsg_data.dataset.shards.HELD_FILES", 100)
    opened = Dataset.open(dataset)
    split_dataset(dataset, SplitRecipe(seed=1), force=True)
    with refuses(DatasetError, "dataset-replaced", dataset):
        _ = opened.splits


@pytest.mark.parametrize("how", ["cut", "changed", "gone"])
def test_a_damaged_file_is_refused(dataset: Path, how: str) -> None:
    path = sorted((dataset / "objects").glob("*.parquet"))[0]
    whole = path.read_bytes()
    if how == "gone":
        path.unlink()
    else:
        middle = len(whole) // 2
        flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
        path.write_bytes(whole[:-9] if how == "cut" else flipped)
    code = "file-missing" if how == "gone" else "file-changed"
    with refuses(DatasetError, code, path.relative_to(dataset).as_posix(), golden=False):
        read_cells(dataset)
    path.write_bytes(whole)
    assert len(read_cells(dataset)) == 12


def test_a_dataset_of_many_parts_keeps_as_many_as_a_bound_allows(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two parts are kept; in the order of the tables each is read once all the same."""
    whole = read_cells(dataset)
    monkeypatch.setattr("bsg_data.dataset.dataset.HELD_BYTES", 1)
    read: list[str] = []
    read_file = Dataset.read_file
    monkeypatch.setattr(
        Dataset,
        "read_file",
        lambda data, entry, **chosen: read.append(entry.path) or read_file(data, entry, **chosen),
    )
    manifest = read_manifest(dataset)
    small = Dataset(dataset, manifest, {}, hash_manifest(dataset))
    assert len(small.scene_ids) == len(whole)
    read.clear()
    for scenes in small.in_shards(small.scene_ids):
        for scene in scenes:
            np.testing.assert_array_equal(small.cells(scene), whole[scene])
    parts = [entry.path for entry in manifest.files_of("objects")]
    assert sorted(read) == parts
    assert len(parts) > 2
    small.cells(small.scene_ids[0])
    assert len(read) == len(parts) + 1, "the first part was given up"


def test_a_vocabulary_is_what_enough_buildings_have(dataset: Path) -> None:
    data = Dataset.open(dataset)
    unclassified = [data.unclassified(scene) for scene in data.scene_ids]
    everywhere = choose_vocabulary(unclassified, min_scenes=12)
    assert "wall" in everywhere
    assert NO_CATEGORY not in everywhere
    assert choose_vocabulary(unclassified, min_scenes=13) == ()
    assert set(everywhere) <= set(choose_vocabulary(unclassified, min_scenes=1))


def test_scenes_in_shards_come_in_the_order_of_the_tables(dataset: Path) -> None:
    data = Dataset.open(dataset)
    parts = [entry.rows for entry in data.manifest.files_of("scenes")]
    every = list(data.in_shards(reversed(data.scene_ids)))
    assert [len(part) for part in every] == parts
    assert tuple(scene for part in every for scene in part) == data.scene_ids
    some = {data.scene_ids[0], data.scene_ids[-1]}
    assert [set(shard) for shard in data.in_shards(some)] == (
        [some] if len(parts) == 1 else [{data.scene_ids[0]}, {data.scene_ids[-1]}]
    )


def test_a_dataset_that_commands_keep_replacing_is_refused(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hashes = map(str, range(1000))
    monkeypatch.setattr("bsg_data.dataset.dataset.hash_manifest", lambda _: next(hashes))
    with refuses(DatasetError, "dataset-replaced", dataset):
        Dataset.open(dataset)
    assert int(next(hashes)) < 20


def test_another_process_opens_the_same_dataset(dataset: Path) -> None:
    opened = Dataset.open(dataset)
    opened.cells(opened.scene_ids[0])
    sent = ForkingPickler.dumps(opened)
    assert len(sent) < 1000, "without its files"
    assert ForkingPickler.loads(sent) is opened
