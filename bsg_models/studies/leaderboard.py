"""Train and measure every model on the same folds, for each kind of mask.

    OUT/MASK/dataset          a copy of the dataset, in folds, with pairs
    OUT/MASK/fold-K/MODEL     a run trained on that kind of mask, without fold K
    OUT/leaderboard.json      written last, with leaderboard.md and leaderboard.png

A stopped leaderboard continues: finished runs of the same configuration and dataset are kept. All
models meet the same masks of the same buildings, and the same resamples.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

from bsg_data.dataset.commit import growing, name_growing, put_in_place
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.kept_maps import copy_class_maps
from bsg_data.dataset.manifest import MANIFEST, FileEntry, Manifest, read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.executors import run_all
from bsg_data.files import (
    AnyPath,
    hold,
    refuse_links,
    resolve_links,
)
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.results import refuse_datasets
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import TrainingError
from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.evaluation.measurement import Fold, measure, predict_all, read_truth
from bsg_models.evaluation.truth import Truth
from bsg_models.inputs.folds import scenes_of
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST, is_finished
from bsg_models.runs.run_log import Ended, read_log
from bsg_models.studies.leaderboard_runs import (
    LeaderboardRecipe,
    Place,
    fit_to,
    plan_runs,
    run_of,
    trained_on,
)
from bsg_models.studies.survey import stream_batches
from bsg_models.training.training import combine_runs, member_config, train_run
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.model import one_thread

DATASET = "dataset"


@dataclass(frozen=True, eq=False)
class ModelResult:
    """One model on one kind of mask."""

    metrics: Bootstrap  # mean over the folds, with values on every resample of the buildings
    # time of a training, mean over the folds; for an ensemble, including its members
    seconds: float
    # kind of mask of the training, if the model names its own; else None
    trained_on: str | None = None


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
    _refuse_one_inside_the_other(dataset, out)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DatasetError(f"{out}: cannot be made ({error.strerror})") from error
    out = out.absolute()  # a worker may run in another folder
    runs = plan_runs(models, recipe)
    for place in (*runs.single, *runs.ensembles):
        for fold in range(recipe.folds):
            refuse_links(out, run_of(out / place.mask, place.name, fold))
    with hold(out):
        for mask in dict.fromkeys((*recipe.masks, *runs.masks)):
            prepare_dataset(dataset, out / mask / DATASET, recipe, mask=mask)
        folds = range(recipe.folds)
        trained = [
            (out / place.mask, place.name, fit_to(config, recipe, mask=place.mask, fold=fold))
            for fold in folds
            for place, config in runs.single.items()
        ]
        run_all(_train, trained, executor=executor, progress=_name(report, "train"))
        combined = [
            (
                out / place.mask,
                place.name,
                fit_to(config, recipe, mask=place.mask, fold=fold),
                runs.members[place],
            )
            for fold in folds
            for place, config in runs.ensembles.items()
        ]
        run_all(_combine, combined, executor=executor, progress=_name(report, "combine"))
        places = [
            (mask, Place(trained_on(config, mask), name))
            for mask in recipe.masks
            for name, config in models.items()
        ]
        shown = [
            (out, mask, place, tuple(runs.members.get(place, {}).values()), recipe)
            for mask, place in places
        ]
        measured = run_all(_measure, shown, executor=executor, progress=_name(report, "measure"))
    results: dict[str, dict[str, ModelResult]] = {mask: {} for mask in recipe.masks}
    for (mask, place), result in zip(places, measured, strict=True):
        own = models[place.name].data.own_strategy
        results[mask][place.name] = replace(result, trained_on=own)
    return Leaderboard(recipe, read_manifest(dataset), results)


def _refuse_one_inside_the_other(dataset: Path, out: Path) -> None:
    """Refuse a dataset and an output folder of which one contains the other."""
    there, own = resolve_links(out), resolve_links(dataset)
    if there.is_relative_to(own) or own.is_relative_to(there):
        raise DatasetError(
            f"{out} and the dataset {dataset} lie one inside the other; choose another --out"
        )


def _refuse_link(path: Path) -> None:
    if path.is_symlink():
        raise DatasetError(f"{path}: is a link that leads out of the leaderboard; remove it")


def _copy_listed(source: Path, entry: FileEntry, place: Path) -> None:
    """Copy a file of a dataset if it matches the manifest."""
    place.parent.mkdir(parents=True, exist_ok=True)
    is_whole = source.stat().st_size == entry.bytes  # refuse an oversized file before the copy
    if is_whole:
        shutil.copyfile(source, place)
    if not is_whole or hash_file(place) != entry.sha256:
        raise DatasetError(f"{source}: is not what the manifest says; `bsg-data check` says more")


def prepare_dataset(source: Path, copy: Path, recipe: LeaderboardRecipe, *, mask: str) -> None:
    """Copy a dataset, split it into folds and draw its pairs, unless that is done."""
    manifest = read_manifest(source)
    split = SplitRecipe(method="folds", ratios=None, folds=recipe.folds, seed=recipe.seed)
    pairs = PairsRecipe(
        mask=MaskRecipe(strategy=mask, fraction=recipe.fraction, seed=recipe.seed),
        draws=recipe.draws,
    )
    for path in (copy.parent, copy, name_growing(copy)):
        _refuse_link(path)
    bare = manifest.without_split()
    if not (copy / MANIFEST).is_file():
        with growing(copy, bare, force=False) as (folder, done):
            if not done:
                for entry in bare.files:
                    _copy_listed(source / entry.path, entry, folder / entry.path)
                copy_class_maps(source, manifest, folder)
                put_in_place(copy, bare)
    there = read_manifest(copy)
    if (there.sources, there.class_space) != (manifest.sources, manifest.class_space):
        raise DatasetError(f"{copy}: is a copy of another dataset; choose another --out")
    if there.split != split:
        split_dataset(copy, split, force=True)
    if read_manifest(copy).pairs != pairs:
        write_pairs(copy, pairs, force=True)


def _train(folder: Path, name: str, config: RunConfig) -> None:
    """Train one model for one fold, unless that is done."""
    run = run_of(folder, name, config.data.fold or 0)
    for path in (run.parent, run):
        _refuse_link(path)
    data = Dataset.open(folder / DATASET)
    if not is_finished(run, config, data):
        for _ in train_run(config, data.path, run, force=True):
            pass


def _combine(folder: Path, name: str, config: RunConfig, names: Mapping[str, str]) -> None:
    """Combine the runs of one fold into an ensemble, by member → name of its run."""
    fold = config.data.fold or 0
    data = Dataset.open(folder / DATASET)
    members = {member: run_of(folder, run, fold) for member, run in names.items()}
    for member, trained in members.items():
        if not is_finished(trained, member_config(config, member), data):
            raise TrainingError(f"{trained}: is not the run that {name} needs; remove it")
    combine_runs(config, data, members, run_of(folder, name, fold))


def _measure(
    out: Path, mask: str, place: Place, members: tuple[str, ...], recipe: LeaderboardRecipe
) -> ModelResult:
    """Measure one model over all folds, on one kind of mask; its time includes its members'."""
    data, folder = Dataset.open(out / mask / DATASET), out / place.mask
    folds = [
        Fold(
            scenes_of(data, "test", fold=fold),
            _predict(run_of(folder, place.name, fold) / BEST, data, fold),
        )
        for fold in range(recipe.folds)
    ]
    with one_thread():
        found = measure(folds, resamples=recipe.resamples, seed=recipe.seed)
    seconds = sum(
        _seconds_of(run_of(folder, name, fold)) / recipe.folds
        for fold in range(recipe.folds)
        for name in (place.name, *members)
    )
    return ModelResult(found, seconds)


def _predict(path: Path, data: Dataset, fold: int) -> Iterator[tuple[Truth, Expectation]]:
    model = restore_model(path, load_checkpoint(path))
    for masked in stream_batches(data, "test", fold=fold, vocabulary=model.vocabulary):
        yield read_truth(masked), predict_all(model, masked)


def _seconds_of(run: Path) -> float:
    """Return the time of all trainings of a run."""
    return sum(entry.seconds for entry in read_log(run) if isinstance(entry, Ended))


def _name(report: Callable[[str, int, int], None], what: str) -> Callable[[int, int], None]:
    return lambda done, total: report(what, done, total)
