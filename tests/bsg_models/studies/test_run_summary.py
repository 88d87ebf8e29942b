from __future__ import annotations

from pathlib import Path

from bsg_models.studies.run_summary import summarise_run
from bsg_models.zoo.config import find_config


def test_a_model_that_counts_has_no_epochs(tmp_path: Path) -> None:
    summary = summarise_run(find_config("mixture"), tmp_path)
    assert (summary.epochs, summary.best, summary.saved) == (0, None, "nothing is saved yet")
    assert summary.again == "starts again"
    assert summary.encode()["val_loss"] is None


def test_members_of_an_ensemble_are_kept(tmp_path: Path) -> None:
    summary = summarise_run(find_config("ensemble"), tmp_path)
    assert summary.members == find_config("ensemble").model.members  # type: ignore[union-attr]
    assert summary.saved == "finished members are kept"
    assert summary.again == "with --resume goes on"
