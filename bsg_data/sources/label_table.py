"""Read tables of labels: CSV or tab-separated text, each row a key and its label."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from bsg_data.errors import SourceError
from bsg_data.inputs.text_table import hint_separator, read_csv
from bsg_data.words.nearest import nearest_names
from bsg_data.words.shown import SHOWN, list_some, show_value

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
    rows = read_csv(path)
    header = [name.strip() for name in next(rows, (0, list[str]()))[1]]
    wanted = _find_columns(path, header, columns)
    labels: dict[Key, tuple[str, str]] = {}
    for number, row in rows:
        if not any(map(str.strip, row)):
            continue
        where = f"{path}, line {number}"
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
