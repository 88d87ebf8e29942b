"""Receptacles: their names, and where kinds of things are kept."""

from __future__ import annotations

import numpy as np
import pytest

from bsg_data.scene.receptacles import (
    find_keeping,
    find_receptacle,
    list_receptacles,
    read_shares,
)
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.things import find_thing, list_things


@pytest.mark.parametrize(
    ("word", "name"),
    [
        ("fridge", "refrigerator"),
        ("Night_Stand", "nightstand"),
        ("CoffeeTable", "coffee table"),
        ("worktops", "counter"),
        ("chest of drawers", "dresser"),
        ("banana", None),
        ("wall", None),
        ("", None),
    ],
)
def test_words_of_robots_name_pieces_of_furniture(word: str, name: str | None) -> None:
    found = find_receptacle(word)
    assert (found and found.name) == name


@pytest.mark.parametrize(
    ("thing", "first"),
    [
        ("milk", "refrigerator"),
        ("mug", "top cabinet"),
        ("cutlery", "bottom cabinet"),
        ("pillow", "bed"),
        ("remote control", "coffee table"),
        ("toothbrush", "sink"),
        ("shampoo", "shower"),
        ("winter coat", "coat rack"),
        ("sneakers", "shoe rack"),
        ("ice cream", "freezer"),
        ("dirty plate", "sink"),
        ("dirty socks", "laundry basket"),
        ("laptop", "table"),
        ("book", "shelf"),
        ("laundry", "laundry basket"),
        ("keys", "key rack"),
    ],
)
def test_a_person_would_look_there_first(thing: str, first: str) -> None:
    kept = find_keeping(thing)
    assert kept is not None
    assert max(kept.weights, key=kept.weights.__getitem__) == first


def test_what_stands_by_itself_is_on_nothing_and_of_others_nothing_is_said() -> None:
    for thing in ("wardrobe", "sofa", "bicycle", "fridges"):
        kept = find_keeping(thing)
        assert kept is not None, thing
        assert not kept.weights, thing
    assert find_keeping("sextant") is None


def test_the_tables_are_whole() -> None:
    shares, pieces = read_shares(), list_receptacles()
    assert set(shares.rooms) <= set(list_room_labels())
    assert shares.belongs.shape == shares.untidy.shape == (len(shares.rooms), len(pieces))
    assert ((shares.belongs > 0) & (shares.belongs < 1)).all()
    for piece in pieces:  # each is a piece of furniture, and is like itself
        found = find_receptacle(piece)
        assert found is not None, piece
        assert pieces.index(piece) in found.like
    known = [find_keeping(thing.name) for thing in list_things()]
    names = {name for kept in known if kept for name in kept.weights}
    assert [
        name for name in names if not (found := find_receptacle(name)) or found.name != name
    ] == []
    assert np.mean([one is not None for one in known]) > 0.98
    assert find_thing("milk") is not None
