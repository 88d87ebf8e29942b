"""`bsg-ros` in a process of its own, and a robot in another one, over DDS on this machine."""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Queue
from typing import Any
from uuid import uuid4
from xml.etree import ElementTree

import pytest
from conftest import REPOSITORY

from bsg_models.runs.found_model import TERMS
from bsg_robot.ros.requests import TOPICS

pytest.importorskip("rclpy", reason="needs ROS 2: the extra ros, or a ROS 2 whose setup is sourced")
HOME, EXAMPLES = REPOSITORY / "docs" / "home.json", REPOSITORY / "docs" / "examples"
WAIT = 120  # seconds; only something that is broken takes them
COMMAND = [sys.executable, "-c", "import bsg_cli.ros; bsg_cli.ros.main()", "--ros-args"]

Start = Callable[..., "subprocess.Popen[str]"]


class Robot:
    """The process of tests/ros_robot.py."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.heard: dict[str, Queue[Any]] = {
            topic: Queue() for topic in ("ready", "answers", "graph", "markers", "reset")
        }
        threading.Thread(target=self._listen, daemon=True).start()
        self.hear("ready")

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            topic, content = json.loads(line)
            self.heard[topic].put(content)

    def say(self, topic: str, text: str | None) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps([topic, text]) + "\n")
        self.process.stdin.flush()

    def hear(self, topic: str) -> Any:
        return self.heard[topic].get(timeout=WAIT)

    def ask(self, topic: str, text: str) -> dict[str, Any]:
        self.say(topic, text)
        answer: dict[str, Any] = self.hear("answers")
        return answer

    def hear_graph(self, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Return the first graph of which something holds."""
        while True:
            graph: dict[str, Any] = self.hear("graph")
            if holds(graph):
                return graph


@pytest.fixture
def start() -> Iterator[Start]:
    """Start processes that find one another on this machine alone, and end them."""
    running = []

    def start_one(*words: str) -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        process = subprocess.Popen(
            words,
            stdin=pipe,
            stdout=pipe,
            text=True,
            env={**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
            cwd=REPOSITORY,
        )
        running.append(process)
        return process

    yield start_one
    for process in running:
        process.kill()
        process.communicate()


@pytest.fixture
def space() -> str:
    """Return a namespace of the test's own."""
    return f"/t{uuid4().hex}"


def start_node(start: Start, space: str, **parameters: object) -> subprocess.Popen[str]:
    values = {"model": "mixture", "period": 0.1, **parameters}
    words = [word for name, value in values.items() for word in ("-p", f"{name}:={value}")]
    return start(*COMMAND, "-r", f"__ns:={space}", *words)


def start_robot(start: Start, space: str) -> Robot:
    robot = str(REPOSITORY / "tests" / "ros_robot.py")
    return Robot(start(sys.executable, robot, space, *TOPICS))


def end(process: subprocess.Popen[str], number: signal.Signals) -> int:
    process.send_signal(number)
    return process.wait(WAIT)


def test_a_robot_begins_with_nothing_and_asks_on_its_way(start: Start, space: str) -> None:
    node, robot = start_node(start, space), start_robot(start, space)
    assert robot.hear("graph")["rooms"] == [], "it is latched: who comes late gets it, too"
    assert robot.ask("where", "sofa")["go_first"] == "explore"
    hall = '{"room": "hall", "position": [0, 0, 0]}'
    answer = robot.ask("discovered", hall)
    assert (answer["topic"], answer["room"]) == ("discovered", "hall")
    assert "read as the kind" in answer["notes"][0]
    robot.ask("entered", '{"room": "hall", "floor_in_view": 0.4}')
    new = {"room": "kitchen", "beside": "hall", "room_type": "kitchen", "position": [3, 4, 0]}
    robot.ask("discovered", json.dumps(new))
    seen = robot.ask(
        "saw", '{"thing": "coat rack", "object": "7", "position": [1, 0, 0], "id": "a"}'
    )
    assert seen == {"topic": "saw", "id": "a", "object": "7"}
    looked = {"topic": "looked", "room": "hall", "thing": "microwave"}
    assert robot.ask("looked", "microwave") == looked
    answer = robot.ask("where", '{"thing": "microwave", "id": "b"}')
    assert (answer["id"], answer["go_first"], answer["cost_unit"]) == ("b", "kitchen", "m")
    places = [(place["room"], place["cost"]) for place in answer["things"][0]["places"]]
    assert places == [("kitchen", 5), ("explore", 5), ("hall", 0)]
    assert robot.ask("expected", "kitchen")["expected"][0]["probability"] > 0.1
    graph = robot.hear_graph(lambda graph: bool(graph["objects"]))
    assert [room["id"] for room in graph["rooms"]] == ["hall", "kitchen"]
    assert 0 < graph["rooms"][0]["hidden_share"] < 1
    assert graph["objects"][0]["room"] == "hall"
    while "microwave" not in str(marks := robot.hear("markers")):
        pass
    assert {(name, points) for name, _, _, points in marks[1:]} == {
        ("rooms", 0), ("names", 0), ("ways", 2), ("objects", 1)
    }  # fmt: skip
    assert {frame for _, _, frame, _ in marks[1:]} == {"map"}
    assert robot.ask("next_place", "milk")["room"] == "kitchen"
    while "milk" not in str(robot.hear("markers")):
        pass
    robot.say("reset", None)
    assert robot.hear("reset") == "0 rooms and 0 objects"
    assert robot.hear_graph(lambda graph: not graph["rooms"])["objects"] == []
    assert end(node, signal.SIGINT) == 130


def test_questions_are_answered_while_sightings_arrive(start: Start, space: str) -> None:
    """From two robots at once; each text is answered, to all who listen."""
    start_node(start, space, graph=HOME)
    first, second = start_robot(start, space), start_robot(start, space)
    for number in range(90):  # fewer than the queues hold
        sighting = {"thing": "chair", "room": "hall", "object": f"c{number}", "id": f"c{number}"}
        first.say("saw", json.dumps(sighting))
        if number % 10 == 0:
            second.say("where", json.dumps({"thing": "chair", "id": f"q{number}"}))
    for robot in (first, second):
        answers = [robot.hear("answers") for _ in range(99)]
        asked = [answer for answer in answers if answer["topic"] == "where"]
        assert {answer["id"] for answer in asked} == {f"q{number}" for number in range(0, 90, 10)}
        assert all(answer["go_first"] for answer in asked)
        objects = {answer["object"] for answer in answers if answer["topic"] == "saw"}
        assert objects == {f"c{number}" for number in range(90)}
    graph = first.hear_graph(lambda graph: len(graph["objects"]) == 93)
    assert sum(obj["room"] == "hall" for obj in graph["objects"]) == 91


@pytest.mark.heavy
def test_a_node_goes_on_from_its_state(start: Start, space: str, tmp_path: Path) -> None:
    """After SIGTERM, at once; after a kill, from what it kept last."""
    state = tmp_path / "seen.json"
    node, robot = start_node(start, space, graph=HOME, state=state), start_robot(start, space)
    robot.ask("discovered", '{"room": "cellar", "beside": "hall"}')
    robot.ask("saw", '{"thing": "sink", "room": "kitchen", "score": 0.7}')
    robot.ask("keeps", '{"thing": "drinks", "room": "cellar"}')
    robot.ask("looked", '{"thing": "sink", "room": "living"}')
    robot.ask("more_rooms", "2")
    before = robot.ask("where", '{"thing": "sink", "here": "hall"}')
    assert end(node, signal.SIGTERM) == 143
    robot.process.kill()
    file = json.loads(state.read_text("utf-8"))
    assert [room["id"] for room in file["rooms"]][-1] == "cellar"

    node, robot = start_node(start, space, graph=HOME, state=state), start_robot(start, space)
    graph = robot.hear("graph")
    assert file["objects"][-1]["time"] <= file["now"] < graph["now"], "its clock went on"
    assert graph == file | {"now": graph["now"]}
    again = robot.ask("where", '{"thing": "sink", "here": "hall"}')
    assert again["things"][0]["habits"][0]["sightings"] == 1
    places, others = (answer["things"][0]["places"] for answer in (again, before))
    assert [(p["room"], p["seen"]) for p in places] == [(p["room"], p["seen"]) for p in others]
    robot.ask("passes", "24")
    assert robot.ask("habits", "cola")["habits"][0]["room"] == "cellar"
    second = subprocess.run(
        [*COMMAND, "-p", f"state:={state}"], capture_output=True, text=True, timeout=WAIT
    )
    assert second.returncode == 1
    assert "another command is writing there" in second.stderr
    assert TERMS in second.stderr
    robot.ask("searched", "cellar")
    assert robot.hear("graph")["rooms"][-1]["hidden_share"] == 0, "time alone publishes nothing"
    while json.loads(state.read_text("utf-8"))["rooms"] == file["rooms"]:  # written within a period
        assert node.poll() is None
        time.sleep(0.02)
    assert end(node, signal.SIGKILL) == -signal.SIGKILL
    robot.process.kill()

    start_node(start, space, graph=HOME, state=state)
    cellar = start_robot(start, space).hear("graph")["rooms"][-1]
    assert (cellar["id"], cellar["hidden_share"]) == ("cellar", 0)


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("graph:=3", "parameter"),
        ("graph", "-p graph"),
        (f"state:={__file__}", "move it away"),
        (
            "grap:=home.json -p use_sim_time:=true -p model:=no-such",
            "no parameter 'grap'; did you mean graph?",
        ),
    ],
)
def test_parameters_that_are_wrong_are_an_error(words: str, fault: str) -> None:
    command = [*COMMAND, "-p", "model:=mixture", "-p", *words.split()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=WAIT)
    assert done.returncode in (1, 2)
    assert fault in done.stderr
    assert not any(word in done.stderr for word in ("Traceback", "use_sim_time", TERMS))


@pytest.mark.heavy
def test_the_client_of_the_page_asks_the_node(start: Start, space: str) -> None:
    start_node(start, space, graph=HOME)
    client = (str(EXAMPLES / "ros_client.py"), "microwave", "sofa")
    done = start(sys.executable, *client, "--ros-args", "-r", f"__ns:={space}")
    lines = done.communicate(timeout=WAIT)[0].splitlines()
    assert [line.split(",")[0] for line in lines[:2]] == ["microwave: kitchen", "sofa: living"]
    assert lines[2] == "go first to kitchen", "a sofa is found already"
    assert done.returncode == 0
    for topic, text, key, value in (
        ("saw", '{"thing": "sink", "room": "hall"}', "object", "saw 4"),
        ("more_rooms", "2", "number", 2),
        ("gone", "saw 4", "object", "saw 4"),
    ):
        words = (client[0], "--topic", topic, text)
        done = start(sys.executable, *words, "--ros-args", "-r", f"__ns:={space}")
        assert json.loads(done.communicate(timeout=WAIT)[0])[key] == value


@pytest.mark.heavy
def test_the_launch_file_starts_the_node(start: Start, space: str, tmp_path: Path) -> None:
    """Its command, as `launch` splits and fills it."""
    tree = ElementTree.parse(EXAMPLES / "belief.launch.xml")
    values = {argument.attrib["name"]: argument.attrib["default"] for argument in tree.iter("arg")}
    assert values["graph"] == values["state"] == "''"
    values |= {"namespace": space, "model": "mixture"}
    (command,) = (element.attrib["cmd"] for element in tree.iter("executable"))
    name, *words = (
        re.sub(r"\$\(var\s(\w+)\)", lambda found: values[found[1]], word)
        for word in shlex.split(command.replace("(var ", "(var\N{NO-BREAK SPACE}"))
    )
    assert name == "bsg-ros"
    start(*COMMAND[:-1], *words)
    assert start_robot(start, space).ask("discovered", "hall")["room"] == "hall"


@pytest.mark.heavy
def test_the_recorded_session_can_be_played(start: Start, space: str) -> None:
    """The node answers as it did, but for the numbers, which a new model changes."""
    highlevel = pytest.importorskip("rosbags.highlevel", reason="needs rosbags: the extra test")
    with highlevel.AnyReader([EXAMPLES / "ros_session"]) as bag:
        recorded = [
            (
                connection.topic.removeprefix("/belief/"),
                bag.deserialize(raw, connection.msgtype).data,
            )
            for connection, _, raw in bag.messages()
            if connection.msgtype == "std_msgs/msg/String"
        ]
    start_node(start, space, graph=HOME)
    robot, answers = start_robot(start, space), [x for t, x in recorded if t == "answers"]
    heard = [pair for pair in recorded if pair[0] not in ("answers", "graph")]
    assert len(heard) == len(answers) > 8
    for (topic, text), answer in zip(heard, map(json.loads, answers), strict=True):
        again = robot.ask(topic, text)
        assert again.keys() == answer.keys()
        assert "error" not in again
        same = ("topic", "id", "room", "object", "thing")
        assert [again.get(key) for key in same] == [answer.get(key) for key in same]
        asked, before = again.get("things", ()), answer.get("things", ())
        assert [thing["class"] for thing in asked] == [thing["class"] for thing in before]


def test_the_page_has_all_topics_and_parameters() -> None:
    from bsg_robot.ros.node import PARAMETERS

    page = (REPOSITORY / "docs" / "robot-software.md").read_text("utf-8")
    rows = re.findall(r"^\| `([\w~/]+)` \| (\S+)", page, re.MULTILINE)
    shown = {name: value.strip("`") for name, value in rows}
    assert {f"~/{topic}" for topic in TOPICS} < shown.keys()
    keys = dict(re.findall(r"^\| `~/(\w+)` \| ([^|]*) \|", page, re.MULTILINE))
    for topic, (kind, _) in TOPICS.items():
        assert {*re.findall(r"`(\w+)`", keys[topic])} == {*kind.model_fields} - {"id"}, topic
    for name, (default, *_) in PARAMETERS.items():
        assert shown[name] == (str(default) or "–"), name
