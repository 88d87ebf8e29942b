"""Ask a running `bsg-ros` where things are, or tell it what a robot sees.

    python ros_client.py microwave "coffee table"
    python ros_client.py --topic entered kitchen
    python ros_client.py --topic saw '{"thing": "sink", "room": "kitchen"}'

It needs `rclpy` and `std_msgs` of ROS 2. docs/robot-software.md describes the topics.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from typing import Any
from uuid import uuid4

import rclpy
from rclpy.utilities import remove_ros_args
from std_msgs.msg import String

# topic → what a word alone is
TOPICS = {
    "discovered": "room",
    "entered": "room",
    "saw": "thing",
    "searched": "room",
    "looked": "thing",
    "gone": "object",
    "describe": "room",
    "more_rooms": "number",
    "passes": "hours",
    "keeps": "thing",
    "never": "thing",
    "forget": "thing",
    "where": "thing",
    "next_place": "thing",
    "expected": "room",
    "habits": "thing",
}
SECONDS = 10.0  # that a question waits for its answer


def ask(topic: str, **said: Any) -> dict[str, Any]:
    """Return the answer to one text: who asks gives it an id, and the answer repeats it."""
    node = rclpy.create_node("asking")
    question, answers = {"id": uuid4().hex, **said}, []

    def hear(message: String) -> None:
        answer = json.loads(message.data)
        if answer.get("id") == question["id"]:
            answers.append(answer)

    node.create_subscription(String, "belief/answers", hear, 10)
    asked = node.create_publisher(String, f"belief/{topic}", 10)
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
    """Print the likeliest room of each thing, and where to go first; or the answer of a topic."""
    parser = argparse.ArgumentParser(description="Ask a running bsg-ros where things are.")
    parser.add_argument("--topic", choices=TOPICS, help="what to say; see docs/robot-software.md")
    parser.add_argument("things", nargs="+", help="things to look for, or the text of the topic")
    asked = parser.parse_args(remove_ros_args(sys.argv)[1:])
    rclpy.init(args=sys.argv)
    said: Any = {"thing": asked.things}
    if asked.topic:
        word = asked.things[0]
        said = {TOPICS[asked.topic]: word}
        if word.startswith("{"):
            try:
                said = json.loads(word)
            except ValueError as error:
                sys.exit(f"{word[:80]}: no JSON ({error})")
    answer = ask(asked.topic or "where", **said)
    if "error" in answer:
        sys.exit(answer["error"])
    if asked.topic:
        print(json.dumps(answer))
        return
    for fact in answer["things"]:
        for best in fact["places"][:1]:  # none while no room is known
            print(f"{fact['thing']}: {best['room']}, {best['probability']:.0%}")
    print(
        f"go first to {answer['go_first']}" if answer["go_first"] else "no room is left to search"
    )
    rclpy.shutdown()


if __name__ == "__main__":
    try:
        main()
        sys.stdout.flush()
    except BrokenPipeError:  # who reads has read enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
