from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from bsg_models.studies.evaluation_report import EvaluationRequest


def test_results_lie_in_the_first_run_unless_a_folder_is_named() -> None:
    request = EvaluationRequest(runs=(Path("a"), Path("b")), dataset=Path("d"))
    assert request.folder == Path("a/evaluation")
    named = EvaluationRequest(runs=(Path("a"),), dataset=Path("d"), out=Path("o"))
    assert named.folder == Path("o")
    with pytest.raises(ValidationError, match="name a run or predictions"):
        EvaluationRequest(runs=(), dataset=Path("d"))
    beside = EvaluationRequest(predictions=(Path("x/mine.parquet"),), dataset=Path("d"))
    assert beside.folder == Path("x/mine-evaluation")
