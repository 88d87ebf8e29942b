"""The tilt of a building: the joint of its rooms written out, and the fit of what is true."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from one_building import observe_building, surround_rooms
from scipy import stats

from bsg_data.arrays import Floats
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_data.observation.observation import Observation, stack
from bsg_models.belief.count_distribution import CountDistribution, negative_binomial
from bsg_models.zoo.building_tilt import fit_building_tilt, log_none_of, log_odds
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.settings import ModelConfig
from bsg_robot.answers.thing_belief import after_looks

MEANS = np.array([[0.0, 0.0], [0.7, 0.1], [0.2, 1.5], [0.05, 0.4]])  # the building, three rooms
SPREADS = np.array([[1.0, 1.0], [0.8, 2.0], [3.0, 4.0], [1.0, 9.0]])
MOST = 30  # objects of a class in a room


class _SameRooms(CalibratedModel):
    """Believes the same of every building of three rooms."""

    reads_labels = True

    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        nodes = len(seen.inputs)
        return negative_binomial(np.resize(MEANS, (nodes, 2)), np.resize(SPREADS, (nodes, 2)))


def tilted_model() -> _SameRooms:
    model = _SameRooms(ModelConfig(family="same rooms"), ModelInputs(classes=2))
    model.hold(
        building_calibration=[
            [[-1.5, 0.7], [0.1, 0.2], [0.5, 0.4]],
            [[2.0, -0.4], [-0.2, 0.1], [0.3, 0.3]],
        ]
    )
    return model


def observe_rooms(
    rooms: list[list[int]], hidden_share: list[float], *, scene_id: str = "home"
) -> Observation:
    histograms = np.vstack([np.sum(rooms, axis=0), rooms])
    return observe_building(histograms, hidden_share=[0.5, *hidden_share], scene_id=scene_id)


def naive(
    column: int, shift: float, slope: float, bend: float, missed: Sequence[float] = (1, 1, 1)
) -> tuple[Floats, Floats, Floats]:
    """Return P(none), P(one) and the mean, of the building and of its rooms, by the joint.

    A look missed each object of a room with probability `missed`.
    """
    rooms = np.arange(1, 4)
    counts = np.arange(MOST)
    r, m = SPREADS[rooms, column, None], MEANS[rooms, column, None]
    each = stats.nbinom.pmf(counts, r, r / (r + m))
    none = each[:, 0].prod()
    odds = np.log(none / (1 - none))
    a = shift + slope * odds + bend * max(0.0, -1 - odds)
    each *= np.array(missed)[:, None] ** counts
    joint = np.einsum("i,j,k->ijk", *each)
    joint[0, 0, 0] *= np.exp(a)
    of_rooms = np.indices(joint.shape)
    held = np.concatenate([of_rooms.sum(axis=0, keepdims=True), of_rooms])
    events = (held == 0, held == 1, held)
    none, one, mean = ((each * joint).sum(axis=(1, 2, 3)) / joint.sum() for each in events)
    return none, one, mean


@pytest.mark.parametrize("column", [0, 1])
@pytest.mark.parametrize("seen", [0, 1])
def test_rooms_and_building_follow_from_the_joint_written_out(column: int, seen: int) -> None:
    model = tilted_model()
    shown = [[0, 0], [0, 0], [0, 0]]
    shown[1][column] = seen
    found = model.predict(observe_rooms(shown, [0.5] * 3)).hidden_counts
    none, one, mean = naive(column, *model.building_calibration[seen, :, column])
    np.testing.assert_allclose(1 - found.presence[:, column], none, rtol=1e-6)
    np.testing.assert_allclose(found.mean[:, column], mean, rtol=1e-5)
    once = np.exp(found.log_probability(np.ones((4, 2)), floor=0.0))[1:, column]
    np.testing.assert_allclose(once, one[1:], rtol=1e-6)


@pytest.mark.parametrize("missed", [(0.1, 1, 1), (0.0, 0.5, 1), (0.05, 0.05, 0.05)])
def test_after_looks_that_missed_it_is_still_that_joint(missed: tuple[float, ...]) -> None:
    model = tilted_model()
    found = model.predict(observe_rooms([[0, 0]] * 3, [0.5] * 3)).hidden_counts
    chances = 1 - np.tile(np.array([1.0, *missed])[:, None], 2)
    after = after_looks(found, chances)
    for column in (0, 1):
        none, _, mean = naive(column, *model.building_calibration[0, :, column], missed)
        np.testing.assert_allclose(1 - after.presence[:, column], none, rtol=1e-5)
        np.testing.assert_allclose(after.mean[1:, column], mean[1:], rtol=1e-4)
    if missed[1:] == (1, 1):  # it is somewhere, so the others have it
        assert (after.presence[2:, 0] > found.presence[2:, 0]).all()


def test_some_rooms_are_answered_as_all_are() -> None:
    model = tilted_model()
    several = [
        observe_rooms([[0, 1], [0, 0], [2, 0]], [0.5, 1.0, 0.0]),
        observe_rooms([[0, 0], [0, 0], [0, 0]], [1.0, 0.3, 1.0]),
    ]
    seen = stack(several)
    every = model.predict(seen).hidden_counts
    for rows in ([2], [1, 2, 3], [1, 6], [5, 6, 7]):
        some = model.predict_rooms(seen, np.array(rows))
        np.testing.assert_allclose(some.presence, every.presence[rows], rtol=1e-9)
        np.testing.assert_allclose(some.mean, every.mean[rows], rtol=1e-9)


def test_a_building_without_rooms_is_not_tilted() -> None:
    seen = observe_building([[3, 1]], hidden_share=[0.5])
    found = tilted_model().predict(seen).hidden_counts
    np.testing.assert_allclose(found.mean[0], [3, 1])


def test_rooms_whose_labels_are_told_are_not_tilted_unless_the_source_is() -> None:
    model, plain = (
        tilted_model(),
        _SameRooms(ModelConfig(family="same rooms"), ModelInputs(classes=2)),
    )
    seen = observe_rooms([[0, 0]] * 3, [1.0] * 3)
    types = ("kitchen", "bedroom", "hall")
    labelled, half, known = (
        replace(seen, surroundings=surround_rooms([None] * 3, said, source=source))
        for said, source in ((types, None), (("kitchen", None, None), None), (types, "hm3d"))
    )
    odds = [
        log_odds(log_none_of(one.predict(some).presence[0]))
        for one, some in (
            (plain, seen),
            (model, seen),
            (model, labelled),
            (model, half),
            (model, known),
        )
    ]
    np.testing.assert_allclose(odds[2], odds[0])
    np.testing.assert_allclose(odds[3] - odds[0], (odds[1] - odds[0]) * 2 / 3)
    np.testing.assert_allclose(odds[4], odds[1])


def test_the_fit_finds_how_often_buildings_hide_none() -> None:
    """Rooms say .3 each, and three of them .657; in truth, all but one in ten hide one."""
    rng = np.random.Generator(np.random.PCG64(0))
    homes = 400
    buildings = []
    targets = np.zeros((4 * homes, 2), dtype=np.int64)
    for home in range(homes):
        buildings.append(observe_rooms([[0, 0]] * 3, [1.0] * 3, scene_id=f"home {home}"))
        if rng.random() < 0.9:
            targets[4 * home + 1 + rng.integers(3)] = 1
            targets[4 * home] = 1
    seen = stack(buildings)
    masked = MaskedBuildings(
        seen, targets, np.zeros(homes, dtype=np.int64), np.tile(np.arange(4), homes)
    )
    unseen, again = fit_building_tilt(np.full((4 * homes, 2), 0.3), masked, np.ones((homes, 1)))
    assert (again == 0).all()  # none was ever seen
    odds = np.log(0.7**3 / (1 - 0.7**3))
    tilted = odds + unseen[0] + unseen[1] * odds
    np.testing.assert_allclose(1 / (1 + np.exp(tilted)), 0.9, atol=0.02)
