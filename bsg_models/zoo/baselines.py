"""The baselines that keep a comparison honest: what was seen, what was seen doubled, the mean."""

from __future__ import annotations

import numpy as np
import torch
from torch_geometric.data import Data

from bsg_data.dataset.histograms import to_histograms
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation, from_hidden_counts
from bsg_models.inputs.graphs import Buildings
from bsg_models.zoo.config import DataConfig
from bsg_models.zoo.model import BeliefModel, share_of, to_array


class InputModel(BeliefModel):
    """What was seen is all there is: hidden = 0."""

    def predict(self, graphs: Data) -> Expectation:
        """Return an expectation of nothing hidden."""
        inputs = to_array(graphs.x)
        return from_hidden_counts(inputs, poisson(np.zeros_like(inputs)))


class DoubledModel(BeliefModel):
    """As much is hidden of each class as the mask's share says: hidden = input · f / (1 − f).

    At a fraction f of one half this doubles what was seen, hence the name. Normalised, it is the
    input itself.
    """

    def predict(self, graphs: Data) -> Expectation:
        """Return the input scaled up."""
        inputs, fraction = to_array(graphs.x), to_array(graphs.fraction)[:, None]
        return from_hidden_counts(
            inputs, poisson(inputs * fraction / np.maximum(1 - fraction, 1e-6))
        )


class TrainMeanModel(BeliefModel):
    """The mean histogram of the training rooms, and of the training buildings, for every input.

    Its raw totals are the mean; hidden = fraction · mean, since a uniform mask hides that share of
    the objects whatever is seen.
    """

    room_mean: torch.Tensor
    building_mean: torch.Tensor

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.register_buffer("room_mean", torch.zeros(classes, dtype=torch.float64))
        self.register_buffer("building_mean", torch.zeros(classes, dtype=torch.float64))

    def fit(self, data: Buildings, choice: DataConfig) -> None:
        """Average the histograms of the training buildings and of their rooms."""
        scenes = data.scenes_of("train", fold=choice.fold)
        histograms = [to_histograms(data.cells[scene]) for scene in scenes]
        rooms = np.concatenate([h[1:] for h in histograms])
        self.room_mean.copy_(torch.from_numpy(rooms.mean(axis=0)))
        self.building_mean.copy_(torch.from_numpy(np.mean([h[0] for h in histograms], axis=0)))

    def predict(self, graphs: Data) -> Expectation:
        """Return the mean, whatever was seen."""
        inputs, fraction = to_array(graphs.x), to_array(share_of(graphs))
        is_building = graphs.is_building.numpy()[:, None]
        mean = np.where(is_building, to_array(self.building_mean), to_array(self.room_mean))
        return Expectation(inputs, poisson(fraction * mean), mean)
