"""Read the texts of an Excel spreadsheet (`.xlsx`): a zip of XML (ISO/IEC 29500-1, clause 18).

Only the XML of the sheets that are asked for, of the texts that cells share and of the lists that
lead there is opened. Its elements and their names are counted while they are parsed: the parser
keeps every name. Any fault is one ValueError.
"""

from __future__ import annotations

import io
import math
import posixpath
import re
import zipfile
from collections.abc import Callable, Iterator
from typing import IO
from xml.parsers import expat

from bsg_data.inputs.bounded_file import ZIP_DAMAGE
from bsg_data.inputs.bounds import (
    COBIE,
    MAX_ATTRIBUTES,
    MAX_CELL,
    MAX_CELLS,
    MAX_ELEMENTS,
    MAX_LETTERS,
    MAX_MEMBERS,
    MAX_NAME,
    MAX_NAMES,
    MAX_NESTING,
    MAX_SHEET_COLUMNS,
    MAX_SHEET_ROWS,
    MAX_TAG,
    SHEET_LIST,
)
from bsg_data.words.shown import SHOWN

SheetRow = dict[int, str]  # number of the column, from 0 → text, of the cells that are not empty
_Attributes = dict[str, str]
_BLOCK = 2**16  # bytes that are parsed at a time
_ENTRY = b"PK\x01\x02"  # begins each entry of the list of a zip's members
_CELL = re.compile(r"([A-Z]{1,3})[0-9]{1,7}")
_AGAIN = "save it again from a spreadsheet program"


def read_sheets(data: bytes, is_read: Callable[[str], bool]) -> Iterator[tuple[str, SheetRow]]:
    """Yield the rows that are not empty of the sheets whose titles are read, each with the title.

    Numbers are written without `.0`, and spaces and line breaks of texts are single spaces.
    """
    if (members := data.count(_ENTRY)) > MAX_MEMBERS:
        raise ValueError(f"expected at most {MAX_MEMBERS:,} files in it, found {members:,}")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            yield from _Book(archive).read(is_read)
    except ValueError:
        raise
    except ZIP_DAMAGE as error:
        raise ValueError(str(error)[:SHOWN] or type(error).__name__) from error


class _Book:
    """A spreadsheet, and how many elements of it were parsed, of which names."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        unpacked = sum(member.file_size for member in archive.infolist())
        if unpacked > COBIE:
            raise ValueError(f"it unpacks to {unpacked:,} bytes; at most {COBIE:,} are read")
        self._archive, self._elements = archive, 0
        self._names: dict[str, str] = {}  # of elements and attributes, which the parsers add
        self._known = 0  # of these names, that are within their bounds

    def read(self, is_read: Callable[[str], bool]) -> Iterator[tuple[str, SheetRow]]:
        """Yield the rows of the sheets whose titles are read."""
        roots = self._list_parts("")
        book = next((part for kind, part in roots.values() if kind == "officeDocument"), None)
        if book is None:
            raise ValueError(f"its _rels/.rels names no workbook; {_AGAIN}")
        parts = self._list_parts(book)
        titles = {  # the file of a sheet → its title; each is read once
            parts[sheet["id"]][1]: sheet.get("name", "")
            for sheet in self._list_elements(book, "sheet")
            if is_read(sheet.get("name", "")) and sheet.get("id") in parts
        }
        strings = next((part for kind, part in parts.values() if kind == "sharedStrings"), None)
        shared = _Texts("si", "t", "a text that cells share")
        if strings is not None and titles:
            for _ in self._parse(strings, shared):
                pass
        cells = _Cells(shared.found)
        for part, title in titles.items():
            cells.open(title)
            for _ in self._parse(part, cells):
                yield from ((title, row) for row in cells.take())

    def _list_parts(self, part: str) -> dict[str, tuple[str, str]]:
        """Return what a file of the archive refers to: id → the last word of its kind, its name."""
        folder, name = posixpath.split(part)
        found = self._list_elements(posixpath.join(folder, "_rels", f"{name}.rels"), "Relationship")
        return {
            one.get("Id", ""): (
                one.get("Type", "").rpartition("/")[2],
                posixpath.normpath(posixpath.join("/", folder, one.get("Target", "")))[1:],
            )
            for one in found
        }

    def _list_elements(self, part: str, tag: str) -> list[_Attributes]:
        """Return the attributes of the elements with a tag, without their namespaces."""
        if part in self._archive.namelist() and self._archive.getinfo(part).file_size > SHEET_LIST:
            raise ValueError(f"{part[:SHOWN]}: expected at most {SHEET_LIST:,} bytes, found more")
        listed = _Listing(tag)
        for _ in self._parse(part, listed):
            pass
        return listed.found

    def _parse(self, part: str, reader: _Reader) -> Iterator[None]:
        """Parse a file of the archive, and stop after each of its blocks."""
        shown = part[:SHOWN]
        parser = expat.ParserCreate(intern=self._names)
        parser.buffer_text, parser.buffer_size = True, _BLOCK
        depth, fed = 0, 0

        def begin(tag: str, attributes: _Attributes) -> None:
            nonlocal depth
            depth += 1
            self._elements += 1
            if depth > MAX_NESTING:
                raise ValueError(f"{shown}: nested more than {MAX_NESTING} deep")
            if self._elements > MAX_ELEMENTS:
                raise ValueError(f"{shown}: more than {MAX_ELEMENTS:,} elements up to here")
            if len(attributes) > MAX_ATTRIBUTES:
                raise ValueError(
                    f"{shown}: a tag of more than {MAX_ATTRIBUTES} attributes; {_AGAIN}"
                )
            if len(self._names) > self._known:
                self._check_names(shown)
            reader.begin(tag.rpartition(":")[2], attributes)

        def end(tag: str) -> None:
            nonlocal depth
            depth -= 1
            reader.end(tag.rpartition(":")[2])

        def refuse(*_: object) -> None:
            """Refuse a document type, which no spreadsheet has: its entities multiply texts."""
            raise ValueError(f"{shown} has a document type; {_AGAIN}")

        parser.StartElementHandler, parser.EndElementHandler = begin, end
        parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = reader.hear, refuse
        try:
            with self._open(part) as file:
                while block := file.read(_BLOCK):
                    parser.Parse(block, False)
                    fed += len(block)
                    if fed - parser.CurrentByteIndex > MAX_TAG:
                        raise ValueError(f"{shown}: a tag of more than {MAX_TAG:,} bytes")
                    yield
                parser.Parse(b"", True)
                yield
        except expat.ExpatError as error:
            what = expat.ErrorString(error.code)
            raise ValueError(f"{shown}, line {error.lineno}: {what}; {_AGAIN}") from error

    def _check_names(self, shown: str) -> None:
        """Refuse new names of elements and attributes, if they are too many or too long."""
        if len(self._names) > MAX_NAMES:
            raise ValueError(
                f"{shown}: more than {MAX_NAMES:,} names of elements and attributes; {_AGAIN}"
            )
        if max(map(len, self._names)) > MAX_NAME:
            raise ValueError(f"{shown}: a name of more than {MAX_NAME} letters; {_AGAIN}")
        self._known = len(self._names)

    def _open(self, part: str) -> IO[bytes]:
        if part not in self._archive.NameToInfo:
            raise ValueError(f"there is no {part[:SHOWN]} in it; {_AGAIN}")
        member = self._archive.getinfo(part)
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{part[:SHOWN]} is not packed as spreadsheets are; {_AGAIN}")
        return self._archive.open(member)


class _Reader:
    """Takes up one XML file, element by element."""

    def begin(self, tag: str, attributes: _Attributes) -> None:
        """Take up the begin of an element."""

    def end(self, tag: str) -> None:
        """Take up the end of an element."""

    def hear(self, text: str) -> None:
        """Take up a piece of text."""


class _Listing(_Reader):
    """Collects the attributes of the elements with a tag, without their namespaces."""

    def __init__(self, tag: str) -> None:
        self._tag, self.found = tag, list[_Attributes]()

    def begin(self, tag: str, attributes: _Attributes) -> None:
        if tag == self._tag:
            self.found.append({key.rpartition(":")[2]: said for key, said in attributes.items()})


class _Texts(_Reader):
    """Collects the text of each element with a tag: what stands in a tag within it.

    How Japanese is pronounced, in `rPh`, is left out.
    """

    def __init__(self, tag: str, within: str, where: str) -> None:
        self._tag, self._within, self._where = tag, within, where
        self._pieces: list[str] = []
        self._length = self._letters = 0
        self._is_heard = self._is_spoken = False
        self.found: list[str] = []

    def begin(self, tag: str, attributes: _Attributes) -> None:
        if tag == self._within:
            self._is_heard = not self._is_spoken
        elif tag == "rPh":
            self._is_spoken = True
        elif tag == self._tag:
            self._pieces, self._length = [], 0

    def hear(self, text: str) -> None:
        if self._is_heard:
            self._length += len(text)
            if self._length > MAX_CELL:
                raise ValueError(f"{self._where}: expected at most {MAX_CELL:,} letters")
            self._pieces.append(text)

    def end(self, tag: str) -> None:
        if tag == self._within:
            self._is_heard = False
        elif tag == "rPh":
            self._is_spoken = False
        elif tag == self._tag:
            self.close(" ".join("".join(self._pieces).split()))

    def close(self, text: str) -> None:
        """Keep the text of an element that ends."""
        self.count(text)
        self.found.append(text)

    def count(self, text: str) -> None:
        """Count the letters of a text; many cells may have one text of the file."""
        self._letters += len(text)
        if self._letters > MAX_LETTERS:
            raise ValueError(f"{self._where}: more than {MAX_LETTERS:,} letters up to here")


class _Cells(_Texts):
    """Collects the rows of sheets, one sheet after the other."""

    def __init__(self, shared: list[str]) -> None:
        super().__init__("c", "v", "")
        self._shared, self._cells, self._rows = shared, 0, 0
        self._title = self._kind = ""
        self._column = -1
        self._row: SheetRow = {}
        self._taken: list[SheetRow] = []

    def open(self, title: str) -> None:
        """Begin a sheet."""
        self._title, self._rows = " ".join(title.split())[:SHOWN], 0

    def take(self) -> Iterator[SheetRow]:
        """Yield the rows that ended since it was called."""
        yield from self._taken
        self._taken.clear()

    def begin(self, tag: str, attributes: _Attributes) -> None:
        if tag == "row":
            self._row, self._column = {}, -1
        elif tag == "c":
            cell, self._kind = attributes.get("r", ""), attributes.get("t", "n")
            self._where = f"sheet {self._title}, {cell[:SHOWN] or 'a cell'}"
            self._within = "t" if self._kind == "inlineStr" else "v"
            self._column = self._number(cell) if cell else self._column + 1
        super().begin(tag, attributes)

    def end(self, tag: str) -> None:
        if tag != "row":
            super().end(tag)
        elif self._row:
            self._rows += 1
            if self._rows > MAX_SHEET_ROWS:
                raise ValueError(f"sheet {self._title}: more than {MAX_SHEET_ROWS:,} rows")
            self._taken.append(self._row)
            self._row = {}

    def close(self, text: str) -> None:
        """Keep a cell that ends, if it says anything."""
        said = self._say(text) if text else ""
        if not said:
            return
        self.count(said)
        self._cells += 1
        if self._cells > MAX_CELLS:
            raise ValueError(f"{self._where}: more than {MAX_CELLS:,} cells up to here")
        if self._column >= MAX_SHEET_COLUMNS:
            raise ValueError(f"{self._where}: more than {MAX_SHEET_COLUMNS} columns")
        self._row[self._column] = said

    def _number(self, cell: str) -> int:
        """Return the number of the column of a cell: 27 for AB12."""
        found = _CELL.fullmatch(cell)
        if found is None:
            raise ValueError(f"{self._where}: expected the name of a cell, as A1; {_AGAIN}")
        number = 0
        for letter in found[1]:
            number = 26 * number + ord(letter) - ord("A") + 1
        return number - 1

    def _say(self, text: str) -> str:
        """Return what a cell says, by the kind that the file gives it."""
        if self._kind == "s":
            if not (text.isascii() and text.isdigit() and len(text) < 10):
                text = "-1"
            if not 0 <= int(text) < len(self._shared):
                many = f"{len(self._shared):,}"
                raise ValueError(
                    f"{self._where}: expected one of the {many} shared texts; {_AGAIN}"
                )
            return self._shared[int(text)]
        if self._kind == "b":
            return {"0": "False", "1": "True"}.get(text, text)
        return _write_number(text) if self._kind == "n" else text


def _write_number(text: str) -> str:
    """Return a number as text: a room 101 may be the number 101.0."""
    try:
        value = float(text)
    except ValueError:
        return text
    if not math.isfinite(value) or abs(value) >= 1e15:
        return text
    return str(int(value)) if value.is_integer() else str(value)
