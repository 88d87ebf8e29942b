"""What a robot says in texts, by hand and at random: each gets an answer."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner
from conftest import REPOSITORY
from hypothesis import given
from hypothesis import strategies as st

from bsg_cli.ros import main
from bsg_data.files import encode_json
from bsg_robot import open_graph
from bsg_robot.ros import requests
from bsg_robot.ros.requests import TOPICS, Robot, read_detections

OFFICE = REPOSITORY / "docs" / "office.json"


@pytest.fixture
def robot() -> Robot:
    return Robot(open_graph(OFFICE, model="mixture"))


def say(robot: Robot, topic: str, **request: Any) -> dict[str, Any]:
    return robot.hear(topic, json.dumps(request))


def test_a_text_that_is_no_object_is_the_first_word(robot: Robot) -> None:
    assert robot.hear("entered", "meeting-room") == {"topic": "entered", "room": "meeting-room"}
    assert robot.hear("saw", "sofa") == {"topic": "saw", "object": "saw 19"}
    assert robot.seen.graph.objects[-1].room_index == 3
    answer = robot.hear("where", "sofa")
    assert (answer["go_first"], answer["here"]) == ("meeting-room", "meeting-room")
    assert robot.hear("where", '"sofa"') == answer
    both = robot.hear("where", '["cup", "sofa"]')["things"]
    assert [thing["thing"] for thing in both] == ["cup", "sofa"]


FACTS = {"room_type": "storage room", "label": "D", "floor_area": 7, "beside": "meeting-room"}
TOY = {"thing": "toy", "room": "R9", "stays": 24, "within": 0.3}
DAY: tuple[tuple[str, dict[str, Any]], ...] = (
    ("passes", {"until": 3600}),
    ("passes", {"hours": 0.1}),
    ("entered", {"room": "kitchen", "floor_in_view": 0.5}),
    ("discovered", {"room": "R9", "beside": ["kitchen"], "position": [1, 2, 3], "floor_area": 8}),
    ("saw", {"thing": "lamp", "room": "R9", "object": "l", "position": [1, 2, 4]}),
    ("saw", {"thing": "mug", "room": "R9", "object": "m", "on": "l"}),
    ("searched", {"room": "meeting-room"}),
    ("looked", {"thing": "bottle"}),
    ("looked", {"thing": "mug", "room": "waiting-room", "chance": 0.5}),
    ("saw", {"thing": "fridge", "object": "f"}),
    ("looked", {"thing": "milk", "at": "f"}),
    ("looked", {"thing": "phone", "time": 3955}),
    ("gone", {"object": "9"}),
    ("searched", {"room": "waiting-room", "found": ["couch", "3"], "time": 3958}),
    ("describe", {"room": "R9", **FACTS}),
    ("more_rooms", {"number": 4}),
    ("saw", {**TOY, "position": [5, 5, 1.24], "age": 48}),
    ("saw", {**TOY, "position": [5, 5, 1.12], "age": 24}),  # within 0.3 m, the same one
    ("keeps", {"thing": "drinks", "at": "fridge", "room": "kitchen"}),
    ("keeps", {"thing": "toy", "room": "kitchen"}),
    ("never", {"thing": "toy", "room": "kitchen"}),
    ("saw", {"thing": "book", "room": "meeting-room", "object": "b", "time": 3959}),
    ("entered", {"room": "kitchen", "seconds_inside": 9, "time": "1970-01-01T02:06:00+01:00"}),
    ("saw", {"thing": "book", "object": "b"}),
    ("forget", {"thing": "toy"}),
)


def test_a_day_of_reports_changes_what_python_would_change(robot: Robot) -> None:
    """Without a room, they are of the one that was entered last."""
    seen = robot.seen.copy()
    for topic, report in DAY:
        assert "error" not in say(robot, topic, **report)
        names = {"object": "object_id"} if topic in ("saw", "gone") else {}
        arguments = {names.get(key, key): value for key, value in report.items()}
        if topic in ("saw", "looked"):
            arguments.setdefault("room", "kitchen")
        getattr(seen, topic)(**arguments)
    assert robot.seen.graph == seen.graph
    habits = say(robot, "habits", thing="book")["habits"]
    assert habits == [*map(asdict, seen.habits("book"))]
    assert {habit["room"] for habit in habits} == {"kitchen", "meeting-room", None}


def test_a_clock_that_jumps_goes_on_from_the_last_time(robot: Robot) -> None:
    def now_at(clock: float) -> float | None:
        note = robot.tell_time(clock)
        assert bool(note) == ("goes on" in note) == (clock in (7, 1e9))
        return robot.seen.graph.now

    seen = len(robot.seen.graph.objects)
    assert [now_at(10), now_at(3600)] == [10, 3600]
    assert [robot.date(stamp) for stamp in (0, 3599, 3601, -1)] == [None, 3599, None, None]
    assert [now_at(7), now_at(17)] == [3600, 3610], "a simulation begins again"
    assert robot.date(16) == 3609
    assert [now_at(1e9), now_at(1e9 + 5)] == [3610, 3615], "another clock"
    assert now_at(4000) == 4000, "the first clock again"
    assert len(robot.seen.graph.objects) == seen
    assert {obj.time for obj in robot.seen.graph.objects} == {10}


@pytest.mark.parametrize(("text", "more"), [("3", 3), ("true", True), ('{"number": true}', True)])
def test_rooms_that_are_not_found_are_a_number_or_true(
    robot: Robot, text: str, more: object
) -> None:
    assert robot.hear("more_rooms", text) == {"topic": "more_rooms", "number": more}
    assert robot.seen.graph.more_rooms is more


def test_the_room_that_is_said_is_that_of_the_ways_also_for_several_robots(robot: Robot) -> None:
    robot.hear("entered", "meeting-room")
    for here, unit in ((None, None), ("kitchen", "rooms")):
        answer = say(robot, "where", thing="cup", robots={"a": "kitchen"}, here=here)
        assert (answer["here"], answer["cost_unit"]) == (here, unit)


def test_a_number_is_an_id(robot: Robot) -> None:
    assert say(robot, "discovered", room=7, beside="kitchen")["room"] == "7"
    say(robot, "discovered", room="R8", beside=7)
    assert say(robot, "saw", thing="cup", room=7, object=41)["object"] == "41"
    assert say(robot, "gone", object=41)["object"] == "41"
    assert robot.seen.rooms[-2:] == ("7", "R8")
    assert robot.seen.graph.adjacency[-2:] == ((2, 4), (4, 5))


def test_the_kind_of_a_building_is_told_when_its_rooms_tell_it() -> None:
    robot = Robot(open_graph({}))
    assert "notes" not in say(robot, "discovered", room=1, room_type="nurse station")
    notes = say(robot, "discovered", room=2, room_type="operating theater")["notes"]
    assert any(note.startswith("building kind taken for `hospital`") for note in notes)
    (note,) = say(robot, "discovered", room="ward")["notes"]
    assert "building kind" not in note, "it is said once"
    assert robot.seen.graph.building_kind == "hospital"


def test_a_word_that_tells_the_model_nothing_is_noted(robot: Robot) -> None:
    gizmo = say(robot, "saw", thing="gizmo", room="kitchen")
    assert gizmo["notes"] == ["no class map knows 'gizmo': it is kept, but tells the model nothing"]
    for topic in ("discovered", "describe"):
        (note,) = say(robot, topic, room="R9", room_type="zzz")["notes"]
        assert note == "'zzz': kind of room unknown; say `room_type`"


@pytest.mark.parametrize(
    ("topic", "text", "code"),
    [
        ("saw", "sofa", "room-unsaid"),
        ("saw", "", "request-malformed"),
        ("discovered", "kitchen", "room-known"),
        ("searched", '{"room": "kitchen", "found": ["chair", "toaster"]}', "object-unknown"),
        ("gone", '{"object": true}', "request-malformed"),
        ("more_rooms", "many", "request-malformed"),
        ("passes", '{"until": "2026-11-28T08:30:00"}', "request-malformed"),
        ("looked", '{"thing": "mug", "room": "kitchen", "time": 1e13}', "request-malformed"),
        ("where", "zzqx", "thing-unknown"),
        ("where", '{"thing": []}', "request-malformed"),
        ("where", '{"thing": "sofa", "thing": "bed"}', "json-malformed"),
        ("where", '{"thing": ' + "[" * 60_000, "json-malformed"),
        ("where", "x" * 65_537, "request-too-large"),
    ],
)
def test_a_fault_is_an_answer_and_changes_nothing(
    robot: Robot, topic: str, text: str, code: str
) -> None:
    before = robot.seen.graph
    answer = robot.hear(topic, text)
    assert (answer["topic"], answer["code"]) == (topic, code)
    assert len(answer["error"]) < 1_000
    assert robot.seen.graph == before
    assert robot.here is None


def test_a_question_that_is_wrong_keeps_its_id(robot: Robot) -> None:
    assert say(robot, "where", thing=3, id="q")["id"] == "q"
    assert say(robot, "where", thing="sofa", id=3)["id"] == "3"
    assert "id" not in say(robot, "where", thing="sofa", id=3.5)


def test_a_broken_detector_fills_no_memory(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requests, "MOST_OBJECTS", len(robot.seen.graph.objects) + 1)
    monkeypatch.setattr(requests, "MOST_ROOMS", len(robot.seen.rooms) + 1)
    say(robot, "saw", thing="cup", room="kitchen", object="new")
    assert (
        say(robot, "saw", thing="cup", room="kitchen", object="more")["code"] == "objects-too-many"
    )
    assert say(robot, "saw", thing="cup", room="kitchen", object="new")["object"] == "new"
    codes = [say(robot, "discovered", room=name).get("code") for name in "ab"]
    assert codes[-1] == "rooms-too-many"


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=8,
)
KEYS = sorted({key for kind, _ in TOPICS.values() for key in kind.model_fields})
SEEN = open_graph(OFFICE, model="mixture")


@given(
    topic=st.sampled_from(sorted(TOPICS)),
    text=st.text() | st.dictionaries(st.sampled_from(KEYS), JSON).map(json.dumps),
)
def test_any_text_gets_an_answer_that_is_json(topic: str, text: str) -> None:
    answer = Robot(SEEN.copy()).hear(topic, text)
    assert json.loads(encode_json(answer))["topic"] == topic


def detection(object_id: str, *scores: tuple[str, float]) -> SimpleNamespace:
    """Return a vision_msgs/msg/Detection3D of vision_msgs 4, as Humble and later have it."""
    return SimpleNamespace(
        results=[
            SimpleNamespace(hypothesis=SimpleNamespace(class_id=word, score=score))
            for word, score in scores
        ],
        bbox=SimpleNamespace(center=SimpleNamespace(position=SimpleNamespace(x=1.0, y=2.0, z=0.5))),
        id=object_id,
    )


def message(frame: str, *detections: SimpleNamespace) -> SimpleNamespace:
    return SimpleNamespace(header=SimpleNamespace(frame_id=frame), detections=[*detections])


@pytest.mark.parametrize(
    ("frame", "place"),
    [("map", {"position": (1.0, 2.0, 0.5)}), ("camera", {})],
)
def test_detections_with_a_high_score_are_sightings(
    robot: Robot, frame: str, place: dict[str, Any]
) -> None:
    heard = message(
        frame,
        detection("d1", ("wall", 0.1), ("microwave", 0.9)),
        detection("d2", ("lamp", 0.4)),
        detection("", ("lamp", 1.0)),
        detection("d3"),
    )
    microwave, lamp = read_detections(heard, frame="map", min_score=0.5)
    assert microwave == {"thing": "microwave", "object": "d1", "score": 0.9, **place}
    assert lamp == {"thing": "lamp", "object": None, "score": 1.0, **place}
    assert robot.answer("saw", microwave)["code"] == "room-unsaid"
    robot.hear("entered", "kitchen")
    assert robot.answer("saw", microwave)["object"] == "d1"
    assert robot.answer("saw", lamp)["object"] == "saw 20"
    assert [obj.score for obj in robot.seen.graph.objects[-2:]] == [0.9, 1.0]


def test_without_ros_the_command_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    monkeypatch.delitem(sys.modules, "bsg_robot.ros.node", raising=False)
    done = CliRunner().invoke(main, ["--ros-args", "-p", "graph:=home.json"])
    assert done.exit_code == 1
    assert "setup.bash" in done.stderr
    assert "[ros]" in done.stderr


@pytest.mark.parametrize("blank", [None, ""])
def test_blank_keys_are_left_out(robot: Robot, blank: str | None) -> None:
    for topic, report in (
        ("saw", {"thing": "sink", "room": "kitchen", "object": blank, "within": blank}),
        ("where", {"thing": "mug", "here": "kitchen", "robots": blank, "look": blank}),
    ):
        assert "error" not in robot.answer(topic, report)
