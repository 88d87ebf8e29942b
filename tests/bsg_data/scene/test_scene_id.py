from __future__ import annotations

import pytest

from bsg_data.scene.scene_id import building_hash, split_scene_id


@pytest.mark.parametrize(
    ("scene_id", "number", "building"),
    [
        ("00006-HkseAnWCgqk", 6, "HkseAnWCgqk"),
        ("HkseAnWCgqk", None, "HkseAnWCgqk"),
        ("00006-a-b", 6, "a-b"),
        ("6-HkseAnWCgqk", None, "6-HkseAnWCgqk"),
        ("00006-", None, "00006-"),
    ],
)
def test_a_number_has_five_digits_and_a_hash_behind_it(
    scene_id: str, number: int | None, building: str
) -> None:
    assert split_scene_id(scene_id) == (number, building)
    assert building_hash(scene_id) == building
