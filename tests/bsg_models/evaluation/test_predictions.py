from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from prediction_rows import rows
from refusals import refuses

from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_data.observation.observation import Observation
from bsg_data.scene.connections import Connections
from bsg_data.scene.surroundings import Surroundings
from bsg_models.errors import PredictionError
from bsg_models.evaluation.measurement import Fold, measure, read_truth
from bsg_models.evaluation.prediction_files import read_predictions
from bsg_models.evaluation.predictions import _log_of_table, _PredictedExpectation, align
from bsg_models.evaluation.truth import Prediction

CLASSES = ("chair", "bed")


def two_rooms() -> MaskedBuildings:
    """Return one building: a room with a hidden chair, and one that was wholly seen."""
    seen = Observation(
        scene_ids=("a",),
        starts=np.array([0, 3]),
        inputs=np.array([[1, 1], [0, 1], [1, 0]]),
        hidden_share=np.array([0.25, 0.5, 0.0], dtype=np.float32),
        visited=np.ones(3, dtype=bool),
        withheld=np.zeros((3, 2), dtype=bool),
        vocabulary=(),
        unclassified=np.zeros((3, 0), dtype=np.int64),
        connections=Connections(np.zeros((0, 2), dtype=np.int64), np.zeros(0, str), np.zeros(0)),
        surroundings=Surroundings.unknown(nodes=3),
    )
    return MaskedBuildings(seen, np.array([[2, 1], [1, 1], [1, 0]]), np.array([0]), np.arange(3))


def expect(path: Path, frame: pd.DataFrame) -> _PredictedExpectation:
    frame.to_parquet(path)
    aligned = align(read_predictions(path), [two_rooms()], CLASSES)
    return aligned.expect(two_rooms())


def test_metrics_are_what_is_worked_out_by_hand(tmp_path: Path) -> None:
    frame = rows(p0=[0.5, 0.75], p1=[0.25, 0.25])
    expected = expect(tmp_path / "a.parquet", frame)
    prediction = Prediction(read_truth(two_rooms()), expected)
    values = measure([Fold(("a",), [{"": prediction}])])[""].point
    # Cells of the rooms: hidden chair 0.5; bed 0.25, and twice nothing, of which 0 is believed.
    assert values["rooms/presence_brier/all"] == pytest.approx((0.5**2 + 0.25**2) / 4)
    assert values["rooms/presence_auroc_micro/all"] == 1.0
    assert values["rooms/presence_ap_micro/all"] == 1.0
    assert values["rooms/presence_calibration_error/all"] == pytest.approx((0.5 + 0.25) / 4)
    # P(one chair) 0.25, P(no bed) 0.75; where nothing was believed, e^-0.001.
    assert values["rooms/hidden_nll"] == pytest.approx(
        (-np.log(0.25) - np.log(0.75) + 2 * 0.001) / 4
    )
    assert values["rooms/top3_unseen"] == 1.0
    # Room 1: 0.75 chairs and 1.25 beds of 2, truly 1 and 1. Room 2 is as it is seen.
    assert values["rooms/mean_absolute_error"] == pytest.approx((0.25 + 0.25) / 4)
    assert values["rooms/total_variation/mean"] == pytest.approx((0.125 + 0) / 2)
    # The building was left out: 1.75 chairs and 1.25 beds, truly 2 and 1.
    assert values["building/mean_absolute_error"] == pytest.approx(0.25)


def test_a_building_is_its_rooms_together_unless_it_is_there(tmp_path: Path) -> None:
    expectation = expect(tmp_path / "a.parquet", rows())
    assert expectation.presence.tolist() == [[0.5, 0.25], [0.5, 0.25], [0, 0]]
    assert expectation.totals.tolist() == [[1.75, 1.25], [0.75, 1.25], [1, 0]]
    told = pd.concat([rows(), rows(node_index=[0, 0], presence=[0.75, 0.5], expected=[3, 2])])
    assert expect(tmp_path / "b.parquet", told).hidden[0].tolist() == [3, 2]


def test_without_exact_probabilities_the_likelihood_is_zero_inflated(tmp_path: Path) -> None:
    expectation = expect(tmp_path / "a.parquet", rows())
    chances = [np.exp(expectation.log_probability(np.full((3, 2), float(n)))) for n in range(30)]
    assert np.sum(chances, axis=0) == pytest.approx(1)
    assert chances[0][1, 0] == pytest.approx(0.5, abs=1e-3)
    assert sum(n * p[1, 0] for n, p in enumerate(chances)) == pytest.approx(0.75, abs=1e-3)


def test_the_tail_of_a_table_is_geometric_and_keeps_the_mean() -> None:
    table = np.array([[[0.5, 1.0, 0.0]], [[0.25, 0.0, 0.0]]])
    expected = np.array([[1.0, 0.0, 2.5]])

    def chance(count: float) -> list[float]:
        return np.exp(_log_of_table(np.full((1, 3), count), table, expected))[0].tolist()

    # 1 = 0.25 + 0.25 · 3: the tail from 2 on has the mean 3, and so q = 1/2; of 2.5 it is 1/3.
    assert chance(0) == pytest.approx([0.5, 1.0, 1e-6])
    assert chance(1) == pytest.approx([0.25, 1e-6, 1e-6])
    assert chance(2) == pytest.approx([0.125, 1e-6, 2 / 3])
    assert chance(3) == pytest.approx([0.0625, 1e-6, 2 / 9])
    assert sum(n * chance(n)[2] for n in range(12)) == pytest.approx(2.5, abs=1e-3)


@pytest.mark.parametrize(
    ("change", "code", "row"),
    [
        ({"scene_id": ["a", "b"]}, "prediction-row", 1),
        ({"class": ["chair", "sofa"]}, "prediction-row", 1),
        ({"draw": [0, 7]}, "prediction-row", 1),
        ({"node_index": [1, 3]}, "prediction-row", 1),
        ({"node_index": [-1, 1]}, "prediction-row", 0),
        ({"class": ["bed", "bed"]}, "prediction-row", 1),
        ({"node_index": [1, 2]}, "prediction-missing", None),
    ],
)
def test_a_row_that_does_not_fit_is_named(
    tmp_path: Path, change: dict[str, list[float]], code: str, row: int | None
) -> None:
    path = tmp_path / "a.parquet"
    with refuses(PredictionError, code, where=path if row is None else f"{path}: row {row}"):
        expect(path, rows(**change))
