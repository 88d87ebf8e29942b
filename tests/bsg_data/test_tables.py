from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from bsg_data.tables import escape_markdown, format_markdown, format_text, make_plain, mark_code


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


def test_what_a_terminal_would_obey_has_a_mark_and_words_of_any_language_stay() -> None:
    mark = "\N{REPLACEMENT CHARACTER}"
    bad = "\x1b[2J\x9b\r\x08\x7f\N{RIGHT-TO-LEFT OVERRIDE}\N{ZERO WIDTH SPACE}\N{LINE SEPARATOR}"
    assert make_plain(f"a{bad}b") == f"a{mark}[2J{mark * 7}b"
    fine = "Küche\t台所\nمطبخ 1\N{NO-BREAK SPACE}m²"
    assert make_plain(fine) == fine


@given(st.lists(st.text(alphabet="a|\\\\`\r\n"), min_size=1, max_size=3))
def test_a_name_in_a_cell_is_escaped_once_and_ends_no_cell(names: list[str]) -> None:
    escaped = [escape_markdown(name) for name in names]
    *_, line = format_markdown([escaped], header=names)
    assert line == f"| {' | '.join(escaped)} |"
    assert len(format_markdown([names], header=names)) == 3


def test_a_name_is_code_unless_it_could_end_it() -> None:
    assert mark_code("hm3d45-v1") == "`hm3d45-v1`"
    assert mark_code("a`<b>") == r"a\`&lt;b&gt;"
