"""Tables as text: aligned for a terminal, or as Markdown for cards and documents.

Every table that people read is made here, so that the same rows look the same everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence

Rows = Sequence[Sequence[object]]


def format_text(rows: Rows, *, header: Sequence[str], numeric: Sequence[str] = ()) -> str:
    """Return rows as an aligned table, with numbers to the right and letters to the left.

    A column is of numbers if the first row has one there, or `numeric` names it. A character that
    a terminal would obey is replaced, so that no name from a file can write to it.

    >>> print(format_text([("chair", 1200), ("bed", 3)], header=("class", "objects")))
    class  objects
    chair    1,200
    bed          3
    """
    is_number = [
        name in numeric or (bool(rows) and not isinstance(rows[0][i], str))
        for i, name in enumerate(header)
    ]
    lines = [list(header), *([_printable(cell) for cell in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(line, widths, is_number, strict=True)
        ).rstrip()
        for line in lines
    )


def format_markdown(rows: Rows, *, header: Sequence[str], numeric: Sequence[str] = ()) -> list[str]:
    """Return rows as the lines of a Markdown table.

    Args:
        rows: of cells; a `|` in a cell is escaped.
        header: the names of the columns.
        numeric: names of the columns that are aligned to the right.

    >>> format_markdown([("chair", 12)], header=("class", "n"), numeric=("n",))
    ['| class | n |', '|---|---:|', '| chair | 12 |']
    """
    rule = "|".join("---:" if name in numeric else "---" for name in header)
    lines = [[_one_cell(cell) for cell in row] for row in (header, *rows)]
    first, *others = (f"| {' | '.join(line)} |" for line in lines)
    return [first, f"|{rule}|", *others]


def _printable(cell: object) -> str:
    text = f"{cell:,}" if isinstance(cell, int) else str(cell)
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


def _one_cell(cell: object) -> str:
    return " ".join(str(cell).split("\n")).replace("|", "\\|")
