"""Read tables of text, CSV or separated by tabs: the one reader of all of them."""

from __future__ import annotations

import codecs
import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from bsg_data.errors import SourceError
from bsg_data.inputs.bounded_file import PACKED, open_stream

SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz")
_MARKS = {  # in a header that is one column → what to do
    ";": "save it with commas, or with tabs as .tsv",
    "\t": "its columns are separated by tabs: name the file .tsv",
    ",": "its columns are separated by commas: name the file .csv",
}
Row = tuple[int, list[str]]  # the number of its last line, and its fields


def read_csv(path: Path) -> Iterator[Row]:
    """Yield the rows of a table that are not empty, the header first; all have as many fields.

    Raises:
        SourceError: if it is no such table; it names the line.
    """
    separator = "\t" if path.name.casefold().removesuffix(PACKED).endswith(".tsv") else ","
    width = None
    with open_stream(path) as file:
        try:
            for line, row in parse_csv(_read_lines(file), separator=separator):
                width = len(row) if width is None else width
                if len(row) == width:
                    yield line, row
                elif any(map(str.strip, row)):
                    where = f"{path}, line {line}"
                    said = f"expected {width} fields, as the header; found {len(row)}"
                    raise SourceError(f"{where}: {said}", code="row-ragged", where=where)
        except ValueError as error:
            said = f"no table ({error}); save it as CSV in UTF-8 (Excel: CSV UTF-8)"
            raise SourceError(f"{path}: {said}", code="csv-malformed", where=path) from error


def parse_csv(lines: bytes | Iterable[str], *, separator: str = ",") -> Iterator[Row]:
    """Yield the rows of a table, also empty ones; a ValueError names the line."""
    if isinstance(lines, bytes):
        lines = _read_lines(io.BytesIO(lines))
    reader = csv.reader(lines, strict=True, delimiter=separator)
    try:
        for row in reader:
            yield reader.line_num, row
    except csv.Error as error:
        why = "a quote is not closed" if "end of data" in str(error) else error
        raise ValueError(f"line {reader.line_num}: {why}") from error


def hint_separator(header: Sequence[str]) -> str:
    """Return what to do about a header that is one column; empty if it has no other separator."""
    marks = _MARKS.items() if len(header) == 1 else ()
    return next((said for mark, said in marks if mark in header[0]), "")


def _read_lines(file: BinaryIO) -> Iterator[str]:
    """Yield the lines of text in UTF-8, or in UTF-16 with a mark of its order."""
    begin = file.read(2)
    file.seek(0)
    is_wide = begin in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    text = io.TextIOWrapper(file, encoding="utf-16" if is_wide else "utf-8-sig", newline="")
    try:
        yield from text
    except UnicodeError:
        if is_wide:
            raise ValueError("not UTF-16, as it begins") from None
        file.seek(0)
        faulty = ((n, line) for n, line in enumerate(file, start=1) if not _is_text(line))
        number, line = next(faulty)
        raise ValueError(f"line {number}: not UTF-8, {line[:40]!r}") from None
    finally:
        with suppress(ValueError):  # where the file is closed already
            text.detach()


def _is_text(line: bytes) -> bool:
    try:
        line.decode()
    except UnicodeDecodeError:
        return False
    return True
