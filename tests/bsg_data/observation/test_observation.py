"""Observations of several buildings, and of moments in a search, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from one_building import observe_building, same_surroundings, surround_rooms

from bsg_data.observation.observation import Observation, observe_search, stack
from bsg_data.observation.view import View
from bsg_data.scene.connections import Connections
from bsg_data.scene.surroundings import Surroundings

HOME = surround_rooms([12, None], [None, "kitchen"], building_kind="home", source="hm3d")
FIELDS = ("starts", "inputs", "hidden_share", "visited", "withheld", "unclassified")


def same(a: Observation, b: Observation) -> bool:
    return (
        (a.scene_ids, a.vocabulary) == (b.scene_ids, b.vocabulary)
        and all(np.array_equal(getattr(a, name), getattr(b, name)) for name in FIELDS)
        and np.array_equal(a.connections.pairs, b.connections.pairs)
        and same_surroundings(a.surroundings, b.surroundings)
    )


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


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0], [1], [2, 2, 1, 0]])
def test_what_is_taken_is_what_was_stacked(parts: list[Observation], order: list[int]) -> None:
    assert same(stack(parts).take(order), stack([parts[number] for number in order]))


def search(
    cells: list[list[int]],
    left: list[list[int]],
    *,
    searched: list[int],
    artifact: int,
    view: View | None = None,
    unclassified: list[list[int]],
    unclassified_left: list[list[int]] | None = None,
    blind: list[int] | None = None,
) -> Observation:
    """Observe a search; every room was visited and hides half, if no view is given."""
    nodes = len(cells)
    return observe_search(
        "home",
        view or View.of_rooms(np.full(nodes - 1, 0.5), classes=len(cells[0])),
        there=(np.array(cells), np.array(unclassified)),
        left=(np.array(left), np.array(unclassified_left or unclassified)),
        searched=np.isin(np.arange(nodes), searched),
        artifacts=np.array([artifact]),
        blind=np.isin(np.arange(len(cells[0])), blind or []),
        vocabulary=("tap",),
        connections=Connections.of_pairs(()),
        surroundings=Surroundings.unknown(nodes=nodes),
    )


def test_a_moment_of_a_search_by_hand() -> None:
    seen = search(
        [[1, 1], [4, 2], [0, 6], [2, 2]],  # the null region, then three rooms
        [[1, 1], [2, 1], [0, 3], [1, 1]],
        unclassified=[[0], [5], [1], [2]],
        unclassified_left=[[0], [2], [1], [0]],
        searched=[1],
        artifact=1,
    )
    assert seen.inputs.tolist() == [[1 + 4 + 0 + 1, 2], [4, 2], [0, 0], [1, 0]]
    assert seen.hidden_share.tolist() == pytest.approx([0.5 * 2 / 3, 0.0, 0.5, 0.5])
    assert seen.withheld.tolist() == [[False, True], [False, False], [False, True], [False, True]]
    assert seen.unclassified.tolist() == [[0 + 5 + 1 + 0], [5], [1], [0]]
    assert seen.visited.all()


def test_what_a_mask_told_of_rooms_stays_until_they_are_searched() -> None:
    """Of four rooms one was searched before, one half seen, one glimpsed, one not entered."""
    view = View.of_rooms(
        np.array([0.0, 0.4, 0.8, 1.0]), classes=2, entered=np.array([True, True, False, False])
    ).withhold(np.array([True, False]))
    seen = search(
        [[0, 0], [3, 3], [3, 3], [3, 3], [3, 3]],
        [[0, 0], [3, 3], [0, 2], [0, 1], [0, 0]],
        view=view,
        unclassified=[[0]] * 5,
        searched=[3],
        artifact=1,
    )
    assert seen.hidden_share.tolist() == pytest.approx([0.35, 0.0, 0.4, 0.0, 1.0])
    assert seen.visited.tolist() == [True, True, True, True, False]
    assert seen.inputs.tolist() == [[6, 3], [3, 0], [0, 0], [3, 3], [0, 0]]
    assert seen.withheld.tolist() == [
        [True, True],
        [False, True],  # the mask withheld nothing here; of the artifact nothing is shown
        [True, True],
        [False, False],
        [True, True],
    ]


def test_what_a_source_cannot_name_is_not_absent_in_a_searched_room() -> None:
    cells = [[0, 0], [1, 0], [2, 0]]
    seen = search(cells, cells, searched=[1], artifact=0, unclassified=[[0]] * 3, blind=[1])
    assert seen.withheld[1].tolist() == [False, True]
    assert seen.cell_share[1].tolist() == [0.0, 1.0]
