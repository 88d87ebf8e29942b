"""Views by hand, and what is hidden under them: counts worked out by hand, parts with wholes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bsg_data.arrays import Counts
from bsg_data.dataset.histograms import Unclassified
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.masks import sample_view
from bsg_data.observation.view import View, hide_cells, sample_hidden, see_unclassified
from bsg_data.recipes import MaskRecipe

NOBODY = np.zeros(4, dtype=bool)


def test_a_building_hides_the_mean_of_its_rooms() -> None:
    view = View.of_rooms(np.array([0.0, 0.5, 1.0]), classes=2)
    assert view.hidden_share.tolist() == [0.5, 0.0, 0.5, 1.0]
    assert view.visited.tolist() == [True, True, True, False]
    assert view.withheld.tolist() == [[False, False]] * 4
    assert View.of_rooms(np.full(3, 0.1), classes=1).hidden_share.tolist() == [0.1] * 4
    assert View.of_rooms(np.zeros(0), classes=1, alone=0.3).hidden_share.tolist() == [0.3]


def test_a_room_that_is_searched_shows_everything() -> None:
    before = View.of_rooms(np.array([0.5, 0.5, 1.0]), classes=2).withhold(np.array([True, False]))
    assert before.withheld[:, 0].all()
    assert before.search(NOBODY).agrees(before)
    after = before.search(np.array([False, True, False, True]))
    assert after.hidden_share.tolist() == [0.5 / 3, 0.0, 0.5, 0.0]
    assert after.visited.all()
    assert after.withheld[:, 0].tolist() == [True, False, True, False]
    assert not after.withheld[:, 1].any()
    whole = before.search(~NOBODY & (np.arange(4) > 0))
    assert not whole.withheld.any()
    assert not whole.hidden_share.any()


def test_views_agree_in_single_precision() -> None:
    one = View.of_rooms(np.array([0.1, 0.7]), classes=2)
    stored = View(one.visited, one.shares_float32.astype(np.float64), one.withheld, one.nodes)
    assert stored.hidden_share.tolist() != one.hidden_share.tolist()
    assert one.agrees(stored)
    assert not one.agrees(one.search(np.array([False, True, False])))
    assert not one.agrees(one.withhold(np.array([True, False])))
    assert one.take(1, 3).hidden_share.tolist() == [0.1, 0.7]


CURTAINS = np.array([[1, 0], [3, 5], [0, 5], [2, 0]])  # of four nodes; the second class is beds
RODS = np.array([[2, 4], [3, 2], [2, 2], [4, 0]])  # curtain rods, and lamps that are no parts
UNCLASSIFIED = Unclassified.of_cells(("curtain rod", "lamp"), RODS)


def hide(recipe: MaskRecipe, draw: int) -> tuple[Counts, Counts]:
    """Return what is hidden of the curtains and beds, and of the rods and lamps."""
    view = sample_view(CURTAINS.shape, recipe, scene_id="s", draw=draw)
    hidden = sample_hidden(CURTAINS, view, recipe, scene_id="s", draw=draw)
    (seen,) = see_unclassified(
        [UNCLASSIFIED],
        [view],
        [recipe],
        MaskStreams([recipe], ["s"], [draw]),
        there=CURTAINS,
        hidden=hidden,
        classes=("curtain", "bed"),
    )
    return hidden, RODS - seen.spread(np.arange(2), 2)


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
        gone, expected = np.zeros(4), np.zeros(4)
        for draw in range(600):
            recipe = MaskRecipe(strategy=strategy, parts=True)
            gone += hide(recipe, draw)[1][:, 0]
            view = sample_view(CURTAINS.shape, recipe, scene_id="s", draw=draw)
            expected += view.hidden_share * RODS[:, 0]
        np.testing.assert_allclose(gone, expected, rtol=0.12)


def test_parts_of_a_withheld_class_are_hidden() -> None:
    for draw in range(20):
        hidden, gone = hide(MaskRecipe(parts=True, withhold=1.0), draw)
        assert (hidden == CURTAINS).all()
        assert gone[[1, 3], 0].tolist() == [3, 4]


# Null region, and rooms that hide nothing, 0.29, 0.29 and all.
SHARES = np.array([0.0, 0.29, 0.29, 1.0])
CELLS = np.array([[0, 3], [4, 4], [60, 0], [30, 10], [2, 2]])


def test_a_share_loses_its_exact_number() -> None:
    view = View.of_rooms(SHARES, classes=2, exact=True)
    hidden = sample_hidden(CELLS, view, MaskRecipe(), scene_id="s", draw=0)
    assert hidden[1].tolist() == [0, 0]
    assert hidden[4].tolist() == [2, 2]
    assert hidden[2:4].sum() == 29, "exact in decimals: in floats 0.29 of 100 is less than 29"
    assert (hidden <= CELLS).all()


def test_draws_of_several_views_are_each_as_if_alone() -> None:
    """Three draws of a view with exact shares, one without, and one with a class withheld."""
    recipe, scenes = MaskRecipe(), ["a", "b", "c"]
    exact = View.of_rooms(SHARES, classes=2, exact=True)
    views = [exact, replace(exact, exact=False), exact.withhold(np.array([True, False]))]
    streams = MaskStreams([recipe] * 9, scenes * 3, [draw for draw in range(3) for _ in scenes])
    together = hide_cells(np.concatenate([CELLS, CELLS + 1, CELLS]), views, streams)
    alone = [
        sample_hidden(cells, view, recipe, scene_id=scene, draw=draw)
        for draw in range(3)
        for cells, view, scene in zip((CELLS, CELLS + 1, CELLS), views, scenes, strict=True)
    ]
    assert together.tolist() == np.concatenate(alone).tolist()
    assert len({one.tobytes() for one in alone}) == 9
