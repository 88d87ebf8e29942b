"""Ask a running `bsg-ros` where things are.

    python ros_client.py microwave "coffee table"

It needs `rclpy` and `std_msgs` of ROS 2. docs/ros.md describes the topics.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from typing import Any
from uuid import uuid4

import rclpy
from rclpy.utilities import remove_ros_args
from std_msgs.msg import String

SECONDS = 10.0  # that a question waits for its answer


def ask(things: Sequence[str]) -> dict[str, Any]:
    """Return the answer to one question: who asks gives it an id, and the answer repeats it."""
    node = rclpy.create_node("asking")
    question, answers = {"id": uuid4().hex, "thing": list(things)}, []

    def hear(message: String) -> None:
        answer = json.loads(message.data)
        if answer.get("id") == question["id"]:
            answers.append(answer)

    node.create_subscription(String, "belief/answers", hear, 10)
    asked = node.create_publisher(String, "belief/where", 10)
    end, is_sent = time.monotonic() + SECONDS, False
    while not answers and time.monotonic() < end:
        if (
            not is_sent
            and asked.get_subscription_count()
            and node.count_publishers("belief/answers")
        ):
            asked.publish(String(data=json.dumps(question)))
            is_sent = True
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_node()
    return answers[0] if answers else {"error": "no answer; is bsg-ros running?"}


def main() -> None:
    """Print the likeliest room of each thing, and where to go first."""
    rclpy.init(args=sys.argv)
    answer = ask(remove_ros_args(sys.argv)[1:])
    if "error" in answer:
        sys.exit(answer["error"])
    for fact in answer.get("things", [answer]):
        for best in fact["places"][:1]:  # none while no room is known
            print(f"{fact['thing']}: {best['room']}, {best['probability']:.0%}")
    print(
        f"go first to {answer['go_first']}" if answer["go_first"] else "no room is left to search"
    )
    rclpy.shutdown()


if __name__ == "__main__":
    main()
