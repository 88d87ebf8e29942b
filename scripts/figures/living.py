"""Draw what a robot gains by living in a home, from the measured figures.

python scripts/figures/living.py --out docs/figures/living.svg
"""

from __future__ import annotations

import json
from pathlib import Path

import click
import matplotlib as mpl
from matplotlib.figure import Figure

FIGURES = Path(__file__).resolve().parents[2] / "docs" / "results" / "figures.json"
COLOURS = ("#3f51b5", "#9aa0a6", "#e8710a")


def draw_searches() -> Figure:
    """Draw the metres of a search by the days that a robot has lived there."""
    table = json.loads(FIGURES.read_text("utf-8"))["living"]["tables"]["Searches"]
    figure = Figure(figsize=(7, 3.2), layout="constrained")
    axes = figure.subplots()
    days = [row[0] for row in table["rows"]]
    for number, colour in enumerate(COLOURS, 1):
        metres = [float(row[number]) for row in table["rows"]]
        axes.plot(days, metres, "o-", color=colour, lw=2)
        axes.annotate(
            table["header"][number], (len(days) - 1, metres[-1]), (8, 0), color=colour, va="center",
            textcoords="offset points", annotation_clip=False,
        )  # fmt: skip
    axes.set(xlabel="days that the robot has lived there", ylabel="metres until it is found")
    axes.set_ylim(bottom=0)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--out", type=click.Path(path_type=Path), required=True, help="The picture.")
def main(out: Path) -> None:
    """Draw the figure."""
    with mpl.rc_context({"svg.hashsalt": "belief-scene-graphs"}):  # else ids in an SVG are random
        draw_searches().savefig(out, metadata={"Date": None})


if __name__ == "__main__":
    main()
