from __future__ import annotations

import csv
from importlib.resources import files

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.scene.room_label import (
    LAYOUTS,
    known_label,
    label_of,
    list_room_labels,
    normalise_room,
)

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
        ("cobie", "Physical Examination Room", "examination room"),
        ("s3dis", "conferenceRoom", "meeting room"),
        ("table", None, None),
    ],
)
def test_words_of_sources_and_of_people(source: str, word: str | None, label: str | None) -> None:
    assert label_of(source, word) == label


def test_every_label_is_a_word_for_itself_and_no_row_is_there_twice() -> None:
    labels = list_room_labels()
    assert 25 <= len(labels) <= 40
    text = files("bsg_mappings").joinpath("room-labels-v2.csv").read_text("utf-8")
    rows = list(csv.reader(text.splitlines()))[1:]
    assert rows == sorted(rows)
    assert len({tuple(row[:2]) for row in rows}) == len(rows)
    every = {row[2] for row in rows if row[2]}
    assert {label: label_of("table", label) for label in every} == {n: n for n in every}
    assert {known_label(label) for label in every} == set(labels)
    assert "waiting room" in every - set(labels)


def test_models_know_the_labels_of_the_first_list() -> None:
    """Weights were trained with these, in this order."""
    text = files("bsg_mappings").joinpath("room-labels-v1.csv").read_text("utf-8")
    rows = list(csv.reader(text.splitlines()))[1:]
    assert list_room_labels() == tuple(sorted({row[2] for row in rows if row[2]}))
    assert {word: label_of(source, word) for source, word, _ in rows} == {
        word: label or None for _, word, label in rows
    }


@given(st.text())
def test_number_case_and_hyphens_of_a_room_do_not_matter(name: str) -> None:
    assert normalise_room(f" {name}_12") == normalise_room(f"{name}-7")
    label = label_of("table", name)
    assert label is None or known_label(label) in list_room_labels()
