"""Models by hand; the contract that all of them keep is proved in `test_testing.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from one_building import observe_building
from scipy import stats
from torch_geometric.nn import GCNConv

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.observation import stack
from bsg_models.belief.count_distribution import CountDistribution, negative_binomial
from bsg_models.inputs.folds import scenes_of
from bsg_models.training.training import new_model
from bsg_models.zoo.config import find_config
from bsg_models.zoo.gamma_poisson import (
    GammaPoissonConfig,
    GammaPoissonModel,
    fit_dispersion,
    fit_gamma_prior,
)
from bsg_models.zoo.gcn import CECIGCN, GCNConfig
from bsg_models.zoo.model import BeliefModel, ModelInputs
from bsg_models.zoo.room_sums import sum_rooms


def fitted(name: str, dataset: Path) -> BeliefModel:
    torch.manual_seed(0)
    data = Dataset.open(dataset)
    config = find_config(name)
    model = new_model(config, data)
    model.fit(data, config.data)
    return model.eval()


def test_input_and_doubled_by_hand(dataset: Path) -> None:
    inputs = [[4.0, 1.0], [3.0, 1.0]]
    assert (fitted("input", dataset).predict(observe_building(inputs)).hidden == 0).all()
    doubled = fitted("doubled", dataset)
    assert doubled.predict(observe_building(inputs)).expected.tolist() == [[8.0, 2.0], [6.0, 2.0]]
    assert doubled.predict(observe_building(inputs, hidden_share=0.75)).expected.tolist()[1] == [
        12.0,
        4.0,
    ]
    assert doubled.predict(observe_building(inputs, hidden_share=0.0)).expected.tolist() == inputs
    assert np.isfinite(
        doubled.predict(observe_building([[0.0, 0.0]], hidden_share=1.0)).hidden
    ).all()


def test_train_mean_is_the_mean_of_the_training_rooms_and_buildings(dataset: Path) -> None:
    data = Dataset.open(dataset)
    scenes = scenes_of(data, "train")
    found = fitted("train-mean", dataset).predict(observe_building([[0.0] * 45] * 3))
    rooms = np.concatenate([data.cells(scene)[1:] for scene in scenes])
    buildings = np.stack([data.cells(scene).sum(axis=0) for scene in scenes])
    np.testing.assert_allclose(found.totals[1], rooms.mean(axis=0))
    np.testing.assert_allclose(found.totals[0], buildings.mean(axis=0))
    np.testing.assert_allclose(found.hidden, found.totals / 2)


def test_the_gamma_prior_maximises_scipys_likelihood() -> None:
    counts = stats.nbinom(1.5, 1.5 / (1.5 + 2.0)).rvs(4000, random_state=0)
    a, b = fit_gamma_prior(np.unique(counts, return_counts=True))
    assert a / b == pytest.approx(counts.mean())

    def likelihood(shape: float) -> float:
        mean = counts.mean()
        return float(stats.nbinom.logpmf(counts, shape, shape / (shape + mean)).sum())

    assert likelihood(a) >= max(likelihood(0.97 * a), likelihood(1.03 * a))
    assert a == pytest.approx(1.5, rel=0.15)


def test_a_class_that_never_occurs_has_a_weak_prior() -> None:
    a, b = fit_gamma_prior((np.array([0]), np.array([50])))
    assert a / b == pytest.approx(0.01)


def test_gamma_poisson_by_hand() -> None:
    """Prior Gamma(2, 1), 3 seen of a mask of one half: posterior Gamma(5, 1.5), hidden mean 5/3."""
    model = GammaPoissonModel(GammaPoissonConfig(), ModelInputs(classes=1))
    model.shape.fill_(2.0)
    model.rate.fill_(1.0)
    found = model.predict(observe_building([[3.0], [3.0], [0.0]]))
    assert found.hidden[1, 0] == pytest.approx(0.5 * 5 / 1.5)
    assert found.hidden_counts.dispersions[0, 1, 0] == 5
    assert found.hidden[0, 0] == pytest.approx(found.hidden[1:].sum())


def test_gamma_poisson_is_the_posterior_of_its_own_model() -> None:
    """Among rooms drawn from the model with 3 objects seen, the hidden ones follow it."""
    rng = np.random.default_rng(0)
    rates = rng.gamma(2.0, 1 / 1.0, 200_000)
    there = rng.poisson(rates)
    seen = rng.binomial(there, 0.5)
    hidden = (there - seen)[seen == 3]
    model = GammaPoissonModel(GammaPoissonConfig(), ModelInputs(classes=1))
    model.shape.fill_(2.0)
    model.rate.fill_(1.0)
    found = model.predict(observe_building([[3.0], [3.0]]))
    distribution = [
        np.exp(found.log_probability(np.full((2, 1), float(n))))[1, 0] for n in range(8)
    ]
    np.testing.assert_allclose(
        np.bincount(hidden, minlength=8)[:8] / len(hidden), distribution, atol=0.01
    )


def test_the_sum_of_rooms_has_their_mean_and_variance() -> None:
    distribution = negative_binomial(
        np.array([[9.0], [2.0], [3.0], [5.0]]), np.array([[9.0], [1.0], [4.0], [2.0]])
    )
    seen = stack(
        [
            observe_building([[0], [0], [0]], hidden_share=0.75),
            observe_building([[4]], hidden_share=0.75),
        ]
    )
    found = sum_rooms(distribution, seen)
    assert found.mean[:3].ravel().tolist() == [5.0, 2.0, 3.0]
    assert found.variance[0, 0] == pytest.approx(2 + 2**2 / 1 + 3 + 3**2 / 4)
    assert found.mean[3, 0] == pytest.approx(4 * 0.75 / 0.25)  # without rooms: what was seen


def test_the_dispersion_maximises_scipys_likelihood() -> None:
    rng = np.random.default_rng(0)
    means = rng.gamma(2.0, 1.0, (4000, 1))
    counts = rng.poisson(rng.gamma(0.8, means / 0.8)).astype(float)
    (found,) = fit_dispersion(counts, means)

    def likelihood(r: float) -> float:
        return float(stats.nbinom.logpmf(counts, r, r / (r + means)).sum())

    assert likelihood(found) >= max(likelihood(0.98 * found), likelihood(1.02 * found))


def test_the_gcn_is_the_papers_layers() -> None:
    model = CECIGCN(GCNConfig(), ModelInputs(classes=45))
    assert [(c.in_channels, c.out_channels) for c in model.convolutions] == [
        (45, 64),
        (64, 64),
        (64, 64),
        (64, 64),
        (64, 45),
    ]
    assert len(model.blocks) == 4
    literal = CECIGCN(GCNConfig(last_layer="block"), ModelInputs(classes=45))
    assert len(literal.blocks) == 5
    assert [type(layer).__name__ for layer in model.blocks[0]] == ["BatchNorm1d", "ReLU", "Dropout"]


def test_one_layer_of_the_gcn_by_hand() -> None:
    """x′ = D^-½ (A + I) D^-½ x W (Kipf and Welling, eq. 2) on a building with two rooms."""
    model = CECIGCN(GCNConfig(depth=1), ModelInputs(classes=2))
    weight = torch.tensor([[1.0, 2.0], [0.0, 1.0]])
    convolution = model.convolutions[0]
    assert isinstance(convolution, GCNConv)
    with torch.no_grad():
        convolution.lin.weight.copy_(weight)
        convolution.bias.zero_()
    x = np.array([[4.0, 2.0], [3.0, 0.0], [1.0, 2.0]])
    adjacency = np.array([[1.0, 1, 1], [1, 1, 0], [1, 0, 1]])
    scale = np.diag(adjacency.sum(axis=1) ** -0.5)
    expected = scale @ adjacency @ scale @ x @ weight.numpy().T
    found = model(model.graph_of(observe_building(x.tolist())))
    np.testing.assert_allclose(found.detach().numpy(), expected, rtol=1e-5)


def test_the_gcn_normalises_once_what_pygs_layers_normalise_each() -> None:
    torch.manual_seed(0)
    model = CECIGCN(GCNConfig(depth=3, width=8, dropout=0.0), ModelInputs(classes=2)).eval()
    graph = model.graph_of(observe_building([[4, 2], [3, 0], [1, 2]]))
    x = graph.x
    for layer, convolution in enumerate(model.convolutions):
        pygs = GCNConv(convolution.in_channels, convolution.out_channels)
        pygs.load_state_dict(convolution.state_dict())
        x = pygs(x, graph.edge_index)
        if layer < len(model.blocks):
            x = model.blocks[layer](x)
    assert torch.equal(model(graph), x)


def test_the_gcn_has_no_negative_totals() -> None:
    torch.manual_seed(0)
    model = CECIGCN(GCNConfig(), ModelInputs(classes=45))
    assert (model.predict(observe_building([[1] * 45] * 4)).totals >= 0).all()


def test_a_building_of_tilted_rooms_has_what_any_of_them_has() -> None:
    """Its mean is the sum of the rooms', its P(0) their product, Poissons and mixtures too."""
    rng = np.random.default_rng(0)
    seen = observe_building([[0] * 6] * 5)
    means, r = rng.gamma(1.0, 1.0, (2, 5, 6)), rng.gamma(2.0, 1.0, (2, 5, 6)) + 0.05
    r[1, 2:] = np.inf
    means[:, :, 5] = 1e-14  # what no room has
    tilts = rng.normal(0, 1.5, (2, 2, 5, 6))
    tilts[:, :, :, 0] = [[[-4.0]], [[4.0]]]  # exactly one in every room
    distribution = CountDistribution(means, r, np.full((2, 5, 1), 0.5), tilts)
    found = sum_rooms(distribution, seen)
    np.testing.assert_allclose(found.mean[0], distribution.mean[1:].sum(axis=0), rtol=1e-6)
    none = (1 - distribution.presence[1:]).prod(axis=0)
    np.testing.assert_allclose(found.presence[0], 1 - none, atol=1e-9)
    np.testing.assert_array_equal(found.presence[1:], distribution.presence[1:])
