"""Every door gives the same answer: Python, the command, ROS, HTTP and MCP, asked the same."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import pytest
from asked_service import ask_service
from click.testing import CliRunner, Result
from conftest import REPOSITORY

from bsg_cli.belief import main as belief
from bsg_robot import SeenBuilding, open_graph
from bsg_robot.answers.description import describe_things
from bsg_robot.answers.ways import read_costs
from bsg_robot.ros.requests import Robot

Map = dict[str, Any]


def read(name: str) -> Map:
    document: Map = json.loads((REPOSITORY / "docs" / name).read_text("utf-8"))
    return document


HOME, OFFICE, DSG = read("home.json"), read("office.json"), read("dsg.json")
SIMPLE = {"kitchen": ["sink", "stove"], "hall": [], "bedroom_2": ["bed"]}
FLAT: Map = {
    "scene_id": "flat",
    "building_kind": "home",
    "stays": 24,
    "rooms": [
        {"id": "hall", "room_type": "corridor", "position": [0, 0, 0], "floor_in_view": 0.9},
        {"id": "kitchen", "position": [4, 0, 0], "floor_area": 12, "hidden_share": 0.4},
        {"id": "living", "label": "Living room", "position": [0, 5, 0], "seconds_inside": 9},
        {"id": "bedroom", "room_type": "bedroom", "position": [-4, 0, 0], "visited": False},
        {"id": "bathroom", "room_type": "bathroom", "position": [-4, 4, 0], "hidden_share": 0},
        {"id": "office", "room_type": {"home office": 0.6, "bedroom": 0.3}, "visited": False},
        {"id": "attic", "visited": False},
    ],
    "objects": [
        {"id": "1", "room": "kitchen", "category": "sink"},
        {"id": "2", "room": "kitchen", "category": "mug", "score": 0.6},
        {"id": "3", "room": "living", "category": "mug", "age": 12},
        {"id": "4", "room": "living", "category": "couch"},
        {"id": "5", "room": "bathroom", "category": "towel", "score": 0.9},
        {"id": "6", "category": "key"},
    ],
    "adjacency": [["hall", one] for one in ("kitchen", "living", "bedroom", "office")],
    "looks": [
        {"room": "kitchen", "thing": "scissors", "chance": 0.7},
        {"room": "living", "thing": "tableware"},
    ],
    "more_rooms": 2,
}
UNREAD: Map = {
    "scene_id": "unread",
    "building_kind": "castle",
    "rooms": [
        {"id": "R1", "room_type": "zzz", "floor_in_view": 0.5},
        {"id": "R2", "room_type": {"zzz": 0.5, "Küche": 0.5}, "visited": False},
        {"id": "Kajüte", "visited": False},
    ],
    "room_labels": {"Kajüte": "bedroom"},
}
KEYS = [[f"2026-11-{day}T08:00:00Z", "hall", "s"] for day in (23, 24, 25)]
LIVED: Map = {
    "scene_id": "lived",
    "now": "2026-11-28T09:30:00+01:00",
    "rooms": [
        {"id": "hall", "hidden_share": 0.2, "time": "2026-11-27T08:00:00Z"},
        {"id": "kitchen", "hidden_share": 0.3, "time": "2026-11-28T08:00:00Z"},
        {"id": "study", "label": "Dad's", "room_type": "home office", "visited": False},
    ],
    "objects": [
        {"id": "s", "room": "hall", "category": "shelf"},
        {"id": "k", "room": "kitchen", "category": "key", "time": 1795852800},
        {"id": "m", "room": "kitchen", "category": "mug", "age": 30, "stays": 12},
    ],
    "looks": [{"room": "hall", "thing": "key", "time": "2026-11-28T07:00:00Z"}],
    "memory": [
        {"id": "k", "category": "key", "sightings": KEYS},
        {"id": "lost", "category": "mug", "sightings": [["2026-11-20T08:00:00Z", None, None]]},
    ],
    "customs": [
        {"thing": "drinks", "room": "study", "at": None},
        {"thing": "cola", "room": "kitchen", "never": True},
    ],
    "more_rooms": 0,
}
SEARCHED: Map = {
    "scene_id": "s",
    "rooms": [{"id": one, "hidden_share": 0} for one in "abc"],
    "more_rooms": 0,
}


@dataclass(frozen=True)
class Question:
    map: Map
    things: str | list[str]
    here: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    labels: str | None = None
    now: str | float | None = None

    @property
    def words(self) -> list[str]:
        return [self.things] if isinstance(self.things, str) else self.things

    def open(self) -> SeenBuilding:
        """Return the building at the time that is said."""
        seen = open_graph(self.map, labels=self.labels)
        if self.now is not None:
            seen.passes(until=self.now)
        return seen

    @property
    def arguments(self) -> Map:
        """The options as Python has them."""
        costs = {"costs": read_costs(self.options["costs"])} if "costs" in self.options else {}
        return {**self.options, **costs}


CLOSED = [["hall", "kitchen", "closed"], ["Living room", "bathroom", 2.5]]

QUESTIONS = {
    "class": Question(HOME, "microwave", "living"),
    "noun": Question(HOME, "banana", "living"),
    "wide class": Question(HOME, "shoes", "upstairs"),
    "several": Question(HOME, ["microwave", "sofa", "banana"], "living"),
    "room by its label": Question(OFFICE, "laptop", "C: meeting room"),
    "all of several": Question(OFFICE, ["cup", "book"], "kitchen", {"task": "all", "chance": 0.5}),
    "Hydra": Question(DSG, "bed", "R(1)", labels="mpcat40"),
    "doubted": Question(FLAT, "mug", "bedroom"),
    "looked for": Question(FLAT, "scissors", "hall"),
    "in no room": Question(FLAT, "key", "attic"),
    "all, each look its cost": Question(
        FLAT, ["mug", "banana", "toilet"], "hall", {"look": {"Living room": 9}, "task": "all"}
    ),
    "two robots": Question(
        FLAT, ["mug", "scissors"], None, {"robots": {"a": "hall", "b": "bedroom"}, "chance": 0.6}
    ),
    "a closed door": Question(FLAT, ["mug", "banana"], "hall", {"costs": CLOSED}),
    "all rooms behind a closed door but one": Question(
        {**SIMPLE, "more_rooms": 0},
        "banana",
        "hall",
        {"costs": [["hall", "kitchen", "closed"], ["bedroom_2", "kitchen", "closed"]]},
    ),
    "within 90 seconds": Question(
        FLAT, ["mug", "banana"], "hall", {"budget": 90, "speed": 0.5, "costs": CLOSED}
    ),
    "too little for any room": Question(FLAT, "banana", "hall", {"budget": 0.5}),
    "two robots, within 20 metres": Question(
        FLAT, "banana", None, {"robots": {"a": "hall", "b": "bedroom"}, "budget": 20, "speed": 1}
    ),
    "kinds that nobody can read": Question(UNREAD, ["milk", "bed"], "R1"),
    "rooms not found yet": Question({**SIMPLE, "more_rooms": True}, "toilet", "kitchen"),
    "nothing left": Question(SEARCHED, "lamp", "b"),
    "a home that has taught": Question(LIVED, ["keys", "mug", "cola", "lamp"], "hall"),
    "the same, a day later": Question(
        LIVED, ["keys", "mug", "cola"], "hall", now="2026-11-29T09:30:00+01:00"
    ),
    "by a clock of seconds": Question(FLAT, "mug", "hall", now=3600.5),
    "no rooms": Question({}, "lamp"),
}


def plain(facts: Any) -> Any:
    """Return facts as JSON has them, each number to its last digit, and null for ∞."""
    return json.loads(json.dumps(facts), parse_constant=lambda _: None)


def by_python(seen: SeenBuilding, asked: Question) -> Map:
    """Return the answer by the methods of a building, without the function of the doors."""
    options = asked.arguments
    robots, here = options.pop("robots", None), asked.here
    words = asked.words
    steps = [] if here is None or robots else seen.explain(words, here=here, **options)

    def describe(word: str) -> Map:
        meaning = seen.understand(word)
        by = "table" if meaning.thing else "class" if meaning.class_name else "likeness"
        return {
            "thing": word,
            "anywhere": seen.anywhere(word),
            "model": seen.asked(word),
            "class": meaning.class_name if by == "class" else None,
            "by": by,
            "how": meaning.how,
            "habits": [*map(asdict, seen.habits(word))],
            "places": [*map(asdict, seen.where(word, here=here, costs=options.get("costs")))],
        }

    return {
        "things": [describe(word) for word in words],
        "go_first": None if robots else seen.next_room(words, here=here, **options),
        "plan": [*map(asdict, steps)],
        "robots": seen.next_rooms(robots, words, **options) if robots else None,
        "found_within": (steps[-1].found if steps else 0.0)
        if "budget" in options and not robots
        else None,
    }


def ask_command(asked: Question) -> Result:
    words = ["-", "--json", *(word for thing in asked.words for word in ("--find", thing))]
    words += ["--from", asked.here] if asked.here else []
    words += ["--labels", asked.labels] if asked.labels else []
    words += [] if asked.now is None else ["--now", str(asked.now)]
    for name, value in asked.options.items():
        option = {"robots": "robot"}.get(name, name)
        each = [f"{key}={of}" for key, of in value.items()] if isinstance(value, dict) else [value]
        if name == "costs":
            option, each = "cost", value
        for words_of in each:
            words += [
                f"--{option}",
                *map(str, words_of if isinstance(words_of, list) else [words_of]),
            ]
    return CliRunner().invoke(belief, words, input=json.dumps(asked.map))


def by_command(asked: Question) -> Map:
    done = ask_command(asked)
    assert done.exit_code == 0, done.output
    answer: Map = json.loads(done.stdout)
    return answer


def by_ros(asked: Question) -> Map:
    robot = Robot(open_graph(asked.map, labels=asked.labels))
    if asked.now is not None:
        assert "now" in robot.answer("passes", {"until": asked.now})
    question = {"thing": asked.things, "here": asked.here, **asked.options}
    answer = robot.answer("where", question)
    assert answer.pop("topic") == "where"
    return answer


@pytest.fixture(scope="module")
def service() -> Any:
    pytest.importorskip("mcp", reason="needs the extra serve")
    from bsg_robot.service.questions import Service

    return Service()


def by_service(service: Any, asked: Question) -> dict[str, Map]:
    question = {"map": asked.map, "things": asked.things, "here": asked.here, **asked.options}
    return ask_service(service, question | {"labels": asked.labels, "now": asked.now})


@pytest.mark.parametrize("kind", QUESTIONS)
def test_every_door_gives_the_same_answer(kind: str, service: Any) -> None:
    asked = QUESTIONS[kind]
    seen = asked.open()
    answer = plain(describe_things(seen, asked.words, here=asked.here, **asked.arguments))
    python = plain(by_python(seen, asked))
    assert {key: answer[key] for key in python} == python
    doors = {"ROS": by_ros(asked), "command": by_command(asked), **by_service(service, asked)}
    for door in ("HTTP", "MCP"):
        assert doors[door].pop("notes") == [*seen.notes]
    for door, found in doors.items():
        assert plain(found) == answer, door


@pytest.mark.parametrize("said", [FLAT, UNREAD, {"R0": ["stove", "fridge"], "R1": []}])
def test_every_door_names_the_kinds_of_rooms(said: Map, service: Any) -> None:
    seen = open_graph(said)
    kinds = {room: [*map(asdict, seen.kinds(room))] for room in seen.rooms}
    assert all(kinds.values())
    robot = Robot(open_graph(said))
    ros = {room: robot.answer("expected", {"room": room})["kinds"] for room in seen.rooms}
    assert ros == kinds
    doors = ask_service(service, {"map": said}, path="/expect", tool="expect_things")
    for door, answer in doors.items():
        found = {room["room"]: room["kinds"] for room in answer["rooms"]}
        assert found.keys() == kinds.keys(), door
        for room, listed in found.items():
            assert listed == [pytest.approx(kind, abs=1e-6) for kind in kinds[room]], (door, room)
    done = CliRunner().invoke(belief, ["-", "--json"], input=json.dumps(said))
    rounded = {room["room"]: room["kinds"] for room in json.loads(done.stdout)}
    for room in seen.graph.rooms:
        listed = {kind["name"]: round(kind["probability"], 4) for kind in kinds[room.name]}
        assert rounded[room.label or room.name] == listed


HOUSE: Map = {
    "scene_id": "house",
    "building_kind": "home",
    "rooms": [
        {"id": "kitchen", "label": "Big kitchen", "floor_in_view": 0.9, "position": [0, 0, 0]},
        {"id": "bedroom", "floor_in_view": 0.7, "position": [5, 0, 0]},
        {"id": "bathroom", "visited": False, "position": [0, 5, 0]},
    ],
    "objects": [
        {"id": "counter", "room": "kitchen", "category": "counter", "position": [-1, 0, 0]},
        {"id": "fridge", "room": "kitchen", "category": "refrigerator", "position": [1, 1, 0]},
        {"id": "cup", "room": "kitchen", "category": "mug", "on": "counter"},
        {"id": "bed", "room": "bedroom", "category": "bed", "position": [6, 1, 0]},
    ],
    "adjacency": [["kitchen", "bedroom"], ["kitchen", "bathroom"]],
}
LOOKED = {**HOUSE, "looks": [{"room": "kitchen", "thing": "milk", "at": "fridge"}]}
NEXT_PLACES: dict[str, tuple[Map, str, Map, Map]] = {  # map, thing, the rest, what a person expects
    "milk, not in the fridge": (
        LOOKED,
        "milk",
        {"here": "Big kitchen", "at": "fridge"},
        {"room": "kitchen", "piece": "counter"},
    ),
    "a mug that was seen": (
        HOUSE,
        "mug",
        {"here": "bedroom", "at": "bed", "look": 0.5, "chance": 0.6},
        {"room": "kitchen", "piece": "counter"},
    ),
    "a room without furniture": (
        HOUSE,
        "toothbrush",
        {"here": "bedroom"},
        {"room": "bathroom", "piece": None},
    ),
    "a room behind a closed door": (
        HOUSE,
        "toothbrush",
        {"here": "bedroom", "costs": [["kitchen", "bathroom", "closed"]]},
        {"room": "bedroom", "piece": "bed"},
    ),
    "nothing left": (SEARCHED, "lamp", {"here": "b"}, {"room": None, "piece": None}),
}


@pytest.mark.parametrize("kind", NEXT_PLACES)
def test_every_door_names_the_same_piece_of_furniture(kind: str, service: Any) -> None:
    home, thing, options, expected = NEXT_PLACES[kind]
    seen = open_graph(home)
    go = seen.next_place(thing, **{**options, "costs": read_costs(options.get("costs"))})
    assert expected == (asdict(go) if go else {"room": None, "piece": None})
    answer = {"thing": thing, **expected}
    ros = Robot(open_graph(home)).answer("next_place", {"thing": thing, **options})
    assert ros == {"topic": "next_place", **answer}
    question = {"map": home, "thing": thing, **options}
    doors = ask_service(service, question, path="/next_place", tool="next_place")
    for door, found in doors.items():
        assert found == {**answer, "notes": [*seen.notes]}, door


FAULTS: dict[str, Any] = {  # what is wrong → the sentence that names it, by every door
    '{"budget": -1}': "budget: ",
    '{"speed": 0}': "speed: ",
    '{"speed": -0.5}': "speed: ",
    '{"here": null, "budget": 5}': "budget",
    '{"costs": [["hall", "attic", 1]]}': "home: no room 'attic'",
    '{"costs": [["hall", "living", -1]]}': "costs: 'hall' to 'living': expected 0 to 1e+09, or",
    '{"costs": [["hall", "living", "shut"]]}': "costs: 'hall' to 'living': expected 0 to 1e+09, or",
    '{"costs": [["hall", "living", 1], ["living", "hall", 2]]}': "costs: 'living' to 'hall': two",
}


@pytest.mark.parametrize("wrong", FAULTS)
def test_every_door_says_what_is_wrong_with_a_budget_a_speed_or_a_cost(
    wrong: str, service: Any
) -> None:
    options = {"here": "hall", **json.loads(wrong)}
    here = options.pop("here")
    asked = Question(HOME, "banana", here, options)
    question = {"map": HOME, "things": "banana", "here": here, **options}
    faults = {
        "ROS": by_ros(asked)["error"],
        "command": ask_command(asked).stderr.split("Error: ")[1],
        **{door: answer["error"] for door, answer in ask_service(service, question).items()},
    }
    for door, fault in faults.items():
        assert FAULTS[wrong] in fault, (door, fault)
        assert "costs: costs: " not in fault, door


@pytest.mark.parametrize("now", ["soon", "2026-11-28T08:30:00", "nan", -1e12, "2026-11-20T08:30Z"])
def test_every_door_refuses_what_is_no_time_or_is_before_the_last_report(
    now: Any, service: Any
) -> None:
    asked = Question(LIVED, "keys", "hall", now=now)
    robot = Robot(open_graph(LIVED))
    faults = {
        "ROS": robot.answer("passes", {"until": now})["error"],
        "command": " ".join(ask_command(asked).stderr.split()),
        **{door: answer["error"] for door, answer in by_service(service, asked).items()},
    }
    for door, fault in faults.items():
        assert re.search("expected (a time|seconds)", fault), (door, fault)
