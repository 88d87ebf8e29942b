from __future__ import annotations

import numpy as np

from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_robot.answers.thing_belief import lift
from bsg_robot.answers.unknown_rooms import Apart


def test_a_network_that_forgets_a_room_in_the_building_is_taken_at_the_word_of_the_room() -> None:
    """The paper's network may say 0 of a building, and .04 of its room: the log odds of none.

    By hand: half of the way from those of the likeliest room to those of homes, on each room.
    """
    means = np.array([[0.0], [0.04], [0.02]])
    every = Expectation(np.zeros((3, 1)), poisson(means))
    belief = Apart(every, (np.array([1, 2]),), (1 - every.presence[0],))
    rates = np.array([[0.5], [0.3], [0.2]])
    found = lift(belief, rates, weight=np.array([0.5]), least=np.zeros((3, 1)))
    none, homes, likeliest = np.exp(-0.06), np.exp(-0.5), np.exp(-0.04)
    odds = none / (1 - none)
    odds *= np.sqrt(homes / (1 - homes) / (likeliest / (1 - likeliest)))
    anywhere = 1 / (1 + odds)
    rooms = (1 - np.exp(-means[1:])) * anywhere / (1 - none)
    np.testing.assert_allclose(found.presence[1:], rooms, rtol=1e-9)
