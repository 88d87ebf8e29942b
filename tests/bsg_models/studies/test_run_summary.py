from __future__ import annotations

from pathlib import Path

import pytest

from bsg_data.errors import DatasetError
from bsg_data.seal import SEAL
from bsg_models.errors import CheckpointError, TrainingError
from bsg_models.runs.run_folder import RECORD
from bsg_models.studies.run_summary import summarise_run


def test_what_is_no_run_is_said(tmp_path: Path, run: Path) -> None:
    assert summarise_run(run).notes == ()
    with pytest.raises(CheckpointError, match="no checkpoint there"):
        summarise_run(tmp_path)
    (run / RECORD).write_text("{}\n", "utf-8")
    with pytest.raises(DatasetError, match=r"training\.json: was changed"):
        summarise_run(run)
    (run / SEAL).unlink()
    with pytest.raises(TrainingError, match=r"training\.json: is no record of a training"):
        summarise_run(run)
