"""Buildings without rooms, and rooms without objects, go through every command."""

from __future__ import annotations

from collections import deque
from pathlib import Path

import pytest

from bsg_data import (
    PairsRecipe,
    SplitRecipe,
    build_dataset,
    check_dataset,
    open_source,
    split_dataset,
    write_pairs,
)
from bsg_data.recipes import MaskRecipe
from bsg_models.studies.comparison import EvaluationRequest
from bsg_models.studies.evaluation_report import report_evaluation
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config


@pytest.mark.parametrize(
    ("row", "figures"),
    [
        pytest.param("hall,", 3, marks=pytest.mark.heavy, id="rooms without objects"),
        pytest.param(",bed", 1, marks=pytest.mark.heavy, id="objects without rooms"),
        pytest.param("hall,\nSCENE,,bed", 0, id="buildings of both kinds, not drawn"),
    ],
)
def test_what_is_empty_is_sound_and_can_be_measured(
    row: str, figures: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not figures:
        plot = "bsg_models.studies.evaluation_report.plot_evaluation"
        monkeypatch.setattr(plot, lambda *_, **__: {})
    text = "".join(f"home{n},{row}\n".replace("SCENE", f"home{n}") for n in range(9))
    (tmp_path / "objects.csv").write_text(f"scene,room,category\n{text}")
    dataset = tmp_path / "dataset"
    build_dataset(open_source("table", tmp_path / "objects.csv"), dataset)
    assert check_dataset(dataset) == ()
    split_dataset(dataset, SplitRecipe(ratios=(0.4, 0.3, 0.3)))
    write_pairs(dataset, PairsRecipe(mask=MaskRecipe(strategy="mixed"), draws=2))
    assert check_dataset(dataset) == ()
    deque(train_run(find_config("train-mean"), dataset, tmp_path / "run"), maxlen=0)
    request = EvaluationRequest(dataset=dataset, runs=(tmp_path / "run",), resamples=2)
    report = report_evaluation(request)
    assert report.report.is_file()
    assert len(report.figures) == figures
