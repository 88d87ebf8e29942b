"""Cells of presence by hand, and its measures against a naive pass over the cells."""

from __future__ import annotations

import numpy as np
import pytest

from bsg_models.evaluation import metrics
from bsg_models.evaluation.presence import SELECTIONS, PresenceCells


def three_rooms() -> PresenceCells:
    """Return the cells of three rooms and two classes; the third room was not visited."""
    return PresenceCells(
        presence=np.array([[0.9, 0.2], [0.4, 0.5], [0.3, 0.8]]),
        seen=np.array([[True, False], [True, True], [False, False]]),
        hidden=np.array([[True, False], [False, True], [False, True]]),
        visited=np.array([True, True, False]),
    )


def test_selections_by_hand() -> None:
    cells = three_rooms()
    assert cells.rooms == {"all": 3, "unseen": 2, "unvisited": 1}
    assert cells.together["all"].presence.tolist() == [0.9, 0.2, 0.4, 0.5, 0.3, 0.8]
    assert cells.together["unseen"].presence.tolist() == [0.2, 0.3, 0.8]
    assert cells.together["unvisited"].hidden.tolist() == [False, True]
    assert [c.presence.tolist() for c in cells.by_class["unseen"]] == [[0.3], [0.2, 0.8]]


def test_a_cell_weighs_as_its_room_does() -> None:
    weights = np.array([1.0, 2.0, 5.0])
    cells = three_rooms()
    assert cells.together["all"].weigh(weights).tolist() == [1, 1, 2, 2, 5, 5]
    assert cells.together["unseen"].weigh(weights).tolist() == [1, 5, 5]
    assert cells.by_class["unvisited"][1].weigh(weights).tolist() == [5]


def test_the_classes_are_a_partition_of_the_cells() -> None:
    rng = np.random.default_rng(0)
    shape = (40, 6)
    cells = PresenceCells(
        presence=rng.random(shape),
        seen=rng.random(shape) < 0.4,
        hidden=rng.random(shape) < 0.3,
        visited=rng.random(40) < 0.5,
    )
    weights = rng.integers(0, 3, 40).astype(float)
    for name in SELECTIONS:
        whole, parts = cells.together[name], cells.by_class[name]
        assert sum(len(part.presence) for part in parts) == len(whole.presence)
        # The Brier score is a mean over cells: that of all is the weighted mean of the classes'.
        mass = [part.weigh(weights) for part in parts]
        scores = [metrics.brier(p.presence, p.hidden, m) for p, m in zip(parts, mass, strict=True)]
        sums = [m.sum() for m in mass]
        expected = np.dot(scores, sums) / np.sum(sums)
        found = metrics.brier(whole.presence, whole.hidden, whole.weigh(weights))
        assert found == pytest.approx(expected)


def test_without_an_unvisited_room_there_is_nothing_to_measure() -> None:
    every = np.ones((2, 3), dtype=bool)
    cells = PresenceCells(presence=every * 0.5, seen=every, hidden=every, visited=every[:, 0])
    assert cells.rooms["unvisited"] == 0
    assert np.isnan(metrics.auroc(cells.together["unvisited"].ranking))
