from __future__ import annotations

import pytest
from pydantic import ValidationError

from bsg_data.observation.robot_faults import explain_fault
from bsg_data.recipes import Record


class Room(Record):
    id: str
    size: int = 0


class Building(Record):
    rooms: tuple[Room, ...]


KEYS = {"": ("rooms",), "rooms": ("id", "size")}


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ([], "the whole file: expected a JSON object"),
        ({"rooms": 5}, "rooms: expected a JSON list"),
        ({"rooms": "abc"}, "rooms: expected a JSON list"),
        ({"rooms": None}, "rooms: expected a JSON list"),
        ({"roms": []}, "'roms' is no key; did you mean rooms?"),
        ({"rooms": [{"id": "hall", "colour": 1}]}, "room 'hall': 'colour' is no key; known are id"),
        ({"rooms": [{"id": "hall", "size": "x"}]}, "room 'hall': size: Input should be"),
        ({"rooms": [{"id": "hall"}] * 2 + [{"id": 5}]}, "room number 3: id: Input should be"),
        ({"rooms": [{"id": "hall"}] * 21 + [None]}, "room number 22: expected a JSON object"),
        ({"rooms": [{"id": "hall"}] * 112 + [None]}, "room number 113: expected a JSON object"),
        ({"rooms": [{"id": "x" * 500, "size": "x"}]}, f"room '{'x' * 80}': size: "),
    ],
)
def test_a_fault_is_told_in_words_of_the_document(said: object, expected: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Building.model_validate(said)
    assert explain_fault(caught.value, said, keys=KEYS).startswith(expected)
