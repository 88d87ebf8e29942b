"""Read the sheets of a workbook (`.xlsx`) as texts. Any fault is one ValueError."""

from __future__ import annotations

import datetime
import io
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from typing import Any

from python_calamine import CalamineError, CalamineWorkbook

_ODD = (RuntimeError, NotImplementedError, EOFError, struct.error)  # of a zip
_SheetRow = dict[int, str]  # number of the column, from the first that is used → text, if any


def read_sheets(data: bytes, is_read: Callable[[str], bool]) -> Iterator[tuple[str, _SheetRow]]:
    """Yield the rows that are not empty of the sheets whose titles are read, each with the title.

    Numbers are written without `.0`, and spaces and line breaks of texts are single spaces. The
    error of a formula is an empty cell.
    """
    try:
        book = CalamineWorkbook.from_filelike(io.BytesIO(data))
        for title in filter(is_read, book.sheet_names):
            for cells in book.get_sheet_by_name(title).iter_rows():
                texts = ((column, _write(cell)) for column, cell in enumerate(cells))
                if row := {column: text for column, text in texts if text}:
                    yield title, row
    except (CalamineError, zipfile.BadZipFile, zlib.error, *_ODD) as error:
        raise ValueError(str(error) or type(error).__name__) from error


def _write(cell: Any) -> str:
    """Return a cell as text: a room 101 may be the number 101.0."""
    if isinstance(cell, float) and cell.is_integer() and abs(cell) < 1e15:
        cell = int(cell)
    text = cell.isoformat() if isinstance(cell, datetime.date | datetime.time) else str(cell)
    return " ".join(text.split())
