from __future__ import annotations

from pathlib import Path

import pytest

from bsg_data.errors import DatasetError
from bsg_models.studies.leaderboard_report import REPORT, refuse_finished


def test_a_finished_leaderboard_is_replaced_by_force_alone(tmp_path: Path) -> None:
    refuse_finished(tmp_path, force=False)
    (tmp_path / REPORT).write_text("{}")
    refuse_finished(tmp_path, force=True)
    with pytest.raises(DatasetError, match="--force replaces it"):
        refuse_finished(tmp_path, force=False)
