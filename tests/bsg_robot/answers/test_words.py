from __future__ import annotations

import pytest
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_data.scene.class_map import ClassMap, OwnMap, load_class_map, parse_own_map
from bsg_data.words.normal import LONGEST
from bsg_robot.answers.nouns import read_nouns
from bsg_robot.answers.words import Meaning, find_meaning

MAP, WIDE = load_class_map("hm3d45-v1"), load_class_map("hm3d-wide-v1")


@pytest.mark.parametrize(
    ("word", "class_name", "class_map", "how"),
    [
        ("microwave", "microwave", MAP, ""),
        ("  Micro-Wave ", "microwave", MAP, "rule"),
        ('"microwave?"', "microwave", MAP, "is 'microwave'"),
        ("fridge", "refrigerator", MAP, "'fridge' is 'refrigerator'"),
        ("shoes", "shoe", WIDE, "'shoes' is one of the class 'shoe'"),
        ("micorwave", "microwave", MAP, "taken for 'microwave', the most similar name"),
        ("red toilett", "toilet", MAP, "taken for 'toilet', the most similar name"),
        ("tv_monitor", "tv", MAP, "'tv_monitor' is 'tv' by the rule 'vocabulary'"),
        ("CoffeeTable", "coffee table", WIDE, "is 'coffee table' by the rule 'separator'"),
    ],
)
def test_a_word_has_a_class_and_a_reason(
    word: str, class_name: str, class_map: ClassMap, how: str
) -> None:
    meaning = find_meaning(word, class_map)
    assert meaning.class_name == class_name
    assert class_map.classes[meaning.class_index] == class_name
    assert how in meaning.how
    assert bool(how) == bool(meaning.how)


def test_a_class_that_is_wider_than_the_word_says_so() -> None:
    wider, alone = find_meaning("laptop", MAP), find_meaning("laptop", WIDE)
    assert (wider.class_name, wider.is_exact) == ("computer", False)
    assert (alone.class_name, alone.is_exact) == ("laptop", True)
    narrowed = find_meaning("fork", MAP, nouns=read_nouns())
    assert narrowed.class_name == "tableware"
    assert narrowed.noun is not None
    own = find_meaning("fork", MAP, nouns=read_nouns(), prefer_exact=False)
    assert own == find_meaning("fork", MAP), "a map of one's own knows best, however wide it is"


@pytest.mark.parametrize("class_map", [MAP, WIDE], ids=lambda m: m.version)
def test_every_class_is_found_by_its_own_name(class_map: ClassMap) -> None:
    for index, name in enumerate(class_map.classes):
        assert find_meaning(name, class_map) == Meaning(name, name, index, "", is_exact=True)


@pytest.mark.parametrize("word", ["lamb", "bled", "tale", "planet bat"])
def test_a_word_that_is_only_like_another_is_not_taken_for_it(word: str) -> None:
    with refuses(RecipeError, "thing-unknown", word, golden=False):
        find_meaning(word, MAP)


@pytest.mark.parametrize(
    ("word", "code"),
    [
        ("wall", "thing-unknown"),
        ("refrig", "thing-unknown"),
        ("", "thing-none"),
        ("x" * (LONGEST + 1), "thing-none"),
    ],
)
def test_a_word_that_means_no_class_is_refused(word: str, code: str) -> None:
    with refuses(RecipeError, code):
        find_meaning(word, MAP)


@pytest.mark.parametrize(
    ("word", "class_name"),
    [
        ("washing machin", "washing machine"),  # a typo comes before the noun `washing`
        ("table lampp", "lamp"),
        ("cup of tea", "tableware"),
        ("book on the table", "book"),
        ("fork", "tableware"),
        ("banana", None),
        ("lost keys", None),
    ],
)
def test_a_class_and_a_typo_come_before_a_noun(word: str, class_name: str | None) -> None:
    meaning = find_meaning(word, MAP, nouns=read_nouns())
    assert meaning.class_name == class_name
    assert meaning.noun is not None or class_name != "tableware"


@pytest.mark.parametrize("word", ["flibber", "roof", "kitchen", "the", "in", "he"])
def test_what_is_no_thing_is_no_noun(word: str) -> None:
    with refuses(RecipeError, "thing-unknown", word, golden=False):
        find_meaning(word, MAP, nouns=read_nouns())


@pytest.mark.parametrize(
    ("word", "kind"),
    [
        ("person", "a person"),
        ("the old man", "a person"),
        ("blue", "a colour"),
        ("run", "an action"),
        ("fire", "an event"),
    ],
)
def test_a_word_that_names_no_thing_is_refused_with_the_reason(word: str, kind: str) -> None:
    with refuses(RecipeError, "thing-unknown", word) as caught:
        find_meaning(word, MAP, nouns=read_nouns())
    assert f"it is the word for {kind}, and models look for things. `bsg" in str(caught.value)


@pytest.mark.parametrize(
    "word", ["fire extinguisher", "screw driver", "baby bed", "blue mug", "running shoes", "orange"]
)
def test_a_thing_with_such_a_word_in_its_name_is_a_thing(word: str) -> None:
    assert find_meaning(word, MAP, nouns=read_nouns()).word == word


@pytest.mark.parametrize(
    ("word", "near"),
    [("Mikrowelle", ""), ("xyz", ""), ("irwel", ""), ("zebrra", "zebra")],
)
def test_no_far_guess_is_offered(word: str, near: str) -> None:
    with refuses(RecipeError, "thing-unknown", word, golden=False) as caught:
        find_meaning(word, MAP, nouns=read_nouns())
    offered = str(caught.value).partition("did you mean ")[2].partition("?")[0]
    assert offered == near


def test_a_typo_counts_in_a_map_of_ones_own() -> None:
    spellings = b"raw_category,category,class\npointer,pointer,pointer\n"
    own = parse_own_map(
        OwnMap(name="own", spellings=spellings, classes=b"index,class,definition\n0,pointer,A.\n")
    )
    assert find_meaning("poiner", own, prefer_exact=False).class_name == "pointer"
    with refuses(RecipeError, "thing-unknown", "fridge", golden=False):
        find_meaning("fridge", own, prefer_exact=False)
