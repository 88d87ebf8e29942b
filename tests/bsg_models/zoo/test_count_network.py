"""Networks of hidden counts: features, head and loss by hand, and what each option does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from scipy import stats
from torch_geometric.data import Data

from bsg_data.errors import MismatchError
from bsg_data.recipes import MaskRecipe
from bsg_models.errors import TrainingError
from bsg_models.inputs.graphs import MaskedGraphs, connect, open_dataset
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST, LAST
from bsg_models.training.training import new_model, train_run
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import RunConfig, override, validate_config
from bsg_models.zoo.count_network import CountNetwork, PriorHead, cell_loss
from bsg_models.zoo.families import NetworkConfig
from bsg_models.zoo.gamma_poisson import GammaPoissonModel
from bsg_models.zoo.node_features import NodeFeatures

NETWORKS = [name for name in ZOO if isinstance(ZOO[name].model, NetworkConfig)]
SMALL = ("model.width=8", "model.embedding=4", "training.epochs=4", "training.validate_every=2")


def configure(name: str, *settings: str) -> RunConfig:
    tables = override(ZOO[name].model_dump(mode="json"), [*SMALL, *settings])
    return validate_config(tables, source="test")


def building(
    counts: list[list[float]], *, others: list[list[float]], visited: list[bool], share: list[float]
) -> Data:
    nodes = len(counts)
    return Data(
        x=torch.tensor(counts),
        y=torch.tensor(counts),
        others=torch.tensor(others),
        edge_index=connect(nodes, ("up", "down")),
        is_building=torch.arange(nodes) == 0,
        visited=torch.tensor(visited),
        fraction=torch.tensor(share),
    )


def test_the_head_is_shrinkage_with_a_prior_of_its_own() -> None:
    """With mean m and shape r everywhere it is the Gamma-Poisson model of a = r, b = r / m."""
    head = PriorHead(NetworkConfig(width=4), 2).eval()
    head.start(torch.tensor([2.0, 0.5]))
    with torch.no_grad():
        head.shape.bias.copy_(torch.log(torch.tensor([3.0, 0.7])))
    graphs = building(
        [[9.0, 1.0], [3.0, 0.0], [6.0, 1.0], [0.0, 0.0]],
        others=[[], [], [], []],
        visited=[True, True, True, False],
        share=[0.5, 0.5, 0.2, 1.0],
    )
    mean, dispersion = head(torch.randn(4, 4), graphs)
    model = GammaPoissonModel(2)
    model.shape.copy_(torch.tensor([3.0, 0.7]))
    model.rate.copy_(torch.tensor([3.0 / 2.0, 0.7 / 0.5]))
    expected = model.predict(graphs)
    np.testing.assert_allclose(mean[1:].detach().numpy(), expected.hidden[1:], rtol=1e-5)
    np.testing.assert_allclose(
        dispersion[1:].detach().numpy(), expected.hidden_counts.dispersions[0, 1:], rtol=1e-5
    )
    assert mean[3].tolist() == pytest.approx([2.0, 0.5])  # nothing seen: the prior


@pytest.mark.parametrize("likelihood", ["mse", "poisson", "negative-binomial"])
def test_losses_are_scipys(likelihood: str) -> None:
    rng = np.random.default_rng(0)
    hidden = rng.poisson(2.0, (5, 3)).astype(float)
    mean, r = rng.gamma(2.0, 1.0, (5, 3)), rng.gamma(2.0, 1.0, (5, 3))
    expected = {
        "mse": (mean - hidden) ** 2,
        "poisson": -stats.poisson.logpmf(hidden, mean),
        "negative-binomial": -stats.nbinom.logpmf(hidden, r, r / (r + mean)),
    }[likelihood]
    found = cell_loss(*map(torch.from_numpy, (hidden, mean, r)), likelihood=likelihood)  # type: ignore[arg-type]
    np.testing.assert_allclose(found.numpy(), expected, rtol=1e-6)


def test_features_by_hand() -> None:
    """Building with three rooms, the last unvisited; one class, two other categories."""
    config = NetworkConfig(embedding=2)
    features = NodeFeatures(config, 1, 2).eval()
    with torch.no_grad():
        features.embedding.weight.copy_(torch.tensor([[1.0, 0.0], [0.0, 10.0]]))
    graphs = building(
        [[3.0], [3.0], [0.0], [0.0]],
        others=[[1.0, 5.0], [1.0, 0.0], [0.0, 5.0], [0.0, 0.0]],
        visited=[True, True, True, False],
        share=[0.5, 0.5, 0.5, 1.0],
    )
    found = features(graphs).detach().numpy()
    assert found.shape == (4, features.width)
    log3, rooms = np.log(4.0), np.log(4.0)
    # log count, presence, log total | odds, visited | embedding | building's log count,
    # siblings: presence and embedding, log rooms, is building
    first = [log3, 1, log3, 0, 1, 1, 0, log3, 0, 0, 10, rooms, 0]
    second = [0, 0, 0, 0, 1, 0, 10, log3, 1, 1, 0, rooms, 0]
    unseen = [0, 0, 0, np.log(49) / 2, 0, 0, 0, log3, 0.5, 0.5, 5, rooms, 0]
    np.testing.assert_allclose(found[1:], [first, second, unseen], rtol=1e-5)
    assert found[0, -1] == 1


@pytest.mark.parametrize(
    ("reads", "changed"),
    [
        ("mask", ("fraction", "visited")),
        ("building", ("x",)),
        ("categories", ("others",)),
    ],
)
def test_a_network_reads_what_it_is_told_to_and_nothing_else(
    reads: str, changed: tuple[str, ...]
) -> None:
    config = NetworkConfig(reads=(reads,), embedding=3)  # type: ignore[arg-type]
    counts, others = [[4.0, 1.0], [4.0, 0.0], [0.0, 1.0]], [[2.0], [0.0], [2.0]]
    graphs = building(counts, others=others, visited=[True] * 3, share=[0.5] * 3)
    other = building(
        [[4.0, 3.0], [4.0, 0.0], [0.0, 3.0]],
        others=[[1.0], [1.0], [0.0]],
        visited=[True, False, True],
        share=[0.5, 1.0, 0.5],
    )
    features = NodeFeatures(config, 2, 1).eval()
    for key in ("fraction", "visited", "x", "others"):
        mixed = graphs.clone()
        mixed[key] = other[key]
        same = torch.equal(features(graphs)[1], features(mixed)[1])
        assert same == (key not in changed), key


@pytest.mark.slow
@pytest.mark.parametrize("name", NETWORKS)
def test_every_network_learns_and_is_saved_and_loaded_alike(
    name: str, dataset: Path, tmp_path: Path
) -> None:
    """On buildings that are alike, it soon beats what it started as: the mean room."""
    settings = ("training.epochs=80", "training.learning_rate=0.02", "model.dropout=0.0")
    reports = list(train_run(configure(name, *settings), dataset, tmp_path / "run"))
    assert reports[-1].train_loss < 0.7 * reports[0].train_loss
    checkpoint = load_checkpoint(tmp_path / "run" / BEST)
    model = restore_model(tmp_path / "run" / BEST, checkpoint)
    assert model.vocabulary == checkpoint.header.vocabulary
    assert "wall" in model.vocabulary
    assert checkpoint.header.calibrated


@pytest.mark.parametrize("likelihood", ["mse", "poisson", "negative-binomial"])
def test_a_likelihood_is_the_law_that_is_given(
    likelihood: str, dataset: Path, tmp_path: Path
) -> None:
    config = configure("deepsets", f"model.likelihood={likelihood}", "model.calibrate=false")
    list(train_run(config, dataset, tmp_path / "run"))
    model = restore_model(tmp_path / "run" / BEST, load_checkpoint(tmp_path / "run" / BEST))
    graphs = MaskedGraphs.stored(dataset, "test", vocabulary=model.vocabulary)
    distribution = model.predict(graphs[0]).hidden_counts.take(np.array([1, 2]))
    assert np.isfinite(distribution.dispersions).all() == (likelihood == "negative-binomial")


def test_an_svd_embedding_is_numpys() -> None:
    present = np.random.default_rng(0).random((60, 7)) < [0.9, 0.7, 0.5, 0.3, 0.3, 0.2, 0.1]
    features = NodeFeatures(NetworkConfig(embed="svd", embedding=3), 2, 7)
    features.fit([present[:20], present[20:]])
    u, s, _ = np.linalg.svd(present.astype(float), full_matrices=False)
    found = present @ features.embedding.weight.detach().numpy().T
    for k in range(3):
        expected = u[:, k] * s[k] / (u[:, k] * s[k]).std()
        np.testing.assert_allclose(np.abs(found[:, k]), np.abs(expected), atol=1e-4)


def test_an_svd_embedding_stays_as_it_is(dataset: Path, tmp_path: Path) -> None:
    config = configure("ceci-sage", "model.embed=svd")
    data = open_dataset(dataset)
    model = new_model(config, data)
    assert isinstance(model, CountNetwork)
    model.fit(data, config.data)
    for report in train_run(config, dataset, tmp_path / "run"):
        if report.epoch == 2:
            break
    list(train_run(config, dataset, tmp_path / "run", resume=True))
    trained = load_checkpoint(tmp_path / "run" / LAST).state_of("model")
    torch.testing.assert_close(
        trained["features.embedding.weight"], model.features.embedding.weight.detach()
    )


def test_a_falling_learning_rate_cannot_be_made_longer(dataset: Path, tmp_path: Path) -> None:
    list(train_run(configure("deepsets"), dataset, tmp_path / "run"))
    longer = configure("deepsets", "training.epochs=9")
    with pytest.raises(TrainingError, match="cannot be made longer"):
        list(train_run(longer, dataset, tmp_path / "run", resume=True))


def test_a_stopped_network_resumes_to_the_same_weights(dataset: Path, tmp_path: Path) -> None:
    config = configure("ceci-sage", "training.epochs=6")
    list(train_run(config, dataset, tmp_path / "whole"))
    for report in train_run(config, dataset, tmp_path / "stopped"):
        if report.epoch == 3:
            break
    list(train_run(config, dataset, tmp_path / "stopped", resume=True))
    a, b = (load_checkpoint(tmp_path / name / BEST) for name in ("whole", "stopped"))
    assert a.header == b.header
    assert all(torch.equal(t, b.tensors[name]) for name, t in a.tensors.items())


def test_what_is_seen_of_other_categories_is_masked_too(dataset: Path) -> None:
    """At share 1 − f of them in uniform masks, none of an unvisited room, the same in all draws."""
    vocabulary = ("ceiling", "floor", "wall")
    data = open_dataset(dataset)
    whole = MaskedGraphs.fresh(
        data, "train", mask=MaskRecipe(fraction=0.0), draw=0, vocabulary=vocabulary
    )
    half = MaskedGraphs.fresh(data, "train", mask=MaskRecipe(), draw=0, vocabulary=vocabulary)
    for a, b in zip(whole, half, strict=True):
        assert (b.others <= a.others).all()
        assert (b.others[0] == b.others[1:].sum(dim=0)).all()
        assert (a.others[1:, 1:] == 1).all()  # every room of the fixture has a floor and a wall
    seen = sum(float(graph.others[0].sum()) for graph in half)
    total = sum(float(graph.others[0].sum()) for graph in whole)
    assert 0.3 < seen / total < 0.7
    rooms = MaskRecipe(strategy="rooms")
    for graph in MaskedGraphs.fresh(data, "train", mask=rooms, draw=1, vocabulary=vocabulary):
        unvisited = ~graph.visited
        assert unvisited.any()
        assert (graph.others[unvisited] == 0).all()
        assert (graph.fraction[unvisited] == 1).all()
        assert (graph.fraction[graph.visited & ~graph.is_building] == 0).all()
    narrow = MaskedGraphs.fresh(data, "train", mask=MaskRecipe(), draw=0, vocabulary=("wall",))
    for a, b in zip(half, narrow, strict=True):  # a mask does not depend on who reads it
        assert torch.equal(a.others[:, [2]], b.others)


def test_the_fraction_varies_from_mask_to_mask_and_not_from_run_to_run(dataset: Path) -> None:
    def shares(draw: int) -> list[float]:
        graphs = MaskedGraphs.fresh(
            dataset, "train", mask=MaskRecipe(), draw=draw, fractions=(0.1, 0.9)
        )
        return [float(graph.fraction[0]) for graph in graphs]

    assert shares(0) == shares(0) != shares(1)
    assert len(set(shares(0))) > 3
    assert all(0.1 <= share <= 0.9 for share in shares(0))


def test_a_graph_without_other_categories_gets_an_answer_and_one_of_others_an_error(
    dataset: Path,
) -> None:
    data = open_dataset(dataset)
    model = new_model(configure("ceci-sage"), data).eval()
    (graph,) = MaskedGraphs.stored(data, "test", vocabulary=model.vocabulary)[:1]
    nothing = graph.clone()
    nothing.others = torch.zeros_like(graph.others)
    del graph.others
    np.testing.assert_array_equal(model.predict(graph).hidden, model.predict(nothing).hidden)
    graph.others = torch.ones(len(graph.x), 7)
    with pytest.raises(MismatchError, match=r"make them with vocabulary=model\.vocabulary"):
        model.predict(graph)
    narrow = new_model(configure("ceci-sage", "data.min_scenes=99"), data)
    assert narrow.vocabulary == ()
    assert np.isfinite(narrow.predict(MaskedGraphs.stored(data, "test")[0]).hidden).all()


def test_a_batch_without_rooms_has_no_loss(dataset: Path) -> None:
    model = new_model(configure("deepsets"), open_dataset(dataset))
    alone = building([[3.0] * 45], others=[[]], visited=[True], share=[0.5])
    loss = model.loss(alone)
    assert loss.item() == 0
    loss.backward()  # type: ignore[no-untyped-call]
