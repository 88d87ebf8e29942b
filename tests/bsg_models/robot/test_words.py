from __future__ import annotations

import pytest
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_data.scene.class_map import ClassMap, OwnMap, load_class_map, parse_own_map
from bsg_models.robot.nouns import read_nouns
from bsg_models.robot.words import MOST_CHARACTERS, Meaning, find_meaning

MAPS = [load_class_map("hm3d45-v2"), load_class_map("hm3d-wide-v1")]


@pytest.mark.parametrize(
    ("word", "class_name", "model", "how"),
    [
        ("microwave", "microwave", 0, ""),
        ("  Micro-Wave ", "microwave", 0, "rule"),
        ('"microwave?"', "microwave", 0, "is 'microwave'"),
        ("fridge", "refrigerator", 0, "'fridge' is 'refrigerator'"),
        ("shoes", "shoe", 1, "'shoes' is one of the class 'shoe'"),
        ("micorwave", "microwave", 0, "taken for 'microwave', the most similar name"),
        ("red toilett", "toilet", 0, "taken for 'toilet', the most similar name"),
        ("tv_monitor", "tv", 0, "'tv_monitor' is 'tv' by the rule 'vocabulary'"),
        ("CoffeeTable", "coffee table", 1, "is 'coffee table' by the rule 'separator'"),
    ],
)
def test_a_word_has_a_class_and_a_reason(word: str, class_name: str, model: int, how: str) -> None:
    meaning = find_meaning(word, MAPS)
    assert (meaning.class_name, meaning.model) == (class_name, model)
    assert MAPS[model].classes[meaning.class_index] == class_name
    assert how in meaning.how
    assert bool(how) == bool(meaning.how)


def test_a_class_of_such_things_alone_comes_before_a_wider_one() -> None:
    alone = find_meaning("laptop", MAPS[:1])
    assert (alone.class_name, alone.is_exact) == ("computer", False)
    both = find_meaning("laptop", MAPS)
    assert (both.class_name, both.model, both.is_exact) == ("laptop", 1, True)
    own = find_meaning("laptop", MAPS, prefer_exact=False)
    assert (own.class_name, own.model) == ("computer", 0)


@pytest.mark.parametrize("class_map", MAPS, ids=lambda m: m.version)
def test_every_class_is_found_by_its_own_name(class_map: ClassMap) -> None:
    for index, name in enumerate(class_map.classes):
        assert find_meaning(name, [class_map]) == Meaning(name, name, index, 0, "", is_exact=True)


@pytest.mark.parametrize("word", ["xbox", "bow", "clamp", "tale", "planet bat"])
def test_a_word_that_is_only_like_another_is_not_taken_for_it(word: str) -> None:
    with refuses(RecipeError, "thing-unknown", word):
        find_meaning(word, MAPS)


@pytest.mark.parametrize(
    ("word", "code"),
    [
        ("wall", "thing-unknown"),
        ("refrig", "thing-unknown"),
        ("", "thing-none"),
        ("x" * (MOST_CHARACTERS + 1), "thing-none"),
    ],
)
def test_a_word_that_means_no_class_is_refused(word: str, code: str) -> None:
    with refuses(RecipeError, code):
        find_meaning(word, MAPS)


@pytest.mark.parametrize(
    ("word", "class_name"),
    [
        ("washing machin", "washing machine"),  # a typo comes before the noun `washing`
        ("table lampp", "lamp"),
        ("cup of tea", "cup"),  # not the wider class of the first map
        ("book on the table", "book"),
        ("fork", "tableware"),
        ("banana", None),
        ("lost keys", None),
    ],
)
def test_a_class_and_a_typo_come_before_a_noun(word: str, class_name: str | None) -> None:
    meaning = find_meaning(word, MAPS, nouns=read_nouns())
    assert meaning.class_name == class_name
    assert meaning.noun is not None or class_name != "tableware"


@pytest.mark.parametrize("word", ["flibber", "roof", "kitchen", "the", "in", "he"])
def test_what_is_no_thing_is_no_noun(word: str) -> None:
    with refuses(RecipeError, "thing-unknown", word, golden=False):
        find_meaning(word, MAPS, nouns=read_nouns())


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
        find_meaning(word, MAPS, nouns=read_nouns())
    assert f"it is the word for {kind}, and models look for things. `bsg" in str(caught.value)


@pytest.mark.parametrize(
    "word", ["fire extinguisher", "screw driver", "baby bed", "blue mug", "running shoes", "orange"]
)
def test_a_thing_with_such_a_word_in_its_name_is_a_thing(word: str) -> None:
    assert find_meaning(word, MAPS, nouns=read_nouns()).word == word


@pytest.mark.parametrize(
    ("word", "near"),
    [("Mikrowelle", ""), ("xyz", ""), ("aed", ""), ("irwel", ""), ("zebrra", "zebra")],
)
def test_no_far_guess_is_offered(word: str, near: str) -> None:
    with refuses(RecipeError, "thing-unknown", word, golden=False) as caught:
        find_meaning(word, MAPS, nouns=read_nouns())
    offered = str(caught.value).partition("did you mean ")[2].partition("?")[0]
    assert offered == near


def test_a_typo_in_a_map_of_ones_own_gives_way_to_a_word_that_another_map_has() -> None:
    spellings = b"raw_category,category,class\npointer,pointer,pointer\n"
    own = parse_own_map(
        OwnMap(name="own", spellings=spellings, classes=b"index,class,definition\n0,pointer,A.\n")
    )
    meaning = find_meaning("printer", [own, MAPS[1]], prefer_exact=False)
    assert (meaning.class_name, meaning.model) == ("printer", 1)
    assert find_meaning("poiner", [own, MAPS[1]], prefer_exact=False).class_name == "pointer"
