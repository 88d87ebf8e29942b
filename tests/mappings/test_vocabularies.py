"""What mappings/README.md says of the vocabularies of detectors, simulators and data sets."""

from __future__ import annotations

import csv
from importlib.resources import files

import pytest
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_data.scene.class_map import ClassMap, load_class_map
from bsg_data.scene.synonyms import vocabulary_words
from bsg_data.words.normal import take_apart

MAPS = [load_class_map(name) for name in ("hm3d45-v1", "hm3d-wide-v1")]
DEFAULT = MAPS[0]
NUMBERS = {"ade20k": 150, "ai2thor": 134, "coco": 80, "darknet": 80, "mpcat40": 42, "nyu40": 40}
NUMBERS |= {"objectnav": 21, "voc": 20}
# Words that a source's own map lists with another class than ours. By `Desktop` a person means the
# computer, and ProcTHOR its tower; by `fan` COBie means ventilation.
OF_A_SOURCE_ALONE = {"procthor45-v1": {"Desktop"}, "behavior45-v1": {"notepad"}}
OF_A_SOURCE_ALONE |= {"cobie45-v1": {"fan"}}


def read(name: str, *, folder: str = "bsg_mappings") -> list[dict[str, str]]:
    with files(folder).joinpath(name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, strict=True))


ROWS = read("vocabularies-v1.csv")


def class_of(class_map: ClassMap, name: str) -> str | None:
    index = class_map.classify(name).class_index
    return None if index is None else class_map.classes[index]


SAID = {
    "television": ("tv", "vocabulary"),
    "TV-stand": ("tv stand", "separator"),
    "beds": ("bed", "number"),
    "house plant": ("plant", "vocabulary"),
    "small plant": ("plant", "head noun"),
    "bed side table": ("bedside table", "separator"),
    "rubbish_bin": ("trash can", "synonym"),
    "LeatherArmchair_2": ("armchair", "head noun"),
    "MacBook": ("laptop", "synonym"),
    "red toilett": ("toilet", "spelling"),
    "wastepaper baskets": ("trash can", "synonym"),
    "shower curtain": ("shower curtain", None),
}
# `drawer` and `glasses` are listed without a class; `baseball glove` is in a vocabulary.
MISLEADING = """dresser drawer, night stand drawer, reading glasses, pair of glasses, slow cooker,
large dog dish, boom box, seat belt, heat sink, wheel chair, blood pressure monitor, number plate,
clothes drying rack, kitchen oven, baseball glove, conveyer belt, GameBoy, painter, battle, sofaa"""


def test_what_a_robot_says_and_a_last_word_that_misleads() -> None:
    read = {name: DEFAULT.classify(name) for name in SAID}
    assert {name: (found.category, found.rule) for name, found in read.items()} == SAID
    names = " ".join(MISLEADING.split()).split(", ")
    assert {name for name in names if DEFAULT.classify(name).role != "unmapped"} == set()


def test_vocabularies_are_whole_and_their_words_named_once() -> None:
    found = {name: vocabulary_words(name) for name in {row["vocabulary"] for row in ROWS}}
    assert {name: len(found[name]) for name in NUMBERS} == NUMBERS
    assert {*found} - NUMBERS.keys() == {"lvis"}
    assert all(len(set(words)) == len(words) for words in found.values())
    assert {*found["voc"]} <= {*found["darknet"]}
    with refuses(RecipeError, "vocabulary-unknown", "cocoo"):
        vocabulary_words("cocoo")


@pytest.mark.parametrize("class_map", MAPS, ids=lambda m: m.version)
def test_every_word_has_the_class_of_its_category_in_any_spelling(class_map: ClassMap) -> None:
    for row in ROWS:
        word, category = row["word"], row["category"]
        expected = class_of(class_map, category) if category else None
        apart = take_apart(word).replace("_", " ")
        forms = {word, word.lower(), word.upper(), apart, apart.replace(" ", "-"), f"{word}_2"}
        assert {form: class_of(class_map, form) for form in forms} == dict.fromkeys(forms, expected)
        assert category == "" or class_map.lookup(category) is not None, word
    for name in ("ade20k", "mpcat40"):  # label spaces say the same
        rows = read(f"labels-{name}.csv")
        assert {row["label"] for row in rows} == {*vocabulary_words(name)}
        for row in rows:
            assert class_of(class_map, row["label"]) == class_of(class_map, row["category"]), row


def test_a_word_is_the_same_under_all_maps_into_one_space_if_they_know_it() -> None:
    for name in ("procthor45-v1", "behavior45-v1", "mp3d45-v1", "cobie45-v1"):
        other = load_class_map(name)
        known = [row["word"] for row in ROWS if other.classify(row["word"]).category is not None]
        differing = {word for word in known if class_of(other, word) != class_of(DEFAULT, word)}
        assert differing == OF_A_SOURCE_ALONE.get(name, set()), name


def test_words_that_name_no_thing_are_not_those_that_a_map_or_a_vocabulary_gives_a_class() -> None:
    rows = read("not-things-v1.csv", folder="bsg_robot.tables")
    assert [row["word"] for row in rows] == sorted({row["word"] for row in rows})
    assert {row["kind"] for row in rows} == {"person", "animal", "colour", "action", "event"}
    for class_map in MAPS:
        assert [row["word"] for row in rows if class_of(class_map, row["word"])] == []
