"""What rooms add to means: three rooms by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tallies import (
    tally_all,
    tally_likelihood,
    tally_presence_loss,
    tally_second,
    tally_surroundings,
    tally_views,
)

from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_data.observation.observation import Observation
from bsg_data.scene.connections import Connections
from bsg_data.scene.surroundings import Surroundings
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation, from_hidden_counts
from bsg_models.evaluation.truth import Truth

# A building and three rooms: half seen, glimpsed, unvisited; two classes, of which the first was
# seen once in the half-seen room and once in the glimpsed one.
INPUTS = np.array([[2, 0], [1, 0], [1, 0], [0, 0]])
HIDDEN = np.array([[2, 1], [1, 0], [0, 0], [1, 1]])
PRESENCE = np.array([[0.9, 0.9], [0.5, 0.25], [0.5, 0.25], [0.75, 0.5]])
SHARE = np.array([0.7, 0.5, 0.6, 1.0], dtype=np.float32)
VISITED = np.array([True, True, False, False])


@pytest.fixture
def case() -> tuple[Truth, MaskedBuildings, Expectation]:
    seen = Observation(
        scene_ids=("a",),
        starts=np.array([0, 4]),
        inputs=INPUTS,
        hidden_share=SHARE,
        visited=VISITED,
        withheld=np.zeros((4, 2), dtype=bool),
        vocabulary=(),
        others=np.zeros((4, 0), dtype=np.int64),
        connections=Connections.of_pairs(()),
    )
    truth = Truth(
        INPUTS.astype(float),
        (INPUTS + HIDDEN).astype(float),
        np.array([True, False, False, False]),
        VISITED,
        np.zeros(4, dtype=np.int64),
        np.zeros(4, dtype=np.int64),
        ("a",),
    )
    found = from_hidden_counts(INPUTS.astype(float), poisson(-np.log1p(-PRESENCE)))
    return truth, MaskedBuildings(seen, INPUTS + HIDDEN, np.zeros(1, dtype=np.int64)), found


def test_views_are_told_apart_and_the_building_is_none_of_them(
    case: tuple[Truth, MaskedBuildings, Expectation],
) -> None:
    shares = tally_views(*case)
    for view, row, gap in (("half-seen", 1, -0.25), ("glimpsed", 2, 0.75), ("unvisited", 3, -0.75)):
        added, cells = shares[f"gap/{view}"]
        assert cells.tolist() == [2.0 * (node == row) for node in range(4)]
        assert added[row] == pytest.approx(gap)
        assert np.count_nonzero(added) == 1


def test_the_likelihood_of_a_poisson(case: tuple[Truth, MaskedBuildings, Expectation]) -> None:
    added, cells = tally_likelihood(*case)["nll"]
    rates = -np.log1p(-PRESENCE)
    by_hand = (rates - HIDDEN * np.log(rates)).mean(axis=1)  # every count is 0 or 1 in a room
    np.testing.assert_allclose(added[1:], by_hand[1:])
    assert cells.tolist() == [0, 1, 1, 1]
    assert added[0] == 0


def test_a_second_one_is_asked_for_where_one_is_seen(
    case: tuple[Truth, MaskedBuildings, Expectation],
) -> None:
    shares = tally_second(*case, classes={"bed": 0, "tv": 1})
    assert [part.sum() for part in shares["said/bed"]] == pytest.approx([1.0, 2.0])
    assert [part.sum() for part in shares["true/bed"]] == [1.0, 2.0]
    assert shares["said/tv"][1].sum() == 0


def test_the_loss_of_presence_has_a_bound(
    case: tuple[Truth, MaskedBuildings, Expectation],
) -> None:
    truth, _, found = case
    rooms = np.array([False, False, False, True])
    added, cells = tally_presence_loss(truth, found, rooms=rooms)
    assert added.tolist() == pytest.approx([0, 0, 0, -np.log(0.75) - np.log(0.5)])
    assert cells.tolist() == [0, 0, 0, 2]
    none = from_hidden_counts(INPUTS.astype(float), poisson(np.zeros((4, 2))))
    added, _ = tally_presence_loss(truth, none, rooms=rooms)
    assert added[3] == pytest.approx(2 * np.log(1e6))


def test_evidence_is_measured_in_unvisited_rooms_that_have_it(
    case: tuple[Truth, MaskedBuildings, Expectation],
) -> None:
    """All rooms have an area, and the unvisited one has no label."""
    truth, masked, found = case
    known = Surroundings.of_rooms([9.0, 4.0, 12.0], ["kitchen", "bathroom", None])
    told = replace(masked, seen=replace(masked.seen, surroundings=known))
    shares = tally_surroundings(truth, told, found)
    rooms = np.array([False, False, False, True])
    assert shares["floor_area"][1].tolist() == [0, 0, 0, 2]
    np.testing.assert_array_equal(
        shares["floor_area"][0], tally_presence_loss(truth, found, rooms=rooms)[0]
    )
    assert not shares["labels"][1].any()


def test_several_tallies_are_one(case: tuple[Truth, MaskedBuildings, Expectation]) -> None:
    both = tally_all(tally_likelihood, tally_views)(*case)
    assert set(both) == set(tally_likelihood(*case)) | set(tally_views(*case))
