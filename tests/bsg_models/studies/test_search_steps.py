"""The rule by which a search is shown, worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from bsg_models.search.knowledge import Knowledge, find_ways
from bsg_models.search.simulator import Step
from bsg_models.studies.search_steps import (
    KEPT,
    KeptSearch,
    KeptStep,
    belief_changes,
    choose_kept,
    choose_shown,
    find_eventful,
    walk_of,
)

CORRIDOR = np.full((4, 4), np.inf)  # rooms 1 – 2 – 3 in a row, 2 m and 3 m apart
CORRIDOR[[1, 2, 2, 3], [2, 1, 3, 2]] = 2.0, 2.0, 3.0, 3.0


def step(rows: list[int], presence: list[list[float]], entered: int, target: int) -> Step:
    """Return a step of searches that begin in room 1, of which some go on."""
    shown = np.array(presence)[:, :, None]
    known = Knowledge(
        task="single",
        here=np.full(len(rows), 1),
        travel=find_ways(np.repeat(CORRIDOR[None], 3, axis=0)),
        rows=np.array(rows),
        unexplored=shown[:, :, 0] > 0,
        wanted=np.ones((len(rows), 1), dtype=bool),
        presence=shown,
        share=None,
    )
    places = (np.full(len(rows), target), np.full(len(rows), entered))
    return Step(np.array(rows), known, *places)


FIRST = step([0, 1, 2], [[0, 0, 0.2, 0.5], [0, 0, 0.2, 0.5], [0, 0, 0.9, 0.9]], 2, 3)
SECOND = step([0, 2], [[0, 0, 0, 0.8], [0, 0, 0, 0.6]], 3, 3)


def kept(episode: int, *, saved: float, change: float, eventful: bool = True) -> KeptSearch:
    def walk(cost: float) -> tuple[KeptStep, ...]:
        return (KeptStep(1, 1, (1,), np.array([0.0, cost]), np.zeros((2, 1))),)

    return KeptSearch(
        scene_id="a",
        world="layout",
        task="single",
        planner="ratio",
        episode=episode,
        start=1,
        artifacts=(0,),
        draw=0,
        eventful=eventful,
        change=change,
        walks={"ratio": walk(10 * (1 - saved)), "nearest": walk(10.0)},
    )


def test_beliefs_change_by_the_mean_over_the_rooms_that_are_open() -> None:
    # Room 2 is entered; room 3 goes from .5 to .8, and from .9 to .6; search 1 has ended.
    np.testing.assert_allclose(belief_changes([FIRST, SECOND], 4), [0.3, 0, 0.3, 0])


def test_a_walk_goes_through_the_rooms_on_the_way() -> None:
    first, second = walk_of([FIRST, SECOND], 2)
    assert (first.entered, first.target, first.way, first.cost) == (2, 3, (2,), 2.0)
    assert (second.entered, second.way, second.cost) == (3, (2, 3), 5.0)
    np.testing.assert_array_equal(second.presence[:, 0], [0, 0, 0, 0.6])
    assert len(walk_of([FIRST, SECOND], 1)) == 1


def test_an_eventful_search_has_few_holders_and_many_rooms_for_either_robot() -> None:
    chance = np.array([0.25, 0.26, 0.1, 0.1])
    entered = [np.array([4, 9, 9, 3]), np.array([4, 9, 3, 9])]
    assert find_eventful(chance, entered).tolist() == [True, False, False, False]


def test_a_building_keeps_eventful_searches_first_then_those_of_changing_beliefs() -> None:
    eventful, changes = np.array([False, True, False, True]), np.array([0.9, 0.1, 0.5, 0.2])
    assert choose_kept(eventful, changes).tolist() == [3, 1, 0, 2]
    assert choose_kept(np.ones(40, dtype=bool), np.zeros(40)).tolist() == list(range(KEPT))


@pytest.mark.parametrize(
    ("searches", "shown"),
    [
        # Of those within 15 points of 40 %, the one in which beliefs change most.
        ([kept(0, saved=0.4, change=0.1), kept(1, saved=0.27, change=0.2)], 1),
        ([kept(0, saved=0.4, change=0.1), kept(1, saved=0.9, change=0.2)], 0),
        # None is within 15 points: the nearest.
        ([kept(0, saved=-2, change=0.9), kept(1, saved=0.8, change=0.2)], 1),
        # An eventful one goes before a typical one.
        ([kept(0, saved=0.4, change=0.9, eventful=False), kept(1, saved=-2, change=0.1)], 1),
        ([kept(0, saved=0.9, change=0.9, eventful=False), kept(1, saved=0.4, change=0)], 1),
        # All alike: the first.
        ([kept(0, saved=0.4, change=0.1), kept(1, saved=0.4, change=0.1)], 0),
    ],
)
def test_the_search_that_is_shown_is_a_usual_one(searches: list[KeptSearch], shown: int) -> None:
    assert choose_shown(searches, "nearest", 0.4).episode == shown
