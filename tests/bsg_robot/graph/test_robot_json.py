"""A robot's own JSON: read by hand, written and read back, refused where it is wrong."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_data.inputs.bounds import (
    MAX_ROBOT_LETTERS,
    MAX_ROBOT_OBJECTS,
    MAX_ROBOT_ROOMS,
    MAX_ROBOT_SOUGHT,
)
from bsg_data.scene.class_map import load_class_map
from bsg_models.belief.hidden_share import VAGUE, ShareBelief
from bsg_models.belief.partial_graph import KnownRoom, Look, PartialGraph, SeenObject, check_report
from bsg_robot.answers.seen_building import open_graph
from bsg_robot.graph import reports, robot_json
from bsg_robot.graph.graph_file import parse_graph
from bsg_robot.graph.reports import reclassify
from bsg_robot.graph.robot_json import (
    RobotGraphError,
    encode_robot_graph,
    list_unmapped,
    parse_robot_graph,
)
from bsg_robot.graph.room_kinds import guess_building_kind, note_room_types, understand_rooms

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
    graph = read(SAID)
    assert [room.share for room in graph.rooms] == [VAGUE, ShareBelief(1.0)]
    assert graph.hidden_share == 0.75
    assert graph.rooms[1].position == (1, 2, 0.5)
    first, second = graph.objects
    assert (first.room_index, first.category) == (1, "refrigerator")
    assert graph.class_space.classes[first.class_index or 0] == "refrigerator"
    assert (second.room_index, second.category, second.class_index) == (0, None, None)
    assert graph.adjacency == ((1, 2),)
    assert list_unmapped(graph) == {"zzqx thing": 1}


def read(said: Any, **how: Any) -> PartialGraph:
    return parse_robot_graph(said, path=Path("x"), **how)


def read_again(graph: PartialGraph) -> PartialGraph:
    """Return the graph that is written, and read without its class map."""
    said = json.loads(json.dumps(encode_robot_graph(graph)))
    again = read(said, class_map=graph.class_space)
    assert read(said) == again
    return again


def test_nodes_and_links_of_networkx_are_told_how_to_write_a_map() -> None:
    said = {"nodes": [{"id": "kitchen", "type": "room"}], "links": []}
    with refuses(RobotGraphError, "graph-malformed", where="x") as caught:
        parse_graph(said, path=Path("x"))
    assert '{"kitchen": ["sink"]' in str(caught.value)


MANY_KEYS = {f"k{number}": 0 for number in range(100_000)}
ON_THE_BENCH = [
    {"id": "bench", "room": "hall", "category": "bench"},
    {"id": "cup", "room": "kitchen", "category": "cup", "on": "bench"},
]
FAULTS: list[tuple[dict[str, Any], str]] = [  # beside `SAID`
    ({"format": "bsg-belief-graph"}, "a belief graph without `partial`"),
    ({"roms": []}, "'roms' is no key; did you mean rooms"),
    ({"x" * 10_000: 1}, f"'{'x' * 80}' is no key"),
    ({"room_labels": {"Kajüte": "bedrom"}}, "room_labels: expected a label that we know"),
    ({"detector": ["chair", 5]}, "detector: expected a JSON list of words"),
    ({"rooms": [{"id": "a"}, {"id": "a"}]}, "room id 'a'"),
    ({"rooms": ["hall"]}, 'room number 1: expected a JSON object, such as {"id": "kitchen"}'),
    ({"rooms": None}, "rooms: is missing (docs/belief.md); the simplest map is {"),
    ({"rooms": [{"id": True}]}, "room number 1: id: "),
    ({"rooms": [{"id": "a", "objects": "sink"}]}, "room 'a': objects: expected a JSON list"),
    ({"objects": [{"id": "1", "category": "bed", "room": "attic"}]}, "object '1' (bed): "),
    ({"objects": [{"id": "7", "clas": "bed"}]}, "object '7': 'clas' is no key; did you mean"),
    ({"objects": ON_THE_BENCH}, "object 'cup': on: 'bench' is in room 'hall'; expected an"),
    ({"objects": [ON_THE_BENCH[0] | {"on": "tble"}]}, "object 'bench': on: there is no object"),
    ({"objects": [ON_THE_BENCH[0] | {"on": "bench"}]}, "object 'bench': on: lies on itself, by"),
    (
        {
            "objects": ON_THE_BENCH[:1],
            "looks": [{"room": "kitchen", "thing": "key", "at": "bench"}],
        },
        "look for 'key': at: 'bench' is in room 'hall'",
    ),
    ({"adjacency": [["hall", "hall"]]}, "adjacency: 'hall' with itself"),
    ({"adjacency": [["hall", "kitchen"], ["hall", []]]}, "pair of adjacency number 2: 1: "),
    (MANY_KEYS, "'k0' is no key; known are format, version"),
]
FAULTS_OF_A_ROOM: list[dict[str, Any]] = [
    {"seconds_inside": -1},
    {"visited": "no"},
    {"box": [[0, 0, 0]] * 3},
    {"floor_index": True},
    {"room_type": {"kitchen": 0.7, "bar": 0.4}},
    {"hidden_share": 0.5, "floor_in_view": 0.5},
    {"hidden_share_sd": 0.1, "seconds_inside": 5},
    {"hidden_share": 1.0, "hidden_share_sd": 0.1},
    {"visited": False, "seconds_inside": 5},
]
FAULTS_OF_THE_SIMPLEST_MAP: list[tuple[Any, str]] = [
    ({"kitchen": 0}, 'kitchen: expected a JSON list of things, such as {"kitchen": ["sink"]'),
    ({"kitchen": ["sink"], "hall": ["lamp", 5]}, "hall.1: expected a thing, such as"),
    ({"x" * 10_000: []}, f"room '{'x' * 80}': id: expected at most 500 characters"),
    ({"kitchen": ["sink"], "scene_id": "home"}, "'kitchen' is no key; known are format, "),
    ({"map": {"kitchen": ["sink"]}}, "room 'map': 'kitchen' is no key; known are "),
]


@pytest.mark.parametrize(
    ("said", "place"),
    [
        *(({**SAID, **said}, place) for said, place in FAULTS),
        (None, "expected a JSON object"),
        *(
            ({"rooms": [{"id": "kitchen", **said}]}, "room 'kitchen': ")
            for said in FAULTS_OF_A_ROOM
        ),
        *FAULTS_OF_THE_SIMPLEST_MAP,
    ],
)
def test_a_fault_is_at_its_place(said: Any, place: str) -> None:
    with refuses(RobotGraphError, "graph-malformed", where="x") as caught:
        read(said)
    assert str(caught.value).startswith(f"x: {place}")
    assert "instance of" not in str(caught.value), "words of JSON, not of Python"


LOOKS = [{"room": "a", "thing": f"thing {n}"} for n in range(MAX_ROBOT_SOUGHT)]
CORNERS = [[0, 0], [1, 0], [1, 1]]
LONG = "x" * 500
TOO_MUCH: dict[str, Any] = {
    "rooms": {"rooms": [{"id": f"r{i}"} for i in range(MAX_ROBOT_ROOMS + 1)]},
    "rooms of a map": MANY_KEYS,
    "things of a map": {"kitchen": ["cup"] * MAX_ROBOT_OBJECTS, "hall": ["cup"]},
    "objects": {"rooms": [], "objects": [{"category": "cup"}] * (MAX_ROBOT_OBJECTS + 1)},
    "letters": {
        "rooms": [],
        "objects": [{"category": f"{n:06}{LONG[6:]}"} for n in range(MAX_ROBOT_LETTERS // 500 + 1)],
    },
    "pairs": {"rooms": [{"id": "a"}, {"id": "b"}], "adjacency": [["a", "b"]] * 100_001},
    "sought": {"rooms": [{"id": "a"}], "looks": [*LOOKS, LOOKS[0] | {"thing": "mug"}]},
    "words": {"rooms": [], "detector": [*MANY_KEYS]},
    "words for rooms": {"rooms": [], "room_labels": dict.fromkeys(MANY_KEYS)},
    "words with classes": {"rooms": [], "detector": dict.fromkeys(MANY_KEYS)},
}


@pytest.mark.parametrize("said", TOO_MUCH.values(), ids=TOO_MUCH)
def test_a_graph_has_bounds(said: Any) -> None:
    """A small file would ask for more memory or time than a machine has."""
    with refuses(RobotGraphError, "graph-malformed", where="x") as caught:
        read(said)
    assert "expected at most" in str(caught.value)


def test_what_is_at_its_bound_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    for bound, upper_bound in (("ALL_CORNERS", 6), ("ROBOT_TYPES", 4), ("ROBOT_KINDS", 3)):
        monkeypatch.setattr(robot_json, f"MAX_{bound}", upper_bound)
    types = ({"hall": 0.5, "den": 0.2}, {"hall": 0.5, "pantry": 0.2})
    rooms = [{"id": str(n), "footprint": CORNERS, "room_type": types[n]} for n in range(2)]
    assert len(read({"rooms": rooms}).rooms) == 2
    for more in (
        {"id": "2", "footprint": CORNERS},
        {"id": "2", "room_type": {"hall": 0.5}},
        {"id": "2", "room_type": "attic"},
        {"id": "2", "unread": ["zzz"]},
    ):
        with refuses(RobotGraphError, "graph-malformed", "x"):
            read({"rooms": [*rooms, more]})
    repeated = {"objects": [{"category": LONG}] * 2_001, "looks": [*LOOKS, *LOOKS]}
    graph = read({"rooms": [{"id": "a"}, {"id": "b"}], **repeated})
    assert len(graph.looks) == 2 * MAX_ROBOT_SOUGHT
    reports.look(graph, Look(2, "thing 1", 0.5), stays=lambda _: 48.0)
    with refuses(RecipeError, "looks-too-many", "x"):
        reports.look(graph, Look(2, "mug", 0.5), stays=lambda _: 48.0)


def test_the_simplest_map_says_what_its_document_says() -> None:
    """A room with things was entered; its name is its kind, if that is a label."""
    simple = {"kitchen_2": ["sink", "chair", "chair"], "R7": ["sink"], "hall": []}
    full = {
        "scene_id": "home",
        "rooms": [
            {"id": "kitchen_2", "room_type": "kitchen"},
            {"id": "R7"},
            {"id": "hall", "visited": False, "room_type": "corridor"},
        ],
        "objects": [
            {"id": "sink 1", "room": "kitchen_2", "category": "sink"},
            {"id": "chair 1", "room": "kitchen_2", "category": "chair"},
            {"id": "chair 2", "room": "kitchen_2", "category": "chair"},
            {"id": "sink 2", "room": "R7", "category": "sink"},
        ],
    }
    path = Path("home.json")
    assert parse_robot_graph(simple, path=path) == parse_robot_graph(full, path=path)
    nothing = {"scene_id": "home", "rooms": []}
    assert parse_robot_graph({}, path=path) == parse_robot_graph(nothing, path=path)


SOFA, FRIDGE = {"id": 101, "type": "sofa"}, {"name": "refrigerator", "object_id": 201}


@pytest.mark.parametrize(
    "said",
    [
        {"living room": ["sofa"], "kitchen": ["refrigerator"], "hall": []},
        {"rooms": {"living room": ["sofa"], "kitchen": ["refrigerator"], "hall": []}},
        {"living room": [SOFA], "kitchen": [FRIDGE], "hall": []},
        {"living room": {"items": ["sofa"]}, "kitchen": {"things": [FRIDGE]}, "hall": {}},
        {
            "rooms": [
                {"name": "living room", "objects": [SOFA]},
                {"room_id": 2, "name": "kitchen", "objects": ["refrigerator"]},
                {"id": "hall", "objects": []},
            ]
        },
        {"living room": np.array(["sofa"]), "kitchen": {"refrigerator"}, "hall": ()},
        {
            "rooms": [
                {"id": "living room", "visited": np.bool_(True)},
                {"id": np.int64(2), "label": np.str_("kitchen"), "visited": 1},
                {"id": "hall", "visited": 0},
            ],
            "objects": (
                {"id": np.int64(1), "room": "living room", "category": np.str_("sofa")},
                {"room": np.int64(2), "category": "refrigerator", "score": np.float32(1)},
            ),
        },
    ],
)
def test_a_map_of_any_form_has_its_rooms_and_objects(said: Any) -> None:
    graph = read(said)
    assert [(room.label or room.name, room.visited, room.room_type) for room in graph.rooms] == [
        ("living room", True, "living room"),
        ("kitchen", True, "kitchen"),
        ("hall", False, "corridor"),
    ]
    found = [(obj.room_index, obj.category, obj.score or 1.0) for obj in graph.objects]
    assert found == [(1, "sofa", 1.0), (2, "refrigerator", 1.0)]
    json.dumps(encode_robot_graph(graph))


def test_points_have_names_of_axes_or_are_of_numpy() -> None:
    for one, two in (({"x": 1, "y": 2, "z": 3}, {"y": 1, "x": 0}), (np.array([1, 2, 3]), [0, 1])):
        room = {"id": "a", "position": one, "footprint": [two, [1, 0], [0, 0]]}
        objects = [{"category": "bed", "room": "a", "position": one}]
        graph = parse_robot_graph({"rooms": [room], "objects": objects}, path=Path("x"))
        assert graph.rooms[0].position == graph.objects[0].position == (1, 2, 3)
        assert graph.rooms[0].footprint == ((0, 1), (1, 0), (0, 0))


def test_a_room_type_that_nobody_can_read_is_not_said_but_noted() -> None:
    types = ["cooking spot", "ward", {"zzqx": 0.5, "hall": 0.25}, "zzqx"]
    rooms = [{"id": str(n), "room_type": said} for n, said in enumerate(types)]
    graph = read({"scene_id": "home", "rooms": [*rooms, {"id": "kitchen", "room_type": "zzz"}]})
    kinds = [None, "patient room", {"corridor": 0.25}, None, "kitchen"]
    assert [room.room_type for room in graph.rooms] == kinds
    note = "'cooking spot', 'zzqx', 'zzz': kind of room unknown; say `room_type`"
    again = read_again(graph)
    assert note == note_room_types(graph)[-1] == note_room_types(again)[-1]
    assert again == graph


@pytest.mark.parametrize(
    ("word", "kind", "note"),
    [
        ("castle", None, "'castle': kind of building unknown; known are home, office"),
        ("flat", "home", "building kind taken for `home`, for it is called flat; say"),
        ("Factory", "warehouse", "building kind taken for `warehouse`, for it is called Factory"),
    ],
)
def test_any_word_says_the_kind_of_a_building_or_nothing(
    word: str, kind: str | None, note: str
) -> None:
    graph = read({"rooms": [], "building_kind": word})
    assert graph.building_kind == kind
    assert note_room_types(graph)[0].startswith(note)
    again = read_again(graph)
    assert again == graph
    assert kind or note_room_types(again) == note_room_types(graph)


def test_a_hotel_s_rooms_have_numbers() -> None:
    """In a hotel that is said, and in one that its rooms tell."""
    names = ["Room 101", "102", "guest room 12", "suite 3", "hotel bar", "7", "kitchen"]
    kinds = [*["hotel room"] * 4, "bar", None, "kitchen"]
    told = {"rooms": [{"id": name} for name in names]}
    for said in (told, told | {"building_kind": "hotel"}):
        graph = read(said)
        assert ([room.room_type for room in graph.rooms], graph.building_kind) == (kinds, "hotel")
    bare = parse_robot_graph(told | {"building_kind": "office"}, path=Path("x"))
    assert [room.room_type for room in bare.rooms[:3]] == [None, None, "bedroom"]


def test_words_of_the_user_stay_with_the_graph() -> None:
    said = {
        "rooms": [{"id": "Kajüte 2"}, {"id": "x", "room_type": "Messe"}, {"id": "Last"}],
        "room_labels": {"Kajüte": "bedroom", "Messe": "canteen", "Last": None},
    }
    graph = read(said)
    assert [room.room_type for room in graph.rooms] == ["bedroom", "canteen", None]
    assert read_again(graph) == graph
    mine = read(said, room_labels=[("Kajüte", "office")])
    assert mine.rooms[0].room_type == "office"
    with pytest.raises(RobotGraphError, match="room_labels"):  # it could not be opened again
        read(said, room_labels=[("x" * 501, "attic")])


def test_the_name_of_a_room_is_its_kind_if_nothing_else_says_one() -> None:
    """The label counts before the id; a saved graph says what was understood."""
    rooms = [
        {"id": "hall"},
        {"id": "R7", "label": "2nd bath room", "room_type": None},
        {"id": "kitchen", "room_type": "bar", "label": "Office"},
        {"id": "3", "room_type": {"bar": 0.5, "pub": 0.25}},
        {"id": "staff kichen", "room_type": "unknown"},
        {"id": "zzqx", "room_type": ""},
        {"id": "R8"},
        {"id": "hut", "label": "Kajüte"},
    ]
    graph = read({"rooms": rooms})
    kinds = ["corridor", "bathroom", "bar", {"bar": 0.75}, "kitchen", None, None, None]
    assert [room.room_type for room in graph.rooms] == kinds
    assert note_room_types(graph) == (
        "hall, 2nd bath room: read as the kinds that their names say",
        "kinds of rooms read by a rule: 'staff kichen' is kitchen (misspelt)",
        "'zzqx', 'Kajüte': kind of room unknown; say `room_type`",
    )
    again = read_again(graph)
    assert again == graph == understand_rooms(graph)
    assert len(note_room_types(again)) == 1, "of the room that is still unknown"


@pytest.mark.parametrize(
    ("rooms", "kind"),
    [
        ("patient room 1, nurse station, medication room, toilet", "hospital"),
        ("printer room, open-plan, toilets, meeting room 1, kitchenette", "office"),
        ("classroom A, classroom B, staff room", "school"),
        ("sales floor, checkout, store room", "shop"),
        ("restaurant, commercial kitchen, toilets", "restaurant"),
        ("kitchen, bedroom, bathroom, office", None),
        ("aisle 1, aisle 2, loading dock, packing area, office", "warehouse"),
        ("aisle 1, aisle 2, checkout, sales floor", "shop"),
        ("patient room, ward, classroom 1, classroom 2", None),
    ],
)
def test_rooms_tell_the_kind_of_a_building_if_two_or_more_do(rooms: str, kind: str | None) -> None:
    found = guess_building_kind([name] for name in rooms.split(", "))
    assert (found and found.label) == kind
    named = {name: [] for name in rooms.split(", ")}
    assert read(named).building_kind == kind
    for other in ("gym", "other"):
        assert read({**named, "building_kind": other}).building_kind == other


def test_what_is_empty_is_left_out_and_ids_are_made_up_or_numbers() -> None:
    said = {
        "scene_id": None,
        "building_kind": "",
        "rooms": [
            {"id": 3, "label": "", "visited": None, "room_type": None, "hidden_share_sd": None},
            {"id": "hall", "position": None},
        ],
        "objects": [
            {"category": "sink", "room": 3, "score": None},
            {"category": "sink", "room": ""},
            {"id": "sink 2", "category": "sink"},
            {"id": 7, "category": "bed", "room": "hall"},
        ],
        "adjacency": [[3, "hall"]],
        "looks": [{"room": 3, "thing": "cup", "chance": None}],
        "detector": None,
        "more_rooms": None,
    }
    graph = parse_robot_graph(said, path=Path("my.flat.json"))
    assert (graph.scene_id, graph.building_kind) == ("my", None)
    assert [room.name for room in graph.rooms] == ["3", "hall"]
    assert [(obj.name, obj.room_index) for obj in graph.objects] == [
        ("sink 1", 1),
        ("sink 3", 0),
        ("sink 2", 0),
        ("7", 2),
    ]
    assert graph.adjacency == ((1, 2),)
    assert [look.room_index for look in graph.looks] == [1]


def test_a_detector_of_few_words_says_nothing_of_other_classes() -> None:
    rooms = [{"id": "kitchen", "hidden_share": 0}, {"id": "hall", "visited": False}]
    said = {**SAID, "rooms": rooms, "detector": ["fridge", "Couch", "flibber"]}
    graph = parse_robot_graph(
        {**said, "objects": [*SAID["objects"], {"id": "3", "room": "hall", "category": "bed"}]},
        path=Path("x"),
    )
    seen = graph.observation()
    known = [graph.class_space.classes.index(name) for name in ("refrigerator", "couch")]
    assert not seen.withheld[:, known].any()
    assert np.delete(seen.withheld, known, axis=1).all()  # a bed that somebody else saw, too
    assert seen.inputs[2].sum() == 1
    assert (seen.cell_share[1] == np.where(seen.withheld[1], 1, 0)).all()  # a searched room
    assert reclassify(graph, load_class_map("hm3d-wide-v1")).detector == tuple(
        (word, None if name is None else load_class_map("hm3d-wide-v1").classes.index(name))
        for word, name in (("fridge", "refrigerator"), ("Couch", "couch"), ("flibber", None))
    )


def test_what_is_reported_in_python_is_of_numbers_that_a_file_can_hold() -> None:
    near = (np.float64(1), np.int64(2), np.float32(0.5))
    room = check_report(KnownRoom("hall", 1.0, position=near, floor_area=np.float64(9)))
    assert (room.position, room.floor_area) == ((1.0, 2.0, 0.5), 9.0)
    assert {type(value) for value in (*room.position, room.floor_area)} == {float}
    for wrong in ({"floor_area": -1.0}, {"position": (1.0, 2.0)}, {"room_type": {"kitchen": 2.0}}):
        with pytest.raises(RecipeError):
            check_report(KnownRoom("hall", 1.0, **wrong))
    bed = SeenObject("1", 1, "bed", "bed", 0, near)
    assert check_report(bed).position == (1.0, 2.0, 0.5)
    with pytest.raises(RecipeError):
        check_report(replace(bed, position=(0.0, 0.0, math.inf)))
    seen = open_graph({"rooms": [{"id": "hall"}]})
    place, share = np.array([1, 2, 3], np.float32), np.float32(0.5)
    seen.discovered("den", beside=np.array(["hall"]), position=place, floor_area=share)
    seen.entered("den", floor_in_view=share)
    assert seen.saw("den", np.str_("bed"), object_id=np.int64(0), position=place) == "0"
    seen.saw("den", "cup", object_id=7, on=np.int32(0), score=share)
    seen.looked("den", "mug", chance=share, at=0)
    seen.gone(7)
    graph = seen.graph
    assert read_again(graph) == graph


def test_circles_of_any_length_and_long_piles_are_read_in_one_pass() -> None:
    pile = [{"id": str(n), "room": "a", "category": "book", "on": str(n + 1)} for n in range(5000)]
    bottom = {"id": "5000", "room": "a", "category": "table"}
    home = {"rooms": [{"id": "a"}], "looks": [{"room": "a", "thing": "key", "at": "5000"}]}
    graph = read({**home, "objects": [*pile, bottom]})
    assert (graph.objects[0].on, graph.looks[0].at) == ("1", "5000")
    assert read_again(graph) == graph
    with refuses(RobotGraphError, "graph-malformed", where="x"):
        read({**home, "objects": [*pile, bottom | {"on": "0"}]})


def test_a_detector_is_a_vocabulary() -> None:
    graph = read({"rooms": [{"id": "a"}], "detector": "coco"})
    assert len(graph.detector or ()) == 80
    assert read_again(graph) == graph
