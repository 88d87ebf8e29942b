from __future__ import annotations

import difflib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.spelling import SHOWN, ask_if_meant, meant_names, nearest_names, show_value

WORDS = st.text(alphabet="abc ", min_size=1, max_size=8)
KNOWN = ["mobile", "boiler", "microwave", "shoes", "stools", "vase", "mini fridge", "fruit"]


@pytest.mark.parametrize(
    ("name", "known", "meant"),
    [
        ("bicycle", KNOWN, ()),  # it only shares letters
        ("microwav", KNOWN, ("microwave",)),
        ("vaze", KNOWN, ("vase",)),
        ("fridg", KNOWN, ("mini fridge",)),
        ("univ", ["universal", "universal-gcn"], ("universal", "universal-gcn")),
        ("uni", ["universal"], ()),  # too short to tell
        ("a.*z", ["abcdefz"], ()),  # no pattern
        ("living room", ["living", "bath"], ("living",)),
        ("big mini fridge", ["fridge", "mini fridge"], ("mini fridge", "fridge")),
        ("understanding", ["stand", "under"], ()),  # no word of it
        ("R0", ["R(0)", "R(1)"], ("R(0)",)),
        ("()", ["-", "", "R(0)"], ()),  # nothing is left to compare
    ],
)
def test_names_that_are_meant(name: str, known: list[str], meant: tuple[str, ...]) -> None:
    assert meant_names(name, known) == meant
    assert meant_names(name, known, most=1) == meant[:1]
    assert bool(ask_if_meant(name, known)) is bool(meant)


@given(WORDS, st.lists(WORDS, unique=True))
def test_the_nearest_are_difflib_s_without_case(name: str, known: list[str]) -> None:
    expected = difflib.get_close_matches(name, known, n=3)
    assert list(nearest_names(name.upper(), known)) == expected


def test_a_name_of_any_length_and_any_value_is_shown_in_a_few_characters() -> None:
    assert nearest_names("b" * SHOWN + "tail" * 100_000, ["b" * SHOWN]) == ("b" * SHOWN,)
    assert show_value("x" * 1000) == "'" + "x" * (SHOWN - 1)
    assert show_value([10**5000]) == "a value of type list"
