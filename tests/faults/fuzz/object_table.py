"""Tables of objects as CSV: `bsg_data.sources.table`."""

from __future__ import annotations

import gzip
from pathlib import Path

from bsg_data.sources.table import ObjectTable
from fuzz.target import Target, load_map, put, read_source

_TABLE = b"""scene,room,category,room_label,floor,floor_area,connected,x,y,z,mine
a,kitchen,chair,kitchen,0,12.5,hall,1,2,0.5,
a,hall,,hallway,0,,kitchen,,,,7
a,,lamp,,,,,,,,
b,1,"a ""b"", c",,,,,,,,
"""


def seeds() -> dict[str, bytes]:
    """Return a table with commas, with tabs, with boxes, and packed."""
    ends = ",".join(f"box_{end}_{axis}" for end in ("min", "max") for axis in "xyz")
    boxes = f"scene,room,category,{ends}\na,1,chair,0,0,0,1,1,1\na,2,bed,,,,,,\n".encode()
    tabs = b"scene\troom\tcategory\na\t1\tchair\n"
    return {"all": _TABLE, "boxes": boxes, "tabs": tabs, "packed": gzip.compress(tabs, mtime=0)}


def read(folder: Path, data: bytes) -> object:
    """Read a table, whose suffix is that of what it looks like."""
    packed = data[:1] == b"\x1f"
    suffix = ".tsv.gz" if packed else ".tsv" if b"\t" in data[:20] else ".csv"
    return read_source(ObjectTable(put(folder, suffix, data)), load_map())


TARGET = Target(
    name="object-table",
    read=read,
    seeds=seeds,
    words=(
        "scene",
        "connected",
        "floor_area",
        "1e308",
        "nan",
        ";",
        '"',
        "\r\n",
        "\t",
        "../x",
        "-0",
    ),
    most=500,
)
