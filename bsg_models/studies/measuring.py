"""Measure one model on the stored pairs of a split, batch by batch: metrics, classes, figures.

Only the sums, the ranked cells and the nodes for figures are kept of a batch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.evaluation.class_errors import ClassErrors
from bsg_models.evaluation.measurement import (
    SplitWeights,
    StreamedMeasurement,
    predict_all,
    read_truth,
)
from bsg_models.evaluation.shown_nodes import ShownCollector, ShownNodes
from bsg_models.inputs.folds import Split
from bsg_models.studies.survey import Survey, choose_stride, join_surveys, stream_batches
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
