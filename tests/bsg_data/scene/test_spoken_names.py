from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.scene.spoken_names import resolve

LISTED = {"tv stand", "shelf", "couch", "knife", "box", "battery", "plant", "basket", "tv", "towel"}
SYNONYMS = {"sofa": "couch", "television": "tv"}


@pytest.mark.parametrize(
    ("name", "first"),
    [
        ("tv__stand", ("tv stand", "separator")),
        ("shelves", ("shelf", "number")),
        ("knives", ("knife", "number")),
        ("boxes", ("box", "number")),
        ("batteries", ("battery", "number")),
        ("sofas", ("couch", "synonym")),
        ("red leather sofas", ("couch", "head noun")),
        ("basket of towels", ("basket", "head noun")),
        ("a pile of towels", ("towel", "head noun")),
        ("towel for the tv", ("towel", "head noun")),
        ("chair - " * 50_000, None),  # at once
        ("", None),
    ],
)
def test_rules_by_hand(name: str, first: tuple[str, str] | None) -> None:
    found = resolve(name, SYNONYMS, known=LISTED.__contains__)
    assert next(found, None) == first


@given(st.text(max_size=40))
def test_of_any_text_only_listed_names_come_out(name: str) -> None:
    for other, _ in resolve(name, SYNONYMS, known=LISTED.__contains__):
        assert other in LISTED


@given(st.text("a3 .#-", max_size=12))
def test_the_number_at_the_end_is_what_a_regular_expression_says(name: str) -> None:
    """The expression is the rule; on a long run of spaces it took a time that grows as its cube."""
    words = re.sub(r"[ .#]*[0-9]*[ .]*$", "", name.replace("-", " ")).split()
    found = resolve(name, {}, known=" ".join(words).__eq__)
    assert (next(found, None) is not None) == bool(words)
