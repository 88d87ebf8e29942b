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


@pytest.mark.parametrize(
    ("source", "word", "label"),
    [
        ("mp3d", "b", "bedroom"),
        ("mp3d", "B", "bar"),  # with its case
        ("mp3d", "z", None),
        ("behavior", "childs_room", "bedroom"),
        ("behavior", "empty_room", None),
        ("procthor", "LivingRoom", "living room"),
        (LAYOUTS, "kitchen/living room", "kitchen"),  # the first that is named
        ("table", "Master-Bedroom 2", "bedroom"),
        ("table", "b", None),  # a letter is Matterport3D's word alone
        ("table", "Room 101", None),
        ("nobody's", "office", "office"),
        ("cobie", "Physical Examination Room", "examination room"),
        ("s3dis", "conferenceRoom", "meeting room"),
        ("table", None, None),
    ],
)
def test_words_of_sources_and_of_people(source: str, word: str | None, label: str | None) -> None:
    assert label_of(source, word) == label


def test_every_label_is_a_word_for_itself_and_models_know_those_of_the_first_list() -> None:
    """Weights were trained with these, in this order."""
    folder = files("bsg_mappings")
    first, rows = (
        list(csv.reader(folder.joinpath(f"room-labels-v{v}.csv").read_text("utf-8").splitlines()))
        for v in (1, 2)
    )
    assert rows[1:] == sorted(rows[1:])
    assert len({tuple(row[:2]) for row in rows}) == len(rows)
    labels = {row[2] for row in rows[1:] if row[2]}
    assert {label: label_of("table", label) for label in labels} == {n: n for n in labels}
    assert list_room_labels() == tuple(sorted({row[2] for row in first[1:] if row[2]}))
    assert {known_label(label) for label in labels} == set(list_room_labels())
    assert all(label_of(source, word) == (label or None) for source, word, label in first[1:])


@given(st.text())
def test_number_case_and_hyphens_of_a_room_do_not_matter(name: str) -> None:
    assert normalise_room(f" {name}_12") == normalise_room(f"{name}-7")
    label = label_of("table", name)
    assert label is None or known_label(label) in list_room_labels()
