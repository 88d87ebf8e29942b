"""Small files that ask for much are errors, and the largest that are none are read in a gigabyte.

Every file is opened by the reader that a command uses, in a process of its own that may take 2 GiB
of memory beyond what its imports took, and 20 seconds of the processor.
"""

from __future__ import annotations

import gzip
import json
import math
import random
import resource
import string
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from book_files import BOOK, SHARED, SHEET, make_book
from book_files import pack as pack_book

from bsg_data.inputs.bounds import MAX_ROBOT_OBJECTS, MAX_ROBOT_ROOMS, MAX_ROBOT_SOUGHT

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are Linux's")
SECONDS, BYTES = 20, 2 * 2**30
Make = Callable[[Path], None]
READ = """
import resource, sys
from pathlib import Path
from bsg_data.errors import BSGError
from bsg_data.sources.catalogue import open_source
from {module} import {reader}
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + {most}, used + {most}))
path = Path(sys.argv[1])
try:
    {call}
    print("answered")
except BSGError as error:
    print("refused:", str(error)[:300])
"""
ROBOT = ("bsg_robot.graph.robot_json", "read_robot_graph", "read_robot_graph(path)")
ANNOTATION = (
    "bsg_data.sources.hm3d",
    "parse_annotation",
    "parse_annotation(path.read_bytes(), path=path)",
)
SOURCE = "bsg_data.sources.catalogue", "open_source"
SHEETS = (
    *SOURCE,
    "from bsg_data.scene.class_map import load_class_map as load; "
    "source = open_source('cobie', path); source.read(source.find().scenes[0], load())",
)
LAYOUT = ("bsg_data.sources.layout_files", "read_layout", "read_layout(path)")
LABELS = ("bsg_data.sources.spark_dsg", "load_label_space", "load_label_space(str(path))")
ZIP = ("bsg_data.sources.hm3d_stats", "_read_scene_lines", "_read_scene_lines(path)")
HOUSE = (
    *SOURCE,
    "from bsg_data.scene.class_map import load_class_map as load; "
    "source = open_source('mp3d', path); source.read(source.find().scenes[0], load())",
)
TABLE = (*SOURCE, "open_source('table', path).find()")
PROCTHOR = (*SOURCE, "open_source('procthor', path).find()")
CLASS_MAP = (
    "bsg_data.scene.class_map",
    "load_class_map",
    "load_class_map(str(path)).classify('chiar')",
)
WORDS = ("bsg_data.sources.room_words", "read_room_words", "read_room_words(path)")
CONFIG = ("bsg_models.zoo.config", "read_config", "read_config(path)")


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
    with gzip.open(path, "wb", compresslevel=1) as file:
        for _ in range(300):
            file.write(b"\n" * 2**20)


def make_long_word(path: Path) -> None:
    """Write some kilobytes in which 200,000 rows repeat a word of a mebibyte."""
    rows = 200_000
    word = pa.DictionaryArray.from_arrays(pa.array([0] * rows, pa.int32()), ["a" * 2**20])
    names = {name: pa.array(["a"] * rows) for name in ("scene", "room", "category")}
    pq.write_table(pa.table({**names, "connected": word}), path)


def make_long_list(path: Path) -> None:
    """Write half a kilobyte in which a row names 50 million rooms."""
    ones = pa.DictionaryArray.from_arrays(pa.array(np.zeros(50_000_000, np.int32)), ["a"])
    listed = pa.ListArray.from_arrays(pa.array([0, len(ones)], pa.int32()), ones)
    names = {name: pa.array(["a"]) for name in ("scene", "room", "category")}
    pq.write_table(pa.table({**names, "connected": listed}), path)


def make_long_words(path: Path) -> None:
    """Write a hundred kilobytes in which 20,000 words of 16,000 letters all differ."""
    words = [f"{'a' * 16_000}{number}" for number in range(20_000)]
    names = {name: ["a"] * len(words) for name in ("scene", "room")}
    table = pa.table({**names, "category": words})
    pq.write_table(table, path, compression="zstd", use_dictionary=False)


def make_lie(path: Path) -> None:
    """Write those words with an index that says that they take a byte."""
    make_long_words(path)
    said = pq.ParquetFile(path).metadata.row_group(0).total_byte_size
    true = _as_varint(said)
    lie = bytes([2 | 0x80, *[0x80] * (len(true) - 2), 0])  # 1, in as many bytes
    data = path.read_bytes()
    assert data.count(true) == 1
    path.write_bytes(data.replace(true, lie))
    assert pq.ParquetFile(path).metadata.row_group(0).total_byte_size == 1


def _as_varint(number: int) -> bytes:
    number, digits = 2 * number, []
    while number:
        digits.append(number & 127 | 128)
        number >>= 7
    return bytes([*digits[:-1], digits[-1] & 127])


LEVELS = "".join(f'<!ENTITY e{n + 1} "{f"&e{n};" * 10}">' for n in range(7))
ATTRIBUTES = " ".join(f"a{number}=''" for number in range(60_000))
ENTITIES = f'<!DOCTYPE sst [<!ENTITY e0 "aaaaaaaaaa">{LEVELS}]><sst><si><t>&e7;</t></si></sst>'


def fill_book(member: str, begin: str, repeated: str, times: int, end: str) -> Make:
    """Make a spreadsheet in which one file is a text that is repeated."""

    def make(path: Path) -> None:
        members = make_book()
        assert member in members
        filled = b"".join((begin.encode(), repeated.encode() * times, end.encode()))
        path.write_bytes(pack_book({**members, member: filled}))

    return make


def make_members(path: Path) -> None:
    """Write a zip without a member whose list names 4 million."""
    entry = struct.pack("<4s4B4HL2L5H2L", b"PK\1\2", *(20, 0) * 2, *[0] * 7, 4, *[0] * 6)
    listed = (entry + b"name") * 4_000_000
    size, ones = len(listed), 2**32 - 1
    many = struct.pack("<4sQHHLLQQQQ", b"PK\6\6", 44, 45, 45, 0, 0, 4 * 10**6, 4 * 10**6, size, 0)
    place = struct.pack("<4sLQL", b"PK\6\7", 0, size, 1)
    last = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 2**16 - 1, 2**16 - 1, ones, ones, 0)
    path.write_bytes(b"".join((listed, many, place, last)))


def text(what: str) -> Make:
    return lambda path: path.write_text(what, "utf-8") and None


def endless(path: Path) -> None:
    path.symlink_to("/dev/zero")


HEADER = "ASCII 1.1\nH - - 0 0 {V} {S} 0 {O} {C} {R} 0 {L}\n"
LINES_OF_HOUSES = {
    "L": "L {n} 0 - 4 2 0 0 0 0 8 4 3\n",
    "R": "R {n} 0 0 0 k 1 1 0 {x} {y} 0 {x}.9 {y}.9 2.5\n",
    "S": "S {n} {r}\n",
    "V": "V {n} {n} F {x} {y} 0\n",
    "C": "C {n} 0 thing#{n}\n",
    "O": "O {n} {r} {n} {x} {y} 1 1 0 0 0 1 0 1 1 1\n",
    "E": "E 0 0 1 0.5 1 1 0.5 0.5 0.75 0 1.5 1.25 0.5 0 0 0 0 0\n",
}


def house(**numbers: int) -> str:
    """Return a house with so many lines of each kind, in 1,000 rooms if it has these."""
    counted = {**dict.fromkeys("VSOCRL", 0), **numbers}
    return HEADER.format(**counted) + "".join(
        line.format(n=n, r=n % 1_000, x=n % 30, y=n % 1_000 // 30)
        for kind, line in LINES_OF_HOUSES.items()
        for n in range(numbers.get(kind, 0))
    )


def make_house(**numbers: int) -> Make:
    return lambda path: path.write_text(house(**numbers), "utf-8") and None


MAP = "raw_category,category,class\n"


def make_words(letters: int, number: int) -> Iterator[str]:
    """Yield rows of a class map whose words share no beginnings and no ends."""
    chance = random.Random(1)
    for _ in range(number):
        yield "".join(chance.choices(string.ascii_lowercase, k=letters)) + ",thing,\n"


LISTS = "[" + "[]," * 20_000_000 + "[]]"
TWICE = json.dumps({str(n): 0 for n in range(300_000)})[:-1] + ', "7": 1}'
SPACED = '{"rooms": [], "x": {' + ",".join(f'"{n:x}" :1' for n in range(4_400_000)) + "}}"
PAIRS = json.dumps({"rooms": [{"id": "a"}, {"id": "b"}], "adjacency": [["a", "b"]] * 1_400_000})
TYPES = [{f"w{n}x{m}": 0.01 for m in range(60)} for n in range(5_000)]
KINDS = json.dumps({"rooms": [{"id": f"k{n}", "room_type": one} for n, one in enumerate(TYPES)]})
CROSSED = [[n * 7 % 11, n * n % 13] for n in range(256)]
FLOORS = json.dumps({"rooms": [{"id": f"k{n}", "footprint": CROSSED} for n in range(4_900)]})
BOMBS = {
    # name: what makes the file, its name, what reads it
    "zip of line feeds": (make_zip, "a.zip", ZIP),
    "YAML of 90,000 keys": (text("".join(f"k{n}: 0\n" for n in range(90_000))), "a.yaml", LAYOUT),
    "YAML of 100,000 brackets": (text("[" * 100_000), "a.yaml", LABELS),
    "YAML of aliases": (text("a: &a [x]\nb: *a\n"), "a.yaml", LABELS),
    "JSON of 300,000 keys, one twice": (text(TWICE), "a.json", ROBOT),
    "JSON of 1,000,000 brackets": (text("[" * 1_000_000), "a.json", ROBOT),
    "JSON of 10,000,000 digits": (text("1" * 10_000_000), "a.json", ROBOT),
    "JSON of 20,000,000 lists": (text(LISTS), "a.json", ROBOT),
    "footprints of 1,254,400 corners": (text(FLOORS), "a.json", ROBOT),
    "1,400,000 pairs of rooms": (text(PAIRS), "a.json", ROBOT),
    "300,000 words for kinds of rooms": (text(KINDS), "a.json", ROBOT),
    "JSON of 4,400,000 keys before spaces": (text(SPACED), "a.json", ROBOT),
    "a long word in 200,000 rows": (make_long_word, "a.parquet", TABLE),
    "a row of 50 million rooms": (make_long_list, "a.parquet", TABLE),
    "an index that lies": (make_lie, "a.parquet", TABLE),
    **{
        f"a spreadsheet of {what}": (fill_book(*file), "a.xlsx", SHEETS)
        for what, file in {
            "entities": (SHARED, ENTITIES, "", 0, ""),
            "48 million texts": (SHARED, "<sst>", "<si/>", 48_000_000, "</sst>"),
            "a long comment": (SHARED, "<!--", "a", 200_000_000, "--><sst/>"),
            "60 million cells in a row": (SHEET, "<worksheet><row>", "<c/>", 60_000_000, ""),
            "20 million levels": (SHEET, "", "<a>", 20_000_000, ""),
            "tags of 60,000 attributes": (SHEET, "", f"<a {ATTRIBUTES}/>", 300, ""),
            "a million sheets": (BOOK, "<a>", '<sheet name="Space"/>', 10**6, "</a>"),
        }.items()
    },
    "a spreadsheet of 4 million files": (make_members, "a.xlsx", SHEETS),
    "annotation of 5,000,000 lines": (
        text("HM3D Semantic Annotations\n" * 5_000_000),
        "a",
        ANNOTATION,
    ),
    **{
        f"a house of {what}": (
            text(HEADER.format(**dict.fromkeys("VSOCRL", 0)) + said),
            "a.house",
            HOUSE,
        )
        for what, said in {
            "250 million line feeds": "\n" * 250_000_000,
            "100 million segments": "E\n" * 100_000_000,
            "a long line": "Q" * 2_000_000,
        }.items()
    },
    "a house of 20,000 rooms": (make_house(L=1, R=20_000), "a.house", HOUSE),
    "a house of 500,000 objects": (make_house(L=1, R=1_000, C=1, O=500_000), "a.house", HOUSE),
    "JSON of half a character": (text('{"scene_id": "\\ud800", "rooms": []}'), "a.json", ROBOT),
    "JSON without an end": (endless, "a.json", ROBOT),
    "240 million rows": (make_rows, "a.parquet", TABLE),
    "CSV of packed line feeds": (make_packed_lines, "a.csv.gz", TABLE),
    "CSV without an end": (endless, "a.csv", TABLE),
    "houses of packed line feeds": (make_packed_lines, "a.jsonl.gz", PROCTHOR),
    "class map of 500,000 rows": (text(MAP + "".join(make_words(4, 500_000))), "a.csv", CLASS_MAP),
    "labels of 300,000 columns": (
        text(",".join(f"c{n}" for n in range(300_000)) + ",source_label,label\n"),
        "a.csv",
        WORDS,
    ),
    "label space of 1,000,000 columns": (
        text("a," * 1_000_000 + "label,name\n" + "1\n" * 900_000),
        "a.csv",
        LABELS,
    ),
    "YAML of 1,000,000 mappings": (text("a: [" + "{}," * 1_000_000 + "]"), "a.yaml", LABELS),
    "TOML of a key of 32,000 parts": (text("a." * 32_000 + "a = 1"), "a.toml", CONFIG),
}


ROOMS = [{"id": f"r{one}", "label": "kitchen", "floor_area": 9} for one in range(MAX_ROBOT_ROOMS)]
OBJECTS = [
    {"id": f"{one}", "category": f"thing {one} of mine", "room": f"r{one % MAX_ROBOT_ROOMS}"}
    for one in range(MAX_ROBOT_OBJECTS)
]
ROUND = [[math.cos(turn / 7), math.sin(turn / 7)] for turn in range(40)]  # crosses no line
SIMPLE = {f"room {one}": [f"thing {one} {n}" for n in range(10)] for one in range(MAX_ROBOT_ROOMS)}
LINES = (f'{one},{one:06X},"thing {one}",{one % 5_000}\n' for one in range(1, 490_000))
KITCHEN = "{label: kitchen, centroid: {x: 1.0, y: 1.25, z: -2.0}, dims: {x: 2, y: 2.5, z: 4}}"
GRAPH = ("bsg_robot.graph.graph_file", "read_graph", "read_graph(path)")
FIND = ("bsg_robot.answers.seen_building", "open_graph", "open_graph(path).where('mug')")
KITCHEN_OF_PILES = {"id": "k"}
TABLES = [{"id": f"t{n}", "room": "k", "category": "table"} for n in range(24_000)]
MUGS = [{"id": f"m{n}", "room": "k", "category": "mug"} for n in range(24_000)]
CUPS = [{"id": f"{n}", "room": "k", "category": "cup", "on": f"{n + 1}"} for n in range(49_000)]
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
    "long names": {
        "objects": [{"room": "k", "category": f"q{n}w {'abc def ' * 11}"} for n in range(10_000)]
    },
}
LARGEST = {
    "robot's graph": (
        text(json.dumps({"scene_id": "a", "rooms": ROOMS, "objects": OBJECTS})),
        "a.json",
        ROBOT,
    ),
    "footprints": (
        text(json.dumps({"scene_id": "a", "rooms": [{**r, "footprint": ROUND} for r in ROOMS]})),
        "a.json",
        ROBOT,
    ),
    "simplest map": (text(json.dumps(SIMPLE)), "a.json", GRAPH),
    "crossing footprints": (
        text(json.dumps({"rooms": [{"id": f"{n}", "footprint": CROSSED} for n in range(780)]})),
        "a.json",
        GRAPH,
    ),
    **{
        name: (text(json.dumps({"rooms": [KITCHEN_OF_PILES], **said})), "a.json", FIND)
        for name, said in PILES.items()
    },
    "annotation": (text("".join(("HM3D Semantic Annotations\n", *LINES))), "a.txt", ANNOTATION),
    "house": (
        make_house(L=1, R=1_000, S=50_000, V=50_000, C=50_000, O=50_000, E=790_000),
        "a.house",
        HOUSE,
    ),
    "class map": (text(MAP + "".join(make_words(31, 49_000))), "a.csv", CLASS_MAP),
    "labels": (
        text("source_label,label\n" + "".join(f"room {n},kitchen\n" for n in range(499_000))),
        "a.csv",
        WORDS,
    ),
    "layout": (
        text("rooms:\n" + "".join(f"  room_{one}: {KITCHEN}\n" for one in range(1, 10_000))),
        "a.yaml",
        LAYOUT,
    ),
}


# Of most readers one that is made and refused within some seconds; `make all` tries the others.
QUICK = (
    *("zip of line feeds", "YAML of 90,000 keys", "YAML of aliases", "JSON of half a character"),
    *("a long word in 200,000 rows", "a spreadsheet of entities", "annotation of 5,000,000 lines"),
    *("a house of a long line", "TOML of a key of 32,000 parts"),
    *("class map of 500,000 rows", "labels of 300,000 columns"),
)


@pytest.mark.parametrize(
    "name",
    [pytest.param(one, marks=[] if one in QUICK else pytest.mark.heavy) for one in BOMBS],
)
def test_a_bomb_is_refused_in_little_memory_and_time(name: str, tmp_path: Path) -> None:
    make, file, reader = BOMBS[name]
    make(tmp_path / file)
    assert read_within_limits(tmp_path / file, reader, BYTES).startswith("refused:")


@pytest.mark.heavy
@pytest.mark.parametrize("name", LARGEST)
def test_the_largest_file_within_the_bounds_is_read(name: str, tmp_path: Path) -> None:
    make, file, reader = LARGEST[name]
    make(tmp_path / file)
    assert read_within_limits(tmp_path / file, reader, 10**9) == "answered"


def read_within_limits(path: Path, reader: tuple[str, str, str], most: int) -> str:
    """Read a file in a process, and return what it said."""
    module, name, call = reader
    code = READ.format(module=module, reader=name, call=call, most=most)
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS)),
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()
