"""Read tables of labels: CSV or tab-separated text, each row a key and its label."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from bsg_data.errors import SourceError
from bsg_data.inputs.text_table import hint_separator, read_csv
from bsg_data.words.nearest import nearest_names
from bsg_data.words.shown import SHOWN, list_some, show_value

_NAMED = 20  # columns that an error names
_Key = TypeVar("_Key")


def read_labels(
    path: Path, columns: Mapping[str, tuple[str, ...]], key_of: Callable[[str, list[str]], _Key]
) -> tuple[dict[_Key, tuple[str, str]], list[str]]:
    """Read a table; rows of one key must have one label.

    Args:
        path: of the table.
        columns: the columns that are read, the label last, each with its further names.
        key_of: makes the key of a row, from its line and its other cells.

    Returns:
        key → its label, maybe empty, and its line; the columns that are not read.

    Raises:
        SourceError: if it is no such table; it names the line.
    """
    rows = read_csv(path)
    header = [name.strip() for name in next(rows, (0, list[str]()))[1]]
    wanted = _find_columns(path, header, columns)
    labels: dict[_Key, tuple[str, str]] = {}
    for number, row in rows:
        if any(map(str.strip, row)):
            where = f"{path}, line {number}"
            *cells, label = (row[column].strip() for column in wanted)
            first, line = labels.setdefault(key_of(where, cells), (label, where))
            if first != label:
                key = ", ".join(
                    f"{name} {cell[:SHOWN]}" for name, cell in zip(columns, cells, strict=False)
                )
                raise SourceError(
                    f"{where}: expected {show_value(first)} for {key}, as "
                    f"{line.rpartition(', ')[2]} says; found {show_value(label)}; remove one of "
                    "the lines",
                    code="rows-disagree",
                    where=where,
                )
    return labels, [name for column, name in enumerate(header) if column not in wanted]


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
            hint = hint_separator(header) or (f"rename {near[0]} to {column}" if near else "")
            raise SourceError(
                f"{path}: no column {column!r}: expected {', '.join(columns)}; found "
                f"{list_some(header, _NAMED) or 'none'}{hint and f'; {hint}'}",
                code="column-missing",
                where=path,
            )
        found.append(header.index(name))
    return found
