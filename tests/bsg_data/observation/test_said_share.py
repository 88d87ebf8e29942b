from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from bsg_data.errors import RecipeError
from bsg_data.observation.hidden_share import VAGUE, ShareBelief, estimate_hidden_share
from bsg_data.observation.said_share import SaidShare


@pytest.mark.parametrize(
    ("said", "believed"),
    [
        ({}, VAGUE),
        ({"visited": False}, ShareBelief(1.0)),
        ({"hidden_share": 0.25}, ShareBelief(0.25)),
        ({"hidden_share": 0.25, "hidden_share_sd": 0.125}, ShareBelief(0.25, 0.125)),
        ({"floor_in_view": 0.5}, estimate_hidden_share(floor_in_view=0.5)),
        ({"walls_in_view": 0.5}, estimate_hidden_share(walls_in_view=0.5)),
    ],
)
def test_a_share_is_said_or_estimated(said: dict[str, Any], believed: ShareBelief) -> None:
    assert SaidShare.model_validate(said).believe() == believed


def test_the_time_inside_counts_by_the_size_of_the_room() -> None:
    said = SaidShare(seconds_inside=20.0)
    hall, closet = said.believe(floor_area=60.0), said.believe(floor_area=4.0)
    assert hall.mean > closet.mean
    assert hall == estimate_hidden_share(seconds_inside=20.0, floor_area=60.0)


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ({"hidden_share": 0.5, "floor_in_view": 0.5}, "hidden_share and floor_in_view"),
        ({"hidden_share": 0.5, "seconds_inside": 3.0}, "hidden_share and seconds_inside"),
        ({"hidden_share_sd": 0.1}, "hidden_share_sd without hidden_share"),
        ({"hidden_share": 1.0, "hidden_share_sd": 0.1}, "standard deviation"),
    ],
)
def test_what_cannot_both_be_is_refused(said: dict[str, Any], why: str) -> None:
    with pytest.raises(RecipeError, match=why):
        SaidShare.model_validate(said).believe()


@pytest.mark.parametrize("share", [-0.1, 1.5, float("nan"), "0.5", True])
def test_a_share_is_a_number_from_0_to_1(share: Any) -> None:
    with pytest.raises(ValidationError):
        SaidShare(hidden_share=share)
