"""Record a session of `bsg-ros` in the home of docs/home.json, as a bag of ROS 2 in MCAP.

    python scripts/figures/ros_session.py --out docs/examples/ros_session

It needs the extra `ros`, and `rosbags` of the extra `test`. A step takes two seconds in the bag, so
that one can watch when it is played.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

HOME = Path(__file__).resolve().parents[2] / "docs" / "home.json"
STEP, MESSAGE = 2_000_000_000, 1_000_000  # nanoseconds between two steps, and two messages of one
DAY = (
    ("where", "microwave"),
    ("entered", '{"room": "hall", "floor_in_view": 0.5}'),
    ("saw", '{"thing": "mirror", "object": "4", "position": [4.5, 0.5, 1.4]}'),
    ("entered", '{"room": "kitchen", "floor_in_view": 0.4}'),
    ("saw", '{"thing": "sink", "object": "5", "position": [3.2, 5.8, 0.9]}'),
    ("saw", '{"thing": "stove", "object": "6", "position": [4.1, 6.1, 0.9]}'),
    ("where", '{"thing": "microwave", "id": "again"}'),
    ("looked", '{"thing": "microwave", "chance": 0.9}'),
    ("where", '{"thing": "microwave", "id": "after a look"}'),
    (
        "discovered",
        '{"room": "pantry", "beside": "kitchen", "room_type": "pantry", "position": [6, 6, 0]}',
    ),
    ("searched", '{"room": "kitchen", "found": ["sink", "stove"]}'),
    ("where", '{"thing": ["microwave", "toilet"], "id": "both"}'),
    ("expected", "upstairs"),
)
_QUEUE = QoSProfile(depth=100)
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
HEARD = {
    "answers": (String, _QUEUE),
    "graph": (String, _LATCHED),
    "markers": (MarkerArray, _LATCHED),
}


class Recorder:
    """A node that says what the robot says, and writes that and all that it hears into a bag."""

    def __init__(self, bag: Writer) -> None:
        self.bag, self.clock, self.answers = bag, 0, 0
        self.node = rclpy.create_node("robot")
        self.types, self.connections = get_typestore(Stores.ROS2_KILTED), {}
        said = dict.fromkeys((topic for topic, _ in DAY), (String, _QUEUE))
        for topic, (kind, qos) in {**said, **HEARD}.items():
            name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
            self.connections[topic] = bag.add_connection(
                f"/belief/{topic}",
                name,
                typestore=self.types,
                offered_qos_profiles=[_describe(qos)],
            )
        self.publishers = {
            topic: self.node.create_publisher(kind, f"/belief/{topic}", qos)
            for topic, (kind, qos) in said.items()
        }
        for topic, (kind, qos) in HEARD.items():
            heard = lambda data, topic=topic: self.write(topic, data)  # noqa: E731
            self.node.create_subscription(kind, f"/belief/{topic}", heard, qos, raw=True)

    def write(self, topic: str, data: bytes) -> None:
        """Write a message at the time of the bag."""
        self.bag.write(self.connections[topic], self.clock, data)
        self.clock += MESSAGE
        self.answers += topic == "answers"

    def spin(self, *, until: int = 0, seconds: float = 0.0) -> None:
        """Hear messages until there are so many answers, and for so long."""
        end = time.monotonic() + seconds
        while self.answers < until or time.monotonic() < end:
            rclpy.spin_once(self.node, timeout_sec=0.05)

    def play(self) -> None:
        """Say all of the day, each step after the answer to the one before."""
        while not all(one.get_subscription_count() for one in self.publishers.values()):
            self.spin(seconds=0.1)
        self.spin(seconds=1.0)
        for number, (topic, text) in enumerate(DAY, 1):
            self.clock = number * STEP
            message = String(data=text)
            self.write(topic, serialize_message(message))
            self.publishers[topic].publish(message)
            self.spin(until=number)
            self.spin(seconds=0.5)


def record(out: Path) -> None:
    """Record the day of a robot into a new folder."""
    rclpy.init()
    writer = Writer(out, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    try:
        with _running_node(), writer as bag:
            Recorder(bag).play()
    finally:
        rclpy.shutdown()


@contextmanager
def _running_node() -> Iterator[None]:
    parameters = (f"graph:={HOME}", "period:=0.1")
    words = [word for one in parameters for word in ("-p", one)]
    program = "import bsg_cli.ros; bsg_cli.ros.main()"
    node = subprocess.Popen([sys.executable, "-c", program, "--ros-args", *words])
    try:
        yield
    finally:
        node.terminate()
        node.wait()


def _describe(qos: QoSProfile) -> Qos:
    latched = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
    durability = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
    ever = QosTime(2_147_483_647, 4_294_967_295)
    return Qos(
        QosHistory.KEEP_LAST,
        qos.depth,
        QosReliability.RELIABLE,
        durability,
        ever,
        ever,
        QosLiveliness.AUTOMATIC,
        ever,
        avoid_ros_namespace_conventions=False,
    )


@click.command()
@click.option("--out", type=click.Path(path_type=Path), required=True, help="A new folder.")
def main(out: Path) -> None:
    """Record a session of bsg-ros as a bag."""
    record(out)


if __name__ == "__main__":
    main()
