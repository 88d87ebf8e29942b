"""What mappings/README.md says of behavior45-v1, proved on the files and on the real list."""

from __future__ import annotations

from collections import Counter

import pytest
from conftest import REPOSITORY

from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.behavior import BehaviorRooms

SAMPLE = REPOSITORY.parent / "shared" / "sources" / "behavior_room_object_list.json"
OURS, HM3D = load_class_map("behavior45-v1"), load_class_map("hm3d45-v2")


def test_what_the_readme_counts() -> None:
    roles = Counter(OURS.classify(name).role for name in OURS.entries)
    assert roles["classified"] == 254
    assert len(OURS.entries) == 586
    found = {entry.class_index for entry in OURS.entries.values()} - {None}
    missing = {name for index, name in enumerate(OURS.classes) if index not in found}
    assert missing == {"curtain", "dresser"}


@pytest.mark.parametrize(
    ("name", "class_name"),
    [
        ("straight_chair", "chair"),
        ("bottle_of_wine", "bottle"),
        ("box_of_cereal", "box"),
        ("carton_of_milk", "box"),
        ("can_of_soda", None),
        ("frail", "basket"),
        ("low_resolution_tree", "plant"),
        ("shower_stall", "shower"),
        ("toilet_stall", None),
        ("showerhead", "shower"),
        ("burner", "stove"),
        ("oven", None),
        ("keyboard", None),
        ("monitor", "computer"),
        ("washer", "washing machine"),
        ("clothes_dryer", "washing machine"),
        ("cap", None),
        ("periodic_table", None),
        ("oden_cooker", None),
        ("wooden_spoon", None),
        ("walls", None),
    ],
)
def test_words_that_were_decided(name: str, class_name: str | None) -> None:
    index = OURS.entries[name].class_index
    assert (None if index is None else OURS.classes[index]) == class_name


@pytest.mark.skipif(not SAMPLE.is_file(), reason="needs ../shared/sources")
def test_coverage_of_the_real_list() -> None:
    source = BehaviorRooms(SAMPLE)
    graphs = [source.read(ref, OURS).graph for ref in source.find().scenes]
    roles = Counter(obj.role for graph in graphs for obj in graph.objects)
    assert roles == {"classified": 22_392, "left-out": 10_026, "structure": 3_160}
