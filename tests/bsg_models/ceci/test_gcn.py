"""The paper's network, beside what the paper writes and what PyG computes."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from configurations import configure
from conftest import REPOSITORY
from one_building import make_zoo_model, observe_building
from torch_geometric.nn import GCNConv

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_models.ceci.gcn import CECI
from bsg_models.ceci.masked_graphs import MaskedGraphs, to_graph
from bsg_models.ceci.network import Network
from bsg_models.training.buildings import TrainingBatches
from bsg_models.training.training import new_model
from bsg_models.zoo.config import find_config

SEEN = observe_building([[4, 2], [3, 0], [1, 2]])
TARGETS = np.array([[7, 2], [5, 0], [2, 2]])


def make(**settings: object) -> CECI:
    torch.manual_seed(0)
    model = make_zoo_model("ceci", classes=2, width=8, **settings).eval()
    assert isinstance(model, CECI)
    return model


def test_the_defaults_are_what_the_paper_says() -> None:
    config = find_config("ceci")
    training = config.training
    assert config.model.model_dump()["depth"] == 5
    assert (training.epochs, training.batch_size) == (5000, 24)
    assert (training.learning_rate, training.decay) == (0.01, 5e-6)
    assert (training.schedule, training.clip) == ("constant", None)
    data = config.data
    assert (data.masks, data.mask.strategy, data.mask.fraction) == ("fixed", "uniform", 0.5)


def test_a_recipe_is_the_papers_network_and_says_where_it_is_shorter() -> None:
    assert find_config("paper") == find_config("ceci")
    quick, paper = find_config("quick"), find_config("paper")
    assert (quick.name, paper.name) == ("ceci-60", "ceci")
    assert quick.training.epochs < paper.training.epochs
    assert quick.model_copy(update={"name": "ceci", "training": paper.training}) == paper


def test_five_convolutions_each_with_batch_normalisation_relu_and_dropout() -> None:
    kinds = ["GCNConv", "BatchNorm1d", "ReLU", "Dropout"]
    for last_layer, last in (("block", kinds), ("linear", ["GCNConv", "Identity"])):
        model = make(last_layer=last_layer)
        layers = [
            type(module).__name__
            for pair in zip(model.convolutions, model.blocks, strict=True)
            for part in pair
            for module in part.modules()
        ]
        assert [name for name in layers if name in {*kinds, "Identity"}] == kinds * 4 + last


@pytest.mark.parametrize("improved", [False, True])
@pytest.mark.parametrize("edges", [("up",), ("down",), ("up", "down")])
def test_a_layer_is_kipf_and_wellings(edges: tuple[str, ...], improved: bool) -> None:
    """D^-½ (A + I) D^-½ X W + b, by matrices; or with A + 2I."""
    model = make(depth=1, improved=improved)
    graph = to_graph(SEEN, edges=edges)  # type: ignore[arg-type]
    adjacency = (1 + improved) * np.eye(3)
    for source, target in graph.edge_index.T.tolist():
        adjacency[target, source] += 1
    scale = np.diag(adjacency.sum(axis=1) ** -0.5)
    layer = model.convolutions[0]
    weight, bias = (one.detach().double().numpy() for one in (layer.lin.weight, layer.bias))
    by_hand: Floats = scale @ adjacency @ scale @ SEEN.inputs @ weight.T + bias
    np.testing.assert_allclose(model(graph).detach().numpy(), by_hand, rtol=1e-5, atol=1e-6)


def test_it_answers_what_layers_of_pyg_answer_that_normalise_themselves() -> None:
    model = make()
    graph = to_graph(SEEN, edges=("up",))
    x = graph.x
    for convolution, block in zip(model.convolutions, model.blocks, strict=True):
        pygs = GCNConv(convolution.in_channels, convolution.out_channels, improved=True)
        pygs.load_state_dict(convolution.state_dict())
        x = block(pygs(x, graph.edge_index, torch.ones(graph.num_edges)))
    torch.testing.assert_close(model(graph), x)


def test_the_loss_is_the_mean_squared_error_of_whole_histograms() -> None:
    model = make()
    graph = model.read(SEEN, TARGETS)
    errors = (model(graph).detach().numpy() - TARGETS) ** 2
    assert model.loss(graph).item() == pytest.approx(errors.mean())
    clipped = (model(graph).detach().numpy().clip(min=0) - TARGETS) ** 2
    total, cells = model.validation_loss(graph)
    assert (total, cells) == (pytest.approx(clipped.sum()), 6)
    unnamed = TARGETS.copy()
    unnamed[:, 1] = -1  # the source has no word for the second class
    assert model.loss(model.read(SEEN, unnamed)).item() == pytest.approx(errors[:, 0].mean())


@pytest.mark.parametrize("last_layer", ["linear", "block"])
def test_a_building_without_rooms_may_be_a_batch_of_its_own(last_layer: str) -> None:
    """One node has no variance: it is normalised as in an answer, and changes no average."""
    model = make(last_layer=last_layer, dropout=0.0)
    lone = model.read(observe_building([[4, 2]]), TARGETS[:1])
    answer, before = model(lone), model.state()
    torch.testing.assert_close(model.train()(lone), answer)
    model.loss(lone).backward()  # type: ignore[no-untyped-call]
    assert all((model.state()[name] == values).all() for name, values in before.items())


@pytest.mark.parametrize(("masks", "number"), [("fixed", 4), ("fresh", 1)])
def test_epochs_are_all_buildings_in_an_order_of_their_own(
    masks: str, number: int, dataset: Path
) -> None:
    """Fixed masks come again in another order; fresh ones are others each epoch."""
    data = Dataset.open(dataset)
    config = configure("ceci", f"data.masks={masks}", "training.batch_size=3", "model.width=4")
    batches = TrainingBatches(config, data, network=new_model(config, data))  # type: ignore[arg-type]

    def epoch(which: int) -> list[list[float]]:
        graphs = list(batches.of(which))
        assert len(graphs) == batches.steps
        starts = [[*graph.is_building.nonzero().flatten(), len(graph.x)] for graph in graphs]
        return [
            graph.x[slice(*ends)].flatten().tolist()
            for graph, rows in zip(graphs, starts, strict=True)
            for ends in pairwise(rows)
        ]

    first, second = epoch(1), epoch(2)
    assert len(first) == number * len(data.splits["train"])
    assert first != second
    assert (sorted(first) == sorted(second)) == (masks == "fixed")
    assert epoch(1) == first


def test_the_paper_in_code_is_at_most_300_lines_of_public_pyg() -> None:
    files = (REPOSITORY / "bsg_models" / "ceci").glob("*.py")
    assert sum(len(path.read_text("utf-8").splitlines()) for path in files) <= 300
    for ours in (CECI, Network, MaskedGraphs):
        hidden = {name for name in vars(ours) if name.startswith("_") and not name.endswith("__")}
        for base in ours.__mro__:
            if base.__module__.startswith("torch"):
                assert not hidden & vars(base).keys(), base
