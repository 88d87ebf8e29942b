"""A robot's own JSON: read by hand, written and read back, refused where it is wrong."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.inputs.bounds import MAX_ROBOT_ROOMS
from bsg_data.observation.hidden_share import VAGUE, ShareBelief, estimate_hidden_share
from bsg_data.observation.robot_json import (
    RobotGraphError,
    encode_robot_graph,
    list_unmapped,
    parse_robot_graph,
    read_robot_graph,
)
from bsg_data.scene.surroundings import BUILDING_KINDS

SAID: dict[str, Any] = {
    "scene_id": "home",
    "rooms": [{"id": "kitchen"}, {"id": "hall", "visited": False, "position": [1, 2, 0.5]}],
    "objects": [
        {"id": "1", "room": "kitchen", "category": "Fridge"},
        {"id": "2", "category": "zzqx thing"},
    ],
    "adjacency": [["hall", "kitchen"]],
}


def test_a_graph_by_hand() -> None:
    graph = parse_robot_graph(SAID, path=Path("x"))
    assert [room.share for room in graph.rooms] == [VAGUE, ShareBelief(1.0)]
    assert graph.hidden_share == 0.75
    assert graph.rooms[1].position == (1, 2, 0.5)
    first, second = graph.objects
    assert (first.room_index, first.category) == (1, "refrigerator")
    assert graph.class_space.classes[first.class_index or 0] == "refrigerator"
    assert (second.room_index, second.category, second.class_index) == (0, None, None)
    assert graph.adjacency == ((1, 2),)
    assert list_unmapped(graph) == {"zzqx thing": 1}


room_types = st.sampled_from([None, "Kitchen", "hallway", "other"]) | st.dictionaries(
    st.sampled_from(["kitchen", "hall", "corridor", ""]), st.floats(0, 0.25), min_size=1
)
texts = st.text(min_size=1, max_size=8).filter(lambda text: text.isprintable())


@given(
    rooms=st.lists(texts, min_size=1, max_size=5, unique=True),
    categories=st.lists(st.sampled_from(["bed", "sofa", "tap", "", "x<y"]), max_size=6),
    data=st.data(),
)
def test_any_graph_is_read_back(
    rooms: list[str], categories: list[str], data: st.DataObject
) -> None:
    said = {
        "scene_id": data.draw(texts),
        "rooms": [
            {
                "id": name,
                "visited": data.draw(st.booleans()),
                "hidden_share": data.draw(st.none() | st.floats(0, 1)),
                "footprint": data.draw(st.none() | st.just([[0, 0], [1, 0], [1, 1.5]])),
            }
            for name in rooms
        ],
        "objects": [
            {
                "id": str(number),
                "room": data.draw(st.none() | st.sampled_from(rooms)),
                "category": c,
            }
            for number, c in enumerate(categories)
        ],
    }
    graph = parse_robot_graph(said, path=Path("x"))
    written = json.loads(json.dumps(encode_robot_graph(graph)))
    assert parse_robot_graph(written, path=Path("x")) == graph


@settings(max_examples=50)
@given(
    area=st.none() | st.floats(0.01, 1e5),
    room_type=room_types,
    building_kind=st.sampled_from([None, "other", *BUILDING_KINDS]),
    source=st.sampled_from([None, "hm3d", "x<y"]),
)
def test_any_surroundings_are_read_back(
    area: float | None, room_type: Any, building_kind: str | None, source: str | None
) -> None:
    kitchen = {"id": "kitchen", "floor_area": area, "room_type": room_type}
    said = {**SAID, "rooms": [kitchen], "objects": [], "adjacency": []}
    said |= {"building_kind": building_kind, "source": source}
    graph = parse_robot_graph(said, path=Path("x"))
    written = json.loads(json.dumps(encode_robot_graph(graph)))
    assert parse_robot_graph(written, path=Path("x")) == graph
    row = graph.observation().surroundings.labels[1]
    assert row.sum() == pytest.approx(0 if graph.rooms[0].room_type is None else 1, abs=1e-6)


def changed(**values: Any) -> str:
    return json.dumps({**SAID, **values})


def room(**values: Any) -> str:
    return changed(rooms=[{"id": "kitchen", **values}])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{", "no JSON"),
        ("[]", "expected a JSON object"),
        ('{"scene_id": "a", "scene_id": "b", "rooms": []}', "the key 'scene_id' twice"),
        (changed(rooms=[{"id": "a"}, {"id": "a"}]), "room id 'a' is there twice"),
        (changed(rooms=[{"id": ""}]), "room number 1: id"),
        (changed(rooms=[{"id": "kitchen", "hidden_share": 1.5}]), "'kitchen': hidden_share"),
        (
            changed(rooms=[{"id": "kitchen", "colour": 1}]),
            "'kitchen': 'colour' is no key; known are ",
        ),
        (
            room(hiden_share=0.5),
            "'kitchen': 'hiden_share' is no key; did you mean hidden_share",
        ),
        (json.dumps({"scene_id": "a", "roms": []}), "'roms' is no key; did you mean rooms"),
        (room(id=3), "room number 1: id: "),
        (
            changed(objects=[{"id": "7", "clas": "bed"}]),
            "object '7': 'clas' is no key; did you mean class",
        ),
        (
            changed(objects=[{"id": "7", "category": "bed"}] * 11 + [5]),
            "object number 12: expected a JSON object",
        ),
        (changed(adjacency=[["hall", "kitchen"], ["hall", 5]]), "pair of adjacency number 2: 1: "),
        (room(room_type={}), "'kitchen': room_type: .*at least one label, found none"),
        (changed(**{"x" * 10_000: 1}), r"graph.json: 'x{80}' is no key; known are format"),
        (
            changed(objects=[{"id": "1", "room": "attic", "category": "bed"}]),
            r"object '1' \(bed\): expected the id of a room, found no room 'attic'; rooms are "
            "kitchen, hall.*: name one of these, or add the room to `rooms`",
        ),
        (changed(objects=[{"id": "1", "room": "kitchen"}]), "object '1': category"),
        (changed(adjacency=[["hall", "hall"]]), "'hall' with itself"),
        (changed(adjacency=[["hall", "attic"]]), "'hall' and 'attic': .*no room 'attic'"),
        (changed(version=4), "version"),
        (changed(version=True), "version: expected a number, found true"),
        (
            room(position=[True, False, True]),
            "'kitchen': position.0: expected a number, found true",
        ),
        (room(position=["1", 2, 3]), "'kitchen': position.0: expected a number, found '1'"),
        (
            room(footprint=[[0, 0], [1, 0], [1, True]]),
            "'kitchen': footprint.2.1: expected a number",
        ),
        (room(floor_index=True), "'kitchen': floor_index: expected a number, found true"),
        (room(hidden_share=0.5, hidden_share_sd=0.5), "'kitchen': .*less than 0.5, found 0.5"),
        (room(hidden_share=0, hidden_share_sd=0.1), "'kitchen': .*of a hidden share of 0"),
        (room(hidden_share=1, hidden_share_sd=0.1), "'kitchen': .*of a hidden share of 1"),
        (room(hidden_share_sd=-0.1), "'kitchen': hidden_share_sd"),
        (room(hidden_share=0.5, floor_in_view=0.5), "has hidden_share and floor_in_view"),
        (room(hidden_share_sd=0.1, seconds_inside=5), "'kitchen': has hidden_share_sd without"),
        (room(visited=False, seconds_inside=5), "'kitchen': seconds_inside: expected none for"),
        (room(walls_in_view=1.5), "'kitchen': walls_in_view"),
        (room(seconds_inside=-1), "'kitchen': seconds_inside"),
        (room(hidden_share_sd="0.1"), "'kitchen': hidden_share_sd"),
        (room(floor_area=0), "'kitchen': floor_area: .* greater than 0"),
        (room(floor_area=1e6), "'kitchen': floor_area: .* less than or equal to 100000"),
        (room(floor_area=True), "'kitchen': floor_area"),
        (room(floor_area="9"), "'kitchen': floor_area"),
        (room(floor_area=0).replace(": 0}", ": NaN}"), "no JSON"),
        (room(room_type="kitchn"), "'kitchen': room_type: .*'kitchn'; did you mean kitchen"),
        (room(room_type="x" * 10_000), "'kitchen': room_type: .*found 'x{80}'; leave it out"),
        (room(room_type=5), "'kitchen': room_type: .*with their probabilities, found 5"),
        (
            room(room_type={"kitchen": True}),
            "'kitchen': room_type: .*with their probabilities",
        ),
        (
            room(room_type={"kitchen": None}),
            "'kitchen': room_type: .*with their probabilities",
        ),
        (
            room(room_type={"kitchen": 0.7, "bar": 0.4}),
            "'kitchen': room_type: .*add up to 1 or less",
        ),
        (room(room_type={"kitchen": -1}), "'kitchen': room_type: .*0 to 1, found -1"),
        (changed(building_kind="castle"), "building_kind: .*'castle'; known are home, office"),
        (changed(building_kind=3), "building_kind"),
        (changed(source=""), "source"),
        (changed(rooms=[{"id": "a", "visited": "yes"}]), "room 'a': visited"),
        (changed(rooms=[{"id": "a", "hidden_share": True}]), "room 'a': hidden_share"),
        (changed(rooms=[{"id": "a", "label": "\ud800"}]), "no JSON"),
        (changed(rooms=[{"id": "a", "footprint": [[0, 0]]}]), "room 'a': footprint"),
        (changed(rooms=[{"id": "a", "position": [1e300, 0, 0]}]), "room 'a': position"),
        (changed(rooms=[{"id": "a", "floor_index": 10**30}]), "room 'a': floor_index"),
        (changed(scene_id="a").replace('"a"', "NaN"), "no JSON"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "graph.json"
    path.write_text(text)
    with pytest.raises(RobotGraphError, match=expected) as caught:
        read_robot_graph(path)
    assert str(path) in str(caught.value)


def test_a_graph_has_a_bound_of_rooms() -> None:
    """A small file would ask for more memory than a machine has."""
    said = {"scene_id": "huge", "rooms": [{"id": f"r{i}"} for i in range(MAX_ROBOT_ROOMS + 1)]}
    with pytest.raises(RobotGraphError, match="rooms: expected at most 10,000, found 10,001"):
        parse_robot_graph(said, path=Path("huge.json"))


def test_surroundings_by_hand() -> None:
    said = {
        **SAID,
        "rooms": [
            {"id": "kitchen", "floor_area": 9, "room_type": "Open kitchen"},
            {"id": "hall", "box": [[0, 0, 0], [3, 2, 2.5]], "room_type": {"hall": 0.5, "bar": 0.5}},
            {"id": "?", "room_type": "unknown"},
        ],
        "building_kind": "Home",
        "source": "my robot",
    }
    graph = parse_robot_graph(said, path=Path("x"))
    kinds = [room.room_type for room in graph.rooms]
    assert kinds == ["kitchen", {"corridor": 0.5, "bar": 0.5}, None]
    assert (graph.building_kind, graph.source) == ("home", "my robot")
    around = graph.observation().surroundings
    np.testing.assert_array_equal(around.floor_area, [np.nan, 9, 6, np.nan])
    assert around.labels.sum(axis=1).tolist() == [0, 1, 1, 0]
    assert (around.building_kinds, around.sources) == (("home",), ("my robot",))
    written = json.loads(json.dumps(encode_robot_graph(graph)))
    assert parse_robot_graph(written, path=Path("x")) == graph


@given(mean=st.floats(0.01, 0.99), part=st.floats(0, 0.99))
def test_any_uncertain_share_is_read_back(mean: float, part: float) -> None:
    sd = part * (mean * (1 - mean)) ** 0.5
    kitchen = {"id": "kitchen", "hidden_share": mean, "hidden_share_sd": sd}
    graph = parse_robot_graph({"scene_id": "home", "rooms": [kitchen]}, path=Path("x"))
    assert (graph.rooms[0].share.mean, graph.rooms[0].share.sd) == (mean, sd)
    written = json.loads(json.dumps(encode_robot_graph(graph)))
    assert parse_robot_graph(written, path=Path("x")) == graph


def test_a_look_stands_in_the_place_of_a_share() -> None:
    rooms = [
        {"id": "hall", "floor_in_view": 0.6},
        {"id": "bath", "visited": False, "walls_in_view": 0.2},
        {"id": "kitchen", "seconds_inside": 4, "box": [[0, 0, 0], [3, 2, 2.5]]},
        {"id": "attic", "visited": False},
    ]
    graph = parse_robot_graph({"scene_id": "home", "rooms": rooms}, path=Path("x"))
    assert [room.share for room in graph.rooms] == [
        estimate_hidden_share(floor_in_view=0.6),
        estimate_hidden_share(walls_in_view=0.2),
        estimate_hidden_share(seconds_inside=4, floor_area=6),
        estimate_hidden_share(visited=False),
    ]
    written = json.loads(json.dumps(encode_robot_graph(graph)))
    assert parse_robot_graph(written, path=Path("x")) == graph


def test_whole_numbers_are_metres() -> None:
    said = {**SAID, "rooms": [{"id": "kitchen", "position": [1, 2.5, -3], "floor_index": 2}]}
    (kitchen,) = parse_robot_graph({**said, "objects": [], "adjacency": []}, path=Path("x")).rooms
    assert kitchen.position == (1.0, 2.5, -3.0)
    assert kitchen.floor_index == 2


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(RobotGraphError, match="cannot be read"):
        read_robot_graph(tmp_path / "none.json")


def test_the_example_of_the_docs_is_understood() -> None:
    graph = read_robot_graph(REPOSITORY / "docs" / "office.json")
    assert list_unmapped(graph) == {}
    assert len(graph.rooms) == 3
    assert graph.histograms()[0].sum() >= 15


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        (
            [],
            "with `scene_id`, `rooms` and `objects` (docs/belief.md), found []",
        ),
        (5, "found 5"),
        (None, "found null"),
        ({"format": "bsg-belief-graph"}, "a belief graph without `partial`"),
        ({"format": "bsg-belief-graph", "partial": [1]}, "expected a JSON object with"),
        ({"scene_id": "a", "rooms": [5]}, "room number 1: expected a JSON object"),
        (
            {"scene_id": "a", "rooms": [{"id": "r", "box": range(3)}]},
            "room 'r': box: expected at most 2, found more",
        ),
        ({"scene_id": "a", "rooms": [], "objects": {1}}, "expected a JSON object"),
    ],
)
def test_a_document_of_another_shape_is_refused_in_words_of_json(
    said: object, expected: str
) -> None:
    with pytest.raises(RobotGraphError, match=re.escape(expected)) as caught:
        parse_robot_graph(said, path=Path("home.json"))
    assert "instance of" not in str(caught.value)
