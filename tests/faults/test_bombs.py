"""Small graphs that ask for much are errors, and the largest that are none are answered.

Only what comes by the network is bounded: robots' graphs and Hydra's. Each is opened in a process
of its own that may take 2 GiB of memory beyond what its imports took, and 20 seconds.
"""

from __future__ import annotations

import json
import math
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from bsg_data.inputs.bounds import MAX_ROBOT_OBJECTS, MAX_ROBOT_ROOMS, MAX_ROBOT_SOUGHT
from bsg_robot.graph.memory import MOST_THINGS

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are Linux's")
SECONDS, BYTES = 20, 2 * 2**30
READ = """
import resource, sys
from pathlib import Path
from bsg_data.errors import BSGError
from bsg_robot.answers.seen_building import open_graph
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + {most}, used + {most}))
try:
    open_graph(Path(sys.argv[1])){where}
    print("answered")
except BSGError as error:
    print("refused:", str(error)[:300])
"""

LISTS = "[" + "[]," * 20_000_000 + "[]]"
SPACED = '{"rooms": [], "x": {' + ",".join(f'"{n:x}" :1' for n in range(4_400_000)) + "}}"
PAIRS = json.dumps({"rooms": [{"id": "a"}, {"id": "b"}], "adjacency": [["a", "b"]] * 1_400_000})
TYPES = [{f"w{n}x{m}": 0.01 for m in range(60)} for n in range(5_000)]
KINDS = json.dumps({"rooms": [{"id": f"k{n}", "room_type": one} for n, one in enumerate(TYPES)]})
CROSSED = [[n * 7 % 11, n * n % 13] for n in range(256)]
FLOORS = json.dumps({"rooms": [{"id": f"k{n}", "footprint": CROSSED} for n in range(4_900)]})
SIGHTINGS = [
    {"id": f"{n}", "category": "mug", "sightings": [[n, "k", "t"]] * 999} for n in range(999)
]
BOMBS = {
    "998,001 sightings": json.dumps({"rooms": [{"id": "k"}], "memory": SIGHTINGS}),
    "1,000,000 brackets": "[" * 1_000_000,
    "10,000,000 digits": "1" * 10_000_000,
    "20,000,000 lists": LISTS,
    "footprints of 1,254,400 corners": FLOORS,
    "1,400,000 pairs of rooms": PAIRS,
    "300,000 words for kinds of rooms": KINDS,
    "4,400,000 keys before spaces": SPACED,
    "half a character": '{"scene_id": "\\ud800", "rooms": []}',
}
QUICK = ("1,000,000 brackets", "20,000,000 lists", "half a character")  # the others: `make all`

ROOMS = [{"id": f"r{one}", "label": "kitchen", "floor_area": 9} for one in range(MAX_ROBOT_ROOMS)]
OBJECTS = [
    {"id": f"{one}", "category": f"thing {one} of mine", "room": f"r{one % MAX_ROBOT_ROOMS}"}
    for one in range(MAX_ROBOT_OBJECTS)
]
ROUND = [[math.cos(turn / 7), math.sin(turn / 7)] for turn in range(40)]  # crosses no line
SIMPLE = {f"room {one}": [f"thing {one} {n}" for n in range(10)] for one in range(MAX_ROBOT_ROOMS)}
TABLES = [{"id": f"t{n}", "room": "k", "category": "table"} for n in range(24_000)]
MUGS = [{"id": f"m{n}", "room": "k", "category": "mug"} for n in range(24_000)]
CUPS = [{"id": f"{n}", "room": "k", "category": "cup", "on": f"{n + 1}"} for n in range(49_000)]


def remember(things: int, sightings: int) -> list[dict[str, object]]:
    """Return a memory of different things, each seen on tables."""
    on = [[n, "k", f"t{n}"] for n in range(sightings)]
    return [{"id": f"m{n}", "category": f"q{n}w mug", "sightings": on} for n in range(things)]


PILES: dict[str, dict[str, object]] = {
    "loose mugs and a look": {
        "objects": [*TABLES, *MUGS],
        "looks": [{"room": "k", "thing": "mug", "at": "t1"}],
    },
    "a pile of cups": {
        "objects": [*TABLES[:9], *CUPS, {"id": "49000", "room": "k", "category": "cup"}]
    },
    "mugs on tables": {"objects": [*TABLES, *(m | {"on": f"t{m['id'][1:]}"} for m in MUGS)]},
    "looks for many things": {
        "objects": [{"room": "k", "category": f"q{n}w mug"} for n in range(49_000)],
        "looks": [{"room": "k", "thing": f"z{n}e mug"} for n in range(MAX_ROBOT_SOUGHT)],
    },
    "many things remembered": {"now": 9, "memory": remember(MOST_THINGS, 1)},
    "many mugs remembered": {
        "objects": TABLES,
        "now": 9,
        "memory": [one | {"category": "mug"} for one in remember(800, 60)],
        "customs": [{"thing": "mug", "at": f"t{n}"} for n in range(1000)],
    },
    "words that nobody knows, with times": {
        "now": 9,
        "objects": [{"room": "k", "category": f"q{n}w z{n}e", "time": 1} for n in range(10_000)],
        "customs": [{"thing": f"x{n}w v{n}e", "room": "k"} for n in range(1000)],
    },
    "long names": {
        "objects": [{"room": "k", "category": f"q{n}w {'abc def ' * 11}"} for n in range(10_000)]
    },
}
LARGEST = {
    "robot's graph": json.dumps({"scene_id": "a", "rooms": ROOMS, "objects": OBJECTS}),
    "footprints": json.dumps(
        {"scene_id": "a", "rooms": [{**r, "footprint": ROUND} for r in ROOMS]}
    ),
    "simplest map": json.dumps(SIMPLE),
    "crossing footprints": json.dumps(
        {"rooms": [{"id": f"{n}", "footprint": CROSSED} for n in range(780)]}
    ),
}


CASES = {  # text, what is asked then, what is said, bytes
    **{name: (text, "", "refused:", BYTES) for name, text in BOMBS.items()},
    **{name: (text, "", "answered", 10**9) for name, text in LARGEST.items()},
    **{
        name: (json.dumps({"rooms": [{"id": "k"}], **pile}), ".where('mug')", "answered", 10**9)
        for name, pile in PILES.items()
    },
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(one, marks=[] if one in QUICK else pytest.mark.heavy) for one in CASES],
)
def test_a_graph_is_answered_or_refused_in_little_memory_and_time(
    name: str, tmp_path: Path
) -> None:
    text, where, said, most = CASES[name]
    (tmp_path / "a.json").write_text(text, "utf-8")
    done = subprocess.run(
        [sys.executable, "-c", READ.format(most=most, where=where), str(tmp_path / "a.json")],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS)),
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(said)
