"""The masks of format 1, as they were tested when they were drawn by."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from bsg_data.arrays import Bools, Counts
from bsg_data.errors import RecipeError
from bsg_data.observation.masks_v1 import (
    STRATEGIES,
    sample_hidden_of_format_1,
    sample_visited_of_format_1,
    view_of_format_1,
)
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.connections import Connections

NOTHING = Connections.of_pairs(())


def draw_mask(cells: Counts, recipe: MaskRecipe, draw: int = 0) -> tuple[Bools, Counts]:
    visited = sample_visited_of_format_1(
        cells, recipe, scene_id="s", draw=draw, connections=NOTHING
    )
    return visited, sample_hidden_of_format_1(cells, visited, recipe, scene_id="s", draw=draw)


def test_the_stream_of_a_recipe_never_changes() -> None:
    """Drawn by version 0.1 and written down: pairs made then are the recipe's for ever."""
    cells = np.arange(12).reshape(4, 3)
    recipe = MaskRecipe(seed=5)
    hidden = sample_hidden_of_format_1(
        cells, np.ones(4, dtype=bool), recipe, scene_id="00006-HkseAnWCgqk", draw=2
    )
    assert hidden.tolist() == [[0, 1, 0], [3, 2, 2], [2, 2, 3], [4, 7, 7]]
    rooms = [draw_mask(cells, MaskRecipe(strategy="rooms"), draw)[0].tolist() for draw in range(3)]
    assert rooms == [
        [True, False, True, False],
        [True, True, False, False],
        [True, True, False, False],
    ]


@given(
    hnp.arrays(
        np.int64, st.tuples(st.integers(1, 6), st.integers(1, 5)), elements=st.integers(0, 9)
    ),
    st.integers(0, 100),
)
def test_how_much_each_hides(cells: Counts, percent: int) -> None:
    n, null = int(cells.sum()), int(cells[0].sum())
    for strategy in ("uniform", "frontier"):
        recipe = MaskRecipe(strategy=strategy, fraction=percent / 100)
        assert draw_mask(cells, recipe)[1].sum() == percent * n // 100
    visited, hidden = draw_mask(cells, MaskRecipe(strategy="rooms", fraction=percent / 100))
    assert (hidden[1:][visited[1:]] == 0).all()
    assert hidden[0].sum() == -(-percent * null // 100)
    assert hidden.sum() * 100 >= percent * n


def test_frontier_grows_over_the_adjacency() -> None:
    cells, row = np.full((9, 2), 5), Connections.of_pairs([(i, i + 1) for i in range(1, 8)])
    cells[0] = 0
    recipe = MaskRecipe(strategy="frontier")
    for draw in range(10):
        visited = sample_visited_of_format_1(
            cells, recipe, scene_id="s", draw=draw, connections=row
        )
        assert np.count_nonzero(np.diff(visited[1:].astype(int))) <= 2, "one run of rooms"
        assert cells[~visited].sum() <= 0.25 * cells.sum()


def test_what_was_told_by_hand() -> None:
    """Two buildings: one with an unvisited room, one without rooms."""
    visited = np.array([True, True, False, True])
    is_building = np.array([True, False, False, True])
    for strategy, of_visited in (("uniform", 0.5), ("rooms", 0.0), ("frontier", 1 / 3)):
        recipe = MaskRecipe(strategy=strategy)
        view = view_of_format_1(visited, recipe, is_building=is_building, classes=3)
        assert view.hidden_share.tolist() == pytest.approx([0.5, of_visited, 1.0, 0.5])
        assert view.withheld.shape == (4, 3)
        assert not view.withheld.any()
    assert STRATEGIES == ("uniform", "rooms", "frontier")


def test_other_masks_are_refused() -> None:
    cells, recipe = np.ones((3, 2), dtype=np.int64), MaskRecipe(strategy="coin")
    with pytest.raises(RecipeError, match=r"format 1 by the mask 'coin'.*draws them anew"):
        draw_mask(cells, recipe)
