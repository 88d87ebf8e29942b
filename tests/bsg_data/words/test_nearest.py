from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.words.nearest import Spellings, ask_if_meant, is_typo, nearest_names
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


WORDS = st.text("abc", max_size=6)


@st.composite
def two_words(draw: st.DrawFn) -> tuple[str, str]:
    """Draw a word after another one, or one that is a step away."""
    word = draw(WORDS)
    at, letter = draw(st.integers(0, len(word))), draw(st.sampled_from("abc"))
    start, end = word[:at], word[at:]
    near = [start + end[1:], start + letter + end, start + letter + end[1:]]
    near.append(start + end[:2][::-1] + end[2:])
    return draw(st.one_of(WORDS, st.sampled_from(near))), word


@given(two_words())
def test_a_typo_is_one_step_that_keeps_the_first_letter(words: tuple[str, str]) -> None:
    """The steps by their definition: leave out, put in, replace, swap."""
    typed, word = words
    places = range(len(word) + 1)
    steps = {word[:i] + word[i + 1 :] for i in places}
    steps |= {word[:i] + letter + word[i:] for i in places for letter in "abc"}
    steps |= {word[:i] + letter + word[i + 1 :] for i in places for letter in "abc"}
    steps |= {word[:i] + word[i : i + 2][::-1] + word[i + 2 :] for i in places}
    steps = {step for step in steps - {word} if step[:1] == word[:1]}
    assert is_typo(typed, word) == (typed in steps)
    found = Spellings([word, "so many things"]).mend(f"so many {typed} things", real=())
    is_long = len(typed) >= 5 and len(word) >= 4
    assert (f"so many {word} things" in found) == (is_long and is_typo(typed, word))


@pytest.mark.parametrize(
    ("name", "mended"),
    [
        ("red toilett 3", ["red toilet"]),
        ("table lampp", ["table lamp"]),
        ("toilet", []),
        ("battle", []),  # another word, not a misspelt bottle
        ("tabel", []),  # too short
        ("x" * 50_000, []),
    ],
)
def test_one_word_is_mended(name: str, mended: list[str]) -> None:
    known = Spellings(["toilet", "table lamp", "bottle"])
    assert [*known.mend(name, real={"battle"})] == mended
