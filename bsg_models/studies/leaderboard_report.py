"""Write the files of a leaderboard.

OUT/leaderboard.json    every metric
OUT/leaderboard.md      the tables
OUT/MASK.png            a figure for each kind of mask
OUT/SHA256SUMS          the seal of all files, written last: its presence means finished
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from bsg_data.errors import DatasetError
from bsg_data.figure_file import noting_failures
from bsg_data.files import AnyPath, encode_json, write_bytes
from bsg_data.results import refuse_other_results, write_results
from bsg_models.evaluation.catalogue import head_value
from bsg_models.rendering.figures import plot_leaderboard
from bsg_models.runs.run_folder import refuse_run
from bsg_models.studies.leaderboard import Leaderboard, ModelResult
from bsg_models.studies.leaderboard_table import (
    HIDDEN,
    UNVISITED,
    WHOLE,
    rank_models,
    write_json,
    write_markdown,
)

REPORT, TABLE = "leaderboard.json", "leaderboard.md"


class LeaderboardReport(NamedTuple):
    """The files of a leaderboard."""

    summary: dict[str, Any]  # the leaderboard as JSON
    report: Path  # file of the summary
    table: Path  # the Markdown document
    figures: tuple[Path, ...]  # one per kind of mask
    notes: tuple[str, ...]  # about figures that cannot be drawn


def refuse_finished(out: AnyPath, *, force: bool) -> None:
    """Refuse a folder with a finished leaderboard unless `force`, and a folder with other results.

    Raises:
        DatasetError: if there is a finished leaderboard, or results of another command.
    """
    out = Path(out)
    refuse_other_results(out, REPORT)
    refuse_run(out)
    if (out / REPORT).exists() and not force:
        raise DatasetError(
            f"{out / REPORT}: is there already; --force replaces it, --out puts it elsewhere"
        )


def report_leaderboard(board: Leaderboard, out: AnyPath) -> LeaderboardReport:
    """Write the files of a leaderboard."""
    out = Path(out)
    summary = write_json(board)
    with write_results(out, report=REPORT) as staged:
        drawn: list[str] = []
        notes: list[str] = []
        for mask, results in board.results.items():
            with noting_failures(notes):
                _plot(results, staged / f"{mask}.png", mask)
                drawn.append(f"{mask}.png")
        write_bytes(staged / TABLE, write_markdown(board).encode())
        write_bytes(staged / REPORT, (encode_json(summary, indent=1) + "\n").encode())
    figures = tuple(out / name for name in drawn)
    return LeaderboardReport(summary, out / REPORT, out / TABLE, figures, tuple(notes))


def summary_rows(results: dict[str, ModelResult]) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the table for a terminal, the best model first."""
    columns = HIDDEN[:6]
    rows = [
        [
            name,
            *(f"{results[name].metrics.point[column]:.4f}" for column in columns),
            f"{results[name].seconds:.1f}",
        ]
        for name in rank_models(results)
    ]
    return ["model", *map(head_value, columns), "training, s"], rows


def _plot(results: dict[str, ModelResult], path: Path, mask: str) -> None:
    headlines = (*HIDDEN, *WHOLE, *(UNVISITED if mask != "uniform" else ()))
    labels = {name: head_value(name) for name in headlines}
    estimates = {name: results[name].metrics.estimates() for name in rank_models(results)}
    title = f"`{mask}` masks; 95 % intervals over buildings; dashed: the best; grey: outside"
    plot_leaderboard(estimates, labels, path, title=title)
