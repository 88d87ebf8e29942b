"""Baselines that every comparison includes: what was seen, what was seen doubled, the mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.dataset.histograms import to_histograms
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.inputs.folds import scenes_of
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.model import BeliefModel, ModelInputs
from bsg_models.zoo.settings import DataConfig, ModelConfig

if TYPE_CHECKING:
    from bsg_data.dataset.dataset import Dataset


class _InputModel(BeliefModel):
    """Predict hidden = 0."""

    by_seed = False

    def predict(self, seen: Observation) -> Expectation:
        """Return an expectation of nothing hidden."""
        inputs = seen.inputs.astype(np.float64)
        return Expectation(inputs, poisson(np.zeros_like(inputs)))


class _DoubledModel(BeliefModel):
    """Predict hidden = input · f / (1 − f) for each class, with f the hidden share.

    At f = 1/2 this doubles what was seen, hence the name. Normalised, it equals the input.
    """

    by_seed = False

    def predict(self, seen: Observation) -> Expectation:
        """Return the input scaled up."""
        inputs = seen.inputs.astype(np.float64)
        share = seen.hidden_share[:, None].astype(np.float64)
        return Expectation(inputs, poisson(inputs * share / np.maximum(1 - share, 1e-6)))


class _TrainMeanModel(BeliefModel):
    """Predict the mean histogram of the training rooms, and of the training buildings.

    Its raw totals are the mean; hidden = share · mean, because a uniform mask hides that share of
    the objects, whatever is seen.
    """

    by_seed = False
    room_mean: Floats  # [C]
    building_mean: Floats  # [C]

    def __init__(self, config: ModelConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.hold(room_mean=np.zeros(inputs.classes), building_mean=np.zeros(inputs.classes))

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Average the histograms of the training buildings and of their rooms."""
        scenes = scenes_of(data, "train", fold=choice.fold)
        rooms, buildings, of_rooms, of_buildings = np.zeros((4, len(self.room_mean)))
        for some in data.in_shards(scenes):
            for scene in some:
                histograms, known = to_histograms(data.cells(scene)), data.nameable(scene)
                rooms += (len(histograms) - 1) * known
                buildings += known
                of_rooms += histograms[1:].sum(axis=0)
                of_buildings += histograms[0]
        self.hold(
            room_mean=of_rooms / np.maximum(rooms, 1),
            building_mean=of_buildings / np.maximum(buildings, 1),
        )

    def predict(self, seen: Observation) -> Expectation:
        """Return the mean, whatever was seen."""
        is_building = seen.is_building[:, None]
        mean = np.where(is_building, self.building_mean, self.room_mean)
        return Expectation(seen.inputs.astype(np.float64), poisson(seen.cell_share * mean), mean)


INPUT = ZooRow(ModelConfig(family="input"), _InputModel, summary="Predict that nothing is hidden.")
DOUBLED = ZooRow(
    ModelConfig(family="doubled"),
    _DoubledModel,
    summary="Predict input / (1 − f), with f the hidden share: at one half, twice what was seen.",
)
TRAIN_MEAN = ZooRow(
    ModelConfig(family="train-mean"),
    _TrainMeanModel,
    summary="Predict the mean histogram of the training rooms, and of the training buildings.",
)
