"""Spreadsheets: what a cell says by its kind, and what no program writes."""

from __future__ import annotations

import datetime
import io
import zipfile

import openpyxl
import pytest
from book_files import LINKS, SHARED, SHEET, make_book, pack

from bsg_data.inputs.bounds import MAX_ATTRIBUTES, MAX_CELL, MAX_NAME, MAX_NAMES, MAX_NESTING
from bsg_data.inputs.spreadsheet import SheetRow, read_sheets

ATTRIBUTES = " ".join(f"a{number}=''" for number in range(MAX_ATTRIBUTES + 1))
TAGS = [f"<n{number}/>" for number in range(MAX_NAMES)]
READABLE = b"<sst><si><r><t>Na</t></r><rPh><t>nah</t></rPh><r><t>me</t></r></si></sst>"


def change(member: str, old: str, new: str) -> bytes:
    """Return a spreadsheet in one file of which a text is another."""
    members = make_book()
    assert old.encode() in members[member]
    return pack({**members, member: members[member].replace(old.encode(), new.encode())})


def put(cells: str) -> bytes:
    """Return a spreadsheet with these cells as the XML of its only row."""
    sheet = f"<worksheet><sheetData><row>{cells}</row></sheetData></worksheet>"
    return pack({**make_book(), SHEET: sheet.encode(), SHARED: READABLE})


def rows(data: bytes) -> list[SheetRow]:
    return [row for _, row in read_sheets(data, lambda title: title == "Space")]


def test_cells_are_the_texts_that_programs_show() -> None:
    day = datetime.datetime(2026, 1, 2)
    data = pack(make_book(["a\n b ", 101, 101.0, 0.5, 10**14], [None, True, "", day, "#REF!"]))
    one = {0: "a b", 1: "101", 2: "101", 3: "0.5", 4: "1" + "0" * 14}
    assert rows(data) == [one, {1: "True", 3: "46024", 4: "#REF!"}], "a day is a number"


@pytest.mark.parametrize(
    ("cell", "text"),
    [
        ('<c t="s"><v>0</v></c>', "Name"),  # of runs, without how it is pronounced
        ('<c t="inlineStr"><is><r><t>a</t></r><r><t>b</t></r></is></c>', "ab"),
        ('<c t="str"><f>A1&amp;"x"</f><v>007</v></c>', "007"),
        ("<c><v>1E2</v></c>", "100"),
        ("<c><v>1e400</v></c>", "1e400"),
        (f"<c><v>{'9' * 5_000}</v></c>", "9" * 5_000),
        ('<x:c xmlns:x="urn:x"><x:v>5</x:v></x:c>', "5"),
    ],
)
def test_a_cell_by_its_kind(cell: str, text: str) -> None:
    assert rows(put(cell))[0] == {0: text}


def test_columns_are_counted_where_cells_have_no_names() -> None:
    data = put('<c><v>1</v></c><c/><c><v>3</v></c><c r="AB1"><v>28</v></c><c><v>29</v></c>')
    assert rows(data)[0] == {0: "1", 2: "3", 27: "28", 28: "29"}


def test_sheets_that_are_not_asked_for_are_not_opened() -> None:
    members = make_book(title="Other")
    assert rows(pack({**members, SHEET: b"no XML", SHARED: b"no XML"})) == []


def test_utf_16_is_read_and_its_document_type_is_refused() -> None:
    sheet = '<worksheet><sheetData><row><c t="str"><v>é</v></c></row></sheetData></worksheet>'
    for begin in ("", "<!DOCTYPE worksheet>"):
        text = f'<?xml version="1.0" encoding="UTF-16"?>{begin}{sheet}'.encode("utf-16")
        data = pack({**make_book(), SHEET: text})
        if not begin:
            assert rows(data) == [{0: "é"}]
            continue
        with pytest.raises(ValueError, match="has a document type; save it again"):
            rows(data)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (put('<c t="s"><v>99</v></c>'), "sheet Space, a cell: expected one of the 1 shared texts"),
        (put('<c r="A1" t="s"><v>x</v></c>'), "sheet Space, A1: expected one of the 1 shared"),
        (put(f'<c r="{"A" * 5_000}1"/>'), "sheet Space, A+: expected the name of a cell, as A1"),
        (put('<c r="CV1"><v>1</v></c>'), "sheet Space, CV1: more than 64 columns"),
        (put(f"<c><v>{'1' * (MAX_CELL + 1)}</v></c>"), "sheet Space, a cell: expected at most 32,"),
        (put("<a>" * MAX_NESTING), f"{SHEET}: nested more than 100 deep"),
        (put(f"<a b='{'c' * 2**21}'/>"), f"{SHEET}: a tag of more than 1,048,576 bytes"),
        (put(f"<a {ATTRIBUTES}/>"), f"{SHEET}: a tag of more than 100 attributes; save it again"),
        (put("".join(TAGS)), f"{SHEET}: more than 1,000 names of elements and attributes; save"),
        (put(f"<{'a' * (MAX_NAME + 1)}/>"), f"{SHEET}: a name of more than 255 letters; save it"),
        (put("</c>"), f"{SHEET}, line 1: mismatched tag; save it again"),
        (change("_rels/.rels", "officeDocument", "x"), "its _rels/.rels names no workbook"),
        (change("_rels/.rels", "xl/workbook.xml", "b" * 10**6), "there is no _rels/b{74} in it"),
        (change(LINKS, f"/{SHEET}", "a.xml"), "there is no xl/a.xml in it; save it"),
        (b"PK no zip", "File is not a zip file"),
    ],
)
def test_what_no_program_writes_is_refused_at_its_place(data: bytes, said: str) -> None:
    with pytest.raises(ValueError, match=said) as caught:
        rows(data)
    assert len(str(caught.value)) < 250


def test_a_name_counts_once_in_all_files_of_a_spreadsheet() -> None:
    half = "".join(TAGS[: MAX_NAMES // 2])
    assert rows(put(f"{half * 3}<c><v>1</v></c>")) == [{0: "1"}]
    shared = f"<sst>{''.join(TAGS[MAX_NAMES // 2 :])}</sst>".encode()
    members = {**make_book(), SHEET: f"<worksheet>{half}</worksheet>".encode(), SHARED: shared}
    with pytest.raises(ValueError, match=f"{SHEET}: more than 1,000 names"):
        rows(pack(members))


def test_a_method_of_packing_that_takes_memory_is_refused() -> None:
    with pytest.raises(ValueError, match="is not packed as spreadsheets are"):
        rows(pack(make_book(), zipfile.ZIP_LZMA))


def test_the_texts_are_those_that_another_reader_sees() -> None:
    """The shared texts of these tests are declared, or they would not be read."""
    sheet = (
        '<worksheet xmlns="{}"><sheetData><row><c t="s"><v>0</v></c></row></sheetData></worksheet>'
    )
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    data = pack({**make_book(), SHEET: sheet.format(main).encode()})
    book = openpyxl.load_workbook(io.BytesIO(data))
    assert rows(data) == [{0: "Name"}]
    assert book["Space"]["A1"].value == "Name"
