"""Histograms of presence against sorted cells: exact with one score a bin, else within a bound."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import exact_ranks
import numpy as np
import pytest

from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.presence import PresenceHistograms, _bin_presence, select_cells
from bsg_models.evaluation.truth import Prediction, Truth

ROOMS, CLASSES = 60, 4
WEIGHTS = np.random.default_rng(1).integers(0, 3, (7, 3)).astype(np.uint16)
MEASURES = (("auroc", exact_ranks.auroc), ("precision", exact_ranks.average_precision))


def make_rooms(*, digits: int, spread: float, seed: int = 0) -> dict[str, np.ndarray]:
    """Return rooms; few digits make many ties, and little spread crowds scores into a few bins."""
    rng = np.random.default_rng(seed)
    shape = (ROOMS, CLASSES)
    return {
        "presence": (0.3 + spread * rng.random(shape)).round(digits),
        "seen": rng.random(shape) < 0.4,
        "hidden": rng.random(shape) < 0.3,
        "visited": rng.random(ROOMS) < 0.5,
        "building": rng.integers(0, len(WEIGHTS), ROOMS),
    }


def count(rooms: dict[str, np.ndarray]) -> PresenceHistograms:
    """Return the rooms in three batches."""
    histograms, seen = PresenceHistograms(WEIGHTS), rooms["seen"].astype(float)
    truth = Truth(
        inputs=seen,
        targets=seen + rooms["hidden"],
        is_building=np.zeros(ROOMS, dtype=bool),
        visited=rooms["visited"],
        building=rooms["building"],
        draw=np.zeros(ROOMS, dtype=np.int64),
        scene_ids=tuple("abcdefg"),
    )
    found = cast(Expectation, SimpleNamespace(presence=rooms["presence"]))
    for rows in np.split(np.arange(ROOMS), [10, 10, 45]):
        histograms.add(Prediction(truth, found), rows, rooms["building"][rows])
    return histograms


@pytest.mark.parametrize(
    ("digits", "spread", "exact"), [(1, 0.7, True), (12, 0.7, False), (12, 0.001, False)]
)
def test_ranks_are_those_of_sorted_cells_within_the_bound(
    digits: int, spread: float, exact: bool
) -> None:
    rooms = make_rooms(digits=digits, spread=spread)
    histograms, off = count(rooms), 0.0
    cells = np.broadcast_to(WEIGHTS[rooms["building"]].T[:, :, None], (3, ROOMS, CLASSES))
    for name, keep in select_cells(rooms["seen"], rooms["visited"]).items():
        ranks = histograms.rank(name)
        for c in (None, *range(CLASSES)):
            some = keep if c is None else keep & (np.arange(CLASSES) == c)
            scores, truth = rooms["presence"][some], rooms["hidden"][some]
            for w in range(3):
                mass = cells[w][some].astype(float)
                bound = exact_ranks.bounds(_bin_presence(scores), truth, mass)
                for (measure, reference), most in zip(MEASURES, bound, strict=True):
                    found = getattr(ranks, measure)[0 if c is None else 1 + c, w]
                    expected = reference(scores, truth, mass)
                    allowed = 1e-12 + (0 if exact else most)
                    assert found == pytest.approx(expected, abs=allowed, nan_ok=True)
                    off = max(off, abs(np.nan_to_num(found - expected)))
    assert exact or spread > 0.1 or off > 1e-6  # crowded bins do differ


def test_selections_by_hand() -> None:
    seen = np.array([[True, False], [True, True], [False, False]])
    found = select_cells(seen, np.array([True, True, False]))
    assert found["all"].all()
    np.testing.assert_array_equal(found["unseen"], ~seen)
    assert found["unvisited"].tolist() == [[False, False], [False, False], [True, True]]


def test_without_an_unvisited_room_there_is_nothing_to_measure() -> None:
    rooms = make_rooms(digits=2, spread=0.7) | {"visited": np.ones(ROOMS, dtype=bool)}
    histograms = count(rooms)
    assert histograms.nodes["unvisited"] == 0
    assert np.isnan(histograms.rank("unvisited").auroc).all()
