"""Read the sheets of a workbook (`.xlsx`) as texts. Any fault is one ValueError."""

from __future__ import annotations

import datetime
import io
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from functools import reduce
from typing import Any

from python_calamine import CalamineError, CalamineWorkbook

# The place of a cell that is not empty: `<c r="AB12" t="s">`, and not `<c r="AB12" s="1"/>`.
_CELL = re.compile(rb'<(?:[\w.-]+:)?c\s[^>/]*?\br="([A-Za-z]+)([0-9]+)"[^>/]*>')
_MOST = 2**25  # cells of a sheet, if it were full
_ODD = (RuntimeError, NotImplementedError, EOFError, struct.error)  # of a zip
_SheetRow = dict[int, str]  # number of the column, from the first that is used → text, if any


def read_sheets(data: bytes, is_read: Callable[[str], bool]) -> Iterator[tuple[str, _SheetRow]]:
    """Yield the rows that are not empty of the sheets whose titles are read, each with the title.

    Numbers are written without `.0`, and spaces and line breaks of texts are single spaces. The
    error of a formula is an empty cell.
    """
    try:
        _require_near(data)
        book = CalamineWorkbook.from_filelike(io.BytesIO(data))
        for title in filter(is_read, book.sheet_names):
            for cells in book.get_sheet_by_name(title).iter_rows():
                texts = ((column, _write(cell)) for column, cell in enumerate(cells))
                if row := {column: text for column, text in texts if text}:
                    yield title, row
    except (CalamineError, zipfile.BadZipFile, zlib.error, *_ODD) as error:
        raise ValueError(str(error) or type(error).__name__) from error


def _require_near(data: bytes) -> None:
    """Refuse a cell far away from the others: the library allots all cells up to it, or ends."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for name in archive.namelist():
            cells = _CELL.finditer(archive.read(name)) if "worksheets/" in name else ()
            places = {(cell[1].upper(), int(cell[2])) for cell in cells}
            width = max((_number(column) for column, _ in places), default=0)
            if width * max((row for _, row in places), default=0) > _MOST:
                raise ValueError(f"{name}: a cell stands far away from the others; delete it")


def _number(column: bytes) -> int:
    """Return the number of a column from its letters: 28 for AB."""
    return reduce(lambda number, letter: 26 * number + letter - 64, column, 0)


def _write(cell: Any) -> str:
    """Return a cell as text: a room 101 may be the number 101.0."""
    if isinstance(cell, float) and cell.is_integer() and abs(cell) < 1e15:
        cell = int(cell)
    text = cell.isoformat() if isinstance(cell, datetime.date | datetime.time) else str(cell)
    return " ".join(text.split())
