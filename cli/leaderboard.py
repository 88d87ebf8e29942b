"""`bsg-evaluate --leaderboard`: train and measure the zoo in cross-validation."""

from __future__ import annotations

import importlib.util
import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from bsg_cli.terminal import format_table, print_json, print_note, progress_bar, worker_pool
from bsg_cli.train import load_config
from bsg_data.errors import DatasetError
from bsg_data.files import write_bytes
from bsg_models.rendering.figures import plot_leaderboard
from bsg_models.studies.leaderboard import (
    Leaderboard,
    LeaderboardRecipe,
    ModelResult,
    make_leaderboard,
)
from bsg_models.studies.leaderboard_table import (
    HEADLINES,
    UNVISITED,
    rank_models,
    write_json,
    write_markdown,
)
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import RunConfig

REPORT, TABLE = "leaderboard.json", "leaderboard.md"


def run_leaderboard(
    dataset: Path,
    out: Path,
    recipe: LeaderboardRecipe,
    *,
    models: str | None,
    workers: int,
    force: bool,
    as_json: bool,
) -> None:
    """Make a leaderboard, and write and print its table."""
    if (out / REPORT).exists() and not force:
        raise DatasetError(
            f"{out / REPORT}: is there already; --force replaces it, --out puts it elsewhere"
        )
    chosen = choose_models(models)
    try:
        with worker_pool(workers) as executor, _bars() as progress:
            board = make_leaderboard(
                dataset, out, chosen, recipe, executor=executor, progress=progress
            )
    except KeyboardInterrupt:
        print_note(f"{out}: the same command goes on; finished runs are kept")
        raise
    figures = [_draw(results, out / f"{mask}.png", mask) for mask, results in _by_mask(board)]
    write_bytes(out / TABLE, write_markdown(board).encode())
    summary = write_json(board)
    write_bytes(out / REPORT, (json.dumps(summary, indent=1) + "\n").encode())
    if as_json:
        print_json(summary)
        return
    for mask, results in _by_mask(board):
        click.echo(f"`{mask}` masks:\n{_summary(results)}\n")
    click.echo(f"table: {out / TABLE}; every metric: {out / REPORT}; figures:")
    click.echo("\n".join(f"  {path}" for path in figures))


def choose_models(models: str | None) -> dict[str, RunConfig]:
    """Return the models of a comma-separated list of zoo names and TOML files; None is the zoo."""
    if models is None:
        chosen = dict(ZOO)
        if importlib.util.find_spec("lightgbm") is None:
            del chosen["poisson-boosting"]
            print_note(
                "note: poisson-boosting is left out: pip install 'belief-scene-graphs[boosting]'"
            )
        return chosen
    names = [name.strip() for name in models.split(",") if name.strip()]
    if not names:
        raise click.UsageError("--models names no model")
    chosen = {name if name in ZOO else Path(name).stem: load_config(name, ()) for name in names}
    strange = [name for name in chosen if not re.fullmatch(r"[\w. -]+", name) or name[0] == "."]
    if strange:
        raise click.UsageError(
            f"--models: {strange[0]!r} cannot name a folder; letters, digits, '-', '_' and '.' can"
        )
    if len(chosen) < len(names):
        raise click.UsageError("--models names a model twice")
    return chosen


def _by_mask(board: Leaderboard) -> Iterator[tuple[str, dict[str, ModelResult]]]:
    yield from board.results.items()


def _summary(results: dict[str, ModelResult]) -> str:
    columns = HEADLINES["what is hidden"][:6]
    rows = [
        [
            name,
            *(f"{results[name].metrics.point[column.metric]:.4f}" for column in columns),
            f"{results[name].seconds:.1f}",
        ]
        for name in rank_models(results)
    ]
    arrows = [f"{column.label} {'↓' if column.less else '↑'}" for column in columns]
    return format_table(rows, header=["model", *arrows, "training, s"])


def _draw(results: dict[str, ModelResult], path: Path, mask: str) -> Path:
    headlines = [*HEADLINES["what is hidden"], *HEADLINES["whole histograms"]]
    headlines += UNVISITED if mask != "uniform" else ()
    labels = {h.metric: f"{h.label} {'↓' if h.less else '↑'}" for h in headlines}
    estimates = {name: results[name].metrics.estimates() for name in rank_models(results)}
    title = f"`{mask}` masks; 95 % intervals over buildings; dashed: the best; grey: far beyond"
    plot_leaderboard(estimates, labels, path, title=title)
    return path


@contextmanager
def _bars() -> Iterator[Callable[[str, int, int], None]]:
    """Yield a callback (what, done, total) that draws a bar for each part of the work."""
    with (
        progress_bar("train", unit="run") as train,
        progress_bar("combine", unit="run") as combine,
        progress_bar("measure", unit="model") as measure,
    ):
        bars = {"train": train, "combine": combine, "measure": measure}
        yield lambda what, done, total: bars[what](done, total)
