"""What each part of the best model is worth: one change a row, on the folds of the leaderboard.

Each variant is `ceci-sage` with the settings of its row, trained and measured as `bsg-leaderboard`
does; `distilled` learns half of its hidden counts from the ensemble instead of the truth. Writes
`ablation.md`, whose rows docs/models.md copies.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import cast

import numpy as np

from bsg_data.dataset.dataset import Dataset
from bsg_data.executors import run_all
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_data.tables import format_markdown
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST, clear_run, is_finished, open_run
from bsg_models.studies.leaderboard import (
    DATASET,
    SECONDS,
    LeaderboardRecipe,
    fit_to,
    make_leaderboard,
    run_of,
)
from bsg_models.training.epochs import TrainingBuildings, train_epochs
from bsg_models.training.training import calibrate_run, new_model, one_thread
from bsg_models.zoo.config import RunConfig, find_config, override, validate_config
from bsg_models.zoo.model import BeliefModel, Network

VARIANTS: dict[str, tuple[str, ...]] = {
    "ceci-sage": (),
    "classes alone": ('model.reads=["mask","building"]',),
    "categories by SVD, 24": ("model.embed=svd", "model.embedding=24"),
    "categories, all and undropped": (
        "model.category_dropout=0.0",
        "model.embedding=256",
        "data.min_scenes=1",
    ),
    "room alone": ('model.reads=["mask","categories"]', "data.edges=[]"),
    "half hidden always": ("data.fractions=[0.5,0.5]",),
    "five stored masks": ("data.masks=fixed", "training.epochs=80"),
}
DISTILLED, TEACHER = "distilled", "ensemble"


class TaughtBuildings(TrainingBuildings):
    """Training buildings of which half, chosen anew each epoch, hide what a teacher believes."""

    def __init__(
        self, config: RunConfig, data: Dataset, model: BeliefModel, teacher: BeliefModel
    ) -> None:
        super().__init__(config, data, model)
        self._teacher = teacher

    def of_epoch(self, epoch: int) -> MaskedBuildings:
        """Return the buildings of an epoch, some with targets sampled from the teacher."""
        masked = super().of_epoch(epoch)
        rng = np.random.default_rng(epoch)
        believed = self._teacher.predict(masked.seen).hidden_counts.sample(rng)
        taught = (rng.random(len(masked)) < 0.5)[masked.seen.building, None]
        targets = np.where(taught, masked.seen.inputs + believed, masked.targets)
        return replace(masked, targets=targets)


def distil(folder: Path, config: RunConfig) -> None:
    """Train the variant that learns from the ensemble, for one fold."""
    fold = config.data.fold or 0
    run, teacher_run = run_of(folder, DISTILLED, fold), run_of(folder, TEACHER, fold)
    data = Dataset.open(folder / DATASET)
    if is_finished(run, config, data) and (run / SECONDS).is_file():
        return
    teacher = restore_model(teacher_run / BEST, load_checkpoint(teacher_run / BEST))
    began = time.perf_counter()
    with open_run(run), one_thread():
        clear_run(run)
        model = new_model(config, data)
        model.fit(data, config.data)
        masked = TaughtBuildings(config, data, model, teacher)
        for _ in train_epochs(cast(Network, model), config, data, run, masked):
            pass
        calibrate_run(config, data, run)
    (run / SECONDS).write_text(json.dumps({"seconds": time.perf_counter() - began}))


def configure(settings: tuple[str, ...]) -> RunConfig:
    """Return ceci-sage with some settings."""
    tables = override(find_config("ceci-sage").model_dump(mode="json"), settings)
    return validate_config(tables, source="ablation")


def format_rows(variants: dict[str, dict[str, str]]) -> list[str]:
    """Return the table, a row a variant, each beside its paired difference from the first."""
    names = ("hidden NLL", "difference", "AUROC", "AUROC unseen", "AP unseen", "calibration error")
    rows = [(name, *cells.values()) for name, cells in variants.items()]
    return format_markdown(rows, header=("variant", *names, "training, s"))


def main() -> int:
    """Train and measure all variants, and write `ablation.md`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="dataset of bsg-data build")
    parser.add_argument("--out", type=Path, required=True, help="folder of a leaderboard, or new")
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--variants", nargs="*", default=list(VARIANTS), choices=list(VARIANTS))
    options = parser.parse_args()
    recipe = LeaderboardRecipe(masks=("uniform",), folds=options.folds)
    folder = options.out / "uniform"
    chosen = dict.fromkeys(["ceci-sage", *options.variants])
    models = {name: configure(VARIANTS[name]) for name in chosen}
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as executor:

        def show(what: str, done: int, total: int) -> None:
            print(f"{what} {done} of {total}", flush=True)

        make_leaderboard(
            options.data,
            options.out,
            {TEACHER: find_config(TEACHER)},
            recipe,
            executor=executor,
            progress=show,
        )
        taught = configure(("seed=1",))  # another start than the teacher's own member
        tasks = [
            (folder, fit_to(taught, recipe, mask="uniform", fold=fold))
            for fold in range(recipe.folds)
        ]
        run_all(distil, tasks, executor=executor)
        models[DISTILLED] = taught
        board = make_leaderboard(
            options.data, options.out, models, recipe, executor=executor, progress=show
        )
    standings = board.standings["uniform"]
    first = standings["ceci-sage"].metrics
    found = {}
    for name, standing in standings.items():
        metrics = standing.metrics
        difference = metrics.difference(first, "rooms/hidden_nll")
        cells = {"nll": f"{metrics.point['rooms/hidden_nll']:.4f}"}
        cells["difference"] = (
            f"{difference.value:+.4f} ({difference.low:+.4f} to {difference.high:+.4f})"
        )
        for metric in ("auroc_macro/all", "auroc_macro/unseen", "ap_micro/unseen"):
            cells[metric] = f"{metrics.point[f'rooms/presence_{metric}']:.4f}"
        cells["ece"] = f"{metrics.point['rooms/presence_calibration_error/all']:.4f}"
        cells["seconds"] = f"{standing.seconds:.0f}"
        found[name] = cells
    text = "\n".join(format_rows(found)) + "\n"
    (options.out / "ablation.md").write_text(text, "utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
