"""`bsg-leaderboard`: train and measure models in cross-validation."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import bsg_data
from bsg_cli.choices import complete_list, load_config
from bsg_cli.data.totals import warn_of_recordings
from bsg_cli.options import (
    dataset_argument,
    force_option,
    number_option,
    out_option,
    seed_option,
    split_names,
    workers_option,
)
from bsg_cli.terminal import Command, print_note, print_text, progress_bar, worker_pool
from bsg_data.observation.masks import MASKS
from bsg_data.registry import require_known
from bsg_data.tables import format_text
from bsg_models.zoo.catalogue import ZOO

if TYPE_CHECKING:
    from bsg_models.zoo.config import RunConfig

_STEPS = {"train": "run", "measure": "model"}  # step of the work → its unit


@click.command("bsg-leaderboard", cls=Command)
@dataset_argument
@click.option(
    "--models",
    shell_complete=complete_list(lambda ctx: ZOO),
    help="Zoo names and TOML files, with commas.  [default: all of the zoo]",
)
@click.option(
    "--masks",
    shell_complete=complete_list(lambda ctx: MASKS),
    default="uniform,rooms",
    show_default=True,
    help="Masks to measure on, with commas.",
)
@number_option("--folds", "Number of folds.", default=5, least=3)
@number_option("--draws", "Masks per building.", default=5)
@out_option("Folder of the results.  [default: leaderboard]")
@workers_option
@seed_option
@number_option("--seeds", "Number of seeds that train each model, from --seed on.", default=1)
@force_option
def main(
    dataset: Path,
    models: str | None,
    masks: str,
    out: Path | None,
    workers: int,
    force: bool,
    **options: Any,
) -> None:
    """Train and measure models of the zoo in cross-validation.

    The dataset stays unchanged. Each model is trained once for each mask, or once in all if its
    configuration names a mask. With --seeds 3, each is trained by three seeds: values are means
    over them, and intervals hold buildings and seeds. After an interruption, run the same command
    again to continue.

    \b
    Example:
      bsg-leaderboard dataset --models doubled,mixture,ceci-sage
    """
    names = split_names(masks, option="--masks")
    require_known("mask", names or (), MASKS)
    chosen = _choose_models(models)
    out = out or Path("leaderboard")
    from bsg_models.studies.leaderboard import LeaderboardRecipe, make_leaderboard
    from bsg_models.studies.leaderboard_report import (
        refuse_finished,
        report_leaderboard,
        summary_rows,
    )

    refuse_finished(out, force=force)
    recipe = LeaderboardRecipe.model_validate({"masks": names, **options})
    print_note(
        f"{len(chosen)} models in {recipe.folds} folds of {len(recipe.masks)} masks, each with "
        f"{recipe.draws} draws, by {recipe.seeds} seed{'s' * (recipe.seeds > 1)}"
    )
    warn_of_recordings(bsg_data.read_manifest(dataset))
    try:
        with worker_pool(workers) as executor, ExitStack() as stack:
            bars = {
                what: stack.enter_context(progress_bar(what, unit=unit))
                for what, unit in _STEPS.items()
            }
            board = make_leaderboard(
                *(dataset, out, chosen, recipe),
                executor=executor,
                progress=lambda what, done, total: bars[what](done, total),
            )
    except KeyboardInterrupt:
        print_note(f"{out}: finished runs are kept; run the same command again to continue")
        raise
    report = report_leaderboard(board, out)
    for note in report.notes:
        print_note(note)
    for mask, results in board.results.items():
        header, rows = summary_rows(results)
        print_text(f"`{mask}` masks:\n{format_text(rows, header=header)}\n")
    print_text(f"page: {report.page}; every metric: {report.report}")
    print_text("figures:")
    print_text("\n".join(f"  {path}" for path in report.figures))


def _choose_models(models: str | None) -> dict[str, RunConfig]:
    """Return the models of a list of zoo names and TOML files with commas; None: all of the zoo."""
    if models is None:
        return {name: load_config(name) for name in ZOO}
    names = [name.strip() for name in models.split(",") if name.strip()]
    if not names:
        raise click.UsageError("--models names no model; expected names with commas between them")
    chosen = {name if name in ZOO else Path(name).stem: load_config(name) for name in names}
    if len(chosen) < len(names):
        raise click.UsageError("--models names a model twice; name each model once")
    return chosen
