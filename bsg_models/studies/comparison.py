"""Compare runs with each other and with the baselines on the same masked pairs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import pandas as pd

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import require_class_space
from bsg_data.errors import DatasetError
from bsg_data.files import AnyPath, stem_of
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_data.recipes import PairsRecipe
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import CheckpointError
from bsg_models.evaluation.bootstrap import LEAST_BUILDINGS, Bootstrap, Estimate
from bsg_models.evaluation.catalogue import head_value
from bsg_models.evaluation.details import ClassErrors, ShownCollector, ShownNodes
from bsg_models.evaluation.measurement import (
    EVALUATOR_VERSION,
    Fold,
    measure,
    predict_all,
    read_truth,
)
from bsg_models.evaluation.prediction_files import PredictionWriter
from bsg_models.evaluation.truth import Truth
from bsg_models.evaluation.verdict import list_headlines
from bsg_models.inputs.folds import Split
from bsg_models.runs.checkpoint import (
    Checkpoint,
    CheckpointHeader,
    load_checkpoint,
    read_header,
    restore_model,
)
from bsg_models.runs.found_model import FoundModel, find_model
from bsg_models.runs.run_folder import LAST
from bsg_models.studies.stored_pairs import (
    Folds,
    Survey,
    folds_of,
    hash_measured,
    join_surveys,
    read_entry,
    stream_batches,
    survey_split,
)
from bsg_models.zoo.catalogue import BASELINES, UNTRAINED
from bsg_models.zoo.config import find_config
from bsg_models.zoo.ensemble import make_model
from bsg_models.zoo.settings import DataConfig

WHOLE = "whole dataset"  # instead of a split


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs and baselines measured on the same truth."""

    runs: tuple[str, ...]  # names of the runs and predictions, in the order given
    split: str  # that they were measured on
    # model → its metrics, on every resample of the buildings; the baselines are last
    bootstraps: dict[str, Bootstrap]
    shown: dict[str, ShownNodes]  # run → the nodes in its figures
    survey: Survey  # of the buildings that they were measured on
    classes: pd.DataFrame  # one row per model, node set and class
    class_names: tuple[str, ...]  # `[C]`
    # what was measured on: dataset, class map, buildings, draws, empty nodes; and which runs, with
    # the sha256 of their checkpoints in the same order
    facts: dict[str, Any]
    notes: tuple[str, ...]  # warnings that a reader of the values needs

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
    found: FoundModel
    checkpoint: Checkpoint


_Predict = Callable[[MaskedBuildings], Expectation]
_Opened = tuple[_Predict, tuple[str, ...]]  # and the categories outside the classes that it reads
_Opener = Callable[[int | None], _Opened]  # of a fold
_Writer = Callable[[str, int | None], PredictionWriter]  # of a run's predictions for a fold


def compare_runs(
    runs: Sequence[AnyPath],
    dataset: AnyPath,
    *,
    split: str,
    predictions: Sequence[AnyPath] = (),
    fresh: PairsRecipe | None = None,
    fold: int | None = None,
    resamples: int = 200,
    seed: int = 0,
    write: _Writer | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Comparison:
    """Measure runs, predictions of other programs and baselines on the stored pairs of a split.

    A dataset without a split is measured whole, under `fresh` masks, and only beside the baselines
    that learn nothing: models that were trained on other buildings are tested on all.

    A run is named after its model; several runs of one model also get their folders' names. Without
    runs, a dataset in folds is measured fold by fold, and the values are averaged. Buildings are
    read, predicted and measured in batches.

    Args:
        runs: trained models, as `find_model` takes them.
        dataset: folder of a split dataset with pairs.
        split: `train`, `val` or `test`.
        predictions: files of predictions, or folders of such files.
        fresh: masks of a dataset without a split; None: ten of the default recipe.
        fold: fold to measure if there is no run; None for all.
        resamples: number of bootstrap resamples of the buildings.
        seed: of the bootstrap.
        write: called with a run's name and a fold; returns a writer of its predictions.
        progress: called with (masked buildings done, in all), over all models.

    Raises:
        CheckpointError: if a run cannot be loaded, or the runs were trained for different folds.
        MismatchError: if a run predicts the classes of another class map.
        DatasetError: if the split has no pairs.
        PredictionError: if predictions cannot be read, or do not fit the pairs.
    """
    data = Dataset.open(Path(dataset))
    loaded = _load_runs(runs, data)
    fold = _one_fold(loaded, fold) if loaded else fold
    part = cast(Split, split)
    folds: Folds = (fold,) if loaded else folds_of(data, fold)
    fresh = None if data.splits else fresh or PairsRecipe()
    if fresh is not None and predictions:
        message = f"{data.path}: predictions are for stored pairs; run `bsg-data split` and `pairs`"
        raise DatasetError(message, code="pairs-missing", where=data.path)
    split = split if fresh is None else WHOLE
    surveys = [survey_split(data, part, fold=one, fresh=fresh) for one in folds]
    survey = join_surveys(surveys)
    openers: dict[str, _Opener] = {run.name: partial(_open_run, run) for run in loaded}
    entries = {}
    for path in predictions:
        entry = read_entry(Path(path), data, split=part, folds=folds)
        name = _first_free(entry.name, {*openers, *BASELINES})
        entries[name] = entry.facts
        openers[name] = partial(_open_entry, entry.aligned.expect)
    chosen = tuple(openers)
    trains = fold is not None or len(folds) > 1 or "train" in data.splits
    baselines = BASELINES if trains else UNTRAINED
    openers |= {name: partial(_fit_baseline, name, data) for name in baselines}
    total = len(openers) * survey.masked
    measuring = _Measuring(data, part, folds, surveys, total, progress, fresh)
    bootstraps = {
        name: measure(
            measuring.predict(name, opener, write if name in chosen[: len(loaded)] else None),
            resamples=resamples,
            seed=seed,
        )
        for name, opener in openers.items()
    }
    classes = data.manifest.class_space.classes
    return Comparison(
        runs=chosen,
        split=split,
        bootstraps=bootstraps,
        shown={name: measuring.shown[name].finish() for name in chosen},
        survey=survey,
        classes=pd.DataFrame(
            [row for name, one in measuring.classes.items() for row in one.rows(name, classes)]
        ),
        class_names=classes,
        facts=_facts(data, survey, fresh=fresh, fold=fold, resamples=resamples, seed=seed)
        | {
            "masks_sha256": None if fresh else hash_measured(data, part, folds),
            "runs": {run.name: _describe(run) for run in loaded},
            "checkpoints_sha256": [hash_file(run.found.path) for run in loaded],
            "predictions": entries,
        },
        notes=tuple(_notes(loaded, data, survey, split)),
    )


@dataclass(eq=False)
class _Measuring:
    """The stored pairs that all models are measured on, and what is seen of them on the way."""

    data: Dataset
    split: Split
    folds: Folds
    surveys: Sequence[Survey]  # of the folds
    total: int  # masked buildings, over all models
    progress: Callable[[int, int], None] | None
    fresh: PairsRecipe | None  # masks of a dataset without a split
    done: int = 0  # masked buildings
    classes: dict[str, ClassErrors] = field(default_factory=dict)  # by model
    shown: dict[str, ShownCollector] = field(default_factory=dict)

    def predict(self, name: str, opener: _Opener, write: _Writer | None) -> list[Fold]:
        """Return the folds of a model, each of which is predicted batch by batch."""
        survey = join_surveys(self.surveys)
        self.classes[name] = ClassErrors()
        self.shown[name] = ShownCollector(survey.stride, survey.example)
        return [
            Fold(survey.scene_ids, self._predict(name, opener, fold, write))
            for survey, fold in zip(self.surveys, self.folds, strict=True)
        ]

    def _predict(
        self, name: str, opener: _Opener, fold: int | None, write: _Writer | None
    ) -> Iterator[tuple[Truth, Expectation]]:
        expect, vocabulary = opener(fold)
        writer = write(name, fold) if write else None
        for masked in stream_batches(
            self.data, self.split, fold=fold, vocabulary=vocabulary, fresh=self.fresh
        ):
            truth, found = read_truth(masked), expect(masked)
            yield truth, found
            self.classes[name].add(truth, found)
            if name not in BASELINES:
                self.shown[name].add(truth, found)
            if writer is not None:
                writer.add(found, masked)
            self.done += len(masked)
            if self.progress is not None:
                self.progress(self.done, self.total)


def _load_runs(runs: Sequence[AnyPath], data: Dataset) -> list[_Loaded]:
    found = [find_model(run) for run in runs]
    checkpoints = [load_checkpoint(one.path) for one in found]
    names = name_runs([(one, c.header) for one, c in zip(found, checkpoints, strict=True)])
    for one, checkpoint in zip(found, checkpoints, strict=True):
        space = checkpoint.header.class_space
        require_class_space(data.manifest, space, what=f"checkpoint {one.path}")
    return [_Loaded(*one) for one in zip(names, found, checkpoints, strict=True)]


def name_runs(runs: Sequence[tuple[FoundModel, CheckpointHeader]]) -> tuple[str, ...]:
    """Return a name for each run: its model's, such as `ceci-gcn`.

    Runs of one model, and a run whose model is also a baseline, get their folder as well:
    `ceci-gcn (second)`. If that name is taken too, a number follows.
    """
    models = [
        found.name if found.kind == "shipped" else header.config.name for found, header in runs
    ]
    times = Counter([*models, *BASELINES])
    names: list[str] = []
    for model, (found, _) in zip(models, runs, strict=True):
        name = model if times[model] == 1 else f"{model} ({found.name})"
        names.append(_first_free(name, names))
    return tuple(names)


def _first_free(name: str, taken: Collection[str]) -> str:
    """Return a name, or the first of `name-2`, `name-3` … whose files would have another name."""
    stems = {stem_of(one) for one in taken}
    free, number = name, 2
    while stem_of(free) in stems:
        free, number = f"{name}-{number}", number + 1
    return free


def _open_run(run: _Loaded, fold: int | None) -> _Opened:
    model = restore_model(run.found.path, run.checkpoint)
    return partial(predict_all, model), model.vocabulary


def _open_entry(expect: _Predict, fold: int | None) -> _Opened:
    return expect, ()


def _fit_baseline(name: str, data: Dataset, fold: int | None) -> _Opened:
    model = make_model(find_config(name), classes=len(data.manifest.class_space.classes))
    if name not in UNTRAINED:
        model.fit(data, DataConfig(fold=fold))
    return partial(predict_all, model), model.vocabulary


def _describe(run: _Loaded) -> dict[str, Any]:
    header = run.checkpoint.header
    return {
        "folder": run.found.name,
        "epoch": header.epoch,
        "dataset_sha256": header.dataset_sha256,
        "config": header.config.model_dump(mode="json"),
    }


def _one_fold(loaded: Sequence[_Loaded], asked: int | None) -> int | None:
    folds = {run.checkpoint.header.config.data.fold for run in loaded}
    listed = ", ".join(
        f"{run.found.name}: {run.checkpoint.header.config.data.fold}" for run in loaded
    )
    if asked is not None and folds != {asked}:
        raise CheckpointError(f"expected runs that test on fold {asked}, found {listed}")
    if len(folds) > 1:
        raise CheckpointError(f"the runs test on different folds ({listed}); name runs of one fold")
    return folds.pop()


def _facts(
    data: Dataset,
    survey: Survey,
    *,
    fresh: PairsRecipe | None,
    fold: int | None,
    resamples: int,
    seed: int,
) -> dict[str, Any]:
    pairs = fresh or data.manifest.pairs
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


def _notes(loaded: Sequence[_Loaded], data: Dataset, survey: Survey, split: str) -> Iterator[str]:
    for run in loaded:
        header = run.checkpoint.header
        if header.dataset_sha256 != data.sha256:
            where = "these buildings" if split == WHOLE else f"buildings of this {split} split"
            yield (
                f"note: {run.name} was trained on another dataset or another version of this one; "
                f"{where} may have been in its training set"
            )
        epochs = header.config.training.epochs
        unfinished = run.found.path.with_name(LAST)
        last = read_header(unfinished).epoch if unfinished.is_file() else epochs
        if header.calibrated != getattr(header.config.model, "calibrate", False):
            yield f"note: {run.name} stopped before its calibration; --resume finishes it"
        if last < epochs:
            yield f"note: {run.name} stopped at epoch {last} of {epochs}; --resume goes on"
    if (buildings := len(survey.scene_ids)) < LEAST_BUILDINGS:
        yield (
            f"note: measured on {buildings} building{'' if buildings == 1 else 's'}: intervals (±) "
            f"and verdicts need at least {LEAST_BUILDINGS} of them"
        )
    if survey.stride > 1:
        yield f"note: the figures show one in {survey.stride} masked buildings"
    if split == WHOLE:
        yield "note: the dataset has no split: all of its buildings are measured, under new masks"
    if split == "train":
        yield "note: the models were trained on these buildings"


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
