"""Measure one model on the stored pairs of a split, batch by batch: metrics, classes, figures.

Only the sums, the ranked cells and the nodes for figures are kept of a batch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.masked_buildings import BATCH, MaskedBuildings
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.evaluation.class_errors import ClassErrors
from bsg_models.evaluation.measurement import (
    SplitWeights,
    StreamedMeasurement,
    count_empty,
    predict_all,
    read_truth,
)
from bsg_models.evaluation.shown_nodes import ShownCollector, ShownNodes
from bsg_models.inputs.folds import Split
from bsg_models.inputs.graphs import stream_split
from bsg_models.zoo.model import BeliefModel


class NodePredictor(NamedTuple):
    """A source of expectations for masked buildings."""

    # returns the expectation of masked buildings, called in the order of the stored pairs
    expect: Callable[[MaskedBuildings], Expectation]
    vocabulary: tuple[str, ...] = ()  # categories outside the classes that it reads


class Receiver(Protocol):
    """A receiver of predictions, batch by batch."""

    def add(self, expectation: Expectation, masked: MaskedBuildings) -> None:
        """Take one batch of masked buildings with its expectation."""


class MeasuredModel(NamedTuple):
    """The measurements of one model."""

    bootstrap: Bootstrap  # every metric, with its values on every resample of the buildings
    # one row per node set and class, as `ClassErrors.rows` gives them
    classes: list[dict[str, Any]]
    shown: ShownNodes | None  # the nodes for its figures; None if it has no figures


def predict_by(model: BeliefModel) -> NodePredictor:
    """Return a model as a predictor."""
    return NodePredictor(lambda masked: predict_all(model, masked), model.vocabulary)


@dataclass(frozen=True, eq=False)
class Measuring:
    """The stored pairs and bootstrap weights that all models are measured with."""

    data: Dataset  # an open dataset
    split: Split  # split to measure on
    folds: tuple[int | None, ...]  # folds measured one by one; (None,) for a dataset without folds
    surveys: Sequence[Survey]  # of each fold
    weights: SplitWeights  # bootstrap weights of the buildings of all folds
    # called after each batch with the number of masked buildings measured in it
    progress: Callable[[int], None] = field(default=lambda done: None)

    def measure(
        self,
        name: str,
        open_fold: Callable[[int | None], NodePredictor],
        *,
        receive: Callable[[int | None], Receiver] | None = None,
        is_drawn: bool = True,
    ) -> MeasuredModel:
        """Measure a model on every fold, and average over the folds.

        Args:
            name: of the model.
            open_fold: returns the predictor of a fold; called when the fold is measured.
            receive: returns the receiver of a fold's predictions; None for no receiver.
            is_drawn: whether the model gets figures.
        """
        survey = join_surveys(self.surveys)
        shown = ShownCollector(choose_stride(survey), survey.example)
        classes, measured = ClassErrors(), []
        for number, fold in enumerate(self.folds):
            predictor = open_fold(fold)
            receiver = receive(fold) if receive else None
            scenes = self.surveys[number].scene_ids
            streamed = StreamedMeasurement(scenes, self.weights.of_split(number))
            for masked in stream_batches(
                self.data, self.split, fold=fold, vocabulary=predictor.vocabulary
            ):
                truth, found = read_truth(masked), predictor.expect(masked)
                streamed.add(truth, found)
                classes.add(truth, found)
                if is_drawn:
                    shown.add(truth, found)
                if receiver is not None:
                    receiver.add(found, masked)
                self.progress(len(masked))
            measured.append(streamed.finish())
        names = self.data.manifest.class_space.classes
        return MeasuredModel(
            self.weights.average(measured).bootstrap(),
            classes.rows(name, names),
            shown.finish() if is_drawn else None,
        )


MOST_SHOWN = 20_000  # nodes in figures: more cannot be told apart, and would fill memory


@dataclass(frozen=True, eq=False)
class Survey:
    """The masked buildings of a split, or of one fold."""

    scene_ids: tuple[str, ...]  # `[B]` of the buildings, in their order
    sizes: Floats  # `[B]` number of classified objects of each
    masked: int  # number of masked buildings; every draw counts
    counts: dict[str, int]  # `rooms`, `building`, `empty_inputs`, `empty_targets`: numbers of nodes

    @property
    def by_size(self) -> list[str]:
        """The buildings by size, the smallest first."""
        return [self.scene_ids[number] for number in np.argsort(self.sizes, kind="stable")]

    @property
    def example(self) -> str:
        """The building of median size, for the figures."""
        return self.by_size[len(self.scene_ids) // 2]


def stream_batches(
    data: Dataset, split: Split, *, fold: int | None, vocabulary: tuple[str, ...] = ()
) -> Iterator[MaskedBuildings]:
    """Yield the stored pairs of a split, at most `BATCH` masked buildings at a time."""
    for masked in stream_split(data, split, fold=fold, vocabulary=vocabulary):
        yield from masked.batches(BATCH)


def survey_split(data: Dataset, split: Split, *, fold: int | None) -> Survey:
    """Read the stored pairs of a split once, and count what is in them."""
    sizes: dict[str, float] = {}
    counts = dict.fromkeys(("rooms", "building", "empty_inputs", "empty_targets"), 0)
    number = 0
    for masked in stream_batches(data, split, fold=fold):
        truth = read_truth(masked)
        number += len(masked)
        buildings = int(truth.is_building.sum())
        found = {"rooms": len(truth.is_building) - buildings, "building": buildings}
        for name, nodes in (found | count_empty(truth)).items():
            counts[name] += nodes
        totals = masked.targets[masked.seen.starts[:-1]].sum(axis=1)
        sizes |= dict(zip(masked.seen.scene_ids, totals.astype(float).tolist(), strict=True))
    if not sizes:  # buildings with too many objects have no pairs
        raise DatasetError(f"{data.path}: no building of the split {split!r} has pairs")
    return Survey(tuple(sizes), np.array(list(sizes.values())), number, counts)


def join_surveys(parts: Sequence[Survey]) -> Survey:
    """Return the surveys of several folds, of different buildings, as one."""
    return Survey(
        tuple(scene for part in parts for scene in part.scene_ids),
        np.concatenate([part.sizes for part in parts]),
        sum(part.masked for part in parts),
        {name: sum(part.counts[name] for part in parts) for name in parts[0].counts},
    )


def choose_stride(survey: Survey, *, most: int = MOST_SHOWN) -> int:
    """Return k such that every k-th masked building together have at most `most` nodes."""
    return max(1, -(-(survey.counts["rooms"] + survey.counts["building"]) // most))
