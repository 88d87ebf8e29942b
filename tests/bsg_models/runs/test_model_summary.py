from __future__ import annotations

from pathlib import Path

import pytest

from bsg_data.inputs.bounded_file import hash_file
from bsg_models.errors import CheckpointError
from bsg_models.runs.model_summary import describe_model, list_shipped, summarise_model


def test_shipped_models_are_listed_in_their_order(shipped: Path) -> None:
    first, second = list_shipped()
    assert (first.name, second.name) == ("universal", "other")
    assert first.data == "12 buildings of synthetic"
    assert first.licence == "Apache-2.0"
    assert first.sha256 == hash_file(shipped / "universal.safetensors")
    assert (first.zoo_name, first.class_space, first.classes) == ("gamma-poisson", "hm3d45-v2", 45)


@pytest.mark.usefixtures("shipped")
def test_the_model_that_is_asked_is_said(run: Path) -> None:
    assert describe_model() == "universal (shipped; trained on 12 buildings of synthetic)"
    assert describe_model(run) == f"run (run, {run / 'best.safetensors'})"
    assert summarise_model(run).kind == "run"
    with pytest.raises(CheckpointError, match="no such folder"):
        describe_model(Path("none"))
