"""Searches by several robots: by hand, and against one robot."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bsg_models.search.knowledge import find_ways
from bsg_models.search.simulator import Answer, Episodes, search_together


def in_a_row(instances: list[int]) -> Episodes:
    """Return one search among rooms 1, 2, … in a row, 2 m apart, in which a look costs 3."""
    nodes = len(instances) + 1
    edges = np.full((1, nodes, nodes), np.inf)
    for room in range(1, nodes - 1):
        edges[0, room, room + 1] = edges[0, room + 1, room] = 2.0
    return Episodes(
        travel=find_ways(edges),
        rooms=np.arange(nodes) > 0,
        starts=np.array([1]),
        artifacts=np.array([[5]]),
        instances=np.array([0, *instances])[None, :, None],
        look=np.full(nodes, 3.0),
    )


def believe(*presence: float) -> object:
    def answer(rows: npt.NDArray[np.int64], explored: object, *, shares: bool = True) -> Answer:
        return np.array([0.0, *presence])[None, :, None], None

    return answer


def test_robots_that_go_to_their_nearest_rooms_share_the_rooms() -> None:
    """They look in 1 and 5 until 3 s; then in 2 and 4 until 8 s; the first goes on to 3."""
    ended = search_together(in_a_row([0, 0, 1, 0, 0]), np.array([[1, 5]]), beliefs=None)
    assert (ended.costs[0], ended.entered[0]) == (3 + 5 + 5, 5)


def test_robots_with_beliefs_go_where_it_is_likely() -> None:
    beliefs = believe(0.01, 0.01, 0.01, 0.01, 0.9)
    ended = search_together(in_a_row([0, 0, 0, 0, 1]), np.array([[1, 4]]), beliefs=beliefs)  # type: ignore[arg-type]
    assert ended.costs[0] == 2 + 3  # the one in room 4 goes to 5


def test_a_robot_that_finds_no_room_left_waits_for_the_other() -> None:
    ended = search_together(in_a_row([0, 1]), np.array([[1, 1, 1]]), beliefs=None)
    assert ended.costs[0] == 2 + 3
