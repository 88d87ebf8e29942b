"""The planners by hand, the table of their names, and planners of somebody else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from refusals import refuses

from bsg_data.arrays import Ints
from bsg_data.errors import RecipeError
from bsg_models.search.catalogue import PLANNERS, Planner, find_planner
from bsg_models.search.knowledge import Knowledge
from bsg_models.search.planners import next_room

ROW = np.full((6, 6), np.inf)  # rooms 1 – 2 – 3 – 4 in a row, 5 out of reach
for a, cost in ((1, 1.0), (2, 1.0), (3, 5.0)):
    ROW[a, a + 1] = ROW[a + 1, a] = cost
HERE: dict[str, Any] = {
    "here": 2,
    "explored": np.array([False, False, True, False, False, False]),
    "presence": np.array([0, 0.3, 0.9, 0.4, 0.5, 1.0]),
}


def farthest(known: Knowledge) -> Ints:
    """Go to the unexplored room that is farthest away."""
    return np.where(known.unexplored, known.distance, -1.0).argmax(axis=1)


def test_what_stands_for_a_planner() -> None:
    assert find_planner("nearest") is PLANNERS["nearest"]
    assert find_planner(farthest) == Planner(farthest, "belief")
    with pytest.raises(RecipeError):
        find_planner("nearst")
    with refuses(RecipeError, "planner-unknown", where="3"):
        find_planner(3)  # type: ignore[arg-type]


def test_the_next_room_of_a_robot_of_its_own() -> None:
    share = np.array([0, 0.2, 0.9, 0.1, 0.05, 1.0])
    for planner, room in (
        ("nearest", 1),
        ("greedy-belief", 4),
        ("greedy-share", 1),
        ("ratio", 3),
        ("expected-cost", 1),
        (farthest, 4),
        (Planner(farthest, "none"), 4),
    ):
        assert next_room(ROW, **HERE, planner=planner, share=share) == room
    explored = np.array([False, True, True, True, True, False])
    assert next_room(ROW, **{**HERE, "explored": explored}) is None


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"presence": [0, np.nan, 0.5]}, "presence"),
        ({"edges": np.ones((3, 2))}, "edges"),
        ({"here": 3}, "explored"),
        ({"share": [0, 0.5]}, "share"),
    ],
)
def test_arrays_that_no_robot_can_mean_are_refused(change: dict[str, Any], where: str) -> None:
    known: dict[str, Any] = {
        "edges": np.ones((3, 3)),
        "here": 1,
        "explored": np.zeros(3, dtype=bool),
        "presence": [0, 0.5, 0.5],
    }
    with refuses(RecipeError, "array-misshapen", where=where):
        next_room(**{**known, **change})


def test_what_no_robot_can_do_is_refused() -> None:
    with refuses(RecipeError, "task-unknown", where="task"):
        next_room(ROW, **HERE, task="both")  # type: ignore[arg-type]
    with refuses(RecipeError, "planner-reads-truth", where="oracle"):
        next_room(ROW, **HERE, planner="oracle")
    with refuses(RecipeError, "share-missing", where="greedy-share"):
        next_room(ROW, **HERE, planner="greedy-share")


@pytest.mark.parametrize(
    "answer",
    [[2], [5], [6], [1.0], [1, 1]],
    ids=["explored", "far", "above", "fraction", "two"],
)
def test_an_answer_that_is_no_unexplored_room_is_refused(answer: list[Any]) -> None:
    def broken(known: Knowledge) -> Ints:
        return np.array(answer)

    with refuses(RecipeError, "planner-names-no-room", where="broken"):
        next_room(ROW, **HERE, planner=broken)
