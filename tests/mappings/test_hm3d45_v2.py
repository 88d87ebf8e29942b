"""What mappings/README.md says of hm3d45-v2, proved on the files and on the real rooms."""

from __future__ import annotations

import csv
from collections import Counter
from importlib.resources import files
from pathlib import Path

import pytest
from conftest import SHARED

from bsg_data.scene.class_map import ClassMap, load_class_map, normalise_name
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.hm3d_stats import HM3DStatistics

Rows = list[dict[str, str]]

# A single fixture, and in how many rooms of the 145 scenes there are two or more under v2.
FIXTURES = {
    "shower": (30, 168),
    "stove": (7, 126),
    "washing machine": (63, 88),
    "computer": (41, 115),
    "toilet": (3, 367),
    "bathtub": (2, 172),
}


@pytest.fixture(scope="module")
def v2() -> ClassMap:
    return load_class_map("hm3d45-v2")


def read(name: str) -> Rows:
    text = files("bsg_mappings").joinpath(name).read_text("utf-8")
    return list(csv.DictReader(text.splitlines(keepends=True), strict=True))


def class_of(class_map: ClassMap, name: str) -> str | None:
    index = class_map.classify(name).class_index
    return None if index is None else class_map.classes[index]


def test_the_classes_are_those_of_v1_in_the_same_order(v2: ClassMap) -> None:
    v1 = load_class_map("hm3d45-v1")
    assert v2.classes == v1.classes
    assert v2.space != v1.space  # other definitions, and another name
    assert all(definition.endswith(".") for definition in v2.definitions)
    assert {class_of(v2, name) for name in v2.classes} == set(v2.classes)


def test_a_category_and_a_normalised_name_have_one_class() -> None:
    by_category: dict[str, set[str]] = {}
    by_name: dict[str, set[str]] = {}
    for row in read("hm3d45-v2.csv"):
        by_category.setdefault(row["category"], set()).add(row["class"])
        by_name.setdefault(normalise_name(row["raw_category"]), set()).add(row["category"])
    assert [name for name, found in by_category.items() if len(found) > 1] == []
    assert [name for name, found in by_name.items() if len(found) > 1] == []
    assert [name for name in by_category if normalise_name(name) not in by_name] == []


def test_structure_has_no_class(v2: ClassMap) -> None:
    categories = {entry.category for entry in v2.entries.values()}
    classified = {e.category for e in v2.entries.values() if e.class_index is not None}
    assert v2.structure <= categories - classified
    assert {"wall", "radiator", "heater", "curtain rod", "closet rod"} <= v2.structure
    listed = [row["category"] for row in read("hm3d45-v2.structure.csv")]
    assert listed == sorted(set(listed))


@pytest.fixture(scope="module")
def respelled() -> dict[str, str]:
    """Spellings that say another thing than the public list's correction → their category."""
    v1 = {row["raw_category"]: row["category"] for row in read("hm3d45-v1.csv")}
    ours = {row["raw_category"]: row["category"] for row in read("hm3d45-v2.csv")}
    assert v1.keys() <= ours.keys()
    changed = (raw for raw in v1 if ours[raw] != v1[raw])
    return {normalise_name(raw): ours[raw] for raw in changed}


def test_what_changed_is_what_the_readme_says(respelled: dict[str, str]) -> None:
    """Every category that moved and every spelling that wins is a name in the README."""
    readme = files("bsg_mappings").joinpath("README.md").read_text("utf-8")
    changes = readme.split("## What v2 changed")[1].split("\n## ")[0]
    before = {(row["category"], row["class"]) for row in read("hm3d45-v1.csv")}
    categories = {category for category, _ in before}
    moved = {
        row["category"]
        for row in read("hm3d45-v2.csv")
        if row["category"] in categories and (row["category"], row["class"]) not in before
    }
    assert len(respelled) == 38
    for name in (*respelled, *moved):
        assert f"`{name}`" in changes


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("shower head", "shower"),
        ("shower hose", None),
        ("oven", None),
        ("oven and stove", "stove"),
        ("clothes dryer", "washing machine"),
        ("monitor", "computer"),
        ("keyboard", None),
        ("wardrobe door", None),
        ("flower pot", "plant"),
        ("vase with flower", "vase"),
        ("picture frame", None),
        ("art frame", "picture"),
        ("tabletop", None),
        ("liquid soap", None),
        ("soap bottle", "bottle"),
    ],
)
def test_hard_cases(v2: ClassMap, name: str, expected: str | None) -> None:
    assert v2.lookup(name) is not None
    assert class_of(v2, name) == expected


@pytest.mark.parametrize(
    ("name", "category", "rule"),
    [
        ("television", "tv", "vocabulary"),
        ("TV-stand", "tv stand", "separator"),
        ("sofas", "sofa", "number"),
        ("beds", "bed", "number"),
        ("house plant", "plant", "vocabulary"),
        ("potted plant", "plant", "vocabulary"),
        ("small plant", "plant", "head noun"),
        ("bed side table", "bedside table", "separator"),
        ("chair_3", "chair", "separator"),
        ("mail box", "mailbox", "separator"),
        ("Garbage_Can", "trash can", "vocabulary"),
        ("rubbish_bin", "trash can", "synonym"),
        ("sofa bed", "sofa", "vocabulary"),
        ("CoffeeTable", "coffee table", "separator"),
        ("coffeetables", "coffee table", "separator"),
        ("LeatherArmchair_2", "armchair", "head noun"),
        ("MacBook", "laptop", "synonym"),
        ("tvmonitor", "tv", "vocabulary"),
        ("TV_Monitor_2", "tv", "vocabulary"),
        ("lighting", "lamp", "vocabulary"),
        ("toilett", "toilet", "spelling"),
        ("micorwave", "microwave", "spelling"),
        ("televison", "tv", "spelling"),
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


def test_every_new_synonym_is_needed_and_all_lead_to_a_category(v2: ClassMap) -> None:
    categories = {entry.category for entry in v2.entries.values()}
    rows = read("synonyms-v2.csv")
    assert {(row["name"], row["category"]) for row in read("synonyms-v1.csv")} < {
        (row["name"], row["category"]) for row in rows
    }
    assert [row["name"] for row in rows] == sorted({normalise_name(row["name"]) for row in rows})
    assert [row for row in rows if row["category"] not in categories | {""}] == []
    assert [row["name"] for row in rows if v2.lookup(row["name"]) is not None] == []
    found = {row["name"]: v2.classify(row["name"]) for row in rows}
    former = {row["name"] for row in read("synonyms-v1.csv")}  # which stays whole
    others = {r["name"] for r in rows if r["category"] and found[r["name"]].rule != "synonym"}
    assert others <= former
    assert [r for r in rows if (found[r["name"]].category or "") != r["category"]] == []


def test_a_part_has_no_class_and_leads_to_one(v2: ClassMap) -> None:
    rows = read("parts-v1.csv")
    names = [row["category"] for row in rows]
    assert names == sorted(set(names))
    assert {v2.classify(name).role for name in names} == {"left-out", "structure"}
    assert {row["class"] for row in rows} <= set(v2.classes)
    assert {"category": "curtain rod", "class": "curtain"} in rows


@pytest.mark.parametrize("name", ["labels-ade20k.csv", "labels-mpcat40.csv"])
def test_labels_of_robots_lead_to_categories(v2: ClassMap, name: str) -> None:
    categories = {entry.category for entry in v2.entries.values()}
    assert [row for row in read(name) if row["category"] not in categories] == []


@pytest.mark.skipif(not SHARED.is_dir(), reason="../shared is not on this machine")
def test_every_public_spelling_has_a_row_with_the_lists_category_or_its_own(
    v2: ClassMap, respelled: dict[str, str]
) -> None:
    vocabulary = SHARED.parent / "reference" / "hm3d_vocabulary.csv"
    with vocabulary.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2532
    for row in rows:
        expected = respelled.get(normalise_name(row["raw_category"]), row["category"])
        assert v2.entries[row["raw_category"]].category == expected


def test_raw_and_corrected_differ_where_the_spelling_wins(
    shared: Path, v2: ClassMap, respelled: dict[str, str]
) -> None:
    """All instances of the 145 scenes: the text's spellings against the zip's corrected names."""

    def classes(
        source: HM3DFolder | HM3DStatistics,
    ) -> dict[tuple[str, int], tuple[str, int | None]]:
        return {
            (ref.scene_id, obj.instance_id): (normalise_name(obj.raw_category), obj.class_index)
            for ref in source.find().scenes
            for obj in source.read(ref, v2).graph.objects
        }

    raw = classes(HM3DFolder(shared / "annotations"))
    corrected = classes(HM3DStatistics(shared / "HM3DSem-v0.2-train.zip"))
    assert len(raw) == 96110
    assert raw.keys() == corrected.keys()
    differ = Counter(raw[i][0] for i in raw if raw[i][1] != corrected[i][1])
    assert set(differ) <= set(respelled)
    assert differ.total() == 94
    assert differ["tabletop"] == 51


def test_rooms_with_two_of_a_single_fixture(shared: Path, v2: ClassMap) -> None:
    source = HM3DFolder(shared / "annotations")
    rooms: Counter[tuple[str, int, str]] = Counter()
    for ref in source.find().scenes:
        for obj in source.read(ref, v2).graph.objects:
            if obj.class_index is not None:
                rooms[ref.scene_id, obj.room_index, v2.classes[obj.class_index]] += 1
    found = {
        name: (
            sum(count > 1 for (*_, c), count in rooms.items() if c == name),
            sum(c == name for *_, c in rooms),
        )
        for name in FIXTURES
    }
    assert found == FIXTURES
