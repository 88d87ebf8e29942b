"""Read tables of text, CSV or separated by tabs: the one reader of all of them."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

from bsg_data.errors import SourceError
from bsg_data.inputs.bounded_file import PACKED, read_bytes
from bsg_data.inputs.documents import decode
from bsg_data.words.nearest import nearest_names
from bsg_data.words.shown import list_some, show_value

SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz")
_MARKS = {  # in a header that is one column → what to do
    ";": "save it with commas, or with tabs as .tsv",
    "\t": "its columns are separated by tabs: name the file .tsv",
    ",": "its columns are separated by commas: name the file .csv",
}
_SHOWN = 20  # columns in an error
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
                fault = f"expected {width} fields, as the header; found {len(row)}"
                raise SourceError(f"{where}: {fault}", code="row-ragged", where=where)
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


def find_columns(
    path: Path,
    header: Sequence[str],
    wanted: Mapping[str, Sequence[str]],
    *,
    required: Collection[str],
    rename: str,
) -> dict[str, int]:
    """Return field → number of its column, spelt as one of its names, else in other letters.

    Args:
        path: of the table, for errors.
        header: the names of its columns.
        wanted: field → names that its column may have, the first that is there counts.
        required: fields without which it is no such table.
        rename: what to do about another name, with `{field}` in it.

    Raises:
        SourceError: if a column is missing, or is there twice.
    """
    columns: dict[str, int] = {}
    for field, names in wanted.items():
        for name in names:
            same = [at for at, title in enumerate(header) if title == name]
            same = same or [at for at, title in enumerate(header) if _is_same(title, name)]
            if len(same) > 1:
                shown = list_some([header[at] for at in same], _SHOWN)
                message = f"{path}: found the column {show_value(name)} twice, as {shown}"
                raise SourceError(message, code="column-twice", where=path)
            if same:
                columns[field] = same[0]
                break
    for field in (field for field in required if field not in columns):
        name = wanted[field][0]
        near = nearest_names(name, [*header][:_SHOWN], most=1)
        hint = f"is it {near[0]}? " if near else ""
        hint = _hint_separator(header) or f"{hint}{rename.format(field=field)}"
        expected = ", ".join(required)
        if others := [other for other in wanted if other not in required]:
            expected += f", and any of {', '.join(others)}"
        raise SourceError(
            f"{path}: no column {name!r}; {hint}. Expected a header with {expected}; found "
            f"{list_some(header, _SHOWN) or 'none'}",
            code="column-missing",
            where=path,
        )
    return columns


def _is_same(title: str, name: str) -> bool:
    return title.strip().casefold() == name.strip().casefold()


def _hint_separator(header: Sequence[str]) -> str:
    """Return what to do about a header that is one column; empty if it has no other separator."""
    marks = _MARKS.items() if len(header) == 1 else ()
    return next((hint for mark, hint in marks if mark in header[0]), "")
