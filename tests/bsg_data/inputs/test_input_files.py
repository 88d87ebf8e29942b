"""Files are read packed or not, and whatever is wrong with one is one error."""

from __future__ import annotations

import gzip
import os
import zipfile
from contextlib import suppress
from datetime import date
from pathlib import Path

import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import DatasetError, SourceError
from bsg_data.inputs.bounded_file import read_bytes, read_member
from bsg_data.inputs.parquet import refusing_damage
from bsg_data.inputs.spreadsheet import read_sheets
from bsg_data.inputs.text_table import parse_csv, read_csv


def test_reading_is_bounded_where_asked_packed_or_not(tmp_path: Path) -> None:
    plain, packed = tmp_path / "a.txt", tmp_path / "a.txt.gz"
    plain.write_bytes(b"x" * 100)
    packed.write_bytes(gzip.compress(b"x" * 100))
    assert read_bytes(plain) == read_bytes(packed, 100) == b"x" * 100
    for path in (plain, packed):
        with refuses(SourceError, "file-too-large", path):
            read_bytes(path, 99)


@pytest.mark.parametrize("name", ["none", "folder", "cut.gz", "plain.gz"])
def test_whatever_cannot_be_read_is_one_error_of_the_readers_choice(
    tmp_path: Path, name: str
) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "cut.gz").write_bytes(gzip.compress(os.urandom(99))[:-9])
    (tmp_path / "plain.gz").write_bytes(b"plain")
    with refuses(DatasetError, "file-unreadable", tmp_path / name):
        read_bytes(tmp_path / name, error=DatasetError)


def write_zip(path: Path, **members: bytes) -> bytes:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in members.items():
            file.writestr(name, data)
    return path.read_bytes()


def test_a_member_of_a_zip_is_there_once(tmp_path: Path) -> None:
    path = tmp_path / "a.zip"
    data = write_zip(path, **{"other": b"", "in/here/table.csv": b"words"})
    assert read_member(path, "table.csv") == b"words"
    for members in ({"a/table.csv": b"1", "b/table.csv": b"2"}, {"x": b""}):
        write_zip(path, **members)
        with refuses(SourceError, "zip-member-missing", path):
            read_member(path, "table.csv")
    for damaged in (b"", b"PK", data[: len(data) // 2], data.replace(b"PK\x03\x04", b"PK\x03\x05")):
        path.write_bytes(damaged)
        with refuses(SourceError, "file-unreadable", path):
            read_member(path, "table.csv")


@given(st.integers(0, 10**6), st.integers(0, 255), st.integers(0, 10**6))
def test_damage_of_parquet_is_one_error(
    tmp_path_factory: pytest.TempPathFactory, place: int, byte: int, end: int
) -> None:
    path = tmp_path_factory.mktemp("a") / "a.parquet"
    pq.write_table(pa.table({"name": ["chair", None], "list": [[1.0], []]}), path)
    data = bytearray(path.read_bytes())
    data[place % len(data)] = byte
    for content in (bytes(data), bytes(data[: end % len(data)])):
        path.write_bytes(content)
        with suppress(SourceError), refusing_damage(path), pq.ParquetFile(path) as file:
            file.read(use_threads=False).validate(full=True)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b'a\n"b', "line 2: a quote is not closed"),
        (b"a\n\xff", "line 2: byte 0xFF is not UTF-8"),
        ("a\n".encode("utf-16") + b"\0", "not UTF-16"),
    ],
)
def test_a_table_of_text_is_refused_at_its_line(data: bytes, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        list(parse_csv(data))


def test_a_table_of_text_has_the_last_line_of_each_row(tmp_path: Path) -> None:
    rows = [(1, ["é", "b"]), (3, ["1\n2", "3"]), (4, []), (5, ["4", "5"])]
    text = 'é\tb\n"1\n2"\t3\n\n4\t5'
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        data = text.encode(encoding)
        assert [*parse_csv(data, separator="\t")] == rows
        (tmp_path / "t.tsv.gz").write_bytes(gzip.compress(data))
        assert [*read_csv(tmp_path / "t.tsv.gz")] == [row for row in rows if row[1]]


def test_a_cell_is_the_text_that_programs_show(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    book.active.append(["Name", "a\n b", "007", 1e2, 0.5, True, date(2026, 1, 2), None, "#REF!"])
    book.create_sheet("other").append(["x"])
    book.save(tmp_path / "a.xlsx")
    data = (tmp_path / "a.xlsx").read_bytes()
    texts = ["Name", "a b", "007", "100", "0.5", "True", "2026-01-02"]
    ((title, row),) = read_sheets(data, lambda title: title == "Sheet")
    assert (title, row) == ("Sheet", dict(enumerate(texts)))
    for cut in (b"PK", data[: len(data) // 2]):
        with pytest.raises(ValueError, match=r"."):
            list(read_sheets(cut, lambda title: True))
