from __future__ import annotations

import csv
from importlib.resources import files

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.scene.room_label import LAYOUTS, label_of, list_room_labels, normalise_room

# Matterport3D's letters and what its data_organization.md says of each.
MATTERPORT = {
    "a": "bathroom",
    "b": "bedroom",
    "c": "closet",
    "d": "dining room",
    "e": "entrance",
    "f": "living room",
    "g": "garage",
    "h": "corridor",
    "i": "library",
    "j": "laundry room",
    "k": "kitchen",
    "l": "living room",
    "m": "meeting room",
    "n": "lounge",
    "o": "office",
    "p": "terrace",
    "r": "game room",
    "s": "staircase",
    "t": "toilet",
    "u": "utility room",
    "v": "tv room",
    "w": "gym",
    "x": "garden",
    "y": "terrace",
    "z": None,
    "B": "bar",
    "C": "classroom",
    "D": "dining room",
    "S": "spa",
    "Z": None,
    "-": None,
}


def test_matterports_letters_are_read_with_their_case() -> None:
    assert {letter: label_of("mp3d", letter) for letter in MATTERPORT} == MATTERPORT


@pytest.mark.parametrize(
    ("source", "word", "label"),
    [
        ("behavior", "childs_room", "bedroom"),
        ("behavior", "grocery_store", "shop"),
        ("behavior", "empty_room", None),
        ("procthor", "LivingRoom", "living room"),
        (LAYOUTS, "hallway", "corridor"),
        (LAYOUTS, "kitchen/living room", "kitchen"),  # the first that is named
        (LAYOUTS, "other", None),
        ("table", "Kitchen", "kitchen"),
        ("table", "Master-Bedroom 2", "bedroom"),
        ("table", "bathroom_0", "bathroom"),
        ("table", "b", None),  # a letter is Matterport3D's word alone
        ("table", "Room 101", None),
        ("table", "7", None),
        ("nobody's", "office", "office"),
        ("table", None, None),
    ],
)
def test_words_of_sources_and_of_people(source: str, word: str | None, label: str | None) -> None:
    assert label_of(source, word) == label


def test_every_label_is_a_word_for_itself_and_no_row_is_there_twice() -> None:
    labels = list_room_labels()
    assert 25 <= len(labels) <= 40
    assert {label: label_of("table", label) for label in labels} == {n: n for n in labels}
    text = files("bsg_mappings").joinpath("room-labels-v1.csv").read_text("utf-8")
    rows = list(csv.reader(text.splitlines()))[1:]
    assert rows == sorted(rows)
    assert len({tuple(row[:2]) for row in rows}) == len(rows)
    assert {row[2] for row in rows if row[2]} == set(labels)


@given(st.text())
def test_number_case_and_hyphens_of_a_room_do_not_matter(name: str) -> None:
    assert normalise_room(f" {name}_12") == normalise_room(f"{name}-7")
    assert label_of("table", name) in (None, *list_room_labels())
