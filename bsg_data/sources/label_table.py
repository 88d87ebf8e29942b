"""Read tables of labels: CSV or tab-separated text, each row a key and its label."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias, TypeVar

from bsg_data.errors import RecipeError, SourceError
from bsg_data.files import AnyPath
from bsg_data.inputs.text_table import find_columns, read_csv
from bsg_data.scene.room_label import check_own_label
from bsg_data.words.shown import SHOWN, show_value

_Key = TypeVar("_Key")
RoomWords: TypeAlias = "AnyPath | Mapping[str, str | None]"  # a path, or what the table holds


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
    found = find_columns(
        path,
        header,
        {name: (name, *others) for name, others in columns.items()},
        required=tuple(columns),
        rename="rename yours to {field}",
    )
    wanted = [found[name] for name in columns]
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


def read_room_words(source: RoomWords) -> tuple[tuple[str, str | None], ...]:
    """Read a table `source_label,label`: words, each with its label; None if it names no kind.

    Args:
        source: path of the table, or what it holds.

    Raises:
        SourceError: if the file is no such table, or a label is none of ours.
    """
    if isinstance(source, Mapping):
        for text in (*source, *source.values()):
            if not isinstance(text, str | None):
                raise RecipeError(
                    f"room_labels: expected words with their labels, found {show_value(text)}",
                    code="room-label-unknown",
                )
        return tuple((word, check_own_label(word, label)) for word, label in source.items())
    labels, _ = read_labels(Path(source), {"source_label": (), "label": ()}, _read_key)
    words = []
    for word, (label, where) in labels.items():
        try:
            words.append((word, check_own_label(word, label)))
        except RecipeError as error:
            raise SourceError(f"{where}: {error}", code=error.code, where=where) from error
    return tuple(words)


def _read_key(where: str, cells: list[str]) -> str:
    (word,) = cells
    if not word:
        message = f"{where}: expected a word for a room in source_label, found none"
        raise SourceError(message, code="row-malformed", where=where)
    return word
