from __future__ import annotations

import pytest

from bsg_data.words.nearest import ask_if_meant, nearest_names
from bsg_data.words.shown import SHOWN, show_value

KNOWN = ["mobile", "boiler", "microwave", "shoes", "stools", "vase", "mini fridge", "fruit"]


@pytest.mark.parametrize(
    ("name", "known", "near"),
    [
        ("bicycle", KNOWN, ()),  # it only shares letters
        ("MICROWAV", KNOWN, ("microwave",)),
        ("vaze", KNOWN, ("vase",)),
        ("fridg", KNOWN, ("mini fridge",)),
        ("univ", ["universal", "universal-gcn"], ("universal", "universal-gcn")),
        ("chaair thing", ["thin", "chair"], ("chair",)),
        ("uni", ["universal"], ()),  # too short to tell
        ("a.*z", ["abcdefz"], ()),  # no pattern
        ("living room", ["living", "bath"], ("living",)),
        ("big mini fridge", ["fridge", "mini fridge"], ("mini fridge", "fridge")),
        ("understanding", ["stand", "under"], ()),  # no word of it
        ("R0", ["R(0)", "R(1)"], ("R(0)",)),
        ("()", ["-", "", "R(0)"], ()),  # nothing is left to compare
        ("b" * SHOWN + "tail" * 100_000, ["b" * SHOWN], ("b" * SHOWN,)),
    ],
)
def test_names_that_are_meant(name: str, known: list[str], near: tuple[str, ...]) -> None:
    assert nearest_names(name, known) == near
    assert nearest_names(name, known, most=1) == near[:1]
    assert bool(ask_if_meant(name, known)) is bool(near)


def test_any_value_is_shown_in_a_few_characters() -> None:
    assert show_value("x" * 1000) == "'" + "x" * (SHOWN - 1)
    assert show_value([10**5000]) == "a value of type list"
