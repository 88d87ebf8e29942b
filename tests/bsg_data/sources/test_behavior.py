from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from conftest import SHARED

from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import SceneGraph
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.source import Source
from bsg_data.testing import SourceContract

SAMPLE = SHARED.parent / "sources" / "behavior_room_object_list.json"
KITCHEN = {"stove-abcdef": 1, "straight_chair-amgwaw": 2, "walls-aaaaaa": 1}
SCENES = {
    "Rs_int": {"kitchen_0": KITCHEN, "bedroom_0": {"bed-zrumze": 1}},
    "Rs_garden": {
        "kitchen_0": {**KITCHEN, "walls-bbbbbb": 1},
        "bedroom_0": {"bed-zrumze": 1},
        "garden_0": {"tree-ccccccc": 3},
    },
    "house_double_floor_upper": {"bedroom_10": {"bed-zrumze": 1}, "bedroom_9": {}},
    "house_double_floor_lower": {"garage_0": {"car-aaaaaa": 1}},
    # Cubicles of a public washroom are no showers.
    "office_bike": {"bathroom_0": {"shower_stall-taqzxq": 1, "shower_stall-invgma": 1}},
}


def write_list(folder: Path, scenes: Any = SCENES) -> Path:
    path = folder / "list.json"
    path.write_text(json.dumps({"success": True, "scenes": scenes}), "utf-8")
    return path


class TestBehavior(SourceContract):
    name = "behavior"

    def write_example(self, folder: Path) -> Path:
        return write_list(folder)


def read_all(source: Source) -> dict[str, SceneGraph]:
    class_map = load_class_map()
    return {ref.scene_id: source.read(ref, class_map).graph for ref in source.find().scenes}


def test_a_house_is_one_building_with_its_floors_and_its_garden(tmp_path: Path) -> None:
    source = open_source("behavior", write_list(tmp_path))
    graphs = read_all(source)
    assert list(graphs) == ["Rs", "house_double_floor", "office_bike"]
    rooms = [(r.region_id, r.source_label, r.label, r.floor_index) for r in graphs["Rs"].rooms]
    assert rooms == [
        (0, "bedroom", "bedroom", 0),
        (1, "garden", "garden", 0),
        (2, "kitchen", "kitchen", 0),
    ]
    objects = [(obj.raw_category, obj.room_index) for obj in graphs["Rs"].objects]
    assert Counter(objects) == {
        ("bed", 1): 1,
        ("tree", 2): 3,
        ("stove", 3): 1,
        ("straight_chair", 3): 2,
        ("walls", 3): 2,
    }  # as the garden's scene has the kitchen, not twice
    double = graphs["house_double_floor"]
    floors = [(r.source_label, r.floor_index) for r in double.rooms]
    assert floors == [("garage", 0), ("bedroom", 1), ("bedroom", 1)]
    assert [obj.room_index for obj in double.objects] == [1, 3]  # bedroom_9 before bedroom_10
    assert {g.building_kind for g in graphs.values()} == {"home", "office"}
    names = [obj.raw_category for obj in graphs["office_bike"].objects]
    assert sorted(names) == ["shower_stall", "toilet_stall"]
    (left,) = source.find().duplicates
    assert (left.scene_id, left.reason) == ("Rs_int", "Rs_garden has all its rooms, and the garden")


def test_rooms_that_the_garden_scene_lacks_are_kept(tmp_path: Path) -> None:
    scenes = {"Rs_int": SCENES["Rs_int"], "Rs_garden": {"garden_0": {"tree-cccccc": 1}}}
    source = open_source("behavior", write_list(tmp_path, scenes))
    assert len(read_all(source)["Rs"].rooms) == 3
    assert source.find().duplicates == ()


def test_a_name_says_building_and_kind(tmp_path: Path) -> None:
    kinds = {
        "gates_bedroom": "home",
        "grocery_store_cafe": "shop",
        "hall_train_station": "hall",
        "hotel_suite_small": "hotel",
        "house_single_floor": "home",
        "officer": None,
        "restaurant_hotel": "restaurant",
        "school_gym": "school",
    }
    path = write_list(tmp_path, {scene: {"a_0": {}} for scene in [*kinds, "Beechwood_1_int"]})
    graphs = read_all(open_source("behavior", path))
    found = {name: graph.building_kind for name, graph in graphs.items()}
    assert found == {"Beechwood": "home", **kinds}


@pytest.mark.skipif(not SAMPLE.is_file(), reason="needs ../shared/sources")
def test_the_real_list() -> None:
    listed = read_all(open_source("behavior", SAMPLE, as_listed=True))
    assert len(listed) == 51
    assert sum(len(graph.rooms) for graph in listed.values()) == 374
    assert sum(len(graph.objects) for graph in listed.values()) == 36_164
    assert None not in {graph.building_kind for graph in listed.values()}
    found = open_source("behavior", SAMPLE).find()
    assert (len(found.scenes), len(found.duplicates)) == (37, 5)
    names = {obj.raw_category for graph in listed.values() for obj in graph.objects}
    assert names == set(load_class_map("behavior45-v1").entries), "no row is idle"
