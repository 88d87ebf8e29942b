from __future__ import annotations

import doctest

from hypothesis import given
from hypothesis import strategies as st

from bsg_data import tables
from bsg_data.tables import format_markdown, format_text


def test_doctests() -> None:
    assert doctest.testmod(tables).failed == 0


def test_numbers_stand_to_the_right_and_letters_to_the_left() -> None:
    text = format_text([("a", 1_000, "x"), ("bbb", 2, "")], header=("name", "n", "note"))
    assert text.splitlines() == ["name      n  note", "a     1,000  x", "bbb       2"]
    assert format_text([], header=("name", "n")) == "name  n"


@given(st.lists(st.tuples(st.text(), st.integers()), min_size=1, max_size=4))
def test_every_row_is_one_line_that_a_terminal_does_not_obey(rows: list[tuple[str, int]]) -> None:
    lines = format_text(rows, header=("name", "n")).split("\n")
    assert len(lines) == 1 + len(rows)
    assert all(line.isprintable() for line in lines)
    assert len({len(line) for line in lines}) == 1  # the last column is of numbers


@given(st.lists(st.tuples(st.text(), st.text()), max_size=4))
def test_markdown_has_as_many_cells_as_columns(rows: list[tuple[str, str]]) -> None:
    lines = format_markdown(rows, header=("a", "b"), numeric=("b",))
    assert lines[1] == "|---|---:|"
    assert len(lines) == 2 + len(rows)
    for line in lines:
        assert "\n" not in line
        assert line.replace("\\|", "").count("|") == 3
