from __future__ import annotations

import numpy as np

from bsg_data.scene.connections import GIVEN, Connections, stack_connections


def test_pairs_that_a_robot_gives_have_no_length() -> None:
    given = Connections.of_pairs([(1, 2), (2, 5)])
    assert len(given) == 2
    assert given.pairs.tolist() == [[1, 2], [2, 5]]
    assert given.methods.tolist() == [GIVEN, GIVEN]
    assert np.isnan(given.lengths).all()
    assert Connections.of_pairs([(1, 2)], method="door").methods.tolist() == ["door"]
    nothing = Connections.of_pairs(())
    assert (len(nothing), nothing.pairs.shape) == (0, (0, 2))


def test_buildings_are_numbered_one_after_another() -> None:
    nothing = Connections.of_pairs(())
    doors = Connections.of_pairs([(1, 2)], method="door")
    every = stack_connections([doors, nothing, Connections.of_pairs([(1, 3)])], [0, 3, 4])
    assert every.pairs.tolist() == [[1, 2], [5, 7]]
    assert every.methods.tolist() == ["door", GIVEN]
    assert len(stack_connections([], [])) == 0
    assert len(stack_connections([nothing, nothing], [0, 1])) == 0
