"""Figures: what is plotted is what was given, and a file that cannot be written is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.figure import Figure
from PIL import Image

from bsg_data.errors import BSGError
from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.evaluation.shown_nodes import ShownNodes
from bsg_models.rendering import figures
from bsg_models.training.learning_curve import EpochReport

CLASSES = ("bed", "lamp", "sink")


@pytest.fixture
def saved(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Figures in the order in which they are saved; they are written, too."""
    kept: list[Figure] = []
    save = figures._save

    def keep(figure: Figure, path: Path) -> None:
        kept.append(figure)
        save(figure, path)

    monkeypatch.setattr(figures, "_save", keep)
    return kept


def test_every_class_has_a_box_and_its_mean(saved: list[Figure], tmp_path: Path) -> None:
    errors = np.array([[1.0, -2.0, 0.0], [3.0, 0.0, 0.0]])
    figures.plot_class_errors(errors, CLASSES, tmp_path / "a" / "x.png", title="errors")
    (axes,) = saved[0].axes
    assert [label.get_text() for label in axes.get_xticklabels()] == list(CLASSES)
    (means,) = [line for line in axes.lines if line.get_label() == "mean"]
    assert list(np.asarray(means.get_ydata())) == [2.0, -1.0, 0.0]
    with Image.open(tmp_path / "a" / "x.png") as image:
        assert image.format == "PNG"
        assert image.width > 1000


def test_bars_are_counts_above_and_probabilities_below(saved: list[Figure], tmp_path: Path) -> None:
    inputs, totals = np.array([[1.0, 0.0, 0.0]]), np.array([[1.0, 2.0, 1.0]])
    target = np.array([[1.0, 3.0, 0.0]])
    shown = ShownNodes(inputs, totals, target, is_building=np.array([True]), example=0)
    figures.plot_building(shown, CLASSES, tmp_path / "x.png", title="t")
    top, bottom = saved[0].axes
    heights = [[bar.get_height() for bar in bars] for bars in top.containers]
    assert heights == [[1, 0, 0], [1, 2, 1], [1, 3, 0]]
    shares = [[bar.get_height() for bar in bars] for bars in bottom.containers]
    assert shares == [[1, 0, 0], [0.25, 0.5, 0.25], [0.25, 0.75, 0]]


def test_the_learning_curve_marks_the_best_epoch(saved: list[Figure], tmp_path: Path) -> None:
    losses: list[tuple[float, float | None]] = [(3.0, None), (2.0, 2.5), (1.0, 2.75)]
    reports = [
        EpochReport(epoch, 3, train, val, best_epoch=2, seconds=1.0)
        for epoch, (train, val) in enumerate(losses, 1)
    ]
    figures.plot_learning_curve(reports, tmp_path / "x.png", title="t", loss="nll")
    lines = {str(line.get_label()): line for line in saved[0].axes[0].lines}
    assert list(np.asarray(lines["training"].get_ydata())) == [3.0, 2.0, 1.0]
    assert list(np.asarray(lines["validation"].get_xdata())) == [2, 3]
    assert "best, epoch 2" in lines


def test_the_leaderboard_has_a_panel_a_metric_and_a_row_a_model(
    saved: list[Figure], tmp_path: Path
) -> None:
    standings = {
        name: {"nll": Estimate(value, value - 0.1, value + 0.1, 10)}
        for name, value in {"good": 1.0, "middle": 1.2, "other": 1.3, "far": 90.0}.items()
    }
    figures.plot_leaderboard(standings, {"nll": "nll ↓"}, tmp_path / "x.png", title="t")
    (axes,) = [one for one in saved[0].axes if one.get_visible()]
    assert [label.get_text() for label in axes.get_yticklabels()] == list(standings)
    assert axes.get_xlim()[1] < 2  # the one far away does not set the scale
    assert [line.get_marker() for line in axes.lines].count(">") == 1


def test_savings_are_in_percent_with_the_oracle_in_its_own_colour(
    saved: list[Figure], tmp_path: Path
) -> None:
    savings = {"star, single": {"ratio": np.array([0.1, 0.3]), "oracle": np.array([0.5, 0.7])}}
    figures.plot_savings(savings, tmp_path / "x.png", title="t", whole="oracle")
    (axes,) = saved[0].axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["oracle", "ratio"]
    colours = {patch.get_facecolor() for patch in axes.patches}
    assert len(colours) == 2
    medians = [np.asarray(line.get_xdata()) for line in axes.lines if line.get_color() == "black"]
    assert any(np.allclose(line, 20) for line in medians)
    assert any(np.allclose(line, 60) for line in medians)


def test_a_figure_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BSGError):
        figures.plot_class_errors(np.zeros((2, 3)), CLASSES, tmp_path / "file" / "x.png", title="")


def test_a_name_is_shown_as_it_is_whatever_the_settings(
    saved: list[Figure], tmp_path: Path
) -> None:
    """In the words of matplotlib this name is a formula, and one that it cannot read."""
    name = r"$\nothing$ 5 %"
    report = EpochReport(1, 1, 2.0, 3.0, 1, 0.1)
    with rc_context({"text.usetex": True}):
        figures.plot_learning_curve([report], tmp_path / "x.png", title=name, loss=name)
    assert saved[0].axes[0].get_title() == name
    assert (tmp_path / "x.png").is_file()
