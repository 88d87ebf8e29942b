"""What masks hide outside the classes, with parts and without."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from bsg_data.arrays import Counts
from bsg_data.observation.hidden_others import have_wholes, sample_hidden_others
from bsg_data.observation.masks import sample_hidden, sample_view
from bsg_data.recipes import MaskRecipe

CURTAINS = np.array([[1, 0], [3, 5], [0, 5], [2, 0]])  # of four nodes; the second class is beds
RODS = np.array([[2, 4], [3, 2], [2, 2], [4, 0]])  # curtain rods, and lamps that are no parts
WHOLES = np.array([0, -1])


def hide(recipe: MaskRecipe, draw: int, wholes: Any = WHOLES) -> tuple[Counts, Counts]:
    view = sample_view(CURTAINS.shape, recipe, scene_id="s", draw=draw)
    hidden = sample_hidden(CURTAINS, view, recipe, scene_id="s", draw=draw)
    gone = sample_hidden_others(
        RODS,
        view,
        recipe,
        scene_id="s",
        draw=draw,
        there=CURTAINS,
        hidden=hidden,
        wholes=wholes,
    )
    return hidden, gone


def test_where_a_category_has_a_thing_to_be_a_part_of() -> None:
    expected = [[False, False], [True, False], [False, False], [True, False]]
    assert have_wholes(CURTAINS, WHOLES).tolist() == expected


def test_parts_are_seen_only_with_a_whole() -> None:
    """Of the rooms with curtains: no rod where all are hidden, every rod where none is."""
    recipe = MaskRecipe(parts=True)
    alone = lone = 0
    for draw in range(300):
        hidden, gone = hide(recipe, draw)
        for room in (1, 3):
            if hidden[room, 0] == CURTAINS[room, 0]:
                assert gone[room, 0] == RODS[room, 0]
            if hidden[room, 0] == 0:
                assert gone[room, 0] == 0
        apart = hide(MaskRecipe(), draw)[1]
        alone += int(hidden[3, 0] == 2 and apart[3, 0] < 4)
        lone += int(gone[2, 0])
    assert alone > 40, "without the option rods are seen whose curtains are hidden"
    assert 0.4 < lone / (300 * 2) < 0.6, "a rod without a curtain falls under the ordinary rule"


def test_the_share_of_hidden_parts_is_that_of_the_others() -> None:
    for strategy in ("uniform", "explore"):
        gone, told = np.zeros(4), np.zeros(4)
        for draw in range(1500):
            recipe = MaskRecipe(strategy=strategy, parts=True)
            gone += hide(recipe, draw)[1][:, 0]
            view = sample_view(CURTAINS.shape, recipe, scene_id="s", draw=draw)
            told += view.hidden_share * RODS[:, 0]
        np.testing.assert_allclose(gone, told, rtol=0.08)


def test_parts_of_a_withheld_class_are_hidden() -> None:
    for draw in range(20):
        hidden, gone = hide(MaskRecipe(parts=True, withhold=1.0), draw)
        assert (hidden == CURTAINS).all()
        assert gone[[1, 3], 0].tolist() == [3, 4]


def test_without_the_option_parts_are_like_all_else() -> None:
    for draw in range(5):
        assert hide(MaskRecipe(), draw)[1].tolist() == hide(MaskRecipe(), draw, None)[1].tolist()


@given(
    hnp.arrays(np.int64, (3, 2), elements=st.integers(0, 6)),
    st.sampled_from(["uniform", "rooms", "explore"]),
    st.integers(0, 20),
)
def test_no_more_is_hidden_than_is_there(cells: Counts, strategy: str, draw: int) -> None:
    recipe = MaskRecipe(strategy=strategy, parts=True, withhold=0.3)
    view = sample_view(cells.shape, recipe, scene_id="s", draw=draw)
    hidden = sample_hidden(cells, view, recipe, scene_id="s", draw=draw)
    gone = sample_hidden_others(
        cells, view, recipe, scene_id="s", draw=draw, there=cells, hidden=hidden, wholes=WHOLES
    )
    assert ((gone >= 0) & (gone <= cells)).all()
