"""Observations of several buildings, and of moments in a search, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from one_building import observe_building, surround_rooms

from bsg_data.observation.observation import Observation, stack

HOME = surround_rooms([12, None], [None, "kitchen"], building_kind="home", source="hm3d")


@pytest.fixture
def parts() -> list[Observation]:
    """Two rooms that connect; none; three rooms of which two connect, twice."""
    return [
        observe_building(
            [[4, 1], [3, 1], [1, 0]],
            hidden_share=0.25,
            connected=[(1, 2)],
            scene_id="a",
            surroundings=HOME,
        ),
        observe_building([[9, 9]], scene_id="b"),
        observe_building(
            [[5, 0], [5, 0], [0, 0], [0, 0]],
            hidden_share=[0.5, 0.0, 0.5, 1.0],
            visited=[True, True, True, False],
            withheld=[1],
            connected=[(1, 3), (2, 3)],
            scene_id="a",
        ),
    ]


def test_a_stack_by_hand(parts: list[Observation]) -> None:
    seen = stack(parts)
    assert len(seen) == 3
    assert seen.scene_ids == ("a", "b", "a")
    assert seen.starts.tolist() == [0, 3, 4, 8]
    assert seen.inputs[:, 0].tolist() == [4, 3, 1, 9, 5, 5, 0, 0]
    assert np.flatnonzero(seen.is_building).tolist() == [0, 3, 4]
    assert seen.building.tolist() == [0, 0, 0, 1, 2, 2, 2, 2]
    assert seen.connections.pairs.tolist() == [[1, 2], [5, 7], [6, 7]]
    own = [seen.take([number]).connections.pairs.tolist() for number in range(3)]
    assert own == [[[1, 2]], [], [[1, 3], [2, 3]]]


def test_the_share_of_a_cell_is_its_nodes_and_all_where_a_class_is_withheld(
    parts: list[Observation],
) -> None:
    assert parts[0].cell_share.tolist() == [[0.25, 0.25]] * 3
    assert parts[2].cell_share.tolist() == [[0.5, 1], [0, 1], [0.5, 1], [1, 1]]
    assert parts[2].cell_share.dtype == np.float64
