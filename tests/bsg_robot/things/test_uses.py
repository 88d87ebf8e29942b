from __future__ import annotations

import csv
import math
from dataclasses import replace

import pytest
from conftest import REPOSITORY

from bsg_robot.things.things import Thing, list_things
from bsg_robot.things.uses import find_use, move_thing

TABLE = (REPOSITORY / "bsg_robot/tables/uses-v1.csv").read_text("utf-8")
ROWS = [*csv.DictReader(TABLE.splitlines())]
WORDS = [word for row in ROWS for word in row["words"].split("|")]
ROOMS = (("dining room", 0.4), ("kitchen", 0.3), ("living room", 0.2), ("office", 0.1))
CHAIR = Thing("chair", ("chair",), "chair", ROOMS, 0.99, 1.0, 2160.0, ("furniture",))


def test_the_table_has_each_word_once_with_rooms_of_homes_that_have_weights() -> None:
    labels = {label for thing in list_things() for label, _ in thing.rooms}
    labels |= {"child's bedroom", "shed", "workshop", "balcony", "basement", "music room"}
    assert len(set(WORDS)) == len(WORDS)
    assert sorted(ROWS, key=lambda row: row["words"]) == ROWS
    for row in ROWS:
        rooms = [part.split(":") for part in row["rooms"].split("|") if part]
        assert len({room for room, _ in rooms}) == len(rooms), row
        assert {room for room, _ in rooms} <= labels, row
        assert all(float(weight) > 0 for _, weight in rooms), row


def test_a_thing_is_mostly_where_the_word_before_it_says() -> None:
    for word in WORDS:
        use, moved = find_use(word), move_thing(CHAIR, [word])
        shares = dict(moved.rooms)
        assert math.isclose(sum(shares.values()), 1)
        assert replace(moved, rooms=CHAIR.rooms) == CHAIR
        assert [*shares.values()] == sorted(shares.values(), reverse=True)
        mostly = moved == CHAIR if use is None else sum(shares[room] for room, _ in use.rooms)
        assert mostly > 0.75, word


def test_what_both_say_by_hand() -> None:
    """Of the use's four fifths, rooms of the thing have more than others; a fifth stays."""
    thing = Thing(
        "seat", ("seat",), None, (("kitchen", 0.9), ("garden", 0.1)), 0.5, 0.5, 24.0, ("tool",)
    )
    rooms = dict(move_thing(thing, ["garden"]).rooms)
    by_use = {"garden": 45 * 0.2, "shed": 20 * 0.1, "garage": 20 * 0.1, "terrace": 15 * 0.1}
    total = sum(by_use.values())
    for room, weight in by_use.items():
        left = 0.2 * dict(thing.rooms).get(room, 0)
        assert rooms[room] == pytest.approx(0.8 * weight / total + left)
    assert rooms["kitchen"] == pytest.approx(0.2 * 0.9)


def test_rooms_and_things_are_uses_too_and_the_word_next_to_the_thing_comes_first() -> None:
    assert move_thing(CHAIR, ["bathroom"]).rooms[0][0] == "bathroom"
    assert move_thing(CHAIR, ["fridge"]).rooms[0][0] == "kitchen"
    assert move_thing(CHAIR, ["red", "zorg"]) == CHAIR
    both = dict(move_thing(CHAIR, ["garden", "dining"]).rooms)
    assert both["garden"] > both["dining room"] > 0


@pytest.mark.parametrize("word", ["paper", "glass", "red", "the", "zorg", "R2", "x" * 101, ""])
def test_words_that_say_nothing_of_a_room(word: str) -> None:
    assert find_use(word) is None
