"""What the rules make of names that hm3d45-v2 does not list.

The files of a published map never change (`tests/bsg_data/scene/test_published_maps.py`).
"""

from __future__ import annotations

import pytest

from bsg_data.scene.class_map import ClassMap, load_class_map


@pytest.fixture(scope="module")
def v2() -> ClassMap:
    return load_class_map("hm3d45-v2")


@pytest.mark.parametrize(
    ("name", "category", "rule"),
    [
        ("television", "tv", "vocabulary"),
        ("TV-stand", "tv stand", "separator"),
        ("beds", "bed", "number"),
        ("house plant", "plant", "vocabulary"),
        ("small plant", "plant", "head noun"),
        ("bed side table", "bedside table", "separator"),
        ("chair_3", "chair", "separator"),
        ("rubbish_bin", "trash can", "synonym"),
        ("sofa bed", "sofa", "vocabulary"),
        ("CoffeeTable", "coffee table", "separator"),
        ("LeatherArmchair_2", "armchair", "head noun"),
        ("MacBook", "laptop", "synonym"),
        ("lighting", "lamp", "vocabulary"),
        ("toilett", "toilet", "spelling"),
        ("red toilett", "toilet", "spelling"),
        ("toilet bowl", "toilet", "synonym"),
        ("wastepaper baskets", "trash can", "synonym"),
    ],
)
def test_what_a_robot_says(v2: ClassMap, name: str, category: str, rule: str) -> None:
    found = v2.classify(name)
    assert (found.category, found.rule) == (category, rule)


@pytest.mark.parametrize(
    "name",
    [
        *("dresser drawer", "night stand drawer", "reading glasses", "pair of glasses"),
        *("slow cooker", "large dog dish", "boom box", "seat belt", "heat sink", "wheel chair"),
        *("blood pressure monitor", "number plate", "clothes drying rack", "kitchen oven"),
        *("baseball glove", "conveyer belt", "GameBoy", "painter", "battle", "sofaa"),
    ],
)
def test_a_last_word_that_misleads_gives_no_class(v2: ClassMap, name: str) -> None:
    """`drawer` and `glasses` are listed without a class; `baseball glove` is in a vocabulary."""
    assert v2.classify(name).role == "unmapped"
