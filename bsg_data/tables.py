"""Format tables as text: aligned for a terminal, or as Markdown.

All tables of this project are made here, so they look the same everywhere.
"""

from __future__ import annotations

import html
import re
import unicodedata
from collections.abc import Sequence

_MARK = "\N{REPLACEMENT CHARACTER}"
_ESCAPED_OR_END = re.compile(r"(\\.)|\|")  # what is escaped, or the end of a cell
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


def format_markdown(rows: Rows, *, header: Sequence[str]) -> list[str]:
    """Return rows as the lines of a Markdown table.

    Args:
        rows: of cells; a `|` in a cell is escaped, unless it is already. All other markup is taken
            for what it is: names from a file go through `escape_markdown` or `mark_code` before.
        header: the names of the columns.

    >>> format_markdown([("chair", 12)], header=("class", "n"))
    ['| class | n |', '|---|---|', '| chair | 12 |']
    """
    lines = [[_one_cell(cell) for cell in row] for row in (header, *rows)]
    first, *others = (f"| {' | '.join(line)} |" for line in lines)
    return [first, "|".join(["", *("---" for _ in header), ""]), *others]


def make_plain(text: str) -> str:
    r"""Return text with a mark in place of each character that controls a terminal.

    Controls, and signs that turn the direction of writing or cannot be seen; not line feeds and
    tabulators.

    >>> make_plain("a\x1b[2Jb")
    'a\ufffd[2Jb'
    """
    if text.isascii() and text.isprintable():
        return text
    return text.translate({ord(c): _MARK for c in set(text) if is_obeyed(c)})


def make_line(text: str) -> str:
    r"""Return plain text on one line, so that no name in it can begin another.

    Errors and notes are lines; see `make_plain`.

    >>> make_line("no room a\nError: b")
    'no room a\ufffdError: b'
    """
    return make_plain(text).replace("\n", _MARK)


def escape_markdown(text: str) -> str:
    r"""Return text on one line, escaped so that Markdown and HTML show it unchanged.

    >>> print(escape_markdown("<b>a|b</b> [x](y)"))
    &lt;b&gt;a\|b&lt;/b&gt; \[x\](y)
    """
    escaped = html.escape(" ".join(make_plain(text).split()), quote=False)
    return re.sub(r"([\\`*\[\]|])", r"\\\1", escaped)


def mark_code(name: str) -> str:
    r"""Return a name in the type of code; one that could end it, as text that is no markup.

    >>> print(mark_code("hm3d45-v1"), mark_code("a`b"))
    `hm3d45-v1` a\`b
    """
    return f"`{name}`" if re.fullmatch(r"[\w.-]+", name) else escape_markdown(name)


def is_obeyed(character: str) -> bool:
    """Say whether a character controls a terminal instead of being shown; see `make_plain`."""
    is_shown = character.isprintable() or character in "\n\t"
    return not is_shown and unicodedata.category(character) != "Zs"  # spaces of other widths


def _printable(cell: object) -> str:
    text = f"{cell:,}" if isinstance(cell, int) else str(cell)
    return "".join(c if c.isprintable() else _MARK for c in text)


def _one_cell(cell: object) -> str:
    r"""Return a cell on one line; a `|` that is escaped already stays as it is."""
    return _ESCAPED_OR_END.sub(lambda m: m[1] or "\\|", " ".join(str(cell).splitlines()))
