"""A ROS 2 node that says where things are that the robot has not seen.

    python3 ros2_belief_node.py --ros-args -p graph:=home.json

It needs `rclpy`, `std_msgs` and `vision_msgs` of ROS 2 Humble or later, and `belief-scene-graphs`
without extras. docs/robot-software.md says how to install it beside them.

Topics that it hears:
    ~/detections  vision_msgs/Detection3DArray   objects that were seen, each with an id
    ~/entered     std_msgs/String                id or label of the room where the robot is
    ~/searched    std_msgs/String                a room in which all was seen
    ~/where       std_msgs/String                a thing to look for, any word
Topics that it speaks on:
    ~/places      std_msgs/String                the answer to ~/where, as JSON
"""

from __future__ import annotations

import json
from dataclasses import asdict

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String
from vision_msgs.msg import Detection3D, Detection3DArray

from bsg_data import BSGError
from bsg_models import DEFAULT_MODEL, open_graph

QUEUE = 10  # messages


class BeliefNode(Node):
    """Tells a `SeenBuilding` what the robot sees, and answers from it."""

    def __init__(self) -> None:
        super().__init__("belief")
        graph = self.declare_parameter("graph", "").value  # a robot's graph: docs/belief.md
        model = self.declare_parameter("model", DEFAULT_MODEL).value
        self.min_score = float(self.declare_parameter("min_score", 0.5).value)
        self.map_frame = self.declare_parameter("map_frame", "map").value
        self.seen = open_graph(graph, model=model)
        self.here: str | None = None
        self.create_subscription(Detection3DArray, "~/detections", self.on_detections, QUEUE)
        self.create_subscription(String, "~/entered", self.on_entered, QUEUE)
        self.create_subscription(String, "~/searched", self.on_searched, QUEUE)
        self.create_subscription(String, "~/where", self.on_where, QUEUE)
        self.places = self.create_publisher(String, "~/places", QUEUE)

    def on_detections(self, message: Detection3DArray) -> None:
        """Add what was detected to the room where the robot is."""
        if self.here is None:
            self.get_logger().warning(
                "detections before a room was entered are left out", once=True
            )
            return
        placed = message.header.frame_id == self.map_frame
        for detection in message.detections:
            self.add(detection, self.here, placed=placed)

    def add(self, detection: Detection3D, room: str, *, placed: bool) -> None:
        """Add one detection; an id that is known is the same object, seen again."""
        best = max(detection.results, key=lambda one: one.hypothesis.score, default=None)
        if best is None or best.hypothesis.score < self.min_score:
            return
        if not detection.id:
            self.get_logger().warning("detections without an id are left out", once=True)
            return
        point = detection.bbox.center.position
        position = (point.x, point.y, point.z) if placed else None
        self.seen.saw(room, best.hypothesis.class_id, object_id=detection.id, position=position)

    def on_entered(self, message: String) -> None:
        """Note the room where the robot is."""
        try:
            self.seen.entered(message.data)
            self.here = message.data
        except BSGError as error:
            self.get_logger().error(str(error))

    def on_searched(self, message: String) -> None:
        """Note that all that is in a room was seen."""
        try:
            self.seen.searched(message.data)
        except BSGError as error:
            self.get_logger().error(str(error))

    def on_where(self, message: String) -> None:
        """Answer where a thing is, and where to go next."""
        try:
            answer = {
                "thing": message.data,
                "class": self.seen.understand(message.data).class_name,
                "places": [asdict(p) for p in self.seen.where(message.data, here=self.here)],
                "next_room": self.seen.next_room(message.data, here=self.here),
            }
        except BSGError as error:
            answer = {"thing": message.data, "error": str(error)}
        self.places.publish(String(data=json.dumps(answer)))


def main() -> None:
    """Run the node until it is stopped."""
    rclpy.init()
    node = BeliefNode()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        if rclpy.ok():
            rclpy.shutdown()


if __name__ == "__main__":
    main()
