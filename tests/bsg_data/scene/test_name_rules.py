from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.scene.name_rules import LONGEST, index_words, is_typo, list_parts, mend, resolve

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
    found = resolve([name], SYNONYMS, known=LISTED.__contains__)
    assert next(found, None) == first


def test_a_name_of_many_words_asks_for_few() -> None:
    asked: list[str] = []
    name = " ".join(f"qzx{chr(97 + n)}" for n in range(12))
    found = resolve([name], {}, known=lambda one: bool(asked.append(one)), most_words=3)
    assert next(found, None) is None
    assert len(asked) < 40, "of the ends that some listed name may be, not of all"


@given(st.text(max_size=40))
def test_of_any_text_only_listed_names_come_out(name: str) -> None:
    for other, _ in resolve([name], SYNONYMS, known=LISTED.__contains__):
        assert other in LISTED


@given(st.text("a3 .#-", max_size=12))
def test_the_number_at_the_end_is_what_a_regular_expression_says(name: str) -> None:
    """The expression is the rule; on a long run of spaces it took a time that grows as its cube."""
    words = re.sub(r"[ .#]*[0-9]*[ .]*$", "", name.replace("-", " ")).split()
    found = resolve([name], {}, known=" ".join(words).__eq__)
    assert (next(found, None) is not None) == bool(words)


def test_the_whole_of_a_later_reading_comes_before_the_last_word_of_an_earlier_one() -> None:
    known = {"table", "coffee table"}.__contains__
    assert [*resolve(["old table", "coffee table"], {}, known=known)] == [
        ("coffee table", "separator")
    ]


def test_a_word_of_a_vocabulary_is_not_taken_by_its_last_word_alone() -> None:
    known = {"monitor", "tv"}.__contains__
    words = {"tv monitor": "tv", "baby monitor": ""}
    rule = {"known": known, "vocabulary": frozenset(words)}
    assert [*resolve(["tv_monitor_2"], words, **rule)] == [("tv", "vocabulary")]
    assert [*resolve(["old tv-monitor"], words, **rule)] == [("tv", "head noun")]
    assert [*resolve(["baby monitor"], words, **rule)] == []
    assert [*resolve(["old baby monitor"], words, **rule)] == []
    assert [*resolve(["old monitor"], words, **rule)] == [("monitor", "head noun")]


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
    said, word = words
    places = range(len(word) + 1)
    steps = {word[:i] + word[i + 1 :] for i in places}
    steps |= {word[:i] + letter + word[i:] for i in places for letter in "abc"}
    steps |= {word[:i] + letter + word[i + 1 :] for i in places for letter in "abc"}
    steps |= {word[:i] + word[i : i + 2][::-1] + word[i + 2 :] for i in places}
    steps = {one for one in steps - {word} if one[:1] == word[:1]}
    assert is_typo(said, word) == (said in steps)
    found = mend(f"so many {said} things", index_words([word, "so many things"]), real=())
    assert (f"so many {word} things" in found) == (is_typo(said, word) and min_length(said, word))


def min_length(said: str, word: str) -> bool:
    return len(said) >= 5 and len(word) >= 4


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
    index = index_words(["toilet", "table lamp", "bottle"])
    assert [*mend(name, index, real={"battle"})] == mended


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
