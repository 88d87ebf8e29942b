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

from bsg_cli.ros import main, requests
from bsg_cli.ros.requests import TOPICS, Robot, read_detections
from bsg_data.files import encode_json
from bsg_models import open_graph

OFFICE = REPOSITORY / "docs" / "office.json"


@pytest.fixture
def robot() -> Robot:
    return Robot(open_graph(OFFICE, model="mixture"))


def say(robot: Robot, topic: str, **said: Any) -> dict[str, Any]:
    return robot.hear(topic, json.dumps(said))


def test_a_text_that_is_no_object_is_the_first_word(robot: Robot) -> None:
    assert robot.hear("entered", "meeting-room") == {"topic": "entered", "room": "meeting-room"}
    assert robot.hear("saw", "sofa") == {"topic": "saw", "object": "saw 19"}
    assert robot.seen.graph.objects[-1].room_index == 3
    answer = robot.hear("where", "sofa")
    places = robot.seen.where("sofa", here="meeting-room")
    assert answer["places"] == [asdict(place) for place in places]
    assert answer["go_first"] == "meeting-room"
    assert say(robot, "expected", room="kitchen")["expected"]
    assert robot.hear("where", '"sofa"') == answer
    both = robot.hear("where", '["cup", "sofa"]')["things"]
    assert [one["thing"] for one in both] == ["cup", "sofa"]


def test_reports_change_what_python_would_change(robot: Robot) -> None:
    other = robot.seen.copy()
    say(robot, "entered", room="kitchen", floor_in_view=0.5)
    say(robot, "discovered", room="R9", beside=["kitchen"], position=[1, 2, 3], floor_area=8)
    say(robot, "saw", thing="lamp", room="R9", object="l", position=[1, 2, 4])
    say(robot, "searched", room="meeting-room")
    other.entered("kitchen", floor_in_view=0.5)
    other.discovered("R9", beside="kitchen", position=(1, 2, 3), floor_area=8)
    other.saw("R9", "lamp", object_id="l", position=(1, 2, 4))
    other.searched("meeting-room")
    assert robot.seen.graph == other.graph
    assert robot.here == "kitchen"


def test_the_name_of_a_new_room_may_be_its_kind(robot: Robot) -> None:
    """As in the simplest map."""
    for name in ("bedroom_2", "R7"):
        say(robot, "discovered", room=name)
    assert [room.room_type for room in robot.seen.graph.rooms[-2:]] == ["bedroom", None]


def test_a_word_that_tells_the_model_nothing_is_noted(robot: Robot) -> None:
    gizmo = say(robot, "saw", thing="gizmo", room="kitchen")
    assert gizmo["notes"] == ["no class map knows 'gizmo': it is kept, but tells the model nothing"]
    (note,) = say(robot, "discovered", room="attic", room_type="zzz")["notes"]
    assert note.startswith("room type 'zzz' is read as")


@pytest.mark.parametrize(
    ("topic", "text", "code"),
    [
        ("saw", "sofa", "room-unsaid"),
        ("saw", "", "request-malformed"),
        ("saw", '{"thing": "sofa", "room": "kitchen", "position": [0, 1]}', "request-malformed"),
        ("saw", '{"thing": "sofa", "room": "kitchen", "object": 7}', "request-malformed"),
        ("entered", "cellar", "room-unknown"),
        ("entered", '{"room": "kitchen", "floor_in_view": 1.5}', "request-malformed"),
        ("entered", '{"room": "kitchen", "floor_in_view": 1, "hidden_share": 0}', "share-twice"),
        ("entered", '{"room": "kitchen", "floor": 1}', "request-malformed"),
        ("discovered", "kitchen", "room-known"),
        ("where", "zzqx", "thing-unknown"),
        ("where", '{"thing": []}', "request-malformed"),
        ("where", "[3]", "request-malformed"),
        ("where", '"sofa', "json-malformed"),
        ("where", '{"thing": "sofa", "thing": "bed"}', "json-malformed"),
        ("where", '{"thing": NaN}', "json-malformed"),
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
    assert "id" not in say(robot, "where", thing="sofa", id=3)


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
    said=st.text() | st.dictionaries(st.sampled_from(KEYS), JSON).map(json.dumps),
)
def test_any_text_gets_an_answer_that_is_json(topic: str, said: str) -> None:
    answer = Robot(SEEN.copy()).hear(topic, said)
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


@pytest.mark.parametrize(("frame", "position"), [("map", (1.0, 2.0, 0.5)), ("camera", None)])
def test_detections_with_an_id_and_a_high_score_are_sightings(
    robot: Robot, frame: str, position: tuple[float, ...] | None
) -> None:
    message = SimpleNamespace(
        header=SimpleNamespace(frame_id=frame),
        detections=[
            detection("d1", ("wall", 0.1), ("microwave", 0.9)),
            detection("d2", ("lamp", 0.4)),
            detection("", ("lamp", 1.0)),
            detection("d3"),
        ],
    )
    (said,) = read_detections(message, frame="map", min_score=0.5)
    assert said == {"thing": "microwave", "object": "d1", "position": position}
    assert robot.answer("saw", said)["code"] == "room-unsaid"
    robot.hear("entered", "kitchen")
    assert robot.answer("saw", said)["object"] == "d1"


def test_without_ros_the_command_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    monkeypatch.delitem(sys.modules, "bsg_cli.ros.node", raising=False)
    done = CliRunner().invoke(main, ["--ros-args", "-p", "graph:=home.json"])
    assert done.exit_code == 1
    assert "setup.bash" in done.stderr
    assert "[ros]" in done.stderr
