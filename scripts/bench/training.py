"""Measure what a training step takes with its data beside a step of a plain network.

    python scripts/bench/training.py

Ours: an epoch on fresh masks, with all of its sampling, divided by its steps. Theirs: a network
of dense layers of the same widths, with the same norms, activations and dropout, on as many random
rows as a batch has nodes, its loss the mean squared error, its optimiser fused. It knows of no
rooms, messages, masks or counts: what it takes is what the numbers alone take.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from itertools import count, pairwise
from pathlib import Path
from typing import cast

import torch
from synthetic import build_synthetic
from timing import Speed, print_speeds, time_both
from torch import nn

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.recipes import SplitRecipe
from bsg_models.training.buildings import TrainingBuildings
from bsg_models.training.epochs import GradientSteps
from bsg_models.training.ranks import Ranks
from bsg_models.training.training import new_model
from bsg_models.zoo.config import RunConfig, find_config
from bsg_models.zoo.gcn import GCNConfig
from bsg_models.zoo.model import Network
from bsg_models.zoo.node_features import NetworkConfig
from bsg_models.zoo.sage import CECISAGE
from bsg_models.zoo.threads import one_thread

BUILDINGS, REPEATS = 145, 7
TARGETS = {"ceci-gcn": 2.5, "universal": 3.0}


def measure() -> Iterator[Speed]:
    """Yield what a step of each network takes, both ways."""
    with tempfile.TemporaryDirectory() as folder, one_thread():
        path = build_synthetic(Path(folder), scenes=BUILDINGS).path
        split_dataset(path, SplitRecipe())
        data = Dataset.open(path)
        for name, target in TARGETS.items():
            yield measure_step(name, data, target=target)


def measure_step(name: str, data: Dataset, *, target: float) -> Speed:
    """Return what a step of a network of the zoo takes."""
    config = find_config(name)
    model = cast(Network, new_model(config, data))
    model.fit(data, config.data)
    buildings = TrainingBuildings(config, data, vocabulary=model.vocabulary)
    steps = GradientSteps(model, config, device=torch.device("cpu"), ranks=Ranks())
    plain = plain_step(make_plain(model), config, rows=count_rows(data) // buildings.steps)
    epoch = count(1)
    ours, theirs = time_both(
        lambda: steps.train_epoch(buildings, next(epoch)),
        lambda: [plain() for _ in range(buildings.steps)],
        repeats=REPEATS,
    )
    return Speed(
        what=f"a training step with its data, `{name}`",
        against="a plain network of the same widths and batch, fused optimiser",
        ours_s=ours / buildings.steps,
        theirs_s=theirs / buildings.steps,
        target=target,
    )


def count_rows(data: Dataset) -> int:
    """Return the number of nodes of the training buildings."""
    return sum(len(data.cells(scene)) for scene in data.splits["train"])


def make_plain(model: Network) -> nn.Sequential:
    """Return the dense layers of a network, with what stands between them, and nothing else."""
    settings, classes = model.config, model.inputs.classes
    if isinstance(settings, GCNConfig):
        widths = [classes, *[settings.width] * (settings.depth - 1)]
        layers = [_gcn_layer(a, b, settings.dropout) for a, b in pairwise(widths)]
        return nn.Sequential(*layers, nn.Linear(widths[-1], classes))
    assert isinstance(model, CECISAGE)
    assert isinstance(settings, NetworkConfig)
    width = settings.width
    return nn.Sequential(
        nn.Dropout(settings.dropout / 2),
        nn.Linear(model.features.width, width),
        nn.SiLU(),
        *(_sage_layer(width, settings.dropout) for _ in range(settings.depth)),
        nn.Linear(width, (2 + settings.tilted) * classes),
    )


def _gcn_layer(before: int, after: int, dropout: float) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(before, after), nn.BatchNorm1d(after), nn.ReLU(), nn.Dropout(dropout)
    )


def _sage_layer(width: int, dropout: float) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(width, width), nn.LayerNorm(width), nn.SiLU(), nn.Dropout(dropout)
    )


def plain_step(network: nn.Sequential, config: RunConfig, *, rows: int) -> Callable[[], None]:
    """Return what takes a step of a plain network on random rows."""
    optimiser = torch.optim.AdamW(
        network.parameters(), lr=config.training.learning_rate, fused=True
    )
    inputs = next(layer.in_features for layer in network.modules() if isinstance(layer, nn.Linear))
    x = torch.randn(rows, inputs)
    y = torch.randn(rows, network[-1].out_features)

    def step() -> None:
        optimiser.zero_grad()
        nn.functional.mse_loss(network(x), y).backward()
        optimiser.step()

    return step


if __name__ == "__main__":
    print_speeds(measure())
