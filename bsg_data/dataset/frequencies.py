"""Count how often each class occurs in a dataset, and plot it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import BSGError, ask_to_install
from bsg_data.figure_file import PLAIN_TEXT, write_figure
from bsg_data.files import AnyPath
from bsg_data.results import refuse_file

_MARK = "belief-scene-graphs: frequencies"  # in the figure: marks it as written by this program
_HEAD = 4096  # bytes in which the mark is, in PNG and SVG


def count_frequencies(dataset: AnyPath) -> pd.DataFrame:
    """Return one row per class, most frequent first.

    Columns: `class`; `instances`; `rooms` and `scenes` with at least one instance.
    """
    data = Dataset.open(dataset)
    classes = data.manifest.class_space.classes
    totals = np.zeros((3, len(classes)), dtype=np.int64)
    for part in data.parts():
        cells, starts = part.every_cell, part.starts
        in_room = np.ones(len(cells), dtype=bool)
        in_room[starts[:-1]] = False
        there = np.add.reduceat(cells, starts[:-1]) > 0 if len(cells) else cells > 0
        totals += [cells.sum(axis=0), (cells[in_room] > 0).sum(axis=0), there.sum(axis=0)]
    frame = pd.DataFrame(
        {
            "class": classes,
            **dict(zip(("instances", "rooms", "scenes"), totals, strict=True)),
        }
    )
    return frame.sort_values(["instances", "class"], ascending=[False, True], ignore_index=True)


def refuse_figure(path: AnyPath, *, force: bool) -> None:
    """Refuse a path for a figure that is in a dataset, in sealed results, or holds something else.

    Args:
        path: path of the figure.
        force: allow replacing a file that this program did not write.

    Raises:
        BSGError: if the path is a folder, in a dataset, one of the files of sealed results, or,
            without `force`, another file.
    """
    path = Path(path)
    if path.is_dir():
        raise BSGError(f"{path}: is a folder; name a file in it, e.g. {path / 'classes.png'}")
    refuse_file(path, force=True)
    if path.exists() and not force:
        with path.open("rb") as file:
            if _MARK.encode() not in file.read(_HEAD):
                raise BSGError(
                    f"{path}: exists and is no figure of this program; --force replaces it"
                )


def plot_frequencies(frame: pd.DataFrame, path: AnyPath, *, title: str) -> None:
    """Plot the instances and the rooms of every class as bars, into an image file.

    Raises:
        BSGError: if matplotlib is not installed or the file cannot be written.
    """
    path = Path(path)
    try:
        from matplotlib import rc_context
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise BSGError(f"a figure needs matplotlib: {ask_to_install('figures')}") from error
    with rc_context(PLAIN_TEXT):
        figure = Figure(figsize=(9, 0.22 * len(frame) + 1.2), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, column, colour in ((left, "instances", "#FF8000"), (right, "rooms", "#9702FA")):
            bars = axes.barh(frame["class"], frame[column], color=colour, height=0.75)
            axes.bar_label(bars, fontsize=7, padding=2)
            axes.set_xlabel(column)
            axes.margins(x=0.12, y=0.01)
            axes.spines[["top", "right"]].set_visible(False)
            axes.tick_params(labelsize=8)
        left.invert_yaxis()
        figure.suptitle(title, fontsize=10)
        write_figure(figure, path, dpi=150, metadata={"Creator": _MARK})
