from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.words.normal import LONGEST, drop_number, list_parts


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("lamp on table", ("lamp",)),
        ("cup next to the sink in the kitchen", ("cup",)),
        ("PICTURE HANGING ABOVE COUCH", ("PICTURE",)),
        ("Cabinet / shelf on wall", ("Cabinet", "shelf")),
        ("mug (red, on table)", ("mug",)),
        ("(old) mug", ("mug",)),
        ("mug (red", ("mug",)),
        ("[mug]", ("mug",)),
        ("mug - 0.5", ("mug -",)),
        ("mug = .5", ("mug",)),
        ("mug 12", ("mug 12",)),  # a number, and no score
        ("walk-in closet", ("walk-in closet",)),
        ("under sink cabinet", ("under sink cabinet",)),
        ("1/2 inch drill", ("1/2 inch drill",)),
        ("in", ("in",)),
        ("()", ("",)),
        ("", ("",)),
        ("x on " * 50_000, ("x on " * 50_000,)),
    ],
)
def test_parts_by_hand(name: str, parts: tuple[str, ...]) -> None:
    assert list_parts(name) == parts


@given(st.text("ax on/,(.)", max_size=LONGEST))
def test_parts_say_nothing_that_the_name_does_not(name: str) -> None:
    parts = list_parts(name)
    assert parts
    assert all(len(part) <= len(name) and {*part} <= {*name, " "} for part in parts)


@given(st.text("a3 .#", max_size=12))
def test_the_number_at_the_end_is_what_a_regular_expression_says(name: str) -> None:
    """The expression is the rule; on a long run of spaces it took a time that grows as its cube."""
    assert drop_number(name) == re.sub(r"[ .#]*[0-9]*[ .]*$", "", name)
