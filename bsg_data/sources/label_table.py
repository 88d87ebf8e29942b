"""Read tables of labels: CSV or tab-separated text, each row a key and its label."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from bsg_data.errors import SourceError
from bsg_data.inputs.bounded_file import PACKED, read_bytes
from bsg_data.inputs.bounds import LABEL_TABLE, MAX_LABEL_ROWS
from bsg_data.inputs.documents import parse_csv
from bsg_data.words.nearest import nearest_names
from bsg_data.words.shown import SHOWN, list_some, show_value

SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz")
_MARKS = {  # in a header that is one column → what to do
    ";": "save it with commas, or with tabs as .tsv",
    "\t": "its columns are separated by tabs: name the file .tsv",
    ",": "its columns are separated by commas: name the file .csv",
}
_NAMED = 20  # columns that an error names
Key = TypeVar("Key")


@dataclass(frozen=True, slots=True)
class LabelTable(Generic[Key]):
    """A table of labels."""

    labels: Mapping[Key, tuple[str, str]]  # key → its label, maybe empty, and its line
    unread: tuple[str, ...]  # columns that are not read


def read_label_table(
    path: Path, columns: Mapping[str, tuple[str, ...]], key_of: Callable[[str, list[str]], Key]
) -> LabelTable[Key]:
    """Read a table; rows of one key must have one label.

    Args:
        path: of the table.
        columns: the columns that are read, the label last, each with its further names.
        key_of: makes the key of a row, from its line and its other cells.

    Raises:
        SourceError: if it is no such table; it names the line.
    """
    rows = _read_rows(path)
    header = [name.strip() for name in rows[0][1]] if rows else []
    wanted = _find_columns(path, header, columns)
    labels: dict[Key, tuple[str, str]] = {}
    for where, row in rows[1:]:
        if len(row) != len(header):
            message = f"{where}: expected {len(header)} fields, as the header; found {len(row)}"
            raise SourceError(message, code="row-ragged", where=where)
        *cells, label = (row[column].strip() for column in wanted)
        first, line = labels.setdefault(key_of(where, cells), (label, where))
        if first != label:
            key = ", ".join(
                f"{name} {cell[:SHOWN]}" for name, cell in zip(columns, cells, strict=False)
            )
            raise SourceError(
                f"{where}: expected {show_value(first)} for {key}, as {line.rpartition(', ')[2]} "
                f"says; found {show_value(label)}; remove one of the lines",
                code="rows-disagree",
                where=where,
            )
    unread = (name for column, name in enumerate(header) if column not in wanted)
    return LabelTable(labels, tuple(unread))


def separator_of(path: Path) -> str:
    """Return what separates the columns of a text table, by the name of its file."""
    return "\t" if path.name.casefold().removesuffix(PACKED).endswith(".tsv") else ","


def hint_separator(header: Sequence[str]) -> str:
    """Return what to do about a header that is one column; empty if it has no other separator."""
    marks = _MARKS.items() if len(header) == 1 else ()
    return next((said for mark, said in marks if mark in header[0]), "")


def _read_rows(path: Path) -> list[tuple[str, list[str]]]:
    """Return the rows that are not empty, each with its line."""
    data = read_bytes(path, LABEL_TABLE)
    try:
        rows = parse_csv(data, most_rows=MAX_LABEL_ROWS, separator=separator_of(path))
        return [(f"{path}, line {line}", row) for line, row in rows if any(map(str.strip, row))]
    except ValueError as error:
        said = f"no table ({error}); save it as CSV in UTF-8"
        raise SourceError(f"{path}: {said}", code="csv-malformed", where=path) from error


def _find_columns(
    path: Path, header: Sequence[str], columns: Mapping[str, tuple[str, ...]]
) -> list[int]:
    """Return the number of each column, by the first of its names that is there."""
    twice = next((name for name, times in Counter(header).items() if name and times > 1), None)
    if twice:
        said = f"the column {show_value(twice)} twice"
        raise SourceError(f"{path}: {said}", code="column-twice", where=path)
    found = []
    for column, others in columns.items():
        name = next((name for name in (column, *others) if name in header), None)
        if name is None:
            near = nearest_names(column, set(header) - set(columns), most=1)
            hint = f"; rename {near[0]} to {column}" if near else ""
            if said := hint_separator(header):
                hint = f"; {said}"
            raise SourceError(
                f"{path}: no column {column!r}: expected {', '.join(columns)}; found "
                f"{list_some(header, _NAMED) or 'none'}{hint}",
                code="column-missing",
                where=path,
            )
        found.append(header.index(name))
    return found
