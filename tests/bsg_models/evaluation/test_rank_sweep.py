"""One pass for all weights, against a ranking that is sorted and summed for each by itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_models.evaluation import metrics
from bsg_models.evaluation.rank_sweep import HIDDEN, RankSweep


def test_by_hand() -> None:
    """0.9 hides something; of the two at 0.5 one does; 0.1 hides nothing."""
    sweep = RankSweep(1, np.array([[1, 0], [1, 2]], dtype=np.uint16))
    flags = np.array([3, 3, 2, 2], dtype=np.uint8)
    sweep.add(np.array([0.9, 0.5, 0.5, 0.1]), flags, np.array([0, 1, 1, 0]))
    auroc, precision = sweep.finish()
    assert auroc[0].tolist() == [3.5 / 4, 0.5]  # without the first building, a tie is left
    assert precision[0] == pytest.approx([(1 + 2 / 3) / 2, 0.5])


def test_nothing_is_undefined() -> None:
    auroc, precision = RankSweep(2, np.ones((1, 3))).finish()
    assert auroc.shape == precision.shape == (2, 3)
    assert np.isnan([*auroc.ravel(), *precision.ravel()]).all()


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 5), st.integers(0, 7), st.integers(0, 2)), max_size=40),
    st.lists(st.integers(0, 40), max_size=4),
)
def test_pieces_are_the_ranking_of_all(cells: list[tuple[int, int, int]], cuts: list[int]) -> None:
    """Scores tie, also across pieces; buildings count 0, 1 or 3 times."""
    table = np.array(sorted(cells, key=lambda cell: -cell[0]), dtype=np.int64).reshape(-1, 3)
    scores, flags, building = table[:, 0] / 5, table[:, 1].astype(np.uint8), table[:, 2]
    weights = np.array([[1, 0], [1, 1], [1, 3]], dtype=np.uint16)
    sweep = RankSweep(2, weights)
    for rows in np.split(np.arange(len(table)), sorted(min(cut, len(table)) for cut in cuts)):
        sweep.add(scores[rows], flags[rows], building[rows])
    auroc, precision = sweep.finish()
    for s in range(2):
        own = (flags & (2 << s)) > 0
        ranking = metrics.rank(scores[own], (flags[own] & HIDDEN) > 0)
        for w in range(2):
            mass = weights[building[own], w].astype(float)
            expected = metrics.auroc(ranking, mass), metrics.average_precision(ranking, mass)
            found = auroc[s, w], precision[s, w]
            np.testing.assert_allclose(found, expected, rtol=1e-12)
