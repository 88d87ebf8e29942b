"""What a person's word means to a model, by the rules of `Dictionary`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_data.scene.class_map import ClassMap, OwnMap, load_class_map, parse_own_map
from bsg_data.words.normal import LONGEST
from bsg_robot.answers.dictionary import Dictionary
from bsg_robot.answers.words import Meaning


@dataclass(eq=False)
class Model:
    """As much of a predictor as words need."""

    class_map: ClassMap
    is_free: bool = False  # whether it goes without nouns
    untaught: tuple[str, ...] = ()


def read_with(class_map: ClassMap, **options: Any) -> Dictionary:
    model: Any = Model(class_map, **options)
    return Dictionary(model)


MAP, WIDE = load_class_map("hm3d45-v1"), load_class_map("hm3d-wide-v1")
WORDS, WIDER = read_with(MAP), read_with(WIDE)
OWN = parse_own_map(
    OwnMap(
        name="own",
        spellings=b"raw_category,category,class\npointer,pointer,pointer\nfork,fork,cutlery\n",
        classes=b"index,class,definition\n0,pointer,A.\n1,cutlery,B.\n",
    )
)


@pytest.mark.parametrize(
    ("word", "class_name", "words", "how"),
    [
        ("microwave", "microwave", WORDS, ""),
        ('"microwave?"', "microwave", WORDS, "is 'microwave'"),
        ("fridge", "refrigerator", WORDS, "'fridge' is 'refrigerator'"),
        ("shoes", "shoe", WIDER, "'shoes' is 'shoe'"),
        ("book on the table", "book", WORDS, "is 'book'"),
        ("micorwave", "microwave", WORDS, "taken for 'microwave', the most similar name"),
        ("red toilett", "toilet", WORDS, "taken for 'toilet', the most similar name"),
        ("washing machin", "washing machine", WORDS, "taken for 'washing machine'"),
        ("CoffeeTable", "coffee table", WIDER, "'CoffeeTable' is 'coffee table'"),
        ("cup of tea", "tableware", WORDS, "'cup of tea' is 'cup'; people search for it in: "),
        ("salver", "tableware", WORDS, "one of the class 'tableware', and judged by"),
        ("banana", None, WORDS, "'banana' is 'fruit'; people search for it in: kitchen"),
        ("signpost", None, WORDS, "no model counts 'signpost', so it is judged by"),
    ],
)
def test_a_word_has_a_class_and_a_reason(
    word: str, class_name: str | None, words: Dictionary, how: str
) -> None:
    meaning = words.understand(word)
    assert meaning.class_name == class_name
    assert how in meaning.how
    assert bool(how) == bool(meaning.how)


@pytest.mark.parametrize("class_map", [MAP, WIDE], ids=lambda m: m.version)
def test_every_class_is_found_by_its_own_name(class_map: ClassMap) -> None:
    words = read_with(class_map, is_free=True)
    for index, name in enumerate(class_map.classes):
        found = words.understand(name)
        assert (found.class_name, found.class_index, found.how) == (name, index, "") or found.thing


def test_a_class_that_is_wider_than_the_word_says_so() -> None:
    wide, alone = WORDS.understand("laptop"), WIDER.understand("laptop")
    assert (wide.class_name, wide.is_exact, wide.is_class) == ("computer", False, False)
    assert (alone.class_name, alone.is_exact) == ("laptop", True)


def test_a_map_of_ones_own_knows_best_however_wide_it_is_and_mends_a_typo() -> None:
    own = read_with(OWN)
    how = "'fork' is one of the class 'cutlery'"
    assert own.understand("fork") == Meaning("fork", "cutlery", 1, how, is_exact=False)
    assert own.understand("poiner").class_name == "pointer"
    assert own.understand("fridge").class_name is None, "the table of things has it"


@pytest.mark.parametrize(
    ("word", "kind"),
    [
        *(("person", "a person"), ("the old man", "a person"), ("blue", "a colour")),
        *(("run", "an action"), ("fire", "an event")),
    ],
)
def test_a_word_that_names_no_thing_is_refused_with_the_reason(word: str, kind: str) -> None:
    with refuses(RecipeError, "thing-unknown", word) as caught:
        WORDS.understand(word)
    assert f"it is the word for {kind}, and models look for things. `bsg" in str(caught.value)


@pytest.mark.parametrize(
    "word", ["fire extinguisher", "screw driver", "baby bed", "blue mug", "running shoes", "orange"]
)
def test_a_thing_with_such_a_word_in_its_name_is_a_thing(word: str) -> None:
    assert WORDS.understand(word).word == word


@pytest.mark.parametrize(
    ("word", "near"),
    [
        *(("Mikrowelle", ""), ("xyz", ""), ("irwel", ""), ("zebrra", "zebra"), ("the", "lathe")),
        *(("refrig", "refrigerator, refrigerator cabinet"), ("bled", "bed, sled, lead")),
        *(("wall", "wall tv, wallet, ball"), ("roof", "roof box, roof bar, roof tile")),
        *(("kitchen", "toy kitchen, kitchenaid, play kitchen"), ("flibber", "dibber")),
    ],
)
def test_what_is_no_thing_is_refused_and_only_what_is_near_is_offered(word: str, near: str) -> None:
    with refuses(RecipeError, "thing-unknown", word) as caught:
        WORDS.understand(word)
    assert str(caught.value).partition("did you mean ")[2].partition("?")[0] == near


@pytest.mark.parametrize("word", ["", "x" * (LONGEST + 1)])
def test_what_can_name_nothing_is_refused(word: str) -> None:
    with refuses(RecipeError, "thing-none"):
        WORDS.understand(word)
