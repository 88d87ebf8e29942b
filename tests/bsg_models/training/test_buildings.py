from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from configurations import configure
from torch.utils.data import DataLoader

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import MaskedBuildings, sample_masked, vary_fractions
from bsg_models.inputs.folds import scenes_of
from bsg_models.inputs.graphs import read_split
from bsg_models.training.buildings import TrainingNodes
from bsg_models.training.count_gradients import CountGradients, as_network
from bsg_models.zoo.model import make_model


def names(masked: MaskedBuildings) -> list[tuple[str, int]]:
    return list(zip(masked.seen.scene_ids, masked.draws.tolist(), strict=True))


def same(one: MaskedBuildings, other: MaskedBuildings) -> bool:
    a, b = one.seen, other.seen
    arrays = ("starts", "inputs", "hidden_share", "visited", "withheld", "unclassified")
    return (
        names(one) == names(other)
        and all(np.array_equal(getattr(a, name), getattr(b, name)) for name in arrays)
        and np.array_equal(a.connections.pairs, b.connections.pairs)
        and np.array_equal(a.surroundings.labels, b.surroundings.labels)
        and np.array_equal(one.targets, other.targets)
    )


@pytest.mark.parametrize("masks", ["fresh", "fixed"])
def test_batches_come_as_torch_would_load_them(dataset: Path, masks: str) -> None:
    data, vocabulary = Dataset.open(dataset), ("wall", "floor", "curtain")
    mask = 'data.mask={strategy="uniform"}' if masks == "fixed" else "data.mask.withhold=0.0"
    config = configure("universal", f"data.masks={masks}", mask, "training.batch_size=4")
    choice = config.data
    whole = (
        read_split(data, "train", vocabulary=vocabulary)
        if masks == "fixed"
        else sample_masked(
            data,
            scenes_of(data, "train"),
            mask=vary_fractions(choice.mask, choice.fractions, 3, 10),
            draw=3,
            vocabulary=vocabulary,
        )
    )
    order = torch.Generator().manual_seed(config.seed_of(3))
    numbers: DataLoader[int] = DataLoader(
        range(len(whole)),  # type: ignore[arg-type]
        batch_size=4,
        shuffle=True,
        generator=order,
        collate_fn=list,
    )
    model = make_model(config, classes=45, vocabulary=vocabulary)
    network = as_network(model)
    assert isinstance(network, CountGradients)
    buildings = TrainingNodes(config, data, network=network)
    batches = list(buildings.masked(3))
    assert buildings.steps == len(batches) == -(-len(whole) // 4)
    for some, chosen in zip(batches, numbers, strict=True):
        assert same(some, whole.take(chosen))
