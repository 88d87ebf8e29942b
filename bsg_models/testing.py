"""Test your own models and metrics: contracts to inherit from.

A subclass names a row of the registry, and pytest runs its tests (docs/extending.md). This
project's own rows pass the same contracts.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch

from bsg_data.arrays import Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.observation import Observation
from bsg_data.scene.connections import Connections
from bsg_data.scene.surroundings import Surroundings
from bsg_data.testing import write_example_dataset
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.catalogue import METRICS, find_value, head_value, name_value
from bsg_models.evaluation.measurement import Fold, Measured, measure_fold
from bsg_models.evaluation.metric import Weights
from bsg_models.evaluation.truth import NODE_SETS, Prediction, Truth
from bsg_models.inputs.graphs import read_split
from bsg_models.runs.checkpoint import load_checkpoint, restore_model, save_model
from bsg_models.runs.checkpoint_file import BEST
from bsg_models.training.count_gradients import as_network
from bsg_models.training.training import new_model
from bsg_models.zoo.config import RunConfig, find_config, read_config, validate_config, write_toml
from bsg_models.zoo.model import BeliefModel

_RTOL, _ATOL = 1e-4, 1e-5  # networks compute in float32


@cache
def _example() -> tuple[tempfile.TemporaryDirectory[str], Dataset]:
    """Return a dataset of small buildings, and the temporary folder that holds it."""
    folder = tempfile.TemporaryDirectory()
    return folder, Dataset.open(write_example_dataset(Path(folder.name)))


@cache
def _fit(name: str) -> tuple[RunConfig, BeliefModel]:
    """Return a row's configuration, and its model after `fit`; a network is not trained here."""
    data, config = _example()[1], find_config(name)
    model = new_model(config, data)
    model.fit(data, config.data)
    return config, model


def observe_building(
    rooms: Sequence[Sequence[int]], *, classes: int, vocabulary: tuple[str, ...]
) -> Observation:
    """Return an observation of one building, half of whose objects are hidden.

    Args:
        rooms: `[R, C]` seen counts of each room.
        classes: C.
        vocabulary: `[V]` categories outside the classes, of which none is seen.
    """
    seen = np.array(rooms, dtype=np.int64).reshape(-1, classes)
    inputs = np.vstack([seen.sum(axis=0, keepdims=True), seen])
    return Observation(
        scene_ids=("by hand",),
        starts=np.array([0, len(inputs)]),
        inputs=inputs,
        hidden_share=np.full(len(inputs), 0.5, dtype=np.float32),
        visited=np.ones(len(inputs), dtype=bool),
        withheld=np.zeros(inputs.shape, dtype=bool),
        vocabulary=vocabulary,
        unclassified=np.zeros((len(inputs), len(vocabulary)), dtype=np.int64),
        connections=Connections.of_pairs(()),
        surroundings=Surroundings.unknown(nodes=len(inputs)),
    )


class ModelContract:
    """The contract of every model."""

    name: ClassVar[str]  # of the model's row in `ZOO`, or of its entry point

    def test_losses_are_numbers(self) -> None:
        """Check that losses and gradients of a network are finite."""
        data, config = _example()[1], find_config(self.name)
        network = as_network(new_model(config, data))
        if network is None:
            return
        network.fit(data, config.data)
        read = read_split(data, "test", vocabulary=network.vocabulary)
        nodes = network.read(read.seen, read.targets)
        total, cells = network.validation_loss(nodes)
        assert np.isfinite(total)
        assert cells > 0
        network.train()
        loss = network.loss(nodes)
        assert loss.shape == ()
        assert torch.isfinite(loss)
        torch.autograd.backward(loss)
        assert any(parameter.grad is not None for parameter in network.parameters())

    def test_beliefs_are_numbers_and_inputs_stay(self) -> None:
        """Check counts of 0 or more, valid probabilities, and unchanged inputs."""
        model = _fit(self.name)[1]
        seen = read_split(_example()[1], "test", vocabulary=model.vocabulary).seen
        for observed in (seen, replace(seen, withheld=np.ones_like(seen.withheld))):
            beliefs = model.expect(observed)
            np.testing.assert_array_equal(beliefs.inputs, observed.inputs)
            assert beliefs.hidden.shape == observed.inputs.shape
            assert (beliefs.hidden >= 0).all()
            np.testing.assert_allclose(beliefs.expected, beliefs.inputs + beliefs.hidden)
            assert ((beliefs.presence >= 0) & (beliefs.presence <= 1)).all()

    def test_beliefs_about_a_building_do_not_depend_on_others(self) -> None:
        """Check that a building gets the same belief alone and among others."""
        model = _fit(self.name)[1]
        seen = read_split(_example()[1], "test", vocabulary=model.vocabulary).seen
        assert len(seen) > 1
        together = model.expect(seen).hidden
        for number in range(len(seen)):
            rows = slice(seen.starts[number], seen.starts[number + 1])
            alone = model.expect(seen.take([number])).hidden
            np.testing.assert_allclose(alone, together[rows], rtol=_RTOL, atol=_ATOL)

    def test_the_order_of_the_rooms_does_not_matter(self) -> None:
        """Check that a room gets the same belief at any position."""
        model = _fit(self.name)[1]
        classes, order = model.inputs.classes, [2, 0, 3, 1]
        rooms = np.random.default_rng(0).poisson(1.0, (4, classes))
        ordered, shuffled = (
            model.expect(
                observe_building(some.tolist(), classes=classes, vocabulary=model.vocabulary)
            ).hidden
            for some in (rooms, rooms[order])
        )
        np.testing.assert_allclose(shuffled[0], ordered[0], rtol=_RTOL, atol=_ATOL)
        np.testing.assert_allclose(shuffled[1:], ordered[1:][order], rtol=_RTOL, atol=_ATOL)

    def test_buildings_without_rooms_or_objects_get_an_answer(self) -> None:
        """Check for finite answers if there are no rooms or no objects."""
        model = _fit(self.name)[1]
        classes = model.inputs.classes
        for rooms in ([], [[0] * classes] * 2, [[7] * classes]):
            seen = observe_building(rooms, classes=classes, vocabulary=model.vocabulary)
            beliefs = model.expect(seen)
            assert np.isfinite(beliefs.log_probability(np.ones_like(beliefs.hidden))).all()

    def test_all_that_it_learns_is_in_its_checkpoint(self, tmp_path: Path) -> None:
        """Check that a checkpoint restores the same beliefs, to the last bit."""
        (config, model), data = _fit(self.name), _example()[1]
        save_model(model, config, data, tmp_path / BEST)
        checkpoint = load_checkpoint(tmp_path / BEST)
        restored = restore_model(tmp_path / BEST, checkpoint)
        assert checkpoint.header.config == config
        seen = read_split(data, "test", vocabulary=model.vocabulary).seen
        model.untaught = restored.untaught  # which the header has
        np.testing.assert_array_equal(restored.expect(seen).hidden, model.expect(seen).hidden)

    def test_its_configuration_is_written_and_read(self, tmp_path: Path) -> None:
        """Check that TOML restores the same configuration."""
        config, path = find_config(self.name), tmp_path / "config.toml"
        path.write_text(write_toml(config), "utf-8")
        assert validate_config(read_config(path), source="TOML") == config


class MetricContract:
    """The contract of every metric."""

    name: ClassVar[str]  # of the metric's row in `METRICS`, or of its entry point

    def prediction(self) -> Prediction:
        """Return two draws of three buildings with three rooms each, five classes."""
        rng = np.random.default_rng(0)
        targets = rng.poisson(1.5, (24, 5)).astype(float)
        truth = Truth(
            inputs=np.floor(targets * rng.random((24, 5))),
            targets=targets,
            is_building=np.arange(24) % 4 == 0,
            visited=np.arange(24) % 4 != 3,
            building=np.repeat([0, 1, 2], 8),
            draw=np.tile(np.repeat([0, 1], 4), 3),
            scene_ids=("a", "b", "c"),
        )
        hidden = poisson(rng.gamma(1.0, 1.0, targets.shape))
        return Prediction(truth, Expectation(truth.inputs, hidden))

    def test_it_has_the_values_that_it_says(self) -> None:
        """Check for a number per node set and part, over no more nodes than there are."""
        metric, prediction = METRICS[self.name], self.prediction()
        assert set(metric.over) <= set(NODE_SETS)
        found = _measure(self.name, [prediction], np.ones((3, 1)))
        assert list(found) == [name_value(self.name, *key) for key in metric.keys]
        for name, (values, nodes) in found.items():
            row, node_set, _ = find_value(name)
            assert row == metric
            assert 0 < nodes <= len(prediction.rows[node_set])
            assert np.isfinite(values).all()
            assert metric.label in head_value(name)

    def test_only_the_ratio_of_weights_counts(self) -> None:
        """Check that doubling all weights changes nothing."""
        weights = np.array([[1.0, 2.0], [3.0, 6.0], [2.0, 4.0]])
        for (once, twice), _ in _measure(self.name, [self.prediction()], weights).values():
            np.testing.assert_allclose(twice, once, rtol=1e-9, atol=1e-12)

    def test_batches_do_not_matter(self) -> None:
        """Check that a prediction in two batches gets the same values."""
        prediction = self.prediction()
        weights = np.array([[1, 2], [1, 0], [1, 1]])
        whole, parts = ([np.arange(24)], [np.arange(12, 24), np.arange(12)])
        found = [
            _measure(self.name, [_take_nodes(prediction, rows) for rows in some], weights)
            for some in (whole, parts)
        ]
        for one, other in zip(*(values.values() for values in found), strict=True):
            assert one.nodes == other.nodes
            np.testing.assert_allclose(one.weighted, other.weighted, rtol=1e-9, atol=1e-12)

    def test_a_building_that_counts_twice_is_there_twice(self) -> None:
        """Check that weights act as repetitions, as every bootstrap interval requires."""
        prediction = self.prediction()
        weighted = _measure(self.name, [prediction], np.array([[2.0], [0.0], [1.0]]))
        rows = np.concatenate([np.flatnonzero(prediction.truth.building == b) for b in (0, 0, 2)])
        taken = _take_nodes(prediction, rows)
        again = replace(taken.truth, building=np.repeat([0, 1, 2], 8))
        whole = Prediction(again, taken.expectation)
        repeated = _measure(self.name, [whole], np.ones((3, 1)))
        for name, (values, _) in weighted.items():
            np.testing.assert_allclose(repeated[name].weighted, values, rtol=1e-9, atol=1e-12)


def _measure(name: str, batches: Sequence[Prediction], weights: Weights) -> Measured:
    """Return a row of `METRICS` for the buildings of the first batch, under weights `[B, W]`."""
    fold = Fold(batches[0].truth.scene_ids, [{"": batch} for batch in batches])
    values = measure_fold(fold, weights)[""]
    return {value: values[value] for value in values if value.split("/")[1] == name}


def _take_nodes(prediction: Prediction, rows: Ints) -> Prediction:
    """Return some nodes of a prediction."""
    truth, beliefs = prediction.truth, prediction.expectation
    taken = replace(
        truth,
        inputs=truth.inputs[rows],
        targets=truth.targets[rows],
        is_building=truth.is_building[rows],
        visited=truth.visited[rows],
        building=truth.building[rows],
        draw=truth.draw[rows],
    )
    return Prediction(taken, Expectation(taken.inputs, beliefs.hidden_counts.take(rows)))
