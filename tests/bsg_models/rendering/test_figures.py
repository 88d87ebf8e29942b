"""Figures: what is plotted is what was given, and a file that cannot be written is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.figure import Figure
from PIL import Image

from bsg_data.files import write_figure
from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.evaluation.details import ShownNodes
from bsg_models.rendering import figures

CLASSES = ("bed", "lamp", "sink")
# A building, then two rooms.
SHOWN = ShownNodes(
    inputs=np.array([[1.0, 0, 0], [0, 0, 0], [0, 0, 0]]),
    totals=np.array([[1.0, 2, 1], [2, 0, 1], [5, 1, 1]]),
    targets=np.array([[1.0, 3, 0], [1, 2, 1], [2, 1, 1]]),
    is_building=np.array([True, False, False]),
    example=0,
)


@pytest.fixture
def saved(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Figures in the order in which they are saved; they are written, too."""
    drawn: list[Figure] = []

    def keep(figure: Figure, path: Path, **how: Any) -> None:
        drawn.append(figure)
        write_figure(figure, path, **how)

    monkeypatch.setattr(figures, "write_figure", keep)
    return drawn


def test_an_evaluation_has_the_three_figures_of_the_paper(
    saved: list[Figure], tmp_path: Path
) -> None:
    notes: list[str] = []
    facts = {"name": "my run", "shown": SHOWN, "classes": CLASSES, "building": "b", "notes": notes}
    drawn = figures.plot_evaluation(tmp_path / "new", **facts)
    assert len(drawn) == len(saved) == 3
    with Image.open(drawn["error in number per class, rooms"]) as image:
        assert image.format == "PNG"
        assert image.width > 1000
    (axes,) = saved[0].axes
    assert [label.get_text() for label in axes.get_xticklabels()] == list(CLASSES)
    (means,) = [line for line in axes.lines if line.get_label() == "mean"]
    assert list(np.asarray(means.get_ydata())) == [2.0, -1.0, 0.0]
    top, bottom = saved[2].axes
    heights = [[bar.get_height() for bar in bars] for bars in top.containers]
    assert heights == [[1, 0, 0], [1, 2, 1], [1, 3, 0]]
    shares = [[bar.get_height() for bar in bars] for bars in bottom.containers]
    assert shares == [[1, 0, 0], [0.25, 0.5, 0.25], [0.25, 0.75, 0]]


def test_the_leaderboard_has_a_panel_a_metric_and_a_row_a_model(
    saved: list[Figure], tmp_path: Path
) -> None:
    standings = {
        name: {"nll": Estimate(value, value - 0.1, value + 0.1, 10)}
        for name, value in {"good": 1.0, "middle": 1.2, "other": 1.3, "far": 90.0}.items()
    }
    title = r"$\nothing$ 5 %"  # in the words of matplotlib a formula, and one that it cannot read
    with rc_context({"text.usetex": True}):
        figures.plot_leaderboard(standings, {"nll": "nll ↓"}, tmp_path / "x.png", title=title)
    assert saved[0].get_suptitle() == title
    (axes,) = [panel for panel in saved[0].axes if panel.get_visible()]
    assert [label.get_text() for label in axes.get_yticklabels()] == list(standings)
    assert axes.get_xlim()[1] < 2  # the one far away does not set the scale
    assert [line.get_marker() for line in axes.lines].count(">") == 1
