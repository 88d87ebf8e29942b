"""Files are read packed or not, and whatever is wrong with one is one error."""

from __future__ import annotations

import gzip
import os
import zipfile
from contextlib import suppress
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
from bsg_data.inputs.spreadsheet import _SheetRow, read_sheets
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
    with refuses(DatasetError, "file-unreadable", tmp_path / name, golden=False):
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
        with refuses(SourceError, "file-unreadable", path, golden=False):
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
    ("data", "said"),
    [
        (b'a\n"b', "line 2: a quote is not closed"),
        (b"a\n\xff", "line 2: byte 0xFF is not UTF-8"),
        ("a\n".encode("utf-16") + b"\0", "not UTF-16"),
    ],
)
def test_a_table_of_text_is_refused_at_its_line(data: bytes, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        list(parse_csv(data))


def test_a_table_of_text_has_the_last_line_of_each_row(tmp_path: Path) -> None:
    rows = [(1, ["é", "b"]), (3, ["1\n2", "3"]), (4, []), (5, ["4", "5"])]
    text = 'é\tb\n"1\n2"\t3\n\n4\t5'
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        data = text.encode(encoding)
        assert [*parse_csv(data, separator="\t")] == rows
        (tmp_path / "t.tsv.gz").write_bytes(gzip.compress(data))
        assert [*read_csv(tmp_path / "t.tsv.gz")] == [row for row in rows if row[1]]


_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_LINK = (
    '<Relationship Id="t" Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships'
    '/sharedStrings" Target="sharedStrings.xml"/></Relationships>'
)
_SHARED = (
    f'<sst xmlns="{_MAIN}"><si><r><t>Na</t></r><rPh sb="0" eb="1"><t>nah</t></rPh><r><t>me</t></r>'
    "</si></sst>"
)


def read_cells(path: Path, cells: str) -> list[_SheetRow]:
    """Return the rows of a workbook with these cells, and with one text that cells share."""
    book = openpyxl.Workbook()
    book.active.title = "Space"
    book.save(path)
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    sheet = f'<worksheet xmlns="{_MAIN}"><sheetData><row>{cells}</row></sheetData></worksheet>'
    parts |= {"xl/worksheets/sheet1.xml": sheet.encode(), "xl/sharedStrings.xml": _SHARED.encode()}
    links = "xl/_rels/workbook.xml.rels"
    parts[links] = parts[links].replace(b"</Relationships>", _LINK.encode())
    data = write_zip(path, **parts)
    return [row for _, row in read_sheets(data, lambda title: title == "Space")]


CELLS = {
    '<c t="s"><v>0</v></c>': "Name",  # of runs, without how it is pronounced
    '<c t="inlineStr"><is><t>a\n b</t></is></c>': "a b",
    '<c t="str"><f>A1&amp;"x"</f><v>007</v></c>': "007",
    "<c><v>1E2</v></c>": "100",
    "<c><v>0.5</v></c>": "0.5",
    '<c t="b"><v>1</v></c>': "True",
    '<c t="d"><v>2026-01-02</v></c>': "2026-01-02",
}


def test_a_cell_is_the_text_that_programs_show(tmp_path: Path) -> None:
    cells = "".join([*CELLS, '<c t="e"><v>#REF!</v></c>'])
    assert read_cells(tmp_path / "a.xlsx", cells) == [dict(enumerate(CELLS.values()))]


@pytest.mark.parametrize("cell", ['<c t="s"><v>99</v></c>', "</c>"])
def test_a_damaged_sheet_is_a_value_error(tmp_path: Path, cell: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        read_cells(tmp_path / "a.xlsx", cell)
