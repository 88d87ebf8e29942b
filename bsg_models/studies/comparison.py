"""Compare runs with each other and with the baselines on the same masked pairs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple

import pandas as pd
from pydantic import Field, model_validator

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import require_class_space
from bsg_data.errors import DatasetError
from bsg_data.files import AnyPath, stem_of
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.recipes import PairsRecipe
from bsg_data.records import Record
from bsg_models.errors import CheckpointError
from bsg_models.evaluation.bootstrap import LEAST_BUILDINGS, Bootstrap, Estimate
from bsg_models.evaluation.details import Details, ShownNodes
from bsg_models.evaluation.measurement import Fold, measure
from bsg_models.evaluation.prediction_files import PredictionWriter
from bsg_models.evaluation.predictions import AlignedPredictions
from bsg_models.evaluation.truth import Prediction
from bsg_models.runs.checkpoint import (
    Checkpoint,
    CheckpointHeader,
    load_checkpoint,
    restore_model,
)
from bsg_models.runs.found_model import FoundModel, find_model
from bsg_models.studies.stored_pairs import MeasuredPairs
from bsg_models.zoo.catalogue import BASELINES, UNTRAINED
from bsg_models.zoo.config import find_config
from bsg_models.zoo.model import BeliefModel, make_model
from bsg_models.zoo.settings import DataConfig

WHOLE = "whole dataset"  # instead of a split
_SHOWN_LIMIT = 20_000  # nodes in figures: more cannot be told apart, and would fill memory


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
        if self.write_predictions == self.folder:
            raise ValueError("write predictions into another folder than the results")
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


class _Run(NamedTuple):
    """A run that is compared."""

    name: str  # of its column
    found: FoundModel
    checkpoint: Checkpoint

    @property
    def header(self) -> CheckpointHeader:
        return self.checkpoint.header


_Model = BeliefModel | AlignedPredictions
_Write = Callable[[MeasuredPairs, str, int | None], PredictionWriter]  # of a run's predictions


def compare_runs(
    request: EvaluationRequest,
    *,
    write: _Write | None = None,
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
        write: called with the pairs, a run's name and a fold; returns a writer of its predictions.
        progress: called with (masked buildings done, in all).

    Raises:
        CheckpointError: if a run cannot be loaded, or the runs were trained for different folds.
        MismatchError: if a run predicts the classes of another class map.
        DatasetError: if the split has no pairs.
        PredictionError: if predictions cannot be read, or do not fit the pairs.
    """
    data = Dataset.open(request.dataset)
    runs = _load_runs(request.runs, data)
    pairs = _choose_pairs(request, data, runs)
    entries = _read_entries(request.predictions, pairs, taken=[run.name for run in runs])
    models: dict[str, _Model] = {
        run.name: restore_model(run.found.path, run.checkpoint) for run in runs
    }
    models |= {name: predictions for name, (predictions, _) in entries.items()}
    details = _prepare_details(pairs, models)
    bootstraps = _measure(request, pairs, models, details, runs, write, progress)
    classes = data.manifest.class_space.classes
    tables = [own.tabulate(name, classes) for name, own in details.items()]
    return Comparison(
        runs=tuple(models),
        bootstraps=bootstraps,
        shown={name: details[name].shown() for name in models},
        buildings=pairs.buildings,
        classes=pd.concat(tables, ignore_index=True),
        class_names=classes,
        facts={
            **_describe_pairs(pairs, fold=pairs.folds[0] if runs else None),
            "resamples": request.resamples,
            "masks_sha256": pairs.masks_sha256 if pairs.fresh is None else None,
            "runs": {run.name: _describe_run(run) for run in runs},
            "checkpoints_sha256": [hash_file(run.found.path) for run in runs],
            "predictions": {name: facts for name, (_, facts) in entries.items()},
        },
        notes=tuple(_list_notes(request, runs, pairs)),
    )


def _measure(
    request: EvaluationRequest,
    pairs: MeasuredPairs,
    models: Mapping[str, _Model],
    details: Mapping[str, Details],
    runs: Sequence[_Run],
    write: _Write | None,
    progress: Callable[[int, int], None] | None,
) -> dict[str, Bootstrap]:
    """Measure models and baselines; keep the details, and write what runs predict."""
    done, written = 0, [run.name for run in runs] if write else []

    def predict(fold: int | None) -> Iterator[dict[str, Prediction]]:
        nonlocal done
        own = {
            name: models[name] if name in models else _fit_baseline(name, pairs.data, fold)
            for name in details
        }
        writers = {name: write(pairs, name, fold) for name in written} if write else {}
        for batch in pairs.predict(own, fold):
            yield batch
            for name, prediction in batch.items():
                details[name].add(prediction)
                if name in writers:
                    writers[name].add(prediction)
            done += int(next(iter(batch.values())).truth.is_building.sum())
            if progress is not None:
                progress(done, len(pairs.survey))

    return measure(
        [
            Fold(tuple(rows.scene_id.unique()), predict(fold))
            for fold, rows in pairs.surveys.items()
        ],
        resamples=request.resamples if len(pairs.buildings) > 1 else 0,  # one has no interval
    )


def _prepare_details(pairs: MeasuredPairs, models: Mapping[str, _Model]) -> dict[str, Details]:
    """Return name → what is kept of models, and of the baselines that are measured beside them."""
    example = pairs.buildings[len(pairs.buildings) // 2]
    details = {name: Details(_stride(pairs), example) for name in models}
    return details | {name: Details() for name in (BASELINES if pairs.trains else UNTRAINED)}


def _stride(pairs: MeasuredPairs) -> int:
    """Return the number k such that every k-th masked building is shown."""
    return max(1, -(-int((pairs.survey.rooms + 1).sum()) // _SHOWN_LIMIT))


def _load_runs(runs: Sequence[AnyPath], data: Dataset) -> list[_Run]:
    found = [find_model(run) for run in runs]
    checkpoints = [load_checkpoint(model.path) for model in found]
    for model, checkpoint in zip(found, checkpoints, strict=True):
        space = checkpoint.header.class_space
        require_class_space(data.manifest, space, what=f"checkpoint {model.path}")
    names = _name_runs([(model, c.header) for model, c in zip(found, checkpoints, strict=True)])
    return list(map(_Run, names, found, checkpoints))


def _name_runs(runs: Sequence[tuple[FoundModel, CheckpointHeader]]) -> tuple[str, ...]:
    """Return a name for each run: its model's, such as `ceci`.

    Runs of one model, and a run whose model is also a baseline, get their folder as well:
    `ceci (second)`. If that name is taken too, a number follows.
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
    stems = {stem_of(other) for other in taken}
    free, number = name, 2
    while stem_of(free) in stems:
        free, number = f"{name}-{number}", number + 1
    return free


def _choose_pairs(request: EvaluationRequest, data: Dataset, runs: Sequence[_Run]) -> MeasuredPairs:
    """Return what is measured on: the fold of the runs, or without runs all folds."""
    fresh = None if data.splits else request.fresh
    if fresh is not None and request.predictions:
        message = f"{data.path}: predictions are for stored pairs; run `bsg-data split` and `pairs`"
        raise DatasetError(message, code="pairs-missing", where=data.path)
    folds: tuple[int | None, ...]
    if runs:
        folds = tuple({run.header.config.data.fold for run in runs})
    else:
        folds = tuple(range(sum(name.startswith("fold-") for name in data.splits))) or (None,)
    if runs and len(folds) > 1:
        listed = ", ".join(f"{run.found.name}: {run.header.config.data.fold}" for run in runs)
        raise CheckpointError(f"the runs test on different folds ({listed}); name runs of one fold")
    return MeasuredPairs(data, request.split, folds, fresh)


def _read_entries(
    paths: Sequence[Path], pairs: MeasuredPairs, *, taken: Sequence[str]
) -> dict[str, tuple[AlignedPredictions, dict[str, Any]]]:
    """Return name → what a file of predictions expects, and where it comes from."""
    entries: dict[str, tuple[AlignedPredictions, dict[str, Any]]] = {}
    for path in paths:
        stem, predictions, facts = pairs.read_entry(path)
        name = _first_free(stem, {*taken, *entries, *BASELINES})
        entries[name] = predictions, facts
    return entries


def _fit_baseline(name: str, data: Dataset, fold: int | None) -> BeliefModel:
    model = make_model(find_config(name), classes=len(data.manifest.class_space.classes))
    model.fit(data, DataConfig(fold=fold))
    return model


def _describe_run(run: _Run) -> dict[str, Any]:
    header = run.header
    return {
        "folder": run.found.name,
        "epoch": header.epoch,
        "dataset_sha256": header.dataset_sha256,
        "config": header.config.model_dump(mode="json"),
    }


def _describe_pairs(pairs: MeasuredPairs, *, fold: int | None) -> dict[str, Any]:
    survey = pairs.survey
    return {
        "split": pairs.split if pairs.fresh is None else WHOLE,
        "fold": fold,
        "dataset_sha256": pairs.data.sha256,
        "class_space": pairs.data.manifest.class_space.name,
        "mask": pairs.recipe.mask.model_dump(mode="json"),
        "buildings": survey.scene_id.nunique(),
        "draws": pairs.recipe.draws,
        "nodes": {"rooms": int(survey.rooms.sum()), "building": len(survey)},
        **{name: int(survey[name].sum()) for name in ("empty_inputs", "empty_targets")},
    }


def _list_notes(
    request: EvaluationRequest, runs: Sequence[_Run], pairs: MeasuredPairs
) -> Iterator[str]:
    buildings, stride = len(pairs.buildings), _stride(pairs)
    whole = pairs.fresh is not None
    where = "these buildings" if whole else f"buildings of this {pairs.split} split"
    for run in runs:
        if run.header.dataset_sha256 != pairs.data.sha256:
            yield (
                f"note: {run.name} was trained on another dataset or another version of this one; "
                f"{where} may have been in its training set"
            )
    if buildings < LEAST_BUILDINGS:
        yield (
            f"note: measured on {buildings} building{'' if buildings == 1 else 's'}: intervals (±) "
            f"and verdicts need at least {LEAST_BUILDINGS} of them"
        )
    if stride > 1:
        yield f"note: the figures show one in {stride} masked buildings"
    if whole:
        yield "note: the dataset has no split: all of its buildings are measured, under new masks"
    elif request.fresh != PairsRecipe():
        yield "note: the dataset has pairs: their masks are measured, not those asked for"
    if pairs.split == "train" and not whole:
        yield "note: the models were trained on these buildings"
