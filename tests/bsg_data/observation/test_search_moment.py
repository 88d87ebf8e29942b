"""What a robot sees in the middle of a search, by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import MaskedBuildings, sample_masked
from bsg_data.observation.observation import Observation
from bsg_data.observation.search_moment import MaskedCells, observe_search
from bsg_data.observation.view import View
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.connections import Connections
from bsg_data.scene.surroundings import Surroundings


def half_seen(nodes: int, classes: int, share: float) -> View:
    """Every room was visited and hides a share, as under the paper's mask."""
    return View.of_rooms(np.full(nodes - 1, share), classes=classes, alone=share)


def test_a_moment_by_hand() -> None:
    cells = np.array([[1, 1], [4, 2], [0, 6], [2, 2]])  # the null region, then three rooms
    left = np.array([[1, 1], [2, 1], [0, 3], [1, 1]])
    taps, taps_left = np.array([[0], [5], [1], [2]]), np.array([[0], [2], [1], [0]])
    seen = observe_search(
        "home",
        MaskedCells(cells, left[None]),
        MaskedCells(taps, taps_left[None]),
        searched=np.array([[False, True, False, False]]),
        withheld=np.array([[False, True]]),
        views=[half_seen(4, 2, 0.5)],
        vocabulary=("tap",),
        connections=Connections.of_pairs([(1, 3)]),
    )
    assert seen.scene_ids == ("home",)
    assert seen.inputs.tolist() == [[1 + 4 + 0 + 1, 2], [4, 2], [0, 0], [1, 0]]
    assert seen.hidden_share.tolist() == pytest.approx([0.5 * 2 / 3, 0.0, 0.5, 0.5])
    assert seen.withheld.tolist() == [[False, True], [False, False], [False, True], [False, True]]
    assert seen.others.tolist() == [[0 + 5 + 1 + 0], [5], [1], [0]]
    assert seen.vocabulary == ("tap",)
    assert seen.visited.all()
    assert seen.connections.pairs.tolist() == [[1, 3]]


def test_a_search_hides_no_surroundings() -> None:
    nothing = np.zeros((3, 0), dtype=np.int64)
    home = Surroundings.of_rooms([12, None], ["kitchen", None], building_kind="home")
    searched = np.array([[False, False, False], [False, True, False]])
    seen = observe_search(
        "home",
        MaskedCells(np.array([[0], [2], [3]]), np.zeros((2, 3, 1), dtype=np.int64)),
        MaskedCells(nothing, np.stack([nothing, nothing])),
        searched=searched,
        withheld=np.array([[True], [True]]),
        views=[half_seen(3, 1, 0.5)] * 2,
        vocabulary=(),
        connections=Connections.of_pairs(()),
        surroundings=home,
    )
    assert seen.surroundings.building_kinds == ("home", "home")
    for number in range(2):
        one = seen.take([number]).surroundings
        np.testing.assert_array_equal(one.floor_area, home.floor_area)
        np.testing.assert_array_equal(one.labels, home.labels)


def test_nothing_is_withheld_once_all_is_searched() -> None:
    cells = np.array([[0], [2], [3]])
    nothing = np.zeros((3, 0), dtype=np.int64)
    seen = observe_search(
        "home",
        MaskedCells(cells, 0 * cells[None]),
        MaskedCells(nothing, nothing[None]),
        searched=np.array([[False, True, True]]),
        withheld=np.array([[True]]),
        views=[half_seen(3, 1, 0.5)],
        vocabulary=(),
        connections=Connections.of_pairs(()),
    )
    assert seen.inputs.tolist() == [[5], [2], [3]]
    assert seen.hidden_share.tolist() == [0.0, 0.0, 0.0]
    assert not seen.withheld.any()


def test_two_searches_of_a_building_are_two_buildings() -> None:
    """Each sees what it would see alone, and its rooms connect to its own."""
    cells = np.array([[0, 0], [4, 2], [3, 6]])
    left = np.array([[[0, 0], [1, 2], [0, 6]], [[0, 0], [4, 0], [3, 0]]])
    taps = np.array([[0], [5], [1]])
    searched = np.array([[False, True, False], [False, False, False]])
    withheld = np.array([[True, False], [False, True]])

    def look(searches: list[int]) -> Observation:
        return observe_search(
            "home",
            MaskedCells(cells, left[searches]),
            MaskedCells(taps, 0 * np.stack([taps] * len(searches))),
            searched=searched[searches],
            withheld=withheld[searches],
            views=[half_seen(3, 2, 0.25)] * len(searches),
            vocabulary=("tap",),
            connections=Connections.of_pairs([(1, 2)]),
        )

    both = look([0, 1])
    assert both.scene_ids == ("home", "home")
    assert both.starts.tolist() == [0, 3, 6]
    assert both.inputs.tolist() == [[4, 8], [4, 2], [0, 6], [7, 0], [4, 0], [3, 0]]
    assert both.hidden_share.tolist() == [0.125, 0.0, 0.25, 0.25, 0.25, 0.25]
    assert both.others.ravel().tolist() == [5, 5, 0, 0, 0, 0]
    assert both.connections.pairs.tolist() == [[1, 2], [4, 5]]
    for number in (0, 1):
        alone, one = look([number]), both.take([number])
        for name in ("inputs", "hidden_share", "withheld", "others", "visited"):
            np.testing.assert_array_equal(getattr(alone, name), getattr(one, name), name)
        assert one.connections.pairs.tolist() == [[1, 2]]


def test_a_building_without_rooms_hides_the_fraction() -> None:
    seen = observe_search(
        "home",
        MaskedCells(np.array([[4]]), np.array([[[1]]])),
        MaskedCells(np.zeros((1, 0), dtype=np.int64), np.zeros((1, 1, 0), dtype=np.int64)),
        searched=np.array([[False]]),
        withheld=np.array([[False]]),
        views=[half_seen(1, 1, 0.75)],
        vocabulary=(),
        connections=Connections.of_pairs(()),
    )
    assert (seen.inputs.tolist(), seen.hidden_share.tolist()) == ([[1]], [0.75])


def test_what_a_mask_told_of_rooms_stays_until_they_are_searched() -> None:
    """Of four rooms one was searched before, one half seen, one glimpsed, one not entered."""
    view = View.of_rooms(
        np.array([0.0, 0.4, 0.8, 1.0]), classes=2, entered=np.array([True, True, False, False])
    ).withhold(np.array([True, False]))
    cells = np.full((5, 2), 3)
    cells[0] = 0
    nothing = np.zeros((5, 0), dtype=np.int64)
    seen = observe_search(
        "home",
        MaskedCells(cells, np.array([[[0, 0], [3, 3], [0, 2], [0, 1], [0, 0]]])),
        MaskedCells(nothing, nothing[None]),
        views=[view],
        searched=np.array([[False, False, False, True, False]]),
        withheld=np.array([[False, True]]),
        vocabulary=(),
        connections=Connections.of_pairs(()),
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
    cells, rods = np.array([[1], [2], [0]]), np.array([[1], [2], [1]])
    seen = observe_search(
        "home",
        MaskedCells(cells, cells[None]),
        MaskedCells(rods, rods[None]),
        views=[half_seen(3, 1, 0.5)],
        searched=np.zeros((1, 3), dtype=bool),
        withheld=np.array([[True]]),
        vocabulary=("curtain rod",),
        connections=Connections.of_pairs(()),
        wholes=np.array([0]),
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
