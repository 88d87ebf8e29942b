"""One word has one class by every door: every word of every vocabulary, phrases, users' cases."""

from __future__ import annotations

import csv
import json
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from conftest import REPOSITORY
from dsg_files import robot_graph

from bsg_data.errors import RecipeError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.synonyms import vocabulary_words
from bsg_data.sources.catalogue import open_source
from bsg_robot import open_graph
from bsg_robot.answers.words import find_everyday
from bsg_robot.graph.graph_file import parse_graph
from bsg_robot.graph.robot_json import parse_robot_graph

MAP = load_class_map()
NAMES = ["ade20k", "ai2thor", "coco", "darknet", "lvis", "mpcat40", "nyu40", "objectnav", "voc"]
LISTED = sorted({word for name in NAMES for word in vocabulary_words(name)})
# phrases of captions and detectors → the class of what they are about; names that are no phrases
ABOUT = """
lamp on table → lamp; box under bed → box; books on shelf → book; chair at desk → chair
towel near sink → towel; trash can next to toilet → garbage bin
picture hanging above the couch → picture; red mug beside computer → tableware
Lamp_on_table_2 → lamp; table w/ chairs → table; chair(0.87) → chair; chair 0.87 → chair
couch: 41% → couch; mug (red) → tableware; chair [1] → chair; chair (2) → chair
mug, red → tableware; Cabinet/shelf → cabinet; gizmo / shelf → shelf; door / cabinet → cabinet
fireplace /w art → none; toilett (old) → toilet; gizmo on table → none; walk in closet → none
carry on bag → bag; bath mat → floor mat; chest of drawers → dresser; clothes on shelf → clothes
"""
ROWS = (row.split(" → ") for row in re.split("; |\n", ABOUT.strip()))
PHRASES = {word: None if name == "none" else name for word, name in ROWS}
WORDS = [*LISTED, *PHRASES]
HERE = Path("here")
Classes = list[str | None]


def name_class(index: int | None) -> str | None:
    return None if index is None else MAP.classes[index]


def list_expected() -> Classes:
    """Return the classes as the file of vocabularies has them, by HM3D's listed words alone."""
    path = files("bsg_mappings").joinpath("vocabularies-v1.csv")
    with path.open(encoding="utf-8", newline="") as file:
        rows = {row["word"]: row["category"] for row in csv.DictReader(file)}
    entries = [MAP.lookup(rows[word]) if rows[word] else None for word in LISTED]
    return [None if entry is None else name_class(entry.class_index) for entry in entries]


EXPECTED = [*list_expected(), *PHRASES.values()]


def label_graph(spaces: dict[str, Any]) -> dict[str, Any]:
    """Return a Hydra graph with an object for each word, and label spaces."""
    graph = robot_graph()
    (model,) = [node for node in graph["nodes"] if node["attributes"].get("name") == "O(2)"]
    nodes = [node for node in graph["nodes"] if node["layer"] != 2]
    for number in range(len(WORDS)):
        attributes = model["attributes"] | {"name": f"O({number})", "semantic_label": number}
        nodes.append({**model, "id": (ord("O") << 56) + number, "attributes": attributes})
    return {**graph, "nodes": nodes, "edges": [], "metadata": {"labelspaces": spaces}}


def read_source(name: str, path: Path) -> dict[str, str | None]:
    """Return word → class of the objects of a source of one building."""
    (scene,) = (source := open_source(name, path)).find().scenes
    objects = source.read(scene, MAP).graph.objects
    return {obj.raw_category: name_class(obj.class_index) for obj in objects}


def by_map(folder: Path) -> Classes:
    graph = parse_robot_graph({"kitchen": WORDS}, path=HERE, class_map=MAP)
    return [name_class(obj.class_index) for obj in graph.objects]


def by_detector(folder: Path) -> Classes:
    said = {"rooms": [{"id": "kitchen"}], "scene_id": "s", "detector": WORDS}
    found = dict(parse_robot_graph(said, path=HERE, class_map=MAP).detector or ())
    return [name_class(found[word]) for word in WORDS]


def by_question(folder: Path) -> Classes:
    seen = open_graph({"kitchen": []})

    def understand(word: str, expected: str | None) -> str | None:
        if find_everyday(word) is not None:  # the table of things may know better
            return expected
        try:
            return seen.understand(word).class_name
        except RecipeError:
            return None

    return [*map(understand, WORDS, EXPECTED)]


def by_label_file(folder: Path) -> Classes:
    rows = [["label", "name"], *([number, word] for number, word in enumerate(WORDS))]
    with (folder / "own.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    read = parse_graph(label_graph({}), path=HERE, labels=folder / "own.csv")
    return [name_class(obj.class_index) for obj in read.graph.objects]


def by_a_recording(folder: Path) -> Classes:
    spaces = {"_l2p0": [[number, word] for number, word in enumerate(WORDS)]}
    (folder / "dsg.json").write_text(json.dumps(label_graph(spaces)), "utf-8")
    found = read_source("spark-dsg", folder / "dsg.json")
    return [found[word] for word in WORDS]


def by_table(folder: Path) -> Classes:
    with (folder / "things.csv").open("w", encoding="utf-8", newline="") as file:
        rows = [["scene", "room", "category"], *(["s", "r", word] for word in WORDS)]
        csv.writer(file).writerows(rows)
    found = read_source("table", folder / "things.csv")
    return [found[word] for word in WORDS]


def by_saw(folder: Path) -> Classes:
    seen = open_graph({"kitchen": []})
    for word in WORDS:
        seen.saw("kitchen", word, within=0)
    return [name_class(obj.class_index) for obj in seen.graph.objects]


DOORS = [by_map, by_detector, by_question, by_label_file, by_a_recording, by_table, by_saw]


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.__name__)
def test_every_word_has_its_class_by_every_door(door: Any, tmp_path: Path) -> None:
    found = door(tmp_path)
    rows = zip(WORDS, found, EXPECTED, strict=True)
    assert [row for row in rows if row[1] != row[2]] == []


CASES = REPOSITORY.parent / "shared" / "cases"


@pytest.mark.skipif(not CASES.is_dir(), reason="needs ../shared")
@pytest.mark.parametrize("case", ["229-phrases", "231-labels-with-scores"])
def test_phrases_and_scores_of_users_are_the_things_before_them(case: str) -> None:
    seen = open_graph(CASES / case / "map.json")
    (scene,) = (source := open_source("table", CASES / case / "t.csv")).find().scenes
    objects = (*seen.graph.objects, *source.read(scene, MAP).graph.objects)
    for obj in objects:
        first = re.split(r" (?:on|under|at|near|next|above|beside)\b| ?[(\[]", obj.raw_category)[0]
        assert obj.class_index == MAP.classify(first).class_index is not None, obj
        assert seen.understand(obj.raw_category).class_name == MAP.classes[obj.class_index]
