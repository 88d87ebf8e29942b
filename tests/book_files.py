"""Spreadsheets whose files a test may change before they are packed."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence

import openpyxl

SHEET, SHARED = "xl/worksheets/sheet1.xml", "xl/sharedStrings.xml"
BOOK, LINKS, TYPES = "xl/workbook.xml", "xl/_rels/workbook.xml.rels", "[Content_Types].xml"
_KIND = "http://schemas.openxmlformats.org/officeDocument/2006/relationships/sharedStrings"
_TYPE = "application/vnd.openxmlformats-officedocument.spreadsheetml.sharedStrings+xml"


def make_book(*rows: Sequence[object], title: str = "Space") -> dict[str, bytes]:
    """Return the files of a spreadsheet of one sheet, with one shared text, which is `Name`."""
    book = openpyxl.Workbook()
    book.active.title = title
    for row in rows or [["Name"]]:
        book.active.append(list(row))
    file = io.BytesIO()
    book.save(file)
    with zipfile.ZipFile(file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    assert SHARED not in members, "openpyxl writes every text into its cell"
    link = f'<Relationship Id="shared" Type="{_KIND}" Target="sharedStrings.xml"/></Relationships>'
    declared = f'<Override PartName="/{SHARED}" ContentType="{_TYPE}"/></Types>'
    members[LINKS] = members[LINKS].replace(b"</Relationships>", link.encode())
    members[TYPES] = members[TYPES].replace(b"</Types>", declared.encode())
    space = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    members[SHARED] = f'<sst xmlns="{space}"><si><t>Name</t></si></sst>'.encode()
    return members


def pack(members: Mapping[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Return the spreadsheet of its files."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method, compresslevel=1) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return file.getvalue()
