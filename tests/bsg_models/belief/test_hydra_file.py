"""What is read from a Spark-DSG file, whose names are taken, and what a person is told of it."""

from __future__ import annotations

import gzip
import json
import sys
from pathlib import Path
from typing import Any

import pytest
from dsg_files import Graph, node, robot_graph, write_graph

from bsg_data.sources.label_space import load_label_space
from bsg_models.belief.hydra_file import open_hydra
from bsg_models.errors import HydraError


def bare_graph() -> Graph:
    """Return the graph without names for its labels."""
    graph = robot_graph()
    del graph["metadata"]
    return graph


def test_a_graph_by_hand(tmp_path: Path) -> None:
    graph = open_hydra(write_graph(tmp_path / "flat.json")).partial()
    assert (graph.scene_id, graph.adjacency, graph.hidden_share) == ("flat", ((1, 2),), 0.5)
    kitchen, other = graph.rooms
    assert (kitchen.name, kitchen.label, kitchen.room_type) == ("R(0)", "kitchen", "kitchen")
    assert kitchen.box is not None
    assert (other.name, other.label, other.room_type, other.box) == ("R(3)", None, None, None)
    assert [(obj.name, obj.room_index, obj.raw_category) for obj in graph.objects] == [
        ("O(2)", 1, "sofa"),
        ("O(5)", 1, "tv_monitor"),
        ("O(6)", 0, "chair"),
        ("O(9)", 2, "label 99"),
    ]


def test_what_a_robot_says_comes_first(tmp_path: Path) -> None:
    graph = robot_graph()
    graph["metadata"]["bsg"] = {
        "partial": {"scene_id": "home", "building_kind": "home", "hidden_share": 0.75},
        "else": 1,
    }
    said = {"id": "galley", "hidden_share": 0.25, "room_type": None, "floor_area": 8.5, "my": {}}
    graph["nodes"][1]["attributes"]["metadata"] = {"bsg": said}
    graph["nodes"][2]["attributes"]["metadata"] = {"bsg": {"visited": False}}
    graph["nodes"][5]["attributes"]["metadata"] = {"bsg": {"id": "7", "category": "armchair"}}
    path = write_graph(tmp_path / "x.json", graph)
    file = open_hydra(path)
    found = file.partial()
    assert (found.scene_id, found.building_kind, found.hidden_share) == ("home", "home", 0.75)
    room, other = found.rooms
    assert (room.name, room.hidden_share, room.room_type, room.floor_area) == (
        *("galley", 0.25),
        *(None, 8.5),
    )
    assert (other.visited, other.hidden_share) == (False, 1)
    assert (found.objects[0].name, found.objects[0].category) == ("7", "armchair")
    assert found.objects[0].room_index == 1
    said["hidden_share"] = 7
    with pytest.raises(HydraError, match=r"x\.json: room 'galley': hidden_share: .* \(in metadata"):
        open_hydra(write_graph(path, graph)).partial()


@pytest.mark.parametrize(
    ("labels", "expected", "told"),
    [
        (
            None,
            ["label 7", "label 10"],
            "3 objects with labels that nobody names (7, 10, 99); name them by --",
        ),
        ("mpcat40", ["cabinet", "couch"], "by mpcat40, 7 is cabinet, 10 is couch"),
        ("ade20k", ["bed", "cabinet"], "by ade20k, 7 is bed, 10 is cabinet, 99 is buffet"),
        ("own.csv", ["oven", "label 10"], "by own, 7 is oven"),
    ],
)
def test_labels_without_names(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    labels: str | None,
    expected: list[str],
    told: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.csv").write_text("label,name\n7,oven\n")
    space = None if labels is None else load_label_space(labels)
    file = open_hydra(write_graph(tmp_path / "flat.json", bare_graph()))
    found = [obj.raw_category for obj in file.partial(labels=space).objects]
    assert found[:3] == [*expected, "chair"], "a name of one's own comes before a number's"
    assert any(told in note for note in file.notes(space))


@pytest.mark.parametrize(
    ("place", "said", "message"),
    [
        (1, {"hiden_share": 0.5}, r"room 'R\(0\)': 'hiden_share' is no key; did you mean hidden_s"),
        (5, {"categry": "bed"}, r"object 'O\(2\)': 'categry' is no key; did you mean category"),
        (None, {"partial": {"buildng_kind": "home"}}, r"partial: 'buildng_kind' is no"),
    ],
)
def test_a_misspelt_key_in_metadata_is_refused(
    tmp_path: Path, place: int | None, said: dict[str, Any], message: str
) -> None:
    graph = robot_graph()
    held = graph if place is None else graph["nodes"][place]["attributes"]
    held["metadata"] = {"bsg": said}
    file = open_hydra(write_graph(tmp_path / "a.json", graph))
    with pytest.raises(HydraError, match=message):
        file.partial()


def test_keys_of_ones_own_in_metadata_are_left_alone(tmp_path: Path) -> None:
    graph = robot_graph()
    graph["metadata"] = {"bsg": {"mine": 1, "partial": {"notes": "x"}}}
    graph["nodes"][1]["attributes"]["metadata"] = {"bsg": {"mine": 1, "hidden_share": 0.5}}
    kitchen = open_hydra(write_graph(tmp_path / "a.json", graph)).partial().rooms[0]
    assert kitchen.hidden_share == 0.5


def test_notes_tell_what_is_odd(tmp_path: Path) -> None:
    named = open_hydra(write_graph(tmp_path / "a.json"))
    assert named.notes()[0] == "1 of 4 objects under no room, counted for the building only"
    assert "labels that nobody names (99)" in named.notes()[1]
    assert len(named.notes()) == 2
    graph = bare_graph()
    graph["nodes"] = [node("O", 1, 2)]
    graph["edges"] = []
    notes = open_hydra(write_graph(tmp_path / "b.json", graph)).notes()
    assert notes == (
        "it has no rooms (layer ROOMS): beliefs are about the building only",
        "1 object with neither a label nor a name",
    )


def test_packed_files_and_a_byte_order_mark_are_read(tmp_path: Path) -> None:
    text = json.dumps(robot_graph())
    packed, marked = tmp_path / "flat.json.gz", tmp_path / "flat.json"
    packed.write_bytes(gzip.compress(text.encode()))
    marked.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert open_hydra(packed).text == text
    assert open_hydra(marked).text == "\ufeff" + text
    assert open_hydra(packed).partial() == open_hydra(marked).partial()
    packed.write_bytes(gzip.compress(text.encode())[:-9])
    with pytest.raises(HydraError, match=r"flat\.json\.gz: .*not a readable gzip file"):
        open_hydra(packed)


def test_a_binary_file_without_its_library_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "spark_dsg", None)
    with pytest.raises(
        HydraError, match=r"as \.json, or pip install '\./belief-scene-graphs\[hydra\]'"
    ):
        open_hydra(tmp_path / "dsg.sparkdsg")
    assert open_hydra(write_graph(tmp_path / "dsg.json")).partial().rooms, "JSON needs none"
