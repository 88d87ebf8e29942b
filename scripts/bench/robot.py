"""Measure what one sighting and the next question take, where hidden shares are sure and where not.

    python scripts/bench/robot.py                       # of buildings of 4, 14 and 50 rooms

Rooms are made up: a third of them was visited, each with two objects. The same questions are asked
of the same building twice, told the shares of visited rooms and not told.
"""

from __future__ import annotations

import statistics
import time
from typing import Any

from bsg_data.tables import format_text
from bsg_models.robot.seen_building import SeenBuilding, open_graph

ROOMS = (4, 14, 50)
QUESTIONS = 15


def make_graph(rooms: int) -> dict[str, Any]:
    """Return a robot's document of a building, a third of whose rooms was visited."""
    visited = range(0, rooms, 3)
    return {
        "scene_id": f"{rooms} rooms",
        "rooms": [{"id": str(room), "visited": room in visited} for room in range(rooms)],
        "objects": [
            {"id": f"{room} {thing}", "room": str(room), "category": thing}
            for room in visited
            for thing in ("chair", "lamp")
        ],
    }


def time_questions(seen: SeenBuilding) -> float:
    """Return the median of the milliseconds that a sighting and a question take together."""
    seen.where("microwave")
    taken = []
    for _ in range(QUESTIONS):
        began = time.perf_counter()
        seen.saw("0", "chair")
        seen.where("microwave")
        taken.append(1000 * (time.perf_counter() - began))
    return statistics.median(taken)


def main() -> None:
    """Print a row a building, with the ratio of both."""
    rows = []
    for rooms in ROOMS:
        document = make_graph(rooms)
        told = {str(room): 0.5 for room in range(0, rooms, 3)}
        sure = time_questions(open_graph(document, hidden_shares=told))
        unsure = time_questions(open_graph(document))
        rows.append((rooms, f"{sure:.1f}", f"{unsure:.1f}", f"{unsure / sure:.1f}"))
    header = ("rooms", "shares sure, ms", "not sure, ms", "ratio")
    print(format_text(rows, header=header, numeric=header))


if __name__ == "__main__":
    main()
