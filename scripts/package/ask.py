"""Measure what an answer takes, with the installation of the Python that runs this file.

    python scripts/package/ask.py docs/home.json

It prints a table: processor time of the import with the first answer, memory, and milliseconds of
one more answer in random graphs of several sizes: the rooms of a word, and the same with the ways
there and the room to go to next. A third of the rooms was not entered; the hidden shares of the
others are told, or not.
"""

from __future__ import annotations

import random
import resource
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

ROOMS = (4, 8, 14, 50, 250)
THING = "microwave"
WORDS = ("sofa", "bed", "table", "chair", "lamp", "sink", "toilet", "stove", "cabinet", "plant")


def main(path: str) -> None:
    """Measure the first answer, then others."""
    from bsg_robot import open_graph

    open_graph(path).where(THING)
    print(f"| import and first answer, processor | {time.process_time():.2f} s |")
    for rooms in ROOMS:
        for told in (True, False):
            seen = open_graph(make_graph(rooms, told=told))
            rooms_of, next_room = (measure(partial(ask, seen)) for ask in (ask_again, go_on))
            shares = "shares told" if told else "no shares"
            print(f"| {rooms} rooms, {shares} | {rooms_of:.1f} ms | {next_room:.1f} ms |")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000
    print(f"| memory after all of these | {memory:.0f} MB |")


def make_graph(rooms: int, *, told: bool) -> dict[str, Any]:
    """Return a robot's graph: each room connects with an earlier one, and shows four objects."""
    draw = random.Random(rooms)
    ids = [f"room {number}" for number in range(rooms)]
    entered = [number % 3 < 2 for number in range(rooms)]
    shares = [{"hidden_share": 0.3} if told else {} for _ in ids]
    places = [[draw.uniform(0, 30), draw.uniform(0, 30), 0] for _ in ids]
    objects = [
        {"id": f"{room} {word}", "room": room, "category": word}
        for room, was_there in zip(ids, entered, strict=True)
        if was_there
        for word in draw.sample(WORDS, 4)
    ]
    return {
        "scene_id": "random",
        "rooms": [
            {"id": room, "position": place, "visited": was_there, **(share if was_there else {})}
            for room, place, was_there, share in zip(ids, places, entered, shares, strict=True)
        ],
        "objects": objects,
        "adjacency": [[ids[draw.randrange(n)], ids[n]] for n in range(1, rooms)],
    }


def ask_again(seen: Any) -> None:
    """Report that an object is another thing, so that nothing is remembered, and ask."""
    known = seen.graph.objects[0]
    word = WORDS[WORDS.index(known.raw_category) - 1]
    seen.saw(seen.rooms[0], word, object_id=known.name)
    seen.where(THING)


def go_on(seen: Any) -> None:
    """Ask as a robot does that wants to move: with the ways, and for the next room."""
    ask_again(seen)
    seen.where(THING, here=seen.rooms[0])
    seen.next_room(THING, here=seen.rooms[0])


def measure(ask: Callable[[], None]) -> float:
    """Return the median milliseconds of several calls, on one processor."""
    ask()
    times: list[float] = []
    while len(times) < 5 or (sum(times) < 1 and len(times) < 100):
        begun = time.process_time()
        ask()
        times.append(time.process_time() - begun)
    return 1000 * statistics.median(times)


if __name__ == "__main__":
    main(sys.argv[1])
