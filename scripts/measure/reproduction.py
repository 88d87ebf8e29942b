"""Train the readings of the paper's CECI on several splits and write their tables.

    python scripts/measure/reproduction.py --data DATASET --runs FOLDER --out FIGURES

`DATASET` is built from HM3D. Every seed splits the buildings anew (80/10/10), trains every reading
with that seed, and measures it on the test buildings of that split. A value is the mean over the
splits; its interval is a bootstrap over buildings. The script keeps finished runs, so a stopped
script continues.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from results import ResultsTable, format_estimate, write_figures

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.evaluation.measurement import Fold, measure, predict_all, read_truth
from bsg_models.inputs.graphs import read_split
from bsg_models.runs.checkpoint import is_finished, load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST
from bsg_models.training.training import train_run
from bsg_models.zoo.catalogue import BASELINES, ZOO
from bsg_models.zoo.config import find_config, override, validate_config

# The open points of the paper, one reading a row. A reading changes the settings that it lists.
READINGS: dict[str, tuple[str, ...]] = {
    "ceci": (),
    "decay as schedule": ("training.decay_as=learning-rate",),
    "fixed pairs": ("data.masks=fixed",),
    "dropout 0.1": ("model.dropout=0.1",),
    "no dropout": ("model.dropout=0.0",),
    "block after last layer": ("model.last_layer=block",),
    "block, no dropout": ("model.last_layer=block", "model.dropout=0.0"),
    "edges up": ('data.edges=["up"]',),
    "edges up, no dropout": ('data.edges=["up"]', "model.dropout=0.0"),
    "edges down": ('data.edges=["down"]',),
    "width 256": ("model.width=256",),
    "2 layers, no dropout": ("model.depth=2", "model.dropout=0.0"),
}

NODES = ("all", "rooms", "building")
# Table I of the paper
PAPER = ("0.0246", "8.26e-05", "-0.084", "-0.697", "0.1122", "8.47e-04", "-0.807", "0.427")
MOMENTS = ("mean", "variance", "skewness", "kurtosis")
COLUMNS = {
    "Frobenius, rooms": "rooms/correlation_frobenius",
    "Frobenius, building": "building/correlation_frobenius",
    "Frobenius, all": "all/correlation_frobenius",
    "total variation, rooms": "rooms/total_variation/mean",
    "error in number, building": "building/mean_absolute_error",
    "hidden NLL": "rooms/hidden_nll",
    "AUROC": "rooms/presence_auroc_macro/all",
    "AUROC, unseen": "rooms/presence_auroc_macro/unseen",
}


def prepare(source: Path, out: Path, *, seed: int, draws: int) -> Path:
    """Return a copy of the dataset, split by `seed`, with stored pairs."""
    dataset = out / f"dataset-{seed}"
    if not (dataset / "pairs").is_dir():
        shutil.rmtree(dataset, ignore_errors=True)
        shutil.copytree(source, dataset)
        split_dataset(dataset, SplitRecipe(seed=seed), force=True)
        write_pairs(dataset, PairsRecipe(draws=draws))
    return dataset


def train(name: str, settings: tuple[str, ...], dataset: Path, run: Path) -> None:
    """Train one reading, unless its run is finished."""
    zoo_name = name if name in ZOO else "ceci"
    tables = override(find_config(zoo_name).model_dump(mode="json"), settings)
    config = validate_config(tables, source=name)
    if not is_finished(run, config, Dataset.open(dataset)):
        train_run(config, dataset, run, force=True)


def measure_splits(
    datasets: Sequence[Path], runs: Sequence[Path], resamples: int
) -> dict[str, Estimate]:
    """Return the metrics of one model, over all splits."""
    folds = []
    for dataset, run in zip(datasets, runs, strict=True):
        model = restore_model(run / BEST, load_checkpoint(run / BEST))
        masked = read_split(Dataset.open(dataset), "test")
        truth = read_truth(masked)
        folds.append(Fold(truth.scene_ids, [(truth, predict_all(model, masked))]))
    return measure(folds, resamples=resamples).estimates()


def tabulate_moments(found: Mapping[str, Mapping[str, Estimate]], nodes: str) -> ResultsTable:
    """Return the paper's Table I for the distances of the nodes' values."""
    moments = [(d, m) for d in ("wasserstein", "energy") for m in MOMENTS]
    rows = [
        [
            name,
            *(
                f"{metrics[f'{nodes}/{d}_values/{m}'].value:.3g}".replace("nan", "–")
                for d, m in moments
            ),
        ]
        for name, metrics in found.items()
    ]
    if nodes == "all":
        rows.insert(0, ["the paper", *PAPER])
    header = ["reading", *(f"{distance[0].upper()} {moment}" for distance, moment in moments)]
    return ResultsTable(
        f"Statistical distance, {nodes} nodes", header, rows, "Less is better.", tested_on="unseen"
    )


def tabulate_metrics(found: Mapping[str, Mapping[str, Estimate]]) -> ResultsTable:
    """Return the Frobenius norms and the other main metrics, a row a reading."""
    rows = [
        [name, *(format_estimate(metrics[one], digits=3) for one in COLUMNS.values())]
        for name, metrics in found.items()
    ]
    reading = "Mean over the splits, with its 95 % interval over buildings."
    return ResultsTable(
        "Frobenius norm and other metrics", ["reading", *COLUMNS], rows, reading, tested_on="unseen"
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Train, measure, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="dataset of bsg-data build")
    parser.add_argument("--runs", type=Path, required=True, help="folder for datasets and runs")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    parser.add_argument("--epochs", type=int, default=600)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--draws", type=int, default=5, help="stored masks of every building")
    parser.add_argument("--resamples", type=int, default=200)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--readings", nargs="*", default=list(READINGS), choices=list(READINGS))
    options = parser.parse_args(argv)
    seeds, folder = range(options.seeds), options.runs
    datasets = [prepare(options.data, folder, seed=seed, draws=options.draws) for seed in seeds]
    models = {name: READINGS[name] for name in options.readings} | dict.fromkeys(BASELINES, ())
    runs = {
        name: [folder / f"{name.replace(' ', '-')}-{seed}" for seed in seeds] for name in models
    }
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as executor:
        futures = {
            run: executor.submit(
                train,
                name,
                (f"seed={seed}", f"training.epochs={options.epochs}", *settings),
                datasets[seed],
                run,
            )
            for name, settings in models.items()
            for seed, run in enumerate(runs[name])
        }
        for run, future in futures.items():
            future.result()
            print(f"trained {run.name}", flush=True)
    found = {name: measure_splits(datasets, runs[name], options.resamples) for name in models}
    write_figures(
        options.out,
        "reproduction",
        [*(tabulate_moments(found, nodes) for nodes in NODES), tabulate_metrics(found)],
        argv=[__file__, *(argv or sys.argv[1:])],
        data=Dataset.open(options.data),
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
