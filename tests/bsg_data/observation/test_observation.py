"""An observation of several buildings, by hand."""

from __future__ import annotations

import numpy as np
from one_building import observe_building, same_surroundings, surround_rooms

from bsg_data.observation.observation import stack


def test_a_stack_by_hand_is_taken_apart_again() -> None:
    """Two rooms that connect; none; three rooms of which two connect, twice."""
    home = surround_rooms([12, None], [None, "kitchen"], building_kind="home", source="hm3d")
    parts = [
        observe_building(
            [[4], [3], [1]], connected=[(1, 2)], scene_id="a", hidden_share=0.25, surroundings=home
        ),
        observe_building([[9]], scene_id="b"),
        observe_building([[5], [5], [0], [0]], connected=[(1, 3), (2, 3)], scene_id="a"),
    ]
    seen = stack(parts)
    assert len(seen) == 3
    assert seen.scene_ids == ("a", "b", "a")
    assert seen.starts.tolist() == [0, 3, 4, 8]
    assert seen.inputs[:, 0].tolist() == [4, 3, 1, 9, 5, 5, 0, 0]
    assert np.flatnonzero(seen.is_building).tolist() == [0, 3, 4]
    assert seen.building.tolist() == [0, 0, 0, 1, 2, 2, 2, 2]
    assert seen.connections.pairs.tolist() == [[1, 2], [5, 7], [6, 7]]
    for number, part in enumerate(parts):
        own = seen.take([number])
        assert own.connections.pairs.tolist() == part.connections.pairs.tolist()
        assert own.hidden_share.tolist() == part.hidden_share.tolist()
        assert same_surroundings(own.surroundings, part.surroundings)
