"""One model on the stored pairs of a split, some buildings at a time: metrics, classes, figures.

Nothing of a batch is kept but what the next steps need: sums, the cells that are ranked, and the
nodes that figures are drawn of.
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
    """What says something of masked buildings.

    Attributes:
        expect: of masked buildings, asked in the order of the stored pairs.
        vocabulary: categories outside the classes that it reads.
    """

    expect: Callable[[MaskedBuildings], Expectation]
    vocabulary: tuple[str, ...] = ()


class Receiver(Protocol):
    """Takes what is predicted, batch by batch."""

    def add(self, expectation: Expectation, masked: MaskedBuildings) -> None:
        """Take in some masked buildings."""


class MeasuredModel(NamedTuple):
    """What is found of one model.

    Attributes:
        bootstrap: every metric, and the same of every resample of the buildings.
        classes: a row a node set and class, as `ClassErrors.rows` gives them.
        shown: the nodes that its figures are drawn of; None if there are none.
    """

    bootstrap: Bootstrap
    classes: list[dict[str, Any]]
    shown: ShownNodes | None


def predict_by(model: BeliefModel) -> NodePredictor:
    """Return a model as a predictor."""
    return NodePredictor(lambda masked: predict_all(model, masked), model.vocabulary)


@dataclass(frozen=True, eq=False)
class Measuring:
    """The pairs that all models are measured on, and the weights that all meet.

    Attributes:
        data: an open dataset.
        split: to measure on.
        folds: that are measured one by one; (None,) of a dataset without folds.
        surveys: of each fold.
        weights: of the buildings of all folds.
        progress: called with the number of masked buildings that were measured, after each batch.
    """

    data: Dataset
    split: Split
    folds: tuple[int | None, ...]
    surveys: Sequence[Survey]
    weights: SplitWeights
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
            open_fold: returns what predicts a fold; asked when its turn comes.
            receive: returns what takes the predictions of a fold; None if nothing does.
            is_drawn: whether figures are drawn of it.
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
