"""Train the readings of the paper's CECI on several splits and write their tables.

    python scripts/measure/reproduction.py --data DATASET --out FOLDER

`DATASET` is built from HM3D. Every seed splits the buildings anew (80/10/10), trains every reading
with that seed, and measures it on the test buildings of that split. A value is the mean over the
splits; its interval is a bootstrap over buildings. The script keeps finished runs, so a stopped
script continues.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from datetime import date
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from results_page import ResultsPage, describe, write_page

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.evaluation.measurement import (
    Measurement,
    SplitWeights,
    count_empty,
    predict_all,
    read_truth,
)
from bsg_models.inputs.graphs import read_split
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST, METRICS
from bsg_models.training.learning_curve import read_metrics
from bsg_models.training.training import train_run
from bsg_models.zoo.catalogue import BASELINES, ZOO
from bsg_models.zoo.config import find_config, override, validate_config

# The open points of the paper, one reading a row. A reading changes the settings that it lists.
READINGS: dict[str, tuple[str, ...]] = {
    "ceci-gcn": (),
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


def prepare(source: Path, out: Path, *, seed: int, draws: int) -> Path:
    """Return a copy of the dataset, split by `seed`, with stored pairs."""
    dataset = out / f"dataset-{seed}"
    if not (dataset / "pairs").is_dir():
        shutil.rmtree(dataset, ignore_errors=True)
        shutil.copytree(source, dataset)
        split_dataset(dataset, SplitRecipe(seed=seed), force=True)
        write_pairs(dataset, PairsRecipe(draws=draws))
    return dataset


def train(name: str, settings: tuple[str, ...], dataset: Path, run: Path) -> float:
    """Train one reading unless it is finished; return its seconds."""
    done = run / "seconds.json"
    if not done.is_file():
        zoo_name = name if name in ZOO else "ceci-gcn"
        tables = override(find_config(zoo_name).model_dump(mode="json"), settings)
        config = validate_config(tables, source=name)
        began = time.perf_counter()
        for _ in train_run(config, dataset, run, force=True):
            pass
        done.write_text(json.dumps(time.perf_counter() - began))
    return float(json.loads(done.read_text("utf-8")))


def measure(
    datasets: list[Path], runs: list[Path], resamples: int
) -> tuple[dict[str, Estimate], dict[str, float]]:
    """Return the metrics of one model, and its mean absolute error in rooms for each class."""
    splits, errors = [], []
    for dataset, run in zip(datasets, runs, strict=True):
        checkpoint = load_checkpoint(run / BEST)
        masked = read_split(Dataset.open(dataset), "test")
        truth = read_truth(masked)
        found = predict_all(restore_model(run / BEST, checkpoint), masked)
        splits.append(Measurement(truth, found))
        errors.append(np.abs(found.totals - truth.targets)[~truth.is_building].mean(axis=0))
    classes = checkpoint.header.class_space.classes
    per_class = dict(zip(classes, np.mean(errors, axis=0).tolist(), strict=True))
    weights = SplitWeights([one.scene_ids for one in splits], resamples=resamples, seed=0)
    each = [one.measure(weights.of_split(number)) for number, one in enumerate(splits)]
    measured = weights.average(each).bootstrap()
    return measured.estimates(), per_class


def plateau(run: Path) -> int:
    """Return the epoch after which no validation is 5 % below the best before it."""
    best, since = float("inf"), 0
    for row in read_metrics(run / METRICS):
        if row.val_loss is not None and row.val_loss < 0.95 * best:
            best, since = row.val_loss, row.epoch
    return since


def cell(e: Estimate, digits: int = 3) -> str:
    """Return a value with its interval."""
    value, low, high = (f"{x:.{digits}g}" for x in (e.value, e.low, e.high))
    return "–" if np.isnan(e.value) else f"{value} ({low} to {high})"


def moments_table(found: dict[str, dict[str, Estimate]], nodes: str, reading: str) -> list[str]:
    """Return the paper's Table I in its four-column form, for one reading of the distances."""
    lines = [
        f"| {nodes} nodes, {reading} | W mean | variance | skewness | kurtosis "
        "| E mean | variance | skewness | kurtosis |",
        "|---|" + "---|" * 8,
    ]
    for name, metrics in found.items():
        cells = [
            f"{metrics[f'{nodes}/{metric}_{reading}/{moment}'].value:.3g}"
            for metric in ("wasserstein", "energy")
            for moment in ("mean", "variance", "skewness", "kurtosis")
        ]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def full_table(found: dict[str, dict[str, Estimate]], names: list[str]) -> list[str]:
    """Return every metric with its interval, a column a model."""
    lines = [f"| metric | {' | '.join(names)} |", "|---|" + "---|" * len(names)]
    for metric in found[names[0]]:
        cells = [cell(found[name][metric]) for name in names]
        lines.append(f"| `{metric}` | " + " | ".join(cells) + " |")
    return [*lines, ""]


def frobenius_table(found: dict[str, dict[str, Estimate]]) -> list[str]:
    """Return the Frobenius norms and the other main metrics, a row a reading."""
    columns = {
        "Frobenius, rooms": "rooms/correlation_frobenius",
        "Frobenius, building": "building/correlation_frobenius",
        "Frobenius, all": "all/correlation_frobenius",
        "total variation, rooms": "rooms/total_variation/mean",
        "error in number, building": "building/mean_absolute_error",
        "hidden NLL": "rooms/hidden_nll",
        "AUROC": "rooms/presence_auroc_macro/all",
        "AUROC, unseen": "rooms/presence_auroc_macro/unseen",
    }
    lines = [f"| reading | {' | '.join(columns)} |", "|---|" + "---|" * len(columns)]
    for name, metrics in found.items():
        lines.append(f"| {name} | " + " | ".join(cell(metrics[m]) for m in columns.values()) + " |")
    return [*lines, ""]


def main() -> int:
    """Train, measure, and write `reproduction.md` and `reproduction.json`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="dataset of bsg-data build")
    parser.add_argument(
        "--out", type=Path, required=True, help="folder to write runs and tables to"
    )
    parser.add_argument("--page", type=Path, help="page to write; default: reproduction.md in OUT")
    parser.add_argument("--epochs", type=int, default=600)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--draws", type=int, default=5, help="stored masks of every building")
    parser.add_argument("--resamples", type=int, default=200)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--readings", nargs="*", default=list(READINGS), choices=list(READINGS))
    options = parser.parse_args()
    datasets = [
        prepare(options.data, options.out, seed=seed, draws=options.draws)
        for seed in range(options.seeds)
    ]
    models = {name: READINGS[name] for name in options.readings} | dict.fromkeys(BASELINES, ())
    runs = {
        name: [options.out / f"{name.replace(' ', '-')}-{seed}" for seed in range(options.seeds)]
        for name in models
    }
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool_of_workers:
        futures = []
        for name, settings in models.items():
            for seed, (dataset, run) in enumerate(zip(datasets, runs[name], strict=True)):
                common = (f"seed={seed}", f"training.epochs={options.epochs}")
                futures.append(
                    (run, pool_of_workers.submit(train, name, (*common, *settings), dataset, run))
                )
        for run, future in futures:
            print(f"{run.name}: {future.result():.0f} s", flush=True)
    measured = {name: measure(datasets, runs[name], options.resamples) for name in models}
    found = {name: metrics for name, (metrics, _) in measured.items()}
    readings = [name for name in models if name not in BASELINES]
    truths = [read_truth(read_split(Dataset.open(dataset), "test")) for dataset in datasets]
    buildings = {scene for truth in truths for scene in truth.scene_ids}
    empty = [count_empty(truth) for truth in truths]
    print(
        f"{len(buildings)} different test buildings, {sum(len(t.inputs) for t in truths)} nodes, "
        f"{sum(e['empty_inputs'] for e in empty)} with an empty input, "
        f"{sum(e['empty_targets'] for e in empty)} empty altogether"
    )
    lines = [*moments_table(found, "all", "values"), *frobenius_table(found)]
    for nodes, reading in (("rooms", "values"), ("building", "values"), ("all", "classes")):
        lines += moments_table(found, nodes, reading)
    lines += full_table(found, [readings[0], *BASELINES])
    lines += ["| reading | epoch of the plateau |", "|---|---|"]
    for name in readings:
        lines.append(f"| {name} | {np.mean([plateau(run) for run in runs[name]]):.0f} |")
    lines += ["", f"| class | {readings[0]} | doubled |", "|---|---|---|"]
    ours, doubled = measured[readings[0]][1], measured["doubled"][1]
    for name in sorted(ours, key=lambda c: -ours[c]):
        lines.append(f"| {name} | {ours[name]:.2f} | {doubled[name]:.2f} |")
    page = ResultsPage(
        "Readings of the paper's CECI",
        (
            "docs/results/reproduction.md gives the conclusions from these tables. Every "
            f"reading was trained on {options.seeds} splits of the buildings. A value is the mean "
            "over the splits, with its 95 % interval over buildings.",
            "\n".join(lines),
        ),
        (),
        describe(Dataset.open(options.data), sys.argv, date=date.today().isoformat()),
    )
    write_page(page, options.page or options.out / "reproduction.md")
    plain = {
        m: {k: [e.value, e.low, e.high, e.nodes] for k, e in v.items()} for m, v in found.items()
    }
    (options.out / "reproduction.json").write_text(json.dumps(plain, indent=1) + "\n", "utf-8")
    print(options.page or options.out / "reproduction.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
