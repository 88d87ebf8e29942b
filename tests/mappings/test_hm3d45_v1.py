"""What the rules make of names that hm3d45-v1 does not list."""

from __future__ import annotations

import pytest

from bsg_data.scene.class_map import load_class_map

MAP = load_class_map("hm3d45-v1")


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
def test_what_a_robot_says(name: str, category: str, rule: str) -> None:
    found = MAP.classify(name)
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
def test_a_last_word_that_misleads_gives_no_class(name: str) -> None:
    """`drawer` and `glasses` are listed without a class; `baseball glove` is in a vocabulary."""
    assert MAP.classify(name).role == "unmapped"
