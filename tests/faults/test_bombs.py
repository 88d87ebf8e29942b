"""Small files that ask for much: each is an error or an answer, in little memory and time.

Every file is made here and opened by the reader that a command uses, in a process of its own that
may take 2 GiB of memory beyond what its imports took, and 20 seconds of the processor.
"""

from __future__ import annotations

import gzip
import io
import json
import resource
import subprocess
import sys
import zipfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

SECONDS, BYTES = 20, 2 * 2**30
READ = """
import resource, sys
from pathlib import Path
{imports}
from bsg_data.errors import BSGError
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + {most}, used + {most}))
path = Path(sys.argv[1])
try:
    {read}
    print("answered")
except BSGError as error:
    print("refused:", str(error)[:300])
"""
ROBOT = ("from bsg_data.observation.robot_json import read_robot_graph", "read_robot_graph(path)")
LAYOUT = ("from bsg_data.sources.room_layouts import read_layout", "read_layout(path)")
LABELS = (
    "from bsg_data.sources.label_space import load_label_space",
    "load_label_space(str(path))",
)
ZIP = (
    "from bsg_data.sources.hm3d_stats import read_scene_lines",
    "read_scene_lines(path)",
)
TABLE = (
    "from bsg_data.sources.table import ObjectTable",
    "ObjectTable(path).find()",
)
WAYS = (
    "from bsg_data.observation.robot_json import read_robot_graph\n"
    "from bsg_models.robot.ways import measure_ways",
    "measure_ways(read_robot_graph(path))",
)
MANIFEST = ("from bsg_data.dataset.manifest import read_manifest", "read_manifest(path.parent)")
PROCTHOR = (
    "from bsg_data.sources.procthor import ProcTHORHouses",
    "ProcTHORHouses(path).find()",
)
CLASS_MAP = ("from bsg_data.scene.own_map import read_own_map", "read_own_map(path)")


def make_zip(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("Per_Scene_Region_Neighborhoods.csv", b"\n" * (250 * 2**20))


def make_rows(path: Path) -> None:
    """Write some kilobytes that say 240 million rows."""
    column = pa.array([0] * 2_000_000, pa.int8())
    table = pa.table({"room": column, "category": column})
    plain = {"use_dictionary": False, "write_statistics": False}  # the quickest to write
    with pq.ParquetWriter(path, table.schema, compression="zstd", **plain) as writer:
        for _ in range(120):
            writer.write_table(table)


def make_packed_lines(path: Path) -> None:
    block = b"\n" * 2**20
    buffer = io.BytesIO()
    with gzip.open(buffer, "wb", compresslevel=1) as file:
        for _ in range(300):
            file.write(block)
    path.write_bytes(buffer.getvalue())


def make_rooms(path: Path, *, joined: list[list[str]]) -> None:
    rooms = [{"id": str(n), "position": [n % 40, n // 40, 0]} for n in range(2000)]
    graph = {"scene_id": "t", "rooms": rooms, "adjacency": joined}
    path.write_text(json.dumps(graph), "utf-8")


def text(what: str) -> Callable[[Path], None]:
    return lambda path: path.write_text(what, "utf-8") and None


def link(target: str) -> Callable[[Path], None]:
    return lambda path: path.symlink_to(target)


TWICE = json.dumps({str(n): 0 for n in range(300_000)})[:-1] + ', "7": 1}'
BOMBS = {
    # name: what makes the file, its name, what reads it
    "zip of line feeds": (make_zip, "a.zip", ZIP),
    "zip without an end": (link("/dev/zero"), "a.zip", ZIP),
    "YAML of 100,000 keys": (text("".join(f"k{n}: 0\n" for n in range(90_000))), "a.yaml", LAYOUT),
    "YAML of 100,000 brackets": (text("[" * 100_000), "a.yaml", LABELS),
    "YAML of aliases": (text("a: &a [x]\nb: *a\n"), "a.yaml", LABELS),
    "JSON of 300,000 keys, one twice": (text(TWICE), "a.json", ROBOT),
    "JSON of 1,000,000 brackets": (text("[" * 1_000_000), "a.json", ROBOT),
    "JSON of 10,000,000 digits": (text("1" * 10_000_000), "a.json", ROBOT),
    "JSON that is 5": (text("5"), "a.json", ROBOT),
    "JSON that is null": (text("null"), "a.json", ROBOT),
    "JSON of half a character": (text('{"scene_id": "\\ud800", "rooms": []}'), "a.json", ROBOT),
    "JSON without an end": (link("/dev/zero"), "a.json", ROBOT),
    "manifest of brackets": (text('{"a":' * 100_000), "dataset.json", MANIFEST),
    "manifest of digits": (text('{"a":' + "1" * 5_000 + "}"), "dataset.json", MANIFEST),
    "240 million rows": (make_rows, "a.parquet", TABLE),
    "CSV of packed line feeds": (make_packed_lines, "a.csv.gz", TABLE),
    "CSV without an end": (link("/dev/zero"), "a.csv", TABLE),
    "houses of packed line feeds": (make_packed_lines, "a.jsonl.gz", PROCTHOR),
    "class map without an end": (link("/dev/zero"), "a.csv", CLASS_MAP),
}
LARGE = {
    # what is answered: as many rooms as ways are measured between
    "2,000 rooms, two of them joined": (partial(make_rooms, joined=[["0", "1"]]), "a.json", WAYS),
    "2,000 rooms, none joined": (partial(make_rooms, joined=[]), "a.json", WAYS),
}


def limit_seconds() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))


def open_bomb(name: str, folder: Path) -> str:
    """Return what is wrong with how a file is read; nothing if it is refused in a line.

    Of a file that is only large, nothing is wrong if there is an answer.
    """
    make, file, (imports, read) = {**BOMBS, **LARGE}[name]
    path = folder / file
    make(path)
    code = READ.format(imports=imports, read=read, most=BYTES)
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=limit_seconds,
    )
    expected = "answered" if name in LARGE else "refused:"
    ended = done.returncode == 0 and done.stdout.startswith(expected) and not done.stderr
    return "" if ended else f"{name}: exit {done.returncode}, {(done.stderr or done.stdout)[-200:]}"


def try_bombs(names: Sequence[str], folder: Path) -> None:
    misses = []
    for number, name in enumerate(names):
        (folder / str(number)).mkdir()
        misses += filter(None, [open_bomb(name, folder / str(number))])
    assert not misses


pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are Linux's")


def test_every_bomb_is_refused_in_little_memory_and_time(tmp_path: Path, full: bool) -> None:
    try_bombs(list(BOMBS) if full else list(BOMBS)[::4], tmp_path)


def test_large_graphs_are_answered_in_little_memory_and_time(tmp_path: Path) -> None:
    try_bombs(list(LARGE), tmp_path)
