from __future__ import annotations

import difflib
import time

from hypothesis import given
from hypothesis import strategies as st

from bsg_data.scene.class_map import load_class_map
from bsg_data.spelling import SHOWN, ask_if_meant, meant_names, nearest_names, show_value

WORDS = st.text(alphabet="abc ", min_size=1, max_size=8)


def test_the_nearest_by_hand() -> None:
    assert nearest_names("stov", ["sofa", "stove"]) == ("stove",)
    assert nearest_names("STOVE", ["Stove"], most=1) == ("Stove",)
    assert nearest_names("x", ["stove"]) == ()
    assert ask_if_meant("chiar", ["chair", "char", "bed"], most=2) == "did you mean char, chair?"
    assert ask_if_meant("x", ["stove"]) == ""


def test_a_name_that_only_shares_letters_is_not_meant() -> None:
    known = ["mobile", "boiler", "microwave", "shoes", "stools", "vase", "mini fridge", "fruit"]
    assert nearest_names("bicycle", known) == ("mobile", "boiler")
    assert ask_if_meant("bicycle", known) == ""
    for typo, name in (("microwav", "microwave"), ("shoos", "shoes"), ("vaze", "vase")):
        assert meant_names(typo, known) == (name,)


def test_a_name_that_is_cut_off_is_meant() -> None:
    known = ["universal", "universal-transformer", "mini fridge", "stand", "abcdefz"]
    assert meant_names("fridg", known) == ("mini fridge",)
    assert meant_names("TRANSFORMER", known) == ("universal-transformer",)
    assert meant_names("univ", known) == ("universal", "universal-transformer")
    assert meant_names("univ", known, most=1) == ("universal",)
    assert meant_names("tand", ["understanding"]) == (), "a word begins with it, or it is another"
    assert meant_names("uni", known) == (), "too short to tell"
    assert meant_names("a.*z", known) == (), "no pattern"


def test_a_name_that_holds_a_known_one_is_meant() -> None:
    assert meant_names("living room", ["living", "bath"]) == ("living",)
    assert meant_names("big mini fridge", ["fridge", "mini fridge"], most=1) == ("mini fridge",)
    assert meant_names("understanding", ["stand", "under"]) == (), "no word of it"


def test_punctuation_is_not_compared() -> None:
    assert meant_names("R0", ["R(0)", "R(1)"]) == ("R(0)",)
    assert meant_names("minifridge", ["mini-fridge", "mini"]) == ("mini-fridge",)
    assert meant_names("()", ["-", "", "R(0)"]) == (), "nothing is left to compare"
    assert meant_names("", ["-", "hall"]) == ()


@given(WORDS, st.lists(WORDS, unique=True))
def test_small_letters_are_compared_as_difflib_does(name: str, known: list[str]) -> None:
    expected = difflib.get_close_matches(name, known, n=3)
    assert list(nearest_names(name, known)) == expected


def test_a_name_of_any_length_is_answered_at_once() -> None:
    known = load_class_map().normalised
    assert len(known) > 2000
    began = time.perf_counter()
    nearest_names("chair " * 1_000_000, known)
    nearest_names("chair", ["chairs" * 1_000_000, "chairs"])
    assert time.perf_counter() - began < 2
    assert nearest_names("b" * SHOWN + "tail", ["b" * SHOWN]) == ("b" * SHOWN,)


def test_any_value_is_shown_in_a_few_characters() -> None:
    class Silent:
        def __repr__(self) -> str:
            raise RuntimeError

    assert show_value("x" * 1000) == "'" + "x" * (SHOWN - 1)
    assert show_value(-(10**5000)) == "an integer of more than 80 digits"
    assert show_value([10**5000]) == "a list"
    assert show_value(Silent()) == "a Silent"
