"""The zip of HM3DSem's statistics: `bsg_data.sources.hm3d_stats`."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

from bsg_data.sources.hm3d_stats import HEADER, MEMBER, HM3DStatistics
from fuzz.target import Target, load_map, put, read_source

_ROWS = f"""{",".join(HEADER)},
00001-abcdefghi01,-1,1,1,lamp_9
00001-abcdefghi01,0,2,3,chair_1:chair_2:kitchen table_3
00802-abcdefghi02,4,1,1,"a, b_7"
00802-abcdefghi02,5,0,0,
"""


def pack(data: bytes, *, member: str = MEMBER) -> bytes:
    """Return a zip with one member, not compressed: its bytes stand in it as they are."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(zipfile.ZipInfo(member), data)
    return file.getvalue()


def seeds() -> dict[str, bytes]:
    """Return a table, which is packed when it is read, and packed ones."""
    text = _ROWS.encode()
    small = text[: text.index(b"\n", text.index(b"lamp")) + 1]
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo("__MACOSX/x"), b"")
        info = zipfile.ZipInfo(f"HM3D/{MEMBER}")
        info.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(info, small)
    return {"table": text, "stored": pack(small), "deflated": file.getvalue()}


def read(folder: Path, data: bytes) -> object:
    """Read a zip, or the zip of a table, whose checksum is right."""
    packed = data if data[:1] == b"P" else pack(data)
    return read_source(HM3DStatistics(put(folder, "HM3DSem-v0.2.zip", packed)), load_map())


TARGET = Target(
    name="statistics-zip",
    read=read,
    seeds=seeds,
    words=(*HEADER, "../secret", ":", "_", "PK\x01\x02", "PK\x05\x06", "\r\n", '"', "00001-a"),
    most=800,
)
