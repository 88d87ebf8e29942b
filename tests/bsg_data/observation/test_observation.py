"""Observations of several buildings, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from one_building import observe_building

from bsg_data.observation.observation import Observation, stack
from bsg_data.scene.surroundings import EVIDENCE, Surroundings

HOME = Surroundings.of_rooms([12, None], [None, "kitchen"], building_kind="home", source="hm3d")
FIELDS = ("starts", "inputs", "hidden_share", "visited", "withheld", "others")


def same(a: Observation, b: Observation) -> bool:
    return (
        (a.scene_ids, a.vocabulary) == (b.scene_ids, b.vocabulary)
        and all(np.array_equal(getattr(a, name), getattr(b, name)) for name in FIELDS)
        and np.array_equal(a.connections.pairs, b.connections.pairs)
        and same_surroundings(a.surroundings, b.surroundings)
    )


def same_surroundings(a: Surroundings, b: Surroundings) -> bool:
    return (
        (a.building_kinds, a.sources) == (b.building_kinds, b.sources)
        and np.array_equal(a.floor_area, b.floor_area, equal_nan=True)
        and np.array_equal(a.labels, b.labels)
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
    assert [seen.connections_of(number).pairs.tolist() for number in range(3)] == [
        [[1, 2]],
        [],
        [[1, 3], [2, 3]],
    ]


def test_the_share_of_a_cell_is_its_nodes_and_all_where_a_class_is_withheld(
    parts: list[Observation],
) -> None:
    assert parts[0].cell_share.tolist() == [[0.25, 0.25]] * 3
    assert parts[2].cell_share.tolist() == [[0.5, 1], [0, 1], [0.5, 1], [1, 1]]
    assert parts[2].cell_share.dtype == np.float64


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0], [1], [2, 2, 1, 0]])
def test_what_is_taken_is_what_was_stacked(parts: list[Observation], order: list[int]) -> None:
    assert same(stack(parts).take(order), stack([parts[number] for number in order]))


def test_stacks_are_stacked(parts: list[Observation]) -> None:
    whole = stack(parts)
    assert same(stack([stack(parts[:2]), parts[2]]), whole)
    assert same(stack([parts[0], stack(parts[1:])]), whole)


def test_what_cannot_be_stacked_is_refused(parts: list[Observation]) -> None:
    with pytest.raises(
        ValueError, match="expected one or more observations of the same vocabulary"
    ):
        stack([parts[0], observe_building([[1, 1]], vocabulary=("tap",))])
    with pytest.raises(ValueError, match="expected one or more observations"):
        stack([])


def test_surroundings_go_with_their_buildings(parts: list[Observation]) -> None:
    around = stack(parts).surroundings
    assert around.building_kinds == ("home", "", "")
    np.testing.assert_array_equal(around.floor_area[:4], [np.nan, 12, np.nan, np.nan])
    assert same_surroundings(stack(parts).take([2, 0]).take([1]).surroundings, HOME)


def test_a_maker_who_says_nothing_of_surroundings_knows_nothing(parts: list[Observation]) -> None:
    assert same_surroundings(parts[2].surroundings, Surroundings.unknown(nodes=4))
    whole = stack(parts)
    nothing = whole.without(*EVIDENCE)
    assert same_surroundings(nothing.surroundings, Surroundings.unknown(nodes=8, buildings=3))
    assert same(replace(nothing, surroundings=whole.surroundings), whole)


def test_surroundings_of_other_nodes_are_refused(parts: list[Observation]) -> None:
    with pytest.raises(ValueError, match=r"expected .* \(1, 1\), found \(3, 1\)"):
        replace(parts[1], surroundings=HOME)
