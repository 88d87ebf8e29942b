"""Draw figures for print: error per class, correlations, histograms, learning curves, savings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from bsg_data.arrays import Floats
from bsg_data.files import PLAIN_TEXT, FigureError, noting_failures, stem_of, write_figure
from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.evaluation.details import ShownNodes
from bsg_models.evaluation.metrics import correlation_matrix, normalise
from bsg_models.runs.run_folder import EpochReport

_INPUT, _PREDICTED, _TRUE = "#BBBBBB", "#0018EC", "#FF8000"
_FAINT_BLUE, _FAINT_ORANGE = "#C9CFFF", "#FFD3A6"


@rc_context(PLAIN_TEXT)
def plot_evaluation(
    folder: Path,
    *,
    name: str,
    shown: ShownNodes,
    classes: Sequence[str],
    building: str,
    notes: list[str],
) -> Mapping[str, Path]:
    """Plot the paper's three figures of one model into a folder, and return caption → path.

    `notes` takes a note about each figure that cannot be drawn.
    """
    rooms, stem = ~shown.is_building, stem_of(name)
    predicted, true = shown.totals[rooms], shown.targets[rooms]
    drawn: dict[str, Path] = {}
    with noting_failures(notes):
        _require_rooms(predicted)
        figure = _plot_class_errors(predicted - true, classes)
        path = folder / f"{stem}-class-errors.png"
        _save(figure, path, title=f"{name}: error in number, rooms")
        drawn["error in number per class, rooms"] = path
    with noting_failures(notes):
        _require_rooms(predicted)
        figure = _plot_correlations({"predicted": predicted, "true": true}, classes)
        path = folder / f"{stem}-correlations.png"
        _save(figure, path, title=f"{name}: correlations of the classes over rooms")
        drawn["correlations of the classes, rooms"] = path
    with noting_failures(notes):
        path = folder / f"{stem}-building.png"
        _save(_plot_building(shown, classes), path, title=f"{name}: building {building}")
        drawn[f"histogram and distribution of {building}"] = path
    return drawn


def _require_rooms(predicted: Floats) -> None:
    if not len(predicted):
        raise FigureError("no building that was measured has a room")


def _plot_class_errors(errors: Floats, classes: Sequence[str]) -> Figure:
    """Plot predicted minus true counts `[N, C]` as box plots: the paper's figure of O″ − O."""
    figure = _figure(11, 4.2)
    axes, places = figure.subplots(), np.arange(1, len(classes) + 1)
    dots = {"marker": ".", "markersize": 2, "markeredgecolor": "#888888"}
    _plot_boxes(axes, errors.T, flierprops=dots)
    axes.plot(places, errors.mean(axis=0), "D", color=_TRUE, markersize=3, label="mean")
    axes.axhline(0, color="black", linewidth=0.5)
    axes.set_xticks(places, classes, rotation=90, fontsize=7)
    axes.set_yscale("symlog", linthresh=2)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylim(1.4 * min(errors.min(), -1.0), 1.4 * max(errors.max(), 1.0))
    axes.set_ylabel("predicted − true number\n(linear within ±2, then logarithmic)", fontsize=8)
    axes.grid(axis="y", linewidth=0.3)
    axes.legend(loc="upper right", fontsize=7, frameon=False)
    return figure


def _plot_correlations(counts: Mapping[str, Floats], classes: Sequence[str]) -> Figure:
    """Plot the correlation matrices of counts `[N, C]`: the paper's figure of correlations."""
    figure = _figure(13, 6.6)
    panels, ticks = figure.subplots(1, len(counts), sharey=True), np.arange(len(classes))
    for axes, (name, values) in zip(panels, counts.items(), strict=True):
        image = axes.imshow(correlation_matrix(values), cmap="RdBu_r", vmin=-1, vmax=1)
        axes.set_xticks(ticks, classes, rotation=90, fontsize=6)
        axes.set_yticks(ticks, classes, fontsize=6)
        axes.set_title(name, fontsize=9)
    figure.colorbar(image, ax=list(panels), shrink=0.7, label="Pearson correlation", pad=0.01)
    return figure


def _plot_building(shown: ShownNodes, classes: Sequence[str]) -> Figure:
    """Plot the input, predicted and true histogram and the distribution of one building."""
    figure = _figure(11, 5.6)
    top, bottom = figure.subplots(2, 1, sharex=True)
    rows = {
        "input": (shown.inputs, _INPUT),
        "predicted": (shown.totals, _PREDICTED),
        "true": (shown.targets, _TRUE),
    }
    positions = np.arange(len(classes))
    for offset, (name, (table, colour)) in zip((-0.28, 0.0, 0.28), rows.items(), strict=True):
        counts = table[[shown.example]]
        top.bar(positions + offset, counts[0], 0.28, color=colour, label=name)
        bottom.bar(positions + offset, normalise(counts)[0], 0.28, color=colour)
    top.set_ylabel("objects (E × O)", fontsize=8)
    bottom.set_ylabel("probability (E)", fontsize=8)
    bottom.set_xticks(positions, classes, rotation=90, fontsize=7)
    top.legend(loc="upper right", fontsize=8, frameon=False, ncols=3)
    for axes in (top, bottom):
        axes.spines[["top", "right"]].set_visible(False)
        axes.margins(x=0.01)
    return figure


@rc_context(PLAIN_TEXT)
def plot_learning_curve(reports: Sequence[EpochReport], path: Path, *, title: str) -> None:
    """Plot training and validation loss over epochs, and mark the epoch of the best checkpoint.

    Its margins are fixed: a layout that fits the labels would take another 40 % of the time. The
    legend is above the axes, where it hides no curve.
    """
    figure = _figure(7, 4)
    figure.set_layout_engine("none")
    axes, epochs = figure.add_axes((0.12, 0.12, 0.85, 0.73)), [report.epoch for report in reports]
    losses = [report.train_loss for report in reports]
    axes.plot(epochs, losses, color=_INPUT, linewidth=0.8, label="training")
    validated = [(r.epoch, r.val_loss) for r in reports if r.val_loss is not None]
    points = np.reshape(validated, (-1, 2)).T
    axes.plot(*points, ".-", color=_PREDICTED, markersize=4, label="validation")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if reports:
        best = reports[-1].best_epoch
        axes.axvline(best, color=_TRUE, linewidth=0.8, linestyle="--", label=f"best, epoch {best}")
    if any(loss > 0 for loss in losses):  # none is where no building has an object
        axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.set_xlabel("epoch")
    axes.set_ylabel("loss, mean over nodes and classes")
    figure.legend(
        loc="upper right", bbox_to_anchor=(0.97, 0.93), fontsize=8, frameon=False, ncols=3
    )
    axes.spines[["top", "right"]].set_visible(False)
    _save(figure, path, title=title, fits=True)


@rc_context(PLAIN_TEXT)
def plot_leaderboard(
    standings: Mapping[str, Mapping[str, Estimate]],
    headlines: Mapping[str, str],
    path: Path,
    *,
    title: str,
) -> None:
    """Plot one panel per metric and one row per model, with 95 % intervals.

    `standings` are model → metric → estimate from the top row, `headlines` metric → label of its
    panel. A dashed line marks the best model, a grey arrow a model far outside the panel.
    """
    rows, columns = len(standings), min(len(headlines), 4)
    size = (3.2 * columns + 1.4, 0.8 + 0.24 * rows)
    figure, panels = _panels(headlines.values(), columns, size)
    places = np.arange(rows)[::-1]
    for axes, (metric, label) in zip(panels, headlines.items(), strict=True):
        estimates = [of_model[metric] for of_model in standings.values()]
        _scale_panel(axes, estimates, sign=1 if label.endswith("↓") else -1)
        left, right = axes.get_xlim()
        for place, estimate in zip(places, estimates, strict=True):
            axes.plot(
                [estimate.low, estimate.high], [place, place], color=_PREDICTED, linewidth=1.2
            )
            if left <= estimate.value <= right or np.isnan(estimate.value):
                axes.plot(estimate.value, place, "o", color=_PREDICTED, markersize=4)
            else:  # outside the panel: the arrow points to the value
                edge, marker = (left, "<") if estimate.value < left else (right, ">")
                axes.plot(edge, place, marker, color=_INPUT, markersize=5, clip_on=False)
        axes.set_yticks(places, standings, fontsize=8)
    _save(figure, path, title=title)


def _scale_panel(axes: Axes, estimates: Sequence[Estimate], *, sign: int) -> None:
    """Mark the best estimate, and let the best three quarters set the scale."""
    known = [estimate for estimate in estimates if not np.isnan(estimate.value)]
    best = sorted(known, key=lambda estimate: sign * estimate.value)[: -(-3 * len(estimates) // 4)]
    if best:
        axes.axvline(best[0].value, color=_TRUE, linewidth=0.7, linestyle="--")
        ends = [x for e in best for x in (e.low, e.value, e.high) if not np.isnan(x)]
        margin = 0.06 * (max(ends) - min(ends)) or 0.01
        axes.set_xlim(min(ends) - margin, max(ends) + 2 * margin)


@rc_context(PLAIN_TEXT)
def plot_savings(
    savings: Mapping[str, Mapping[str, Floats]], path: Path, *, title: str, whole: str
) -> None:
    """Plot box plots of what planners save, one panel per world and task.

    `savings` are panel → planner → saving in each building `[B]`; `whole` is the planner that no
    other can beat, drawn in its own colour.
    """
    names, columns = list(next(iter(savings.values()))), min(len(savings), 2)
    figure, panels = _panels(savings, columns, (6.2 * columns, 0.9 + 0.34 * len(names)))
    for axes, by_planner in zip(panels, savings.values(), strict=True):
        percent = [100 * by_planner[name] for name in reversed(names)]
        dots = {"marker": ".", "markersize": 3, "markeredgecolor": "#888888"}
        boxes = _plot_boxes(axes, percent, flierprops=dots, orientation="horizontal")
        for name, box in zip(reversed(names), boxes, strict=True):
            box.set_facecolor(_FAINT_ORANGE if name == whole else _FAINT_BLUE)
        axes.axvline(0, color="black", linewidth=0.7)
        axes.set_xlim(max(min(float(values.min()) for values in percent) - 5, -150), 100)
        axes.set_yticks(range(1, len(names) + 1), list(reversed(names)), fontsize=8)
    figure.supxlabel("cost saved compared with `nearest` in each building, %", fontsize=8)
    _save(figure, path, title=title)


def _panels(
    labels: Iterable[str], columns: int, size: tuple[float, float]
) -> tuple[Figure, list[Axes]]:
    """Return a panel for each label, in lines of the given width and height in inches."""
    named = list(labels)
    lines = -(-len(named) // columns)
    figure = _figure(size[0], lines * size[1] + 0.5)
    panels = figure.subplots(lines, columns, sharey=True, squeeze=False).ravel()
    for axes in panels[len(named) :]:
        axes.set_visible(False)
    for axes, label in zip(panels, named, strict=False):
        axes.set_title(label, fontsize=9)
        axes.tick_params(axis="x", labelsize=7)
        axes.grid(axis="x", linewidth=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    return figure, list(panels[: len(named)])


def _plot_boxes(axes: Axes, values: Iterable[Floats], **options: Any) -> list[Any]:
    thin = {"linewidth": 0.6}
    drawn = axes.boxplot(
        list(values),
        widths=0.6,
        patch_artist=True,
        medianprops={"color": "black"},
        boxprops={"facecolor": _FAINT_BLUE, **thin},
        whiskerprops=thin,
        capprops=thin,
        **options,
    )
    return list(drawn["boxes"])


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _save(figure: Figure, path: Path, *, title: str, fits: bool = False) -> None:
    figure.suptitle(title, fontsize=10)
    write_figure(figure, path, dpi=160, bbox_inches=None if fits else "tight")
