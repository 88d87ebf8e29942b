"""Observations of several buildings, and of moments in a search, by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from one_building import observe_building, same_surroundings, surround_rooms

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import MaskedBuildings, sample_masked
from bsg_data.observation.observation import Observation, observe_search, stack
from bsg_data.observation.view import View
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.connections import Connections
from bsg_data.scene.surroundings import BUILDING_KINDS, UNKNOWN, Surroundings

HOME = surround_rooms([12, None], [None, "kitchen"], building_kind="home", source="hm3d")
FIELDS = ("starts", "inputs", "hidden_share", "visited", "withheld", "others")


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


def test_stacks_are_stacked(parts: list[Observation]) -> None:
    whole = stack(parts)
    assert same(stack([stack(parts[:2]), parts[2]]), whole)
    assert same(stack([parts[0], stack(parts[1:])]), whole)


def test_what_cannot_be_stacked_is_refused(parts: list[Observation]) -> None:
    with pytest.raises(ValueError, match="same vocabulary"):
        stack([parts[0], observe_building([[1, 1]], vocabulary=("tap",))])


def test_surroundings_go_with_their_buildings(parts: list[Observation]) -> None:
    around = stack(parts).surroundings
    assert around.building_kinds.tolist() == [BUILDING_KINDS.index("home"), UNKNOWN, UNKNOWN]
    np.testing.assert_array_equal(around.floor_area[:4], [np.nan, 12, np.nan, np.nan])
    assert same_surroundings(stack(parts).take([2, 0]).take([1]).surroundings, HOME)

    without = stack(parts).without("floor_area").surroundings
    assert np.isnan(without.floor_area).all()
    assert without.labels.any()


def search(
    cells: list[list[int]],
    left: list[list[list[int]]],
    *,
    searched: list[list[bool]],
    withheld: list[list[bool]],
    view: View | None = None,
    others: list[list[int]] | None = None,
    others_left: list[list[list[int]]] | None = None,
    connected: tuple[tuple[int, int], ...] = (),
    wholes: list[int] | None = None,
    surroundings: Surroundings | None = None,
) -> Observation:
    """Observe E searches; every room was visited and hides half, if no view is given."""
    nodes, searches = len(cells), len(left)
    classes = len(cells[0])
    if view is None:
        view = View.of_rooms(np.full(nodes - 1, 0.5), classes=classes, alone=0.5)
    every = np.array(others if others else np.zeros((nodes, 0)), dtype=np.int64)
    rest = np.array(others_left if others_left else np.tile(every, (searches, 1, 1)))
    return observe_search(
        "home",
        there=(np.array(cells), every),
        left=(np.array(left), rest),
        searched=np.array(searched),
        withheld=np.array(withheld),
        views=[view] * searches,
        vocabulary=("tap",) if others else (),
        connections=Connections.of_pairs(connected),
        wholes=None if wholes is None else np.array(wholes),
        surroundings=surroundings or Surroundings.unknown(nodes=nodes),
    )


def test_a_moment_of_a_search_by_hand() -> None:
    seen = search(
        [[1, 1], [4, 2], [0, 6], [2, 2]],  # the null region, then three rooms
        [[[1, 1], [2, 1], [0, 3], [1, 1]]],
        others=[[0], [5], [1], [2]],
        others_left=[[[0], [2], [1], [0]]],
        searched=[[False, True, False, False]],
        withheld=[[False, True]],
        connected=((1, 3),),
    )
    assert seen.scene_ids == ("home",)
    assert seen.inputs.tolist() == [[1 + 4 + 0 + 1, 2], [4, 2], [0, 0], [1, 0]]
    assert seen.hidden_share.tolist() == pytest.approx([0.5 * 2 / 3, 0.0, 0.5, 0.5])
    assert seen.withheld.tolist() == [[False, True], [False, False], [False, True], [False, True]]
    assert seen.others.tolist() == [[0 + 5 + 1 + 0], [5], [1], [0]]
    assert seen.visited.all()
    assert seen.connections.pairs.tolist() == [[1, 3]]


def test_nothing_is_withheld_once_all_is_searched() -> None:
    seen = search([[0], [2], [3]], [[[0]] * 3], searched=[[False, True, True]], withheld=[[True]])
    assert seen.inputs.tolist() == [[5], [2], [3]]
    assert seen.hidden_share.tolist() == [0.0, 0.0, 0.0]
    assert not seen.withheld.any()


def test_a_building_without_rooms_hides_the_fraction() -> None:
    view = View.of_rooms(np.zeros(0), classes=1, alone=0.75)
    seen = search([[4]], [[[1]]], searched=[[False]], withheld=[[False]], view=view)
    assert (seen.inputs.tolist(), seen.hidden_share.tolist()) == ([[1]], [0.75])


def test_two_searches_of_a_building_are_two_buildings() -> None:
    """Each sees what it would see alone, and its rooms connect to its own."""
    left = [[[0, 0], [1, 2], [0, 6]], [[0, 0], [4, 0], [3, 0]]]
    searched = [[False, True, False], [False, False, False]]
    withheld = [[True, False], [False, True]]

    def look(first: int, last: int) -> Observation:
        return search(
            [[0, 0], [4, 2], [3, 6]],
            left[first:last],
            others=[[0], [5], [1]],
            others_left=[[[0], [0], [0]]] * (last - first),
            searched=searched[first:last],
            withheld=withheld[first:last],
            connected=((1, 2),),
            surroundings=HOME,
        )

    both = look(0, 2)
    assert both.starts.tolist() == [0, 3, 6]
    assert both.inputs.tolist() == [[4, 8], [4, 2], [0, 6], [7, 0], [4, 0], [3, 0]]
    assert both.hidden_share.tolist() == [0.25, 0.0, 0.5, 0.5, 0.5, 0.5]
    assert both.others.ravel().tolist() == [5, 5, 0, 0, 0, 0]
    assert both.connections.pairs.tolist() == [[1, 2], [4, 5]]
    for number in (0, 1):
        assert same(both.take([number]), look(number, number + 1))


def test_what_a_mask_told_of_rooms_stays_until_they_are_searched() -> None:
    """Of four rooms one was searched before, one half seen, one glimpsed, one not entered."""
    view = View.of_rooms(
        np.array([0.0, 0.4, 0.8, 1.0]), classes=2, entered=np.array([True, True, False, False])
    ).withhold(np.array([True, False]))
    seen = search(
        [[0, 0], [3, 3], [3, 3], [3, 3], [3, 3]],
        [[[0, 0], [3, 3], [0, 2], [0, 1], [0, 0]]],
        view=view,
        searched=[[False, False, False, True, False]],
        withheld=[[False, True]],
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


def test_parts_of_what_is_withheld_are_withheld() -> None:
    """Of two rooms with curtain rods one has a curtain; the rod of the null region is seen."""
    cells, rods = [[1], [2], [0]], [[1], [2], [1]]
    seen = search(
        cells, [cells], others=rods, searched=[[False] * 3], withheld=[[True]], wholes=[0]
    )
    assert seen.others.ravel().tolist() == [2, 0, 1]


def test_training_masks_of_a_search(dataset: Path) -> None:
    data = Dataset.open(dataset)
    scenes = data.splits["train"]

    def sample(withhold: float) -> MaskedBuildings:
        recipe = MaskRecipe(strategy="search", withhold=withhold)
        return sample_masked(data, scenes, mask=recipe, draw=0)

    plain, moments = sample(0.0), sample(0.3)
    assert not plain.seen.withheld.any()
    searched_any = withheld_any = False
    for number in range(len(scenes)):
        one, before = moments.take([number]), plain.take([number])
        inputs, is_room = one.seen.inputs, ~one.seen.is_building
        searched = (one.seen.hidden_share == 0) & is_room
        searched_any |= bool(searched.any())
        withheld_any |= bool(one.seen.withheld.any())
        np.testing.assert_array_equal(inputs[searched], one.targets[searched])
        assert (inputs[one.seen.withheld & is_room[:, None]] == 0).all()
        free = ~one.seen.withheld.any(axis=0)
        rest = ~searched & is_room
        np.testing.assert_array_equal(inputs[rest][:, free], before.seen.inputs[rest][:, free])
        assert searched.sum() <= is_room.sum() // 2
    assert searched_any
    assert withheld_any
