from __future__ import annotations

from pathlib import Path

from bsg_models.studies.run_summary import summarise_run
from bsg_models.zoo.catalogue import ZOO


def test_a_model_that_counts_has_no_epochs(tmp_path: Path) -> None:
    summary = summarise_run(ZOO["mixture"], tmp_path)
    assert (summary.epochs, summary.best, summary.saved) == (0, None, "nothing is saved yet")
    assert summary.again == "starts again"
    assert summary.encode()["val_loss"] is None


def test_members_of_an_ensemble_are_kept(tmp_path: Path) -> None:
    summary = summarise_run(ZOO["ensemble"], tmp_path)
    assert summary.members == ZOO["ensemble"].model.members  # type: ignore[union-attr]
    assert summary.saved == "finished members are kept"
    assert summary.again == "with --resume goes on"
