from __future__ import annotations

import numpy as np
import pytest

from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import from_hidden_counts
from bsg_models.evaluation.shown_nodes import ShownCollector
from bsg_models.evaluation.truth import Truth


@pytest.mark.parametrize(
    ("stride", "kept", "example"),
    [(1, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9], 4), (3, [0, 1, 4, 5, 6, 7], 2), (9, [0, 1, 4, 5], 2)],
)
def test_every_kth_masked_building_is_kept_and_the_example(
    stride: int, kept: list[int], example: int
) -> None:
    """Five masked buildings of two nodes: one draw of a, two of c, two of b."""
    targets = np.arange(10.0)[:, None]
    collector = ShownCollector(stride, "c")
    for rows, scenes in ((np.arange(4), ("a", "c")), (np.arange(4, 10), ("c", "b"))):
        number = [0, 0, 1, 1] if len(rows) == 4 else [0, 0, 1, 1, 1, 1]
        shift = 2 if len(rows) == 4 else 0  # the first batch has another building before c
        truth = Truth(
            inputs=targets[rows],
            targets=targets[rows],
            is_building=rows % 2 == 0,
            visited=np.ones(len(rows), dtype=bool),
            building=np.array(number),
            draw=np.zeros(len(rows), dtype=np.int64),
            scene_ids=scenes if not shift else ("a", "d"),
        )
        collector.add(truth, from_hidden_counts(truth.inputs, poisson(truth.inputs)))
    shown = collector.finish()
    assert shown.targets[:, 0].tolist() == kept
    assert shown.totals[:, 0].tolist() == [2 * one for one in kept]
    assert shown.targets[shown.example, 0] == 4
    assert shown.example == example
