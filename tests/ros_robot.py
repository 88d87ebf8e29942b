"""A robot in a process of its own: it says what stdin tells it to, and prints what it hears.

    python ros_robot.py NAMESPACE TOPIC...

Each line of stdin is `[topic, text]`, or `["reset", null]` for the service. Each line of stdout is
`[topic, content]`; the first is `["ready", null]`, once node and robot have found each other.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from typing import Any

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray


def tell(topic: str, content: Any) -> None:
    sys.stdout.write(json.dumps([topic, content]) + "\n")
    sys.stdout.flush()


def tell_markers(message: Any) -> None:
    marks = [(m.ns, m.text, m.header.frame_id, len(m.points)) for m in message.markers]
    tell("markers", marks)


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("robot", namespace=sys.argv[1])
    queue = QoSProfile(depth=100)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publishers = {
        name: node.create_publisher(String, f"belief/{name}", queue) for name in sys.argv[2:]
    }
    node.create_subscription(
        String, "belief/answers", lambda m: tell("answers", json.loads(m.data)), queue
    )
    node.create_subscription(
        String, "belief/graph", lambda m: tell("graph", json.loads(m.data)), latched
    )
    node.create_subscription(MarkerArray, "belief/markers", tell_markers, latched)
    reset = node.create_client(Trigger, "belief/reset")

    def obey() -> None:
        while not (
            all(publisher.get_subscription_count() for publisher in publishers.values())
            and node.count_publishers(f"{sys.argv[1]}/belief/answers")
            and reset.service_is_ready()
        ):
            time.sleep(0.02)
        tell("ready", None)
        for line in sys.stdin:
            topic, text = json.loads(line)
            if topic == "reset":
                done = reset.call_async(Trigger.Request())
                done.add_done_callback(lambda d: tell("reset", d.result().message))
            else:
                publishers[topic].publish(String(data=text))

    threading.Thread(target=obey, daemon=True).start()
    rclpy.spin(node)


if __name__ == "__main__":
    main()
