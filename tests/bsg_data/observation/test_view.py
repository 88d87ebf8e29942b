"""Views by hand, and what is hidden under them: counts worked out by hand, parts with wholes."""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Counts
from bsg_data.dataset.histograms import Unclassified
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.view import View, hide_cells, see_unclassified
from bsg_data.recipes import MaskRecipe
from bsg_data.testing import draw_mask


def test_a_building_hides_the_mean_of_its_rooms() -> None:
    view = View.of_rooms(np.array([0.0, 0.5, 1.0]), classes=2)
    assert view.hidden_share.tolist() == [0.5, 0.0, 0.5, 1.0]
    assert view.visited.tolist() == [True, True, True, False]
    assert view.withheld.tolist() == [[False, False]] * 4
    assert View.of_rooms(np.full(3, 0.1), classes=1).hidden_share.tolist() == [0.1] * 4
    assert View.of_rooms(np.zeros(0), classes=1, alone=0.3).hidden_share.tolist() == [0.3]


def test_a_withheld_class_shows_where_nothing_is_hidden_and_an_unknown_one_nowhere() -> None:
    view = View.of_rooms(np.array([0.0, 0.5]), classes=2)
    classes = np.array([True, False])
    assert view.withhold(classes).withheld[:, 0].tolist() == [True, False, True]
    assert view.withhold(classes, unknown=~classes).withheld[:, 1].all()


def test_views_agree_in_single_precision() -> None:
    view = View.of_rooms(np.array([0.1, 0.7]), classes=2)
    stored = View(view.visited, view.shares_float32.astype(np.float64), view.withheld, view.nodes)
    assert stored.hidden_share.tolist() != view.hidden_share.tolist()
    assert view.agrees(stored)
    assert not view.agrees(View.of_rooms(np.array([0.1, 0.6]), classes=2))
    assert not view.agrees(view.withhold(np.array([True, False])))
    assert view.take(1, 3).hidden_share.tolist() == [0.1, 0.7]


CURTAINS = np.array([[1, 0], [3, 5], [0, 5], [2, 0]])  # of four nodes; the second class is beds
RODS = np.array([[2, 4], [3, 2], [2, 2], [4, 0]])  # curtain rods, and lamps that are no parts
UNCLASSIFIED = Unclassified.of_cells(("curtain rod", "lamp"), RODS)


def hide(recipe: MaskRecipe, draw: int) -> tuple[View, Counts, Counts]:
    """Return the view, and what is hidden of the curtains and beds, and of the rods and lamps."""
    view, _, hidden = draw_mask(CURTAINS, recipe, draw=draw)
    (seen,) = see_unclassified(
        [UNCLASSIFIED],
        [view],
        MaskStreams([recipe], ["s"], [draw]),
        present=CURTAINS,
        hidden=hidden,
        classes=("curtain", "bed"),
    )
    return view, hidden, RODS - seen.count(UNCLASSIFIED.names)


def test_parts_are_seen_only_with_a_whole() -> None:
    """Of the rooms with curtains: no rod where all are hidden, every rod where none is."""
    recipe = MaskRecipe(parts=True)
    alone = lone = 0
    for draw in range(300):
        _, hidden, gone = hide(recipe, draw)
        for room in (1, 3):
            if hidden[room, 0] == CURTAINS[room, 0]:
                assert gone[room, 0] == RODS[room, 0]
            if hidden[room, 0] == 0:
                assert gone[room, 0] == 0
        apart = hide(MaskRecipe(), draw)[2]
        alone += int(hidden[3, 0] == 2 and apart[3, 0] < 4)
        lone += int(gone[2, 0])
    assert alone > 40, "without the option rods are seen whose curtains are hidden"
    assert 0.4 < lone / (300 * 2) < 0.6, "a rod without a curtain falls under the ordinary rule"


def test_the_share_of_hidden_parts_is_that_of_the_others() -> None:
    for strategy in ("uniform", "explore"):
        gone, expected = np.zeros(4), np.zeros(4)
        for draw in range(600):
            recipe = MaskRecipe(strategy=strategy, parts=True)
            view, _, rods_and_lamps = hide(recipe, draw)
            gone += rods_and_lamps[:, 0]
            expected += view.hidden_share * RODS[:, 0]
        np.testing.assert_allclose(gone, expected, rtol=0.12)


# Null region, and rooms that hide nothing, 0.29, 0.29 and all.
SHARES = np.array([0.0, 0.29, 0.29, 1.0])
CELLS = np.array([[0, 3], [4, 4], [60, 0], [30, 10], [2, 2]])


def test_a_share_loses_its_exact_number() -> None:
    view = View.of_rooms(SHARES, classes=2, exact=True)
    hidden = hide_cells(CELLS, [view], MaskStreams([MaskRecipe()], ["s"], [0]))
    assert hidden[1].tolist() == [0, 0]
    assert hidden[4].tolist() == [2, 2]
    assert hidden[2:4].sum() == 29, "exact in decimals: in floats 0.29 of 100 is less than 29"
    assert (hidden <= CELLS).all()
