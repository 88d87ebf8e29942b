"""Compare runs with each other and with the baselines on the same masked pairs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

import pandas as pd
from pydantic import Field, model_validator

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import require_class_space
from bsg_data.errors import DatasetError
from bsg_data.files import AnyPath, stem_of
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.recipes import PairsRecipe, Record
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import CheckpointError
from bsg_models.evaluation.bootstrap import LEAST_BUILDINGS, Bootstrap, Estimate
from bsg_models.evaluation.details import ClassErrors, ShownCollector, ShownNodes
from bsg_models.evaluation.measurement import (
    EVALUATOR_VERSION,
    Fold,
    measure_models,
    predict_all,
    read_truth,
)
from bsg_models.evaluation.prediction_files import PredictionWriter
from bsg_models.evaluation.truth import Truth
from bsg_models.runs.checkpoint import (
    Checkpoint,
    CheckpointHeader,
    load_checkpoint,
    restore_model,
)
from bsg_models.runs.found_model import FoundModel, find_model
from bsg_models.studies.stored_pairs import (
    Expect,
    Folds,
    folds_of,
    hash_measured,
    read_entry,
    stream_batches,
    survey_split,
)
from bsg_models.zoo.catalogue import BASELINES, UNTRAINED
from bsg_models.zoo.config import find_config
from bsg_models.zoo.ensemble import make_model
from bsg_models.zoo.model import BeliefModel
from bsg_models.zoo.settings import DataConfig

WHOLE = "whole dataset"  # instead of a split
_MOST_SHOWN = 20_000  # nodes in figures: more cannot be told apart, and would fill memory


class EvaluationRequest(Record):
    """What to compare, and which files to write."""

    # trained models, as `find_model` takes them: paths of runs, or names
    runs: tuple[Path | str, ...] = ()
    dataset: Path  # folder of a split dataset with pairs
    split: Literal["train", "val", "test"] = "test"  # split to measure on
    # files of predictions of other programs, or folders of such files
    predictions: tuple[Path, ...] = ()
    # masks of a dataset without a split, all buildings of which are measured
    fresh: PairsRecipe = PairsRecipe()
    # folder for the expectations of the runs, written as predictions
    write_predictions: Path | None = None
    # folder of the results. None means `evaluation` in the folder of the first run; if that run is
    # no folder, `evaluation` here; without runs, `STEM-evaluation` beside the first predictions.
    out: Path | None = None
    html: Path | None = None  # file for one page with all results; None for none
    # number of bootstrap resamples of the buildings; 0 gives no intervals
    resamples: int = Field(default=200, ge=0)
    force: bool = False  # replace existing results

    @model_validator(mode="after")
    def _has_something_to_measure(self) -> EvaluationRequest:
        if not self.runs and not self.predictions:
            raise ValueError("name a run or predictions")
        return self

    @property
    def folder(self) -> Path:
        """Folder of the results."""
        if self.out is None and not self.runs:
            first = self.predictions[0]
            return first.with_name(f"{first.stem}-evaluation")
        run = self.runs[0] if self.runs else Path()
        inside = isinstance(run, Path) and not run.is_file()
        return self.out or (Path(run) / "evaluation" if inside else Path("evaluation"))


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs and baselines measured on the same truth."""

    runs: tuple[str, ...]  # names of the runs and predictions, in the order given
    # model → its metrics, on every resample of the buildings; the baselines are last
    bootstraps: dict[str, Bootstrap]
    shown: dict[str, ShownNodes]  # run → the nodes in its figures
    buildings: tuple[str, ...]  # that they were measured on, the smallest first
    classes: pd.DataFrame  # one row per model, node set and class
    class_names: tuple[str, ...]  # `[C]`
    # what was measured on: dataset, class map, buildings, draws, empty nodes; and which runs, with
    # the sha256 of their checkpoints in the same order
    facts: dict[str, Any]
    notes: tuple[str, ...]  # warnings that a reader of the values needs

    @property
    def example(self) -> str:
        """The building of median size, for the figures."""
        return self.buildings[len(self.buildings) // 2]

    @property
    def has_verdicts(self) -> bool:
        """Whether there are enough buildings to say which model is better."""
        return len(self.buildings) >= LEAST_BUILDINGS

    @cached_property
    def estimates(self) -> dict[str, dict[str, Estimate]]:
        """Model → metric → value with its interval."""
        return {name: measured.estimates() for name, measured in self.bootstraps.items()}


class _Loaded(NamedTuple):
    """A run that is compared."""

    name: str  # of its column
    found: FoundModel
    checkpoint: Checkpoint


_Opener = Callable[[int | None], BeliefModel | Expect]  # returns what predicts a fold
_Writer = Callable[[str, int | None], PredictionWriter]  # of a run's predictions for a fold


def compare_runs(
    request: EvaluationRequest,
    *,
    write: _Writer | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Comparison:
    """Measure runs, predictions of other programs and baselines on the stored pairs of a split.

    A dataset without a split is measured whole, under the `fresh` masks of the request, and only
    beside the baselines that learn nothing: models that were trained on other buildings are tested
    on all.

    A run is named after its model; several runs of one model also get their folders' names. Without
    runs, a dataset in folds is measured fold by fold, and the values are averaged. Buildings are
    read, predicted and measured in batches.

    Args:
        request: what to compare, on which buildings; no file that it names is written.
        write: called with a run's name and a fold; returns a writer of its predictions.
        progress: called with (masked buildings done, in all), over all models.

    Raises:
        CheckpointError: if a run cannot be loaded, or the runs were trained for different folds.
        MismatchError: if a run predicts the classes of another class map.
        DatasetError: if the split has no pairs.
        PredictionError: if predictions cannot be read, or do not fit the pairs.
    """
    data, split = Dataset.open(request.dataset), request.split
    loaded = _load_runs(request.runs, data)
    fold = _one_fold(loaded) if loaded else None
    folds: Folds = (fold,) if loaded else folds_of(data)
    fresh = None if data.splits else request.fresh
    if fresh is not None and request.predictions:
        message = f"{data.path}: predictions are for stored pairs; run `bsg-data split` and `pairs`"
        raise DatasetError(message, code="pairs-missing", where=data.path)
    surveys = {one: survey_split(data, split, fold=one, fresh=fresh) for one in folds}
    openers: dict[str, _Opener] = {run.name: partial(_restore, run) for run in loaded}
    entries = {}
    for path in request.predictions:
        stem, expect, facts = read_entry(path, data, split=split, folds=folds)
        name = _first_free(stem, {*openers, *BASELINES})
        entries[name], openers[name] = facts, partial(_any_fold, expect)
    chosen = tuple(openers)
    trains = fold is not None or len(folds) > 1 or "train" in data.splits
    baselines = BASELINES if trains else UNTRAINED
    openers |= {name: partial(_fit_baseline, name, data) for name in baselines}
    measuring = _Measuring(request, data, surveys, len(openers), progress, fresh)
    models = {
        name: measuring.folds_of(name, opener, write if name in chosen[: len(loaded)] else None)
        for name, opener in openers.items()
    }
    many = len(measuring.buildings) > 1  # one building has no interval
    resamples = request.resamples if many else 0
    bootstraps = measure_models(models, resamples=resamples)
    classes = data.manifest.class_space.classes
    tables = [one.tabulate(name, classes) for name, one in measuring.classes.items()]
    return Comparison(
        runs=chosen,
        bootstraps=bootstraps,
        shown={name: measuring.shown[name].finish() for name in chosen},
        buildings=measuring.buildings,
        classes=pd.concat(tables, ignore_index=True),
        class_names=classes,
        facts={
            "split": split if fresh is None else WHOLE,
            **_facts(measuring, fold=fold),
            "masks_sha256": hash_measured(data, split, folds) if fresh is None else None,
            "runs": {run.name: _describe(run) for run in loaded},
            "checkpoints_sha256": [hash_file(run.found.path) for run in loaded],
            "predictions": entries,
        },
        notes=tuple(_notes(loaded, measuring)),
    )


@dataclass(eq=False)
class _Measuring:
    """The stored pairs that all models are measured on, and what is seen of them on the way."""

    request: EvaluationRequest
    data: Dataset
    surveys: Mapping[int | None, pd.DataFrame]  # fold → its masked buildings
    models: int
    progress: Callable[[int, int], None] | None
    fresh: PairsRecipe | None  # masks of a dataset without a split
    done: int = 0  # masked buildings
    classes: dict[str, ClassErrors] = field(default_factory=dict)  # by model
    shown: dict[str, ShownCollector] = field(default_factory=dict)

    @cached_property
    def survey(self) -> pd.DataFrame:
        """The masked buildings of all folds."""
        return pd.concat(self.surveys.values())

    @cached_property
    def buildings(self) -> tuple[str, ...]:
        """The buildings, the smallest first."""
        sizes = self.survey.groupby("scene_id", sort=False).objects.last()
        return tuple(sizes.sort_values(kind="stable").index)

    @property
    def stride(self) -> int:
        """Number k such that every k-th masked building is shown."""
        return max(1, -(-int((self.survey.rooms + 1).sum()) // _MOST_SHOWN))

    def folds_of(self, name: str, opener: _Opener, write: _Writer | None) -> list[Fold]:
        """Return what a model is measured on; it is predicted batch by batch."""
        self.classes[name] = ClassErrors()
        self.shown[name] = ShownCollector(self.stride, self.buildings[len(self.buildings) // 2])
        return [
            Fold(tuple(survey.scene_id.unique()), self._predict(name, opener, fold, write))
            for fold, survey in self.surveys.items()
        ]

    def _predict(
        self, name: str, opener: _Opener, fold: int | None, write: _Writer | None
    ) -> Iterator[tuple[Truth, Expectation]]:
        opened = opener(fold)
        vocabulary = opened.vocabulary if isinstance(opened, BeliefModel) else ()
        expect = partial(predict_all, opened) if isinstance(opened, BeliefModel) else opened
        writer = write(name, fold) if write else None
        for masked in stream_batches(
            self.data, self.request.split, fold=fold, vocabulary=vocabulary, fresh=self.fresh
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
                self.progress(self.done, self.models * len(self.survey))


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


def _restore(run: _Loaded, fold: int | None) -> BeliefModel:
    return restore_model(run.found.path, run.checkpoint)


def _any_fold(expect: Expect, fold: int | None) -> Expect:
    return expect


def _fit_baseline(name: str, data: Dataset, fold: int | None) -> BeliefModel:
    model = make_model(find_config(name), classes=len(data.manifest.class_space.classes))
    model.fit(data, DataConfig(fold=fold))
    return model


def _describe(run: _Loaded) -> dict[str, Any]:
    header = run.checkpoint.header
    return {
        "folder": run.found.name,
        "epoch": header.epoch,
        "dataset_sha256": header.dataset_sha256,
        "config": header.config.model_dump(mode="json"),
    }


def _one_fold(loaded: Sequence[_Loaded]) -> int | None:
    folds = {run.checkpoint.header.config.data.fold for run in loaded}
    if len(folds) > 1:
        listed = ", ".join(
            f"{run.found.name}: {run.checkpoint.header.config.data.fold}" for run in loaded
        )
        raise CheckpointError(f"the runs test on different folds ({listed}); name runs of one fold")
    return folds.pop()


def _facts(measuring: _Measuring, *, fold: int | None) -> dict[str, Any]:
    data, survey, request = measuring.data, measuring.survey, measuring.request
    pairs = measuring.fresh or data.manifest.pairs
    if pairs is None:
        raise DatasetError(f"{data.path}: has no pairs; run `bsg-data pairs` first")
    return {
        "evaluator_version": EVALUATOR_VERSION,
        "fold": fold,
        "dataset_sha256": data.sha256,
        "class_space": data.manifest.class_space.name,
        "mask": pairs.mask.model_dump(mode="json"),
        "buildings": survey.scene_id.nunique(),
        "draws": pairs.draws,
        "nodes": {"rooms": int(survey.rooms.sum()), "building": len(survey)},
        **{name: int(survey[name].sum()) for name in ("empty_inputs", "empty_targets")},
        "resamples": request.resamples,
    }


def _notes(loaded: Sequence[_Loaded], measuring: _Measuring) -> Iterator[str]:
    split, whole = measuring.request.split, measuring.fresh is not None
    for run in loaded:
        header = run.checkpoint.header
        if header.dataset_sha256 != measuring.data.sha256:
            where = "these buildings" if whole else f"buildings of this {split} split"
            yield (
                f"note: {run.name} was trained on another dataset or another version of this one; "
                f"{where} may have been in its training set"
            )
    if (buildings := len(measuring.buildings)) < LEAST_BUILDINGS:
        yield (
            f"note: measured on {buildings} building{'' if buildings == 1 else 's'}: intervals (±) "
            f"and verdicts need at least {LEAST_BUILDINGS} of them"
        )
    if measuring.stride > 1:
        yield f"note: the figures show one in {measuring.stride} masked buildings"
    if whole:
        yield "note: the dataset has no split: all of its buildings are measured, under new masks"
    elif measuring.request.fresh != PairsRecipe():
        yield "note: the dataset has pairs: their masks are measured, not those asked for"
    if split == "train" and not whole:
        yield "note: the models were trained on these buildings"
