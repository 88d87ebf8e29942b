"""Train and measure every model on the same folds, for each kind of mask.

    OUT/MASK/dataset          a copy of the dataset, in folds, with pairs
    OUT/MASK/fold-K/MODEL     a run trained on that kind of mask, without fold K
    OUT/MASK/seed-S/fold-K/MODEL    the same by a further seed, S above that of the leaderboard
    OUT/leaderboard.json      written last, with leaderboard.html, leaderboard.md and MASK.png

Each model is trained on every kind of mask of the leaderboard and measured on the same kind. A
configuration that names its own mask, such as `mixed`, is trained once, on that mask, and measured
on every kind. All models meet the same masks of the same buildings, and the same resamples.

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
from typing import NamedTuple

from pydantic import Field, field_validator

from bsg_data.dataset import commit
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import MANIFEST, Manifest, read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.executors import run_all
from bsg_data.files import AnyPath, hold, refuse_links, resolve_links
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.observation.masks import MASKS
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, Record, SplitRecipe
from bsg_data.results import name_staged, refuse_datasets, write_folder
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import ConfigError, TrainingError
from bsg_models.evaluation.bootstrap import Bootstrap, average_seeds
from bsg_models.evaluation.measurement import Fold, measure, predict_all, read_truth
from bsg_models.evaluation.truth import Truth
from bsg_models.inputs.folds import scenes_of
from bsg_models.runs.checkpoint import is_finished, load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST, read_record
from bsg_models.studies.stored_pairs import stream_batches
from bsg_models.training.training import member_config, train_run
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.ensemble import EnsembleConfig, is_by_seed
from bsg_models.zoo.model import one_thread

DATASET = "dataset"


class LeaderboardRecipe(Record):
    """Everything that a leaderboard depends on besides the dataset and the models."""

    # kinds of masks to measure on; a model without its own mask is trained on each
    masks: tuple[str, ...] = ("uniform", "rooms")
    fraction: float = 0.5  # share of the objects that they hide
    folds: int = 5  # number of folds; every building is tested on once
    draws: int = 5  # masks of every building
    seed: int = 0  # of the folds, the masks and the trainings
    seeds: int = Field(default=1, ge=1)  # number that train each model: seed, seed + 1, …
    resamples: int = 200  # number of bootstrap resamples of the buildings

    @field_validator("masks")
    @classmethod
    def _masks_exist(cls, masks: tuple[str, ...]) -> tuple[str, ...]:
        MASKS.require(masks)
        return masks


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
    dataset, out = Path(dataset), Path(out)
    report = progress or (lambda what, done, total: None)
    refuse_datasets(out)
    there, own = resolve_links(out), resolve_links(dataset)
    if there.is_relative_to(own) or own.is_relative_to(there):
        raise DatasetError(
            f"{out} and the dataset {dataset} lie one inside the other; choose another --out"
        )
    out.mkdir(parents=True, exist_ok=True)
    out = out.absolute()  # a worker may run in another folder
    runs = plan_runs(models, recipe)
    for place in runs:
        for seed in range(recipe.seeds):
            for fold in range(recipe.folds):
                refuse_links(out, run_of(out / place.mask, place.name, fold, seed=seed))
    with hold(out):
        for mask in dict.fromkeys((*recipe.masks, *(place.mask for place in runs))):
            prepare_dataset(dataset, out / mask / DATASET, recipe, mask=mask)
        for what, is_ensemble in (("train", False), ("combine", True)):
            tasks = [
                (out / place.mask, place.name, fold, seed, run, recipe)
                for seed in range(recipe.seeds)
                for fold in range(recipe.folds)
                for place, run in runs.items()
                if bool(run.members) == is_ensemble and seed < run.seeds
            ]
            run_all(_make_run, tasks, executor=executor, progress=partial(report, what))
        shown = [
            (out, mask, name, runs[_place_of(config, name, mask)], recipe)
            for mask in recipe.masks
            for name, config in models.items()
        ]
        measured = run_all(_measure, shown, executor=executor, progress=partial(report, "measure"))
    results: dict[str, dict[str, ModelResult]] = {mask: {} for mask in recipe.masks}
    for (_, mask, name, *_), result in zip(shown, measured, strict=True):
        results[mask][name] = result
    return Leaderboard(recipe, read_manifest(dataset), results)


class Place(NamedTuple):
    """Where the runs of a model are, one per seed and fold."""

    mask: str  # kind of mask that it is trained on
    name: str  # of the model


class PlannedRun(NamedTuple):
    """A run of a leaderboard, the same for every seed and fold."""

    config: RunConfig
    members: Mapping[str, str]  # of an ensemble: member → name of its run, of the same mask
    seeds: int = 1  # number that train it


def plan_runs(
    models: Mapping[str, RunConfig], recipe: LeaderboardRecipe
) -> dict[Place, PlannedRun]:
    """Return the runs that the models of a leaderboard need; models share equal runs.

    An ensemble reuses a run of the leaderboard if its configuration is the one it needs. Otherwise
    the member is trained once more, as `ENSEMBLE+MEMBER`. Members are trained by every seed.
    """
    runs = {
        _place_of(config, name, mask): PlannedRun(
            config, {}, recipe.seeds if is_by_seed(config) else 1
        )
        for mask in recipe.masks
        for name, config in models.items()
    }
    for place, (config, *_) in list(runs.items()):
        if isinstance(config.model, EnsembleConfig):
            members = {
                member: _plan_member(runs, place, member, member_config(config, member), recipe)
                for member in config.model.members
            }
            runs[place] = PlannedRun(config, members, recipe.seeds)
    return runs


def _plan_member(
    runs: dict[Place, PlannedRun],
    ensemble: Place,
    member: str,
    needed: RunConfig,
    recipe: LeaderboardRecipe,
) -> str:
    """Plan the run of an ensemble's member unless it is planned; return its name."""
    mask, name = ensemble.mask, member
    for name in (member, f"{ensemble.name}+{member}"):
        planned = runs.setdefault(Place(mask, name), PlannedRun(needed, {}))
        if fit_to(planned.config, recipe, mask=mask) == fit_to(needed, recipe, mask=mask):
            runs[Place(mask, name)] = planned._replace(seeds=recipe.seeds)
            return name
    raise ConfigError(
        f"{name!r} is the name of a run that {ensemble.name} needs; rename this model"
    )


def _place_of(config: RunConfig, name: str, mask: str) -> Place:
    """Return where a model is trained that is measured on a kind of mask."""
    return Place(config.data.own_strategy or mask, name)


def fit_to(
    config: RunConfig,
    recipe: LeaderboardRecipe,
    *,
    mask: str,
    fold: int | None = None,
    seed: int = 0,
) -> RunConfig:
    """Return a configuration for one kind of mask, one fold and one of the leaderboard's seeds.

    That seed, the leaderboard's own plus the number `seed`, is added to the configuration's seeds.
    A mask that the configuration names is kept.
    """
    more = recipe.seed + seed
    drawn = MaskRecipe(strategy=mask, fraction=recipe.fraction, seed=more)
    if config.data.own_strategy:
        own = config.data.mask
        drawn = own.model_copy(update={"seed": own.seed + more})
    data = config.data.under(drawn).model_copy(update={"fold": fold})
    return config.model_copy(update={"data": data, "seed": config.seed + more})


def run_of(folder: Path, name: str, fold: int, *, seed: int = 0) -> Path:
    """Return the folder of a run below that of a mask; seeds have numbers from 0, the first."""
    return (folder / f"seed-{seed}" if seed else folder) / f"fold-{fold}" / name


def prepare_dataset(source: Path, copy: Path, recipe: LeaderboardRecipe, *, mask: str) -> None:
    """Copy a dataset, split it into folds and draw its pairs, unless that is done."""
    manifest = read_manifest(source)
    split = SplitRecipe(method="folds", ratios=None, folds=recipe.folds, seed=recipe.seed)
    pairs = PairsRecipe(
        mask=MaskRecipe(strategy=mask, fraction=recipe.fraction, seed=recipe.seed),
        draws=recipe.draws,
    )
    for path in (copy, name_staged(copy)):
        refuse_links(copy.parents[1], path)
    if not (copy / MANIFEST).is_file():
        _copy_dataset(source, copy, manifest)
    there = read_manifest(copy)
    if (there.sources, there.class_space) != (manifest.sources, manifest.class_space):
        raise DatasetError(f"{copy}: is a copy of another dataset; choose another --out")
    if there.split != split:
        split_dataset(copy, split, force=True)
    if read_manifest(copy).pairs != pairs:
        write_pairs(copy, pairs, force=True)


def _copy_dataset(source: Path, copy: Path, manifest: Manifest) -> None:
    """Copy a dataset without its split and pairs."""
    bare = manifest.without_split()
    plan = bare.model_dump_json().encode()
    with write_folder(copy, commit.DATASET, plan=plan, force=False) as (folder, is_done):
        if is_done:
            return
        for entry in bare.files:
            place = folder / entry.path
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source / entry.path, place)
            if hash_file(place) != entry.sha256:
                raise DatasetError(
                    f"{source / entry.path}: is not what the manifest says; `bsg-data check` says "
                    "more"
                )
        for class_map in manifest.class_maps:
            class_map.copy_map(source, folder)
        commit.publish(folder, bare)


def _make_run(
    folder: Path, name: str, fold: int, seed: int, planned: PlannedRun, recipe: LeaderboardRecipe
) -> None:
    """Train a model for one fold and seed, or combine an ensemble's runs, unless that is done."""
    config = fit_to(planned.config, recipe, mask=folder.name, fold=fold, seed=seed)
    data, find_run = Dataset.open(folder / DATASET), partial(run_of, folder, fold=fold, seed=seed)
    run = find_run(name)
    if not planned.members:
        if not is_finished(run, config, data):
            train_run(config, data.path, run, force=True)
        return
    members = {member: find_run(one) for member, one in planned.members.items()}
    for member, trained in members.items():
        if not is_finished(trained, member_config(config, member), data):
            raise TrainingError(f"{trained}: is not the run that {name} needs; remove it")
    train_run(config, data.path, run, force=True, members=members)


def _measure(
    out: Path, mask: str, name: str, planned: PlannedRun, recipe: LeaderboardRecipe
) -> ModelResult:
    """Measure one model over all folds and seeds, on one kind of mask.

    Its time includes its members'.
    """
    own = planned.config.data.own_strategy
    data, folder = Dataset.open(out / mask / DATASET), out / (own or mask)
    scenes = [scenes_of(data, "test", fold=fold) for fold in range(recipe.folds)]
    found, seconds = [], 0.0
    for seed in range(planned.seeds):
        find_run = partial(run_of, folder, seed=seed)
        folds = [
            Fold(some, _predict(find_run(name, fold), data, fold))
            for fold, some in enumerate(scenes)
        ]
        with one_thread():
            found.append(measure(folds, resamples=recipe.resamples, seed=recipe.seed))
        seconds += sum(
            record.seconds
            for fold in range(recipe.folds)
            for one in (name, *planned.members.values())
            if (record := read_record(find_run(one, fold)))
        )
    mean = seconds / (planned.seeds * recipe.folds)
    return ModelResult(average_seeds(found, seed=recipe.seed), mean, own, planned.seeds)


def _predict(run: Path, data: Dataset, fold: int) -> Iterator[tuple[Truth, Expectation]]:
    model = restore_model(run / BEST, load_checkpoint(run / BEST))
    for masked in stream_batches(data, "test", fold=fold, vocabulary=model.vocabulary):
        yield read_truth(masked), predict_all(model, masked)
