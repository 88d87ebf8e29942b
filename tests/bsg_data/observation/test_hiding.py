"""What is hidden under a view: counts worked out by hand, and cells without objects beside none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bsg_data.observation.hiding import Hiding
from bsg_data.observation.view import View

# Null region, and rooms that hide nothing, 0.29, 0.29 and all.
SHARES = np.array([0.0, 0.29, 0.29, 1.0])
CELLS = np.array([[0, 3], [4, 4], [60, 0], [30, 10], [2, 2]])


@pytest.fixture
def view() -> View:
    """Return a view under which each share loses an exact number."""
    return View.of_rooms(SHARES, classes=2, exact=True)


def test_a_share_loses_its_exact_number(view: View) -> None:
    hidden = Hiding.under(view, CELLS).draw(np.random.default_rng(0))
    assert hidden[1].tolist() == [0, 0]
    assert hidden[4].tolist() == [2, 2]
    assert hidden[2:4].sum() == 29, "exact in decimals: in floats 0.29 of 100 is less than 29"
    assert (hidden <= CELLS).all()


def test_each_draw_is_another_and_changes_nothing_of_the_next(view: View) -> None:
    hiding = Hiding.under(view, CELLS)
    first = hiding.draw(np.random.default_rng(1))
    assert (hiding.draw(np.random.default_rng(2)) != first).any()
    np.testing.assert_array_equal(hiding.draw(np.random.default_rng(1)), first)


def test_cells_without_objects_take_no_random_number(view: View) -> None:
    """Masks are published: the numbers are those of one draw over all cells."""
    single = replace(view, exact=False)
    hidden = Hiding.under(single, CELLS).draw(np.random.default_rng(3))
    plain = np.random.default_rng(3).binomial(CELLS, view.hidden_share[:, None])
    np.testing.assert_array_equal(hidden, plain)


@pytest.mark.parametrize("exact", [True, False])
def test_nothing_hides_nothing(exact: bool) -> None:
    view = View.of_rooms(SHARES, classes=2, exact=exact)
    none = np.zeros_like(CELLS)
    np.testing.assert_array_equal(Hiding.under(view, none).draw(np.random.default_rng(0)), none)
