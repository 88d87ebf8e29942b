"""Whatever is wrong with a file is one error: all sources in one table of (source, bytes, code)."""

from __future__ import annotations

import gzip
import io
import json
import zipfile
from pathlib import Path
from typing import Any

import pytest
from house_files import HOUSE, change
from refusals import refuses

from bsg_data.errors import SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.catalogue import SOURCES, open_source
from bsg_data.sources.hm3d_stats import HEADER, MEMBER

Row = tuple[str, str, bytes, str]  # source, name of the file, its bytes, code

_ROOMS = [{"id": "room|4", "roomType": "Bedroom"}]
_FLOOR = [{"x": x, "y": 0, "z": z} for x, z in ((0, 0), (2, 0), (2, 2))]


def _house(**changes: Any) -> bytes:
    rooms = [{**_ROOMS[0], "floorPolygon": _FLOOR}]
    return json.dumps({"rooms": rooms, **changes}).encode() + b"\n"


def _floor(*corners: tuple[float, float]) -> bytes:
    polygon = [{"x": x, "y": 0, "z": z} for x, z in corners]
    return _house(rooms=[{**_ROOMS[0], "floorPolygon": polygon}])


def _zip(*rows: str) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(MEMBER, "\n".join([",".join(HEADER), *rows]))
    return file.getvalue()


_COLUMNS = (
    "scene,room,category,room_label,floor,floor_area,connected,count,x,y,z,"
    "box_min_x,box_min_y,box_min_z,box_max_x,box_max_y,box_max_z"
)
_FIRST = "a,0,bed,bath,,,,,,,,,,,,,"


def _table(row: str) -> bytes:
    return f"{_COLUMNS}\n{_FIRST}\n{row}\n".encode()


def _count(place: int) -> str:
    """Return the header of the house with another number at a place."""
    header = HOUSE.split("\n")[1].split()
    return " ".join([*header[:place], "7", *header[place + 1 :]])


LISTS: list[Row] = [
    ("behavior", "list.json", b'{"scenes": {"gym": {"gym_0": {"bed": 1}}}}', "model-malformed"),
    ("behavior", "list.json", b"", "json-malformed"),
    ("behavior", "list.json", b'{"scenes": {}}', "listing-malformed"),
    ("behavior", "list.json", b'{"scenes": {"a": {"k_0": {"b-x": 1.5}}}}', "listing-malformed"),
    ("behavior", "list.json", b'{"scenes": {"../a": {"k_0": {}}}}', "listing-malformed"),
    ("s3dis", "list.json", b'{"a": 1}', "listing-malformed"),
    ("s3dis", "list.json", b'["chair_1_office"]', "listing-malformed"),
    ("s3dis", "list.json", b"[1]", "listing-malformed"),
    ("cobie", "b.xlsx", b"PK no zip", "spreadsheet-malformed"),
    ("hm3d-stats", "HM3DSem-v0.2.zip", _zip(), "source-empty"),
    ("spark-dsg", "dsg.json", b"{'nodes': []}", "json-malformed"),
    ("spark-dsg", "dsg.json", b'{"nodes": [], "edges": []}', "dsg-malformed"),
]
STATISTICS: list[Row] = [
    ("hm3d-stats", "s.zip", _zip("s,7,1,1,bed_9", row), "line-malformed")
    for row in (
        *("s,0,1,2,chair_1", "s,0,1,1,chair", "s,zero,1,1,chair_1", "s,1,1,1,chair_9"),
        *("s,7,1,1,chair_1", 's,0,1,1,"chair_1'),
    )
]
HOUSES: list[Row] = [
    ("procthor", "plain.jsonl.gz", b"{}\n", "file-unreadable"),
    ("procthor", "cut.jsonl.gz", gzip.compress(b"{}\n" * 4000, mtime=0)[:-20], "file-unreadable"),
    ("procthor", "open.json", b"[[]", "json-malformed"),
    ("procthor", "after.json", b"[{}] {}", "json-malformed"),
    ("procthor", "half.json", b'[{}, {"a": 1', "json-malformed"),
    ("procthor", "bad.json", b'[{"rooms": \xff}]', "json-malformed"),
    ("procthor", "empty.jsonl", b"\n\n", "source-empty"),
    ("procthor", "h.jsonl", _floor((0, 0), (1e9, 0), (2, 0)), "house-malformed"),
    ("procthor", "h.jsonl", _house(objects=[{"id": "4|0", "assetId": "B"}]), "house-malformed"),
    ("procthor", "h.jsonl", b'{"rooms": NaN}', "json-malformed"),
    ("mp3d", "a.house.gz", b"ASCII 1.1", "file-unreadable"),
    ("mp3d", "a.house", b"ASCII 1.1\nC  0  1 caf\xe9", "line-malformed"),
    ("mp3d", "a.house", b"", "line-malformed"),
    ("mp3d", "house.txt", b"", "source-empty"),
    *(
        ("mp3d", "a.house", change(line, other).encode(), "line-malformed")
        for line, other in (
            ("ASCII", "ASCII 1.0"),
            ("H  -", "-"),
            *(("H  -", _count(at)) for at in (8, 9, 10, 12)),  # O, C, R and L
            ("L  0", "H  -  -  1"),
            ("R  1", "R  2 0  0 0  b"),
            ("R  1", "R  1 0  0 0  b  6 2 0  4.1 0 nan  8 4 2.5"),
            ("R  1", "R  1 0  0 0  b  6 2 0  4.1 0 0.1  8 4 1e9"),
            ("R  1", "R  1 0  0 0  b  6 2 0  9 0 0.1  8 4 2"),
            ("S  1", "S  1 7  0"),
            ("V  9", "V  9 5  F  0 0 0"),
            ("O  0", "O  0 0 1  1 1 0.25  1 0 0  0 1 0  0.5 x 0.25"),
            ("O  0", "O  0 0 1  1 1 0.25  9 0 0  0 1 0  1 1 1"),
            ("E  0", "X  0"),
        )
    ),
]
TABLES: list[Row] = [
    ("table", "t.txt", b"", "table-suffix"),
    ("table", "t.parquet", b"PAR1", "parquet-unreadable"),
    *(
        ("table", "objects.csv", text, code)
        for text, code in (
            (b"", "column-missing"),
            (b"scene,room,category,x,y\n", "column-missing"),
            (b"scene\troom\tcategory\na\thall\tbed\n", "column-missing"),
            (b"scene_id,room,category\na,1,bed\n", "column-missing"),
            (b"Scene,SCENE,room,category\na,a,1,bed\n", "column-twice"),
            (b"scene,room,category\n", "source-empty"),
            (b"scene,room,category\n,,\n", "source-empty"),
            (b"scene,room,category,count\na,,bed,0\n", "source-empty"),
            (b"scene,room,category\na,1\n", "row-ragged"),
            (b"scene,room,category\na,,\n", "row-malformed"),
            (b'scene,room,category\na,1,"bed\n', "csv-malformed"),
            ("scene,room,category\n1,1,1\na,Küche,Herd\n".encode("cp1252"), "csv-malformed"),
        )
    ),
    *(
        ("table", "objects.csv", _table(row), "row-malformed")
        for row in (
            "../up,1,bed,,,,,,,,,,,,,,",
            "NULL,1,bed,,,,,,,,,,,,,,",
            "a,1,bed,,1.5,,,,,,,,,,,,",
            "a,,bed,,0,,,,,,,,,,,,",
            f"a,1,{'b' * 201},,,,,,,,,,,,,,",
            "a,kit\x07chen,bed,,,,,,,,,,,,,,",
            "a,1,bed,,,,2;\x85 3\x9b,,,,,,,,,,",
            "a,1,bed,,,,,-1,,,,,,,,,",
            "a,1,bed,,,,,9e9,,,,,,,,,",
            "a,1,,,,,,2,,,,,,,,,",
            "a,1,bed,,,,,3,1,1,1,,,,,,",
            "a,1,bed,,,,,,nan,2,1,,,,,,",
            "a,1,bed,,,,,,,,,0,0,1,1,1,0",
            "a,1,bed,,,,,,2,0,0,0,0,0,1,1,1",
        )
    ),
    ("table", "objects.csv", _table("a,1,bed,,,,1,,,,,,,,,,"), "room-unknown"),
    ("table", "objects.csv", _table("a,1,bed,,,,2,,,,,,,,,,"), "room-unknown"),
    ("table", "objects.csv", _table("a,0,bed,kitchen,,,,,,,,,,,,,"), "rows-disagree"),
]


@pytest.mark.parametrize(
    ("source", "name", "data", "code"), [*LISTS, *STATISTICS, *HOUSES, *TABLES]
)
def test_a_bad_input_is_one_error_that_names_its_place(
    tmp_path: Path, source: str, name: str, data: bytes, code: str
) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    opened = open_source(source, path)
    class_map = load_class_map(SOURCES[source].class_map)
    with refuses(SourceError, code) as caught:
        for ref in opened.find().scenes:
            opened.read(ref, class_map)
    lines = {"line-malformed", "row-malformed", "row-ragged", "rows-disagree", "room-unknown"}
    assert name in str(caught.value)
    assert (", line " in str(caught.value.where)) == (code in lines)
