from __future__ import annotations

from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.parts import find_wholes, load_parts


def test_wholes_by_hand() -> None:
    parts = {"curtain rod": "curtain", "shower head, old": "shower"}
    found = find_wholes(["shower head, old", "", "curtain rod"], ["curtain", "bed"], parts)
    assert found.tolist() == [-1, -1, 0], "a space without showers has no wholes of their parts"


def test_parts_are_outside_the_classes_and_their_things_inside() -> None:
    class_map = load_class_map("hm3d45-v2")
    parts = load_parts()
    assert parts["curtain rod"] == "curtain"
    assert set(parts.values()) <= set(class_map.classes)
    roles = {class_map.classify(category).role for category in parts}
    assert roles <= {"left-out", "structure"}
