from __future__ import annotations

import numpy as np

from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import from_hidden_counts, from_totals, join

INPUTS = np.array([[2.0, 0.0, 1.0]])


def test_totals_below_the_input_hide_nothing() -> None:
    found = from_totals(INPUTS, np.array([[1.0, 3.0, 1.5]]))
    assert found.hidden.tolist() == [[0.0, 3.0, 0.5]]
    assert found.expected.tolist() == [[2.0, 3.0, 1.5]]
    assert found.totals.tolist() == [[1.0, 3.0, 1.5]]


def test_what_was_seen_is_below_every_quantile() -> None:
    found = from_hidden_counts(INPUTS, poisson(np.array([[0.5, 3.0, 0.0]])))
    assert found.totals.tolist() == found.expected.tolist() == [[2.5, 3.0, 1.0]]
    assert found.quantile(0.0).tolist() == INPUTS.tolist()
    assert found.quantile(0.5).tolist() == [[2.0, 3.0, 1.0]]
    assert found.quantile(0.95).tolist() == [[4.0, 6.0, 1.0]]


def test_batches_are_joined_in_order() -> None:
    parts = [from_hidden_counts(INPUTS, poisson(INPUTS * k)) for k in (1.0, 2.0)]
    together = join(parts)
    assert together.hidden.tolist() == [*INPUTS.tolist(), *(2 * INPUTS).tolist()]
    assert together.inputs.shape == together.totals.shape == (2, 3)
