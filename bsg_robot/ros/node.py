"""The node: topics, services and parameters of ROS 2 around a `Robot`.

A question with an argument and an answer would need a service type of its own, which somebody has
to compile for every distribution and every robot. Here it is two topics of text: the request has an
`id`, and the answer on `~/answers` repeats it. Every language can do that, `ros2 bag` records it,
and a client that dies leaves nothing behind.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import rclpy
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from bsg_data.errors import BSGError, RecipeError
from bsg_data.files import encode_json, hold, write_bytes
from bsg_data.tables import make_line
from bsg_data.words.nearest import ask_if_meant
from bsg_models.belief.partial_graph import PartialGraph
from bsg_models.runs.found_model import DEFAULT_MODEL, TERMS
from bsg_robot.answers.seen_building import SeenBuilding, open_graph
from bsg_robot.graph.robot_json import RobotGraphError, encode_robot_graph
from bsg_robot.ros.markers import draw
from bsg_robot.ros.requests import TOPICS, Robot, read_detections

try:
    from vision_msgs.msg import Detection3DArray
except ModuleNotFoundError:  # the wheels of rclpy come without it
    Detection3DArray = None

# name → default, meaning, least and most
PARAMETERS: dict[str, tuple[Any, str, tuple[float, float] | None]] = {
    "graph": ("", "file with what the robot has seen; empty: nothing", None),
    "state": ("", "file that keeps what it sees; a new node goes on from it; empty: none", None),
    "model": (DEFAULT_MODEL, "a shipped model, or the path of a run", None),
    "room_labels": ("", "CSV source_label,label of your words for rooms; empty: none", None),
    "map_frame": ("map", "frame of all positions", None),
    "min_score": (0.5, "detections with a lower score are ignored", (0.0, 1.0)),
    "period": (1.0, "seconds between two states: the graph, the markers, the file", (0.05, 3600.0)),
}
_NOTHING: dict[str, Any] = {"scene_id": "building", "rooms": []}
_QUEUE = QoSProfile(depth=100)  # reliable
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # late ones get it, too


class BeliefNode:
    """Gives texts and detections to a `Robot`, and publishes its answers and its state."""

    def __init__(self, node: Any, held: ExitStack) -> None:
        """Declare parameters, read the graph, and open all topics.

        Args:
            node: of rclpy.
            held: ends with the node; it holds the file of the state.

        Raises:
            ParameterException: for a parameter of another type, or out of its range.
            BSGError: if a file cannot be read, or there is no such model.
        """
        self.node, self.log = node, node.get_logger()
        parameters = {name: _declare(node, name) for name in PARAMETERS}
        self.graph, self.model = parameters["graph"], parameters["model"]
        self.room_labels = parameters["room_labels"] or None
        if self.model == DEFAULT_MODEL:  # ROS does not tell who has named it
            self.log.info(TERMS)
        self.state = Path(parameters["state"]) if parameters["state"] else None
        self.frame, self.min_score = parameters["map_frame"], parameters["min_score"]
        self.thing: str | None = None  # what was asked for last, which the markers show
        self.published: PartialGraph | None = None  # the last one, and so below
        self.written: PartialGraph | None = None
        self.drawn: tuple[PartialGraph, str | None] | None = None
        if self.state is not None:
            held.enter_context(hold(self.state))  # of no other node at a time
        goes_on = self.state is not None and self.state.exists()
        try:
            self._open(self.state if goes_on else self.graph)
        except RobotGraphError as error:
            if not goes_on:
                raise
            hint = f"{error}; this file is `state`: move it away to begin with `graph`"
            raise RobotGraphError(hint, code=error.code) from error
        self.answers = node.create_publisher(String, "~/answers", _QUEUE)
        self.graphs = node.create_publisher(String, "~/graph", _LATCHED)
        self.markers = node.create_publisher(MarkerArray, "~/markers", _LATCHED)
        for topic in TOPICS:
            node.create_subscription(String, f"~/{topic}", partial(self.hear, topic), _QUEUE)
        if Detection3DArray is not None:
            detections = Detection3DArray, "~/detections", self.detect
            node.create_subscription(*detections, qos_profile_sensor_data)
        node.create_service(Trigger, "~/reset", self.reset)
        node.create_timer(parameters["period"], self.publish)
        self.publish()

    def _open(self, graph: Any) -> None:
        seen = open_graph(graph or _NOTHING, model=self.model, room_labels=self.room_labels)
        self.robot = Robot(seen)
        self.tell_time()
        for note in seen.notes:
            self.log.info(make_line(note))
        self.log.info(f"{_count(seen)} by {self.model} from {graph or 'no file'}")

    def tell_time(self) -> None:
        """Tell the robot the time; a simulator's clock that does not run yet says 0."""
        clock = self.node.get_clock().now().nanoseconds // 1000 / 1e6
        if clock and (note := self.robot.tell_time(clock)):
            self.log.warning(note)

    def hear(self, topic: str, message: String) -> None:
        """Answer a text."""
        self.tell_time()
        answer = self.robot.hear(topic, message.data)
        if "error" in answer:
            self.log.warning(make_line(f"~/{topic}: {answer['error']}"))
        elif topic == "where":
            self.thing = answer["things"][0]["thing"]
        elif topic == "next_place":
            self.thing = answer["thing"]
        for note in answer.get("notes", ()):
            self.log.info(make_line(f"~/{topic}: {note}"))
        self.answers.publish(String(data=encode_json(answer)))

    def detect(self, message: Any) -> None:
        """Note what a detector saw from the room where the robot is."""
        self.tell_time()
        stamp = message.header.stamp
        time = self.robot.date(stamp.sec + stamp.nanosec / 1e9)
        seen: list[str] = []  # in this message: each of its detections is another object
        for sighting in read_detections(message, frame=self.frame, min_score=self.min_score):
            answer = self.robot.answer("saw", sighting | {"time": time, "besides": seen})
            seen += [answer["object"]] if "object" in answer else []
            # A detector never stops: it would repeat them with every message.
            for note in answer.get("notes", ()):
                self.log.info(make_line(f"~/detections: {note}"), throttle_duration_sec=10.0)
            if "error" in answer:
                fault = make_line(f"~/detections: {answer['error']}")
                self.log.warning(fault, throttle_duration_sec=10.0)

    def reset(self, _: Any, answer: Any) -> Any:
        """Begin with the parameter `graph` again."""
        try:
            self._open(self.graph)
            self.thing = None
            self.publish()
            answer.success, answer.message = True, _count(self.robot.seen)
        except BSGError as error:
            answer.success, answer.message = False, str(error)
        return answer

    def publish(self) -> None:
        """Publish what is new, and keep it: at most once a period, because sightings come often."""
        seen = self.robot.seen
        if not _reports_the_same(seen.graph, self.published):
            self.graphs.publish(String(data=_encode(seen)))
            self.published = seen.graph
        now = (seen.graph, self.thing)
        if now != self.drawn and self.markers.get_subscription_count():
            self.markers.publish(draw(seen, thing=self.thing, frame=self.frame))
            self.drawn = now
        self.write_state()

    def write_state(self) -> None:
        """Write the state; a full disk does not stop the node, which tries again."""
        seen = self.robot.seen
        if self.state is not None and not _reports_the_same(seen.graph, self.written):
            try:
                write_bytes(self.state, _encode(seen).encode())
                self.written = seen.graph
            except BSGError as error:
                self.log.error(make_line(str(error)), throttle_duration_sec=10.0)


def run(ros_args: Sequence[str]) -> None:
    """Run the node until Ctrl-C, SIGTERM or a shutdown of ROS.

    Raises:
        BSGError: if its graph, its state or its model cannot be read.
    """
    try:
        rclpy.init(args=[*ros_args])
    except RuntimeError as error:
        raise RecipeError(str(error), code="ros-arguments") from error
    node = rclpy.create_node("belief")
    belief = None
    with ExitStack() as held:
        try:
            for name in _list_unknown(ros_args):
                hint = ask_if_meant(name, PARAMETERS) or f"parameters are {', '.join(PARAMETERS)}"
                node.get_logger().warning(make_line(f"no parameter {name!r}; {hint}"))
            belief = BeliefNode(node, held)
            rclpy.spin(node)
        except ParameterException as error:
            raise RecipeError(f"parameter {error}", code="ros-parameter") from error
        except ExternalShutdownException:
            pass
        finally:
            if belief is not None:
                belief.write_state()
            node.destroy_node()
            rclpy.try_shutdown()


def _list_unknown(ros_args: Sequence[str]) -> list[str]:
    """Return the parameters of a command that are neither the node's nor ROS's own."""
    given = [word for flag, word in pairwise(ros_args) if flag in ("-p", "--param")]
    names = [word.partition(":=")[0].rpartition(":")[2] for word in given]
    return [name for name in names if name not in PARAMETERS and name != "use_sim_time"]


def _declare(node: Any, name: str) -> Any:
    default, meaning, span = PARAMETERS[name]
    spans = [FloatingPointRange(from_value=span[0], to_value=span[1])] if span else []
    descriptor = ParameterDescriptor(
        description=meaning, read_only=True, floating_point_range=spans
    )
    return node.declare_parameter(name, default, descriptor).value


def _reports_the_same(graph: PartialGraph, before: PartialGraph | None) -> bool:
    """Return whether nothing was reported since; time passes by itself."""
    return before is not None and replace(graph, now=before.now) == before


def _encode(seen: SeenBuilding) -> str:
    return encode_json(encode_robot_graph(seen.graph), ensure_ascii=False)


def _count(seen: SeenBuilding) -> str:
    return f"{len(seen.rooms):,} rooms and {len(seen.graph.objects):,} objects"
