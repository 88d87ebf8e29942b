"""Train and measure every model on the same folds, for each kind of mask.

    OUT/MASK/dataset          a copy of the dataset, in folds, with pairs
    OUT/MASK/fold-K/MODEL     a run trained on that kind of mask, without fold K
    OUT/MASK/seed-S/fold-K/MODEL    the same by a further seed, S above that of the leaderboard
    OUT/leaderboard.json      written last, with leaderboard.html and MASK.png

Each model is trained on every kind of mask of the leaderboard and measured on the same kind. A
configuration that names its own mask, such as `mixed`, is trained once, on that mask, and measured
on every kind. All models meet the same masks of the same buildings, and the same resamples. An
ensemble trains its own members.

With several seeds, every model whose training depends on one is trained by each: its start, its
order and its own masks differ. Folds and masks of the tests stay.

A stopped leaderboard continues: finished runs of the same configuration and dataset are kept.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pydantic import Field, field_validator

from bsg_data.dataset import commit
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import MANIFEST, Manifest, read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.executors import run_all
from bsg_data.files import AnyPath, hold
from bsg_data.observation.masks import MASKS
from bsg_data.observation.pairs import write_pairs
from bsg_data.places import RESULTS, refuse_datasets
from bsg_data.recipes import MAX_SEED, Fraction, MaskRecipe, PairsRecipe, Seed, SplitRecipe
from bsg_data.records import Record
from bsg_data.results import recover, write_folder
from bsg_models.evaluation.bootstrap import Bootstrap, average_seeds
from bsg_models.evaluation.measurement import Fold, measure
from bsg_models.evaluation.truth import Prediction
from bsg_models.inputs.folds import scenes_of
from bsg_models.runs.checkpoint import is_finished, load_checkpoint, restore_model
from bsg_models.runs.checkpoint_file import BEST
from bsg_models.runs.run_folder import read_record
from bsg_models.studies.stored_pairs import MeasuredPairs
from bsg_models.training.training import train_run
from bsg_models.zoo.config import RunConfig

DATASET = "dataset"


class LeaderboardRecipe(Record):
    """Everything that a leaderboard depends on besides the dataset and the models."""

    # kinds of masks to measure on; a model without its own mask is trained on each
    masks: tuple[str, ...] = ("uniform", "rooms")
    fraction: Fraction = 0.5  # share of the objects that they hide
    folds: int = Field(default=5, ge=2, le=10_000)  # every building is tested on once
    draws: int = Field(default=5, ge=1, le=1_000_000)  # masks of every building
    seed: Seed = 0  # of the folds, the masks and the trainings
    seeds: int = Field(default=1, ge=1, le=1_000)  # number that train each model: seed, seed + 1, …
    resamples: int = 200  # number of bootstrap resamples of the buildings

    @field_validator("masks")
    @classmethod
    def _masks_exist(cls, masks: tuple[str, ...]) -> tuple[str, ...]:
        MASKS.require(masks)
        return masks

    def count_seeds(self, config: RunConfig) -> int:
        """Return how many seeds train a model: one if no seed changes it."""
        return self.seeds if config.is_by_seed else 1


@dataclass(frozen=True, eq=False)
class ModelResult:
    """One model on one kind of mask."""

    # mean over the folds and seeds, with values on every resample of the buildings and seeds
    metrics: Bootstrap
    # time of a training, mean over the folds and seeds; for an ensemble, including its members
    seconds: float
    # kind of mask of the training, if the model names its own; else None
    trained_on: str | None = None
    seeds: int = 1  # number that trained it in each fold


@dataclass(frozen=True, eq=False)
class Leaderboard:
    """All models on all kinds of masks."""

    recipe: LeaderboardRecipe  # that it was made by
    manifest: Manifest  # of the dataset
    results: dict[str, dict[str, ModelResult]]  # mask → model → result


def make_leaderboard(
    dataset: AnyPath,
    out: AnyPath,
    models: Mapping[str, RunConfig],
    recipe: LeaderboardRecipe,
    *,
    executor: Executor | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Leaderboard:
    """Train and measure models in cross-validation.

    Args:
        dataset: folder of `bsg-data build`; it is copied and not changed.
        out: folder of the leaderboard.
        models: name → configuration.
        recipe: masks, folds and resamples.
        executor: runs trainings and measurements; None runs them in this process.
        progress: called with (what, done, in all).

    Raises:
        DatasetError: if the dataset is unfinished, or `out` is in a dataset or holds a leaderboard
            of another one.
        TrainingError: if a training fails.
    """
    dataset, out = Path(dataset), Path(out).absolute()  # a worker may run in another folder
    report = progress or (lambda what, done, total: None)
    refuse_datasets(out)
    trainings = _list_trainings(out, models, recipe)
    measured = [(out, mask, name, models[name], recipe) for mask in recipe.masks for name in models]
    with hold(out):
        copies = (out / mask / DATASET for mask in recipe.masks)
        for copy in dict.fromkeys((*copies, *(copy for copy, _ in trainings.values()))):
            prepare_dataset(dataset, copy, recipe)
        tasks = [(run, *training) for run, training in trainings.items()]
        run_all(_train, tasks, executor=executor, progress=partial(report, "train"))
        found = run_all(_measure, measured, executor=executor, progress=partial(report, "measure"))
    results: dict[str, dict[str, ModelResult]] = {mask: {} for mask in recipe.masks}
    for (_, mask, name, *_), result in zip(measured, found, strict=True):
        results[mask][name] = result
    return Leaderboard(recipe, read_manifest(dataset), results)


def _list_trainings(
    out: Path, models: Mapping[str, RunConfig], recipe: LeaderboardRecipe
) -> dict[Path, tuple[Path, RunConfig]]:
    """Return run → dataset and configuration: of each mask, or once of a model's own mask."""
    return {
        run_of(out / mask, name, fold, seed=seed): (
            out / mask / DATASET,
            _fit_to(config, recipe, mask=mask, fold=fold, seed=seed),
        )
        for seed in range(recipe.seeds)
        for fold in range(recipe.folds)
        for measured in recipe.masks
        for name, config in models.items()
        if seed < recipe.count_seeds(config)
        for mask in [config.data.own_strategy or measured]
    }


def _fit_to(
    config: RunConfig,
    recipe: LeaderboardRecipe,
    *,
    mask: str,
    fold: int | None = None,
    seed: int = 0,
) -> RunConfig:
    """Return a configuration for one kind of mask, one fold and one of the leaderboard's seeds.

    That seed, the leaderboard's own plus the number `seed`, is added to the configuration's seeds;
    after the largest seed comes 0. A mask that the configuration names is kept.
    """
    more = _add(recipe.seed, seed)
    drawn = MaskRecipe(strategy=mask, fraction=recipe.fraction, seed=more)
    if config.data.own_strategy:
        own = config.data.mask
        drawn = own.model_copy(update={"seed": _add(own.seed, more)})
    data = config.data.model_copy(update={"mask": drawn, "fold": fold})
    return config.model_copy(update={"data": data, "seed": _add(config.seed, more)})


def _add(seed: int, more: int) -> int:
    return (seed + more) % (MAX_SEED + 1)


def run_of(folder: Path, name: str, fold: int, *, seed: int = 0) -> Path:
    """Return the folder of a run below that of a mask; seeds have numbers from 0, the first."""
    return (folder / f"seed-{seed}" if seed else folder) / f"fold-{fold}" / name


def prepare_dataset(source: Path, copy: Path, recipe: LeaderboardRecipe) -> None:
    """Copy a dataset to `MASK/dataset`, in folds and with pairs, unless that is done."""
    manifest, strategy = read_manifest(source), copy.parent.name
    split = SplitRecipe(method="folds", ratios=None, folds=recipe.folds, seed=recipe.seed)
    mask = MaskRecipe(strategy=strategy, fraction=recipe.fraction, seed=recipe.seed)
    pairs = PairsRecipe(mask=mask, draws=recipe.draws)
    if not (copy / MANIFEST).is_file():
        _copy_dataset(source, copy, manifest)
    copied = read_manifest(copy)
    if (copied.sources, copied.class_space) != (manifest.sources, manifest.class_space):
        raise DatasetError(f"{copy}: is a copy of another dataset; choose another --out")
    if copied.split != split:
        split_dataset(copy, split, force=True)
    if read_manifest(copy).pairs != pairs:
        write_pairs(copy, pairs, force=True)


def _copy_dataset(source: Path, copy: Path, manifest: Manifest) -> None:
    """Copy a dataset without its split and pairs; who reads it compares hashes."""
    bare = manifest.without_split()
    plan = bare.model_dump_json().encode()
    with write_folder(copy, commit.DATASET, plan=plan, force=False) as (folder, is_done):
        if is_done:
            return
        for entry in bare.files:
            (folder / entry.path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source / entry.path, folder / entry.path)
        for class_map in manifest.class_maps:
            class_map.copy_map(source, folder)
        commit.publish(folder, bare)


def _train(run: Path, dataset: Path, config: RunConfig) -> None:
    """Train a run, unless that is done; what a killed training put in place is finished first."""
    run.parent.mkdir(parents=True, exist_ok=True)
    with hold(run):
        recover(run, RESULTS)
    if not is_finished(run, config, Dataset.open(dataset)):
        train_run(config, dataset, run, force=True)


def _measure(
    out: Path, mask: str, name: str, config: RunConfig, recipe: LeaderboardRecipe
) -> ModelResult:
    """Measure one model over all folds and seeds, on one kind of mask."""
    own, seeds = config.data.own_strategy, recipe.count_seeds(config)
    pairs = MeasuredPairs(Dataset.open(out / mask / DATASET), "test", tuple(range(recipe.folds)))
    found, seconds = [], 0.0
    for seed in range(seeds):
        runs = [run_of(out / (own or mask), name, fold, seed=seed) for fold in range(recipe.folds)]
        folds = [
            Fold(scenes_of(pairs.data, "test", fold=fold), _predict(run, pairs, fold))
            for fold, run in enumerate(runs)
        ]
        (measured,) = measure(folds, resamples=recipe.resamples, seed=recipe.seed).values()
        found.append(measured)
        seconds += sum(record.seconds for record in map(read_record, runs) if record)
    mean = seconds / (seeds * recipe.folds)
    return ModelResult(average_seeds(found, seed=recipe.seed), mean, own, seeds)


def _predict(run: Path, pairs: MeasuredPairs, fold: int) -> Iterator[dict[str, Prediction]]:
    model = restore_model(run / BEST, load_checkpoint(run / BEST))
    yield from pairs.predict({"": model}, fold)
