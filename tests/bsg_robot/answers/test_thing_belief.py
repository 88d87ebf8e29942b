from __future__ import annotations

import numpy as np

from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_robot.answers.thing_belief import lift
from bsg_robot.answers.unknown_rooms import Apart


def test_no_room_is_sure_where_a_network_forgets_it_in_the_building() -> None:
    """The paper's network predicts a building by itself: 0, though a room may have one."""
    means = np.array([[0.0], [0.04], [0.02]])
    every = Expectation(np.zeros((3, 1)), poisson(means))
    belief = Apart(every, (np.array([1, 2]),), (1 - every.presence[0],))
    rates = np.array([[0.5], [0.3], [0.2]])
    found = lift(belief, rates, weight=np.array([0.5]), least=np.zeros((3, 1)))
    assert 0.02 < found.presence[2, 0] < found.presence[1, 0] < 0.3
