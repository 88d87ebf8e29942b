"""The files of docs/examples run: the planner's as it is, the node of ROS 2 on a stub of rclpy."""

from __future__ import annotations

import json
import re
import runpy
import sys
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar

import pytest
from conftest import REPOSITORY

EXAMPLES = REPOSITORY / "docs" / "examples"


def test_the_lines_of_the_page_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Beside docs/office.json."""
    monkeypatch.chdir(REPOSITORY / "docs")
    text = (REPOSITORY / "docs" / "planners.md").read_text("utf-8")
    (block,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(compile(block, "docs/planners.md", "exec"), {"__name__": "planning"})
    before, after = map(float, capsys.readouterr().out.split())
    assert before > 0 == after


def test_the_search_with_a_planner_finds_everything(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLES / "search_with_a_planner.py"), run_name="__main__")
    *steps, last = capsys.readouterr().out.splitlines()
    assert steps[0] == "washstand_3: towel"
    assert sum(": nothing" not in step for step in steps) == 3
    assert last == "all found after 73 s"


class FakeNode:
    """What the example takes of `rclpy.node.Node`, as Humble has it."""

    given: ClassVar[dict[str, Any]] = {}

    def __init__(self, name: str) -> None:
        self.heard: dict[str, Any] = {}
        self.said: dict[str, list[Any]] = {}
        self.logged: list[str] = []

    def declare_parameter(self, name: str, value: Any) -> SimpleNamespace:
        return SimpleNamespace(value=self.given.get(name, value))

    def create_subscription(self, kind: type, topic: str, callback: Any, depth: int) -> None:
        self.heard[topic] = (kind, callback)

    def create_publisher(self, kind: type, topic: str, depth: int) -> SimpleNamespace:
        return SimpleNamespace(publish=self.said.setdefault(topic, []).append)

    def get_logger(self) -> SimpleNamespace:
        def log(text: str, *, once: bool = False) -> None:
            self.logged.append(text)

        return SimpleNamespace(warning=log, error=log)

    def destroy_node(self) -> None: ...


class String(SimpleNamespace):
    """std_msgs/msg/String: `data`."""


class Detection3DArray(SimpleNamespace):
    """vision_msgs/msg/Detection3DArray of vision_msgs 4: `header`, `detections`."""


class Detection3D(SimpleNamespace):
    """vision_msgs/msg/Detection3D of vision_msgs 4: `header`, `results`, `bbox`, `id`."""


def detection(name: str, object_id: str, score: float) -> Detection3D:
    hypotheses = [("wall", 0.1), (name, score)]
    return Detection3D(
        results=[
            SimpleNamespace(hypothesis=SimpleNamespace(class_id=word, score=how))
            for word, how in hypotheses
        ],
        bbox=SimpleNamespace(center=SimpleNamespace(position=SimpleNamespace(x=1.0, y=2.0, z=0.5))),
        id=object_id,
    )


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Any:
    modules = {
        "rclpy": {"init": None, "spin": None, "ok": None, "shutdown": None},
        "rclpy.executors": {"ExternalShutdownException": type("Ended", (Exception,), {})},
        "rclpy.node": {"Node": FakeNode},
        "std_msgs": {},
        "std_msgs.msg": {"String": String},
        "vision_msgs": {},
        "vision_msgs.msg": {"Detection3D": Detection3D, "Detection3DArray": Detection3DArray},
    }
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    office = str(REPOSITORY / "docs" / "office.json")
    monkeypatch.setattr(FakeNode, "given", {"graph": office, "model": "mixture"})
    return runpy.run_path(str(EXAMPLES / "ros2_belief_node.py"))["BeliefNode"]()


def hear(node: Any, topic: str, message: Any) -> None:
    kind, callback = node.heard[topic]
    assert isinstance(message, kind)
    callback(message)


def ask(node: Any, thing: str) -> dict[str, Any]:
    hear(node, "~/where", String(data=thing))
    answer: dict[str, Any] = json.loads(node.said["~/places"][-1].data)
    return answer


def see(node: Any, *detections: Detection3D, frame: str = "map") -> None:
    header = SimpleNamespace(frame_id=frame)
    hear(node, "~/detections", Detection3DArray(header=header, detections=list(detections)))


def test_the_ros_node_answers_where_things_are(node: Any) -> None:
    answer = ask(node, "fridge")
    assert answer["class"] == "refrigerator"
    assert answer["places"][0]["room"] == answer["next_room"] == "kitchen"
    hear(node, "~/searched", String(data="kitchen"))
    assert ask(node, "fridge")["next_room"] != "kitchen"
    assert "zzqx" in ask(node, "zzqx")["error"]


def test_the_ros_node_adds_what_was_detected_to_the_room_where_it_is(node: Any) -> None:
    see(node, detection("microwave", "5", 0.9))
    assert node.logged == ["detections before a room was entered are left out"]
    hear(node, "~/entered", String(data="meeting-room"))
    before = len(node.seen.graph.objects)
    see(
        node,
        detection("microwave", "d5", 0.9),
        detection("lamp", "d6", 0.4),
        detection("lamp", "", 1),
    )
    see(node, detection("microwave", "d5", 0.8), frame="camera")
    assert len(node.seen.graph.objects) == before + 1
    assert node.seen.graph.objects[-1].room_index == 3
    places = ask(node, "microwave")["places"]
    assert (places[0]["room"], places[0]["seen"]) == ("meeting-room", ["d5"])
    assert node.logged[-1] == "detections without an id are left out"


def test_the_ros_node_lives_on_after_a_room_that_is_not_known(node: Any) -> None:
    hear(node, "~/entered", String(data="cellar"))
    hear(node, "~/searched", String(data="attic"))
    assert [line.partition("; ")[0] for line in node.logged] == [
        "office: no room 'cellar'",
        "office: no room 'attic'",
    ]
    assert node.here is None
