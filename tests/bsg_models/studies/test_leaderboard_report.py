from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from bsg_data.errors import DatasetError
from bsg_data.figure_file import FigureError
from bsg_models.studies.leaderboard_report import REPORT, refuse_finished, report_leaderboard


def test_a_finished_leaderboard_is_replaced_by_force_alone(tmp_path: Path) -> None:
    refuse_finished(tmp_path, force=False)
    (tmp_path / REPORT).write_text("{}")
    refuse_finished(tmp_path, force=True)
    with pytest.raises(DatasetError, match="--force replaces it"):
        refuse_finished(tmp_path, force=False)


def test_a_figure_that_cannot_be_drawn_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(results: object, path: Path, mask: str) -> None:
        raise FigureError("no LaTeX")

    module = "bsg_models.studies.leaderboard_report"
    monkeypatch.setattr(f"{module}._plot", fail)
    monkeypatch.setattr(f"{module}.write_json", lambda board: {})
    monkeypatch.setattr(f"{module}.write_markdown", lambda board: "table")
    board: Any = SimpleNamespace(results={"uniform": {}})
    report = report_leaderboard(board, tmp_path / "out")
    assert report.figures == ()
    assert report.notes == ("note: a figure is missing: no LaTeX",)
    assert report.table.read_text("utf-8") == "table"
