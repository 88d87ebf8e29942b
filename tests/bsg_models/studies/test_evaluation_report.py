from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from bsg_models.evaluation.measurement import Estimate
from bsg_models.studies.evaluation_report import EvaluationRequest, judge, metric_rows


def test_results_lie_in_the_first_run_unless_a_folder_is_named() -> None:
    request = EvaluationRequest(runs=(Path("a"), Path("b")), dataset=Path("d"))
    assert request.folder == Path("a/evaluation")
    named = EvaluationRequest(runs=(Path("a"),), dataset=Path("d"), out=Path("o"))
    assert named.folder == Path("o")
    with pytest.raises(ValidationError, match="at least 1 item"):
        EvaluationRequest(runs=(), dataset=Path("d"))


def test_a_cell_has_half_the_width_of_its_interval() -> None:
    estimates = {"m": {"rooms/x": Estimate(0.5, 0.25, 0.75, 9)}}
    assert metric_rows(estimates, resamples=200) == [["rooms/x", "9", "0.5 ±0.2"]]
    assert metric_rows(estimates, resamples=0) == [["rooms/x", "9", "0.5"]]


def test_a_verdict_needs_intervals_that_are_apart() -> None:
    low, middle, high = (Estimate(v, v - 0.5, v + 0.5, 9) for v in (1.0, 1.8, 3.0))
    assert judge(low, high, less=True) == "better"
    assert judge(low, high, less=False) == "worse"
    assert judge(high, low, less=False) == "better"
    assert judge(low, middle, less=True) == "not distinguishable"
    sure = Estimate(1.0, float("nan"), float("nan"), 9)
    assert judge(sure, sure, less=True) == "not distinguishable"
