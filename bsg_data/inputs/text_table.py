"""Read tables of text, CSV or separated by tabs: the one reader of all of them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

from bsg_data.errors import SourceError
from bsg_data.inputs.bounded_file import PACKED, read_bytes
from bsg_data.inputs.documents import decode

SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz")
_MARKS = {  # in a header that is one column → what to do
    ";": "save it with commas, or with tabs as .tsv",
    "\t": "its columns are separated by tabs: name the file .tsv",
    ",": "its columns are separated by commas: name the file .csv",
}
_Row = tuple[int, list[str]]  # the number of its last line, and its fields


def read_csv(path: Path) -> Iterator[_Row]:
    """Yield the rows of a table that are not empty, the header first; all have as many fields.

    Raises:
        SourceError: if it is no such table; it names the line.
    """
    separator = "\t" if path.name.casefold().removesuffix(PACKED).endswith(".tsv") else ","
    width = None
    try:
        for line, row in parse_csv(read_bytes(path), separator=separator):
            width = len(row) if width is None else width
            if len(row) == width:
                yield line, row
            elif any(map(str.strip, row)):
                where = f"{path}, line {line}"
                said = f"expected {width} fields, as the header; found {len(row)}"
                raise SourceError(f"{where}: {said}", code="row-ragged", where=where)
    except ValueError as error:
        why = str(error).partition("; ")[0]
        message = f"{path}: no table ({why}); save it as CSV in UTF-8 (Excel: CSV UTF-8)"
        raise SourceError(message, code="csv-malformed", where=path) from error


def parse_csv(data: bytes, *, separator: str = ",") -> Iterator[_Row]:
    """Yield the rows of a table, also empty ones; a ValueError names the line."""
    reader = csv.reader(io.StringIO(decode(data), newline=""), strict=True, delimiter=separator)
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
