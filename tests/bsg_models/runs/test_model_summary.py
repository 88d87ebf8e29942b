from __future__ import annotations

from pathlib import Path

import pytest

from bsg_models.errors import CheckpointError
from bsg_models.runs.model_summary import describe_model, summarise_model


@pytest.mark.usefixtures("shipped")
def test_the_model_that_is_asked_is_said(run: Path) -> None:
    assert describe_model() == "universal (shipped; trained on 12 buildings of synthetic)"
    assert describe_model(run) == f"run (run, {run / 'best.safetensors'})"
    assert summarise_model(run).kind == "run"
    with pytest.raises(CheckpointError, match="no such folder"):
        describe_model(Path("none"))
