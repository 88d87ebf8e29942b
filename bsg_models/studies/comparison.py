"""Compare runs with each other and with the baselines on the same masked pairs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import pandas as pd

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.files import AnyPath, stem_of
from bsg_data.inputs.bounded_file import hash_file
from bsg_models.errors import CheckpointError
from bsg_models.evaluation.bootstrap import LEAST_BUILDINGS, Bootstrap, Estimate
from bsg_models.evaluation.catalogue import head_value
from bsg_models.evaluation.measurement import EVALUATOR_VERSION, SplitWeights
from bsg_models.evaluation.shown_nodes import ShownNodes
from bsg_models.evaluation.verdict import list_headlines
from bsg_models.inputs.folds import Split
from bsg_models.runs.checkpoint import (
    Checkpoint,
    CheckpointHeader,
    load_checkpoint,
    read_header,
    require_dataset,
    restore_model,
)
from bsg_models.runs.found_model import FoundModel, find_model, name_model
from bsg_models.runs.run_folder import LAST
from bsg_models.studies.entries import Entry, Folds, folds_of, hash_measured, read_entry
from bsg_models.studies.measuring import (
    MeasuredModel,
    Measuring,
    NodePredictor,
    Receiver,
    Survey,
    choose_stride,
    join_surveys,
    predict_by,
    survey_split,
)
from bsg_models.zoo.catalogue import BASELINES
from bsg_models.zoo.config import find_config
from bsg_models.zoo.ensemble import make_model
from bsg_models.zoo.settings import DataConfig


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs and baselines measured on the same truth.

    Attributes:
        runs: names of the runs, in the order given; the baselines follow them.
        split: that they were measured on.
        bootstraps: model → its metrics, with their values on every resample of the buildings.
        shown: run → the nodes in its figures.
        survey: of the buildings that they were measured on.
        classes: one row per model, node set and class.
        class_names: `[C]`.
        facts: what was measured on: dataset, class map, buildings, draws, empty nodes; and which
            runs, with the sha256 of their checkpoints in the same order.
        notes: warnings that a reader of the values needs.
    """

    runs: tuple[str, ...]
    split: str
    bootstraps: dict[str, Bootstrap]
    shown: dict[str, ShownNodes]
    survey: Survey
    classes: pd.DataFrame
    class_names: tuple[str, ...]
    facts: dict[str, Any]
    notes: tuple[str, ...]

    @property
    def has_verdicts(self) -> bool:
        """Whether there are enough buildings to say which model is better."""
        return len(self.survey.scene_ids) >= LEAST_BUILDINGS

    @cached_property
    def estimates(self) -> dict[str, dict[str, Estimate]]:
        """Model → metric → value with its interval."""
        return {name: measured.estimates() for name, measured in self.bootstraps.items()}


class _Loaded(NamedTuple):
    """A run that is compared."""

    name: str  # of its column
    found: FoundModel  # where it is
    checkpoint: Checkpoint  # its weights

    @property
    def header(self) -> CheckpointHeader:
        """Header of its checkpoint."""
        return self.checkpoint.header


def compare_runs(
    runs: Sequence[AnyPath],
    dataset: AnyPath,
    *,
    split: str,
    predictions: Sequence[AnyPath] = (),
    fold: int | None = None,
    resamples: int = 200,
    seed: int = 0,
    write: Callable[[str, int | None], Receiver] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Comparison:
    """Measure runs, predictions of other programs and baselines on the stored pairs of a split.

    A run is named after its model; several runs of one model also get their folders' names. Without
    runs, a dataset in folds is measured fold by fold, and the values are averaged. Buildings are
    read, predicted and measured in batches.

    Args:
        runs: trained models, as `find_model` takes them.
        dataset: folder of a split dataset with pairs.
        split: `train`, `val` or `test`.
        predictions: files of predictions, or folders of such files.
        fold: fold to measure if there is no run; None for all.
        resamples: number of bootstrap resamples of the buildings.
        seed: of the bootstrap.
        write: called with a run's name and a fold; returns a receiver of its predictions.
        progress: called with (masked buildings done, in all), over all models.

    Raises:
        CheckpointError: if a run cannot be loaded, or the runs were trained for different folds.
        MismatchError: if a run predicts the classes of another class map.
        DatasetError: if the split has no pairs.
        PredictionError: if predictions cannot be read, or do not fit the pairs.
    """
    dataset = Path(dataset)
    data = Dataset.open(dataset)
    found = [find_model(run) for run in runs]
    checkpoints = [load_checkpoint(one.path) for one in found]
    sums = [hash_file(one.path) for one in found]
    columns = name_runs([(one, c.header) for one, c in zip(found, checkpoints, strict=True)])
    loaded = [_Loaded(*one) for one in zip(columns, found, checkpoints, strict=True)]
    for run in loaded:
        require_dataset(run.found.path, run.header, data.manifest)
    fold = _one_fold(loaded, fold) if loaded else fold
    part = cast(Split, split)
    folds: Folds = (fold,) if loaded else folds_of(data, fold)
    surveys = [survey_split(data, part, fold=one) for one in folds]
    survey = join_surveys(surveys)
    entries = [read_entry(Path(p), data, split=part, folds=folds) for p in predictions]
    names = _order((run.name for run in loaded), entries)
    measuring = Measuring(
        data,
        part,
        folds,
        surveys,
        SplitWeights([one.scene_ids for one in surveys], resamples=resamples, seed=seed),
        _count(progress, total=len(names) * survey.masked),
    )
    of_run = {run.name: run for run in loaded}
    measured: dict[str, MeasuredModel] = {}
    for name, entry in names.items():
        own = of_run.get(name)
        measured[name] = measuring.measure(
            name,
            entry.open_fold if entry else _opener(own, name, data),
            receive=partial(write, name) if write and own else None,
            is_drawn=name not in BASELINES,
        )
    chosen = tuple(name for name in names if name not in BASELINES)
    return Comparison(
        runs=chosen,
        split=split,
        bootstraps={name: one.bootstrap for name, one in measured.items()},
        shown={name: one.shown for name, one in measured.items() if one.shown is not None},
        survey=survey,
        classes=pd.DataFrame([row for one in measured.values() for row in one.classes]),
        class_names=data.manifest.class_space.classes,
        facts=_facts(data, survey, fold=fold, resamples=resamples, seed=seed)
        | {
            "masks_sha256": hash_measured(data, part, folds),
            "runs": _describe(loaded),
            "checkpoints_sha256": sums,
            "predictions": {name: entry.facts for name, entry in names.items() if entry},
        },
        notes=tuple(_notes(loaded, data, survey, split)),
    )


def _opener(run: _Loaded | None, name: str, data: Dataset) -> Callable[[int | None], NodePredictor]:
    """Return a function that opens a run, or fits the baseline of that name, for a fold."""

    def open_fold(fold: int | None) -> NodePredictor:
        if run is not None:
            return predict_by(restore_model(run.found.path, run.checkpoint))
        model = make_model(find_config(name), classes=len(data.manifest.class_space.classes))
        model.fit(data, DataConfig(fold=fold))
        return predict_by(model)

    return open_fold


def _order(runs: Iterable[str], entries: Sequence[Entry]) -> dict[str, Entry | None]:
    """Return everything that is measured, by name: runs, then predictions, then baselines."""
    names: dict[str, Entry | None] = dict.fromkeys(runs)
    for entry in entries:
        names[first_free(entry.name, {*names, *BASELINES})] = entry
    return names | dict.fromkeys(BASELINES)


def _describe(loaded: Sequence[_Loaded]) -> dict[str, Any]:
    """Return folder, epoch, dataset and configuration of each run, by name."""
    return {
        run.name: {
            "folder": run.found.name,
            "epoch": run.header.epoch,
            "dataset_sha256": run.header.dataset_sha256,
            "config": run.header.config.model_dump(mode="json"),
        }
        for run in loaded
    }


def _one_fold(loaded: Sequence[_Loaded], asked: int | None) -> int | None:
    folds = {run.header.config.data.fold for run in loaded}
    listed = ", ".join(f"{run.found.name}: {run.header.config.data.fold}" for run in loaded)
    if asked is not None and folds != {asked}:
        raise CheckpointError(f"expected runs that test on fold {asked}, found {listed}")
    if len(folds) > 1:
        raise CheckpointError(f"the runs test on different folds ({listed}); name runs of one fold")
    return folds.pop()


def _facts(
    data: Dataset, survey: Survey, *, fold: int | None, resamples: int, seed: int
) -> dict[str, Any]:
    pairs = data.manifest.pairs
    if pairs is None:
        raise DatasetError(f"{data.path}: has no pairs; run `bsg-data pairs` first")
    return {
        "evaluator_version": EVALUATOR_VERSION,
        "fold": fold,
        "dataset_sha256": data.sha256,
        "class_space": data.manifest.class_space.name,
        "mask": pairs.mask.model_dump(mode="json"),
        "buildings": len(survey.scene_ids),
        "draws": pairs.draws,
        "nodes": {name: survey.counts[name] for name in ("rooms", "building")},
        **{name: survey.counts[name] for name in ("empty_inputs", "empty_targets")},
        "resamples": resamples,
        "seed": seed,
    }


def _notes(loaded: Sequence[_Loaded], data: Dataset, survey: Survey, split: str) -> list[str]:
    notes = []
    for run in loaded:
        header = run.header
        if header.dataset_sha256 != data.sha256:
            notes.append(
                f"note: {run.name} was trained on another dataset or another version of this one; "
                f"buildings of this {split} split may have been in its training set"
            )
        epochs = header.config.training.epochs
        unfinished = run.found.path.with_name(LAST)
        last = read_header(unfinished).epoch if unfinished.is_file() else epochs
        if header.calibrated != getattr(header.config.model, "calibrate", False):
            notes.append(f"note: {run.name} stopped before its calibration; --resume finishes it")
        if last < epochs:
            notes.append(f"note: {run.name} stopped at epoch {last} of {epochs}; --resume goes on")
    if (buildings := len(survey.scene_ids)) < LEAST_BUILDINGS:
        notes.append(
            f"note: measured on {buildings} building{'' if buildings == 1 else 's'}: intervals (±) "
            f"and verdicts need at least {LEAST_BUILDINGS} of them"
        )
    if (stride := choose_stride(survey)) > 1:
        notes.append(f"note: the figures show one in {stride} masked buildings")
    if split == "train":
        notes.append("note: the models were trained on these buildings")
    return notes


def _count(progress: Callable[[int, int], None] | None, *, total: int) -> Callable[[int], None]:
    """Return a function that adds up measured masked buildings and reports their number."""
    done = 0

    def add(number: int) -> None:
        nonlocal done
        done += number
        if progress is not None:
            progress(done, total)

    return add


def encode_comparison(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as JSON: metric → model → value, interval, nodes; unknown is null."""
    metrics: dict[str, dict[str, Any]] = {}
    for model, estimates in comparison.estimates.items():
        for name, e in estimates.items():
            values = {"value": e.value, "low": e.low, "high": e.high}
            known = {end: None if np.isnan(number) else number for end, number in values.items()}
            metrics.setdefault(name, {})[model] = {**known, "nodes": e.nodes}
    notes = list(comparison.notes)
    return {"split": comparison.split, **comparison.facts, "notes": notes, "metrics": metrics}


def headline_rows(comparison: Comparison) -> list[list[str]]:
    """Return one row per headline metric: its label, and the value of every model."""
    names = list_headlines(comparison.bootstraps)
    return [[head_value(name), *_cells(comparison, name)] for name in names]


def metric_rows(comparison: Comparison) -> list[list[str]]:
    """Return one row per metric: its name, its number of nodes, and the value of every model."""
    first = next(iter(comparison.estimates.values()))
    return [[name, str(e.nodes), *_cells(comparison, name)] for name, e in first.items()]


def _cells(comparison: Comparison, name: str) -> Iterator[str]:
    return (_cell(estimates[name]) for estimates in comparison.estimates.values())


def _cell(estimate: Estimate) -> str:
    """Return a value ± half the width of its 95 % interval."""
    if np.isnan(estimate.value):
        return "-"
    value = f"{estimate.value:.3g}"
    half = (estimate.high - estimate.low) / 2
    return value if np.isnan(half) else f"{value} ±{half:.1g}"


def name_runs(runs: Sequence[tuple[FoundModel, CheckpointHeader]]) -> tuple[str, ...]:
    """Return a name for each run: its model's, such as `ceci-gcn`.

    Runs of one model, and a run whose model is also a baseline, get their folder as well:
    `ceci-gcn (second)`. If that name is taken too, a number follows.
    """
    models = [name_model(found, header) for found, header in runs]
    times = Counter([*models, *BASELINES])
    names: list[str] = []
    for model, (found, _) in zip(models, runs, strict=True):
        name = model if times[model] == 1 else f"{model} ({found.name})"
        names.append(first_free(name, names))
    return tuple(names)


def first_free(name: str, taken: Collection[str]) -> str:
    """Return a name, or the first of `name-2`, `name-3` … that is not taken.

    Two names count as equal if files named after them would have the same name.

    >>> first_free("mine", ["mine", "mine-2"])
    'mine-3'
    """
    stems = {stem_of(one) for one in taken}
    free, number = name, 2
    while stem_of(free) in stems:
        free, number = f"{name}-{number}", number + 1
    return free
