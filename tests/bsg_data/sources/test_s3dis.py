from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.catalogue import open_source
from bsg_data.testing import SourceContract

LABELS = [
    "<UNK>_0_<UNK>_0_0",
    "chair_1_conferenceRoom_1_1",
    "chair_2_conferenceRoom_1_1",
    "clutter_9_office_10_1",
    "wall_1_office_2_1",
    "sofa_1_lounge_1_5a",
]


class TestS3DIS(SourceContract):
    name = "s3dis"

    def write_example(self, folder: Path) -> Path:
        path = folder / "semantic_labels.json"
        path.write_text(json.dumps(LABELS), "utf-8")
        return path


def test_a_scene_is_an_area(tmp_path: Path) -> None:
    source = open_source("s3dis", TestS3DIS().write_example(tmp_path))
    one, five = source.find().scenes
    class_map = load_class_map("s3dis45-v1")
    graph = source.read(one, class_map).graph
    assert (one.scene_id, five.scene_id, graph.building_kind) == ("area_1", "area_5a", "office")
    assert [room.label for room in graph.rooms] == ["meeting room", "office", "office"]
    assert Counter((obj.room_index, obj.category, obj.role) for obj in graph.objects) == {
        (1, "chair", "classified"): 2,
        (2, "unknown", "nameless"): 1,
        (3, "wall", "structure"): 1,
    }
