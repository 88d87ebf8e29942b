"""Draw figures for print: error per class, correlations, histograms, learning curves, savings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from bsg_data.figure_file import PLAIN_TEXT, noting_failures, write_figure
from bsg_data.files import stem_of
from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.evaluation.metrics import Floats, correlation_matrix, normalise
from bsg_models.evaluation.shown_nodes import ShownNodes
from bsg_models.training.learning_curve import EpochReport

INPUT, PREDICTED, TRUE = "#BBBBBB", "#0018EC", "#FF8000"


@rc_context(PLAIN_TEXT)
def plot_class_errors(errors: Floats, classes: Sequence[str], path: Path, *, title: str) -> None:
    """Plot the error in number per class as a box plot (the paper's figure of O″ − O).

    Args:
        errors: `[N, C]` predicted minus true counts.
        classes: `[C]` names.
        path: image file to write.
        title: text above the plot.
    """
    figure = _figure(11, 4.2)
    axes = figure.subplots()
    axes.boxplot(
        [errors[:, c] for c in range(len(classes))],
        widths=0.6,
        flierprops={"marker": ".", "markersize": 2, "markeredgecolor": "#888888"},
        medianprops={"color": "black"},
        boxprops={"facecolor": "#C9CFFF", "linewidth": 0.6},
        whiskerprops={"linewidth": 0.6},
        capprops={"linewidth": 0.6},
        patch_artist=True,
    )
    means = errors.mean(axis=0)
    axes.plot(np.arange(1, len(classes) + 1), means, "D", color=TRUE, markersize=3, label="mean")
    axes.axhline(0, color="black", linewidth=0.5)
    axes.set_xticks(np.arange(1, len(classes) + 1), classes, rotation=90, fontsize=7)
    axes.set_yscale("symlog", linthresh=2)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylim(1.4 * min(errors.min(), -1.0), 1.4 * max(errors.max(), 1.0))
    axes.set_ylabel("predicted − true number\n(linear within ±2, then logarithmic)", fontsize=8)
    axes.grid(axis="y", linewidth=0.3)
    axes.legend(fontsize=7, frameon=False)
    axes.set_title(title, fontsize=10)
    _save(figure, path)


@rc_context(PLAIN_TEXT)
def plot_correlations(
    predicted: Floats, true: Floats, classes: Sequence[str], path: Path, *, title: str
) -> None:
    """Plot the two correlation matrices side by side (the paper's figure of correlations).

    Args:
        predicted: `[N, C]` counts.
        true: `[N, C]` counts.
        classes: `[C]` names.
        path: image file to write.
        title: text above the plot.
    """
    figure = _figure(13, 6.6)
    left, right = figure.subplots(1, 2, sharey=True)
    ticks = np.arange(len(classes))
    for axes, counts, name in ((left, predicted, "predicted"), (right, true, "true")):
        image = axes.imshow(correlation_matrix(counts), cmap="RdBu_r", vmin=-1, vmax=1)
        axes.set_xticks(ticks, classes, rotation=90, fontsize=6)
        axes.set_yticks(ticks, classes, fontsize=6)
        axes.set_title(name, fontsize=9)
    figure.colorbar(image, ax=(left, right), shrink=0.7, label="Pearson correlation", pad=0.01)
    figure.suptitle(title, fontsize=10)
    _save(figure, path)


@rc_context(PLAIN_TEXT)
def plot_building(shown: ShownNodes, classes: Sequence[str], path: Path, *, title: str) -> None:
    """Plot the input, predicted and true histogram and the distribution of one building.

    Args:
        shown: nodes with what a model expects of them.
        classes: `[C]` names.
        path: image file to write.
        title: text above the plot.
    """
    node = shown.example
    figure = _figure(11, 5.6)
    top, bottom = figure.subplots(2, 1, sharex=True)
    rows = {
        "input": (shown.inputs[[node]], INPUT),
        "predicted": (shown.totals[[node]], PREDICTED),
        "true": (shown.targets[[node]], TRUE),
    }
    positions = np.arange(len(classes))
    for offset, (name, (counts, colour)) in zip((-0.28, 0.0, 0.28), rows.items(), strict=True):
        top.bar(positions + offset, counts[0], 0.28, color=colour, label=name)
        bottom.bar(positions + offset, normalise(counts)[0], 0.28, color=colour)
    top.set_ylabel("objects (E × O)", fontsize=8)
    bottom.set_ylabel("probability (E)", fontsize=8)
    bottom.set_xticks(positions, classes, rotation=90, fontsize=7)
    top.legend(fontsize=8, frameon=False, ncols=3)
    for axes in (top, bottom):
        axes.spines[["top", "right"]].set_visible(False)
        axes.margins(x=0.01)
    figure.suptitle(title, fontsize=10)
    _save(figure, path)


@rc_context(PLAIN_TEXT)
def plot_learning_curve(
    reports: Sequence[EpochReport], path: Path, *, title: str, loss: str
) -> None:
    """Plot training and validation loss over epochs, and mark the epoch of the best checkpoint.

    Args:
        reports: one per epoch of a training.
        path: image file to write.
        title: text above the plot.
        loss: name of the loss, the label of the axis.
    """
    figure = _figure(7, 4)
    axes = figure.subplots()
    epochs = [report.epoch for report in reports]
    axes.plot(epochs, [r.train_loss for r in reports], color=INPUT, linewidth=0.8, label="training")
    validated = {r.epoch: r.val_loss for r in reports if r.val_loss is not None}
    axes.plot(
        list(validated),
        list(validated.values()),
        ".-",
        color=PREDICTED,
        markersize=4,
        label="validation",
    )
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if reports:
        best = reports[-1].best_epoch
        axes.axvline(best, color=TRUE, linewidth=0.8, linestyle="--", label=f"best, epoch {best}")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.set_xlabel("epoch")
    axes.set_ylabel(loss)
    axes.legend(fontsize=8, frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_title(title, fontsize=10)
    _save(figure, path)


def plot_evaluation(
    folder: Path,
    *,
    name: str,
    shown: ShownNodes,
    classes: Sequence[str],
    building: str,
    notes: list[str],
) -> Mapping[str, Path]:
    """Plot the three figures of one model into a folder.

    Args:
        folder: folder of the images.
        name: name of the model.
        shown: nodes with what the model expects of them.
        classes: `[C]` names.
        building: name of the building that is shown.
        notes: takes a note about each figure that cannot be drawn.

    Returns:
        Caption → path of the figures that were drawn.
    """
    rooms = ~shown.is_building
    errors = shown.totals - shown.targets
    stem = stem_of(name)
    drawn: dict[str, Path] = {}
    with noting_failures(notes):
        path = folder / f"{stem}-class-errors.png"
        plot_class_errors(errors[rooms], classes, path, title=f"{name}: error in number, rooms")
        drawn["error in number per class, rooms"] = path
    with noting_failures(notes):
        path = folder / f"{stem}-correlations.png"
        title = f"{name}: correlations of the classes over rooms"
        plot_correlations(shown.totals[rooms], shown.targets[rooms], classes, path, title=title)
        drawn["correlations of the classes, rooms"] = path
    with noting_failures(notes):
        path = folder / f"{stem}-building.png"
        plot_building(shown, classes, path, title=f"{name}: building {building}")
        drawn[f"histogram and distribution of {building}"] = path
    return drawn


@rc_context(PLAIN_TEXT)
def plot_leaderboard(
    standings: Mapping[str, Mapping[str, Estimate]],
    headlines: Mapping[str, str],
    path: Path,
    *,
    title: str,
) -> None:
    """Plot one panel per metric and one row per model, with 95 % intervals.

    A dashed line marks the best model. A grey arrow stands for a model far outside the panel.

    Args:
        standings: model → metric → estimate, from the top row to the bottom row.
        headlines: metric → label of its panel.
        path: image file to write.
        title: text above the plot.
    """
    columns = min(len(headlines), 4)
    lines = -(-len(headlines) // columns)
    figure = _figure(3.2 * columns + 1.4, lines * (0.8 + 0.24 * len(standings)) + 0.5)
    panels = figure.subplots(lines, columns, sharey=True, squeeze=False).ravel()
    places = np.arange(len(standings))[::-1]
    shown = -(-3 * len(standings) // 4)  # the best three quarters set the scale of a panel
    for axes, (metric, label) in zip(panels, headlines.items(), strict=False):
        of_models = [estimates[metric] for estimates in standings.values()]
        sign = 1 if label.endswith("↓") else -1
        known = sorted(
            (one for one in of_models if not np.isnan(one.value)), key=lambda e: sign * e.value
        )
        if known:
            axes.axvline(known[0].value, color=TRUE, linewidth=0.7, linestyle="--")
            ends = [x for e in known[:shown] for x in (e.low, e.value, e.high) if not np.isnan(x)]
            margin = 0.06 * (max(ends) - min(ends)) or 0.01
            axes.set_xlim(min(ends) - margin, max(ends) + 2 * margin)
        left, right = axes.get_xlim()
        for place, one in zip(places, of_models, strict=True):
            axes.plot([one.low, one.high], [place, place], color=PREDICTED, linewidth=1.2)
            if left <= one.value <= right or np.isnan(one.value):
                axes.plot(one.value, place, "o", color=PREDICTED, markersize=4)
            else:  # outside the panel: the arrow points to the value
                edge, marker = (left, "<") if one.value < left else (right, ">")
                axes.plot(edge, place, marker, color=INPUT, markersize=5, clip_on=False)
        axes.set_title(label, fontsize=9)
        axes.set_yticks(places, standings, fontsize=8)
        axes.tick_params(axis="x", labelsize=7)
        axes.grid(axis="x", linewidth=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    for axes in panels[len(headlines) :]:
        axes.set_visible(False)
    figure.suptitle(title, fontsize=10)
    _save(figure, path)


@rc_context(PLAIN_TEXT)
def plot_savings(
    savings: Mapping[str, Mapping[str, Floats]], path: Path, *, title: str, whole: str
) -> None:
    """Plot box plots of what planners save, one panel per world and task.

    Args:
        savings: panel → planner → saving in each building, `[B]`.
        path: image file to write.
        title: text above the plot.
        whole: planner that no other can beat, drawn in its own colour.
    """
    columns = min(len(savings), 2)
    lines = -(-len(savings) // columns)
    names = list(next(iter(savings.values())))
    figure = _figure(6.2 * columns, lines * (0.9 + 0.34 * len(names)) + 0.5)
    panels = figure.subplots(lines, columns, sharey=True, squeeze=False).ravel()
    for axes, (label, by_planner) in zip(panels, savings.items(), strict=False):
        boxes = axes.boxplot(
            [100 * by_planner[name] for name in reversed(names)],
            orientation="horizontal",
            widths=0.6,
            patch_artist=True,
            flierprops={"marker": ".", "markersize": 3, "markeredgecolor": "#888888"},
            medianprops={"color": "black"},
            whiskerprops={"linewidth": 0.7},
            capprops={"linewidth": 0.7},
        )
        for name, box in zip(reversed(names), boxes["boxes"], strict=True):
            box.set(facecolor="#FFD3A6" if name == whole else "#C9CFFF", linewidth=0.6)
        axes.axvline(0, color="black", linewidth=0.7)
        low = min(float(100 * values.min()) for values in by_planner.values())
        axes.set_xlim(max(low - 5, -150), 100)
        axes.set_yticks(range(1, len(names) + 1), list(reversed(names)), fontsize=8)
        axes.tick_params(axis="x", labelsize=7)
        axes.set_title(label, fontsize=9)
        axes.grid(axis="x", linewidth=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    for axes in panels[len(savings) :]:
        axes.set_visible(False)
    figure.supxlabel("cost saved compared with `nearest` in each building, %", fontsize=8)
    figure.suptitle(title, fontsize=10)
    _save(figure, path)


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _save(figure: Figure, path: Path) -> None:
    write_figure(figure, path, dpi=160, bbox_inches="tight")
