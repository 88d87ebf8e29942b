"""Views, by hand."""

from __future__ import annotations

import numpy as np

from bsg_data.observation.view import View

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
    stored = View(one.visited, one.told.astype(np.float64), one.withheld, one.nodes)
    assert stored.hidden_share.tolist() != one.hidden_share.tolist()
    assert one.agrees(stored)
    assert not one.agrees(one.search(np.array([False, True, False])))
    assert not one.agrees(one.withhold(np.array([True, False])))
    assert one.take(1, 3).hidden_share.tolist() == [0.1, 0.7]
