"""Networks of hidden counts: features, head and loss by hand, and what each option does."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from one_building import observe_building
from scipy import stats
from torch import nn
from torch_geometric.data import Data
from torch_geometric.nn import GCNConv, SAGEConv

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import MismatchError
from bsg_data.observation.masked_buildings import sample_masked
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.surroundings import BUILDING_KINDS, Surroundings
from bsg_models.belief.count_distribution import negative_binomial
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.inputs.graphs import read_split, to_graph
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST, LAST
from bsg_models.training.training import new_model, train_run
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import RunConfig, find_config, override, validate_config
from bsg_models.zoo.count_network import CountNetwork, Posterior, PriorHead, cell_loss
from bsg_models.zoo.gamma_poisson import GammaPoissonConfig, GammaPoissonModel
from bsg_models.zoo.gcn import NormalisedConv
from bsg_models.zoo.model import ModelInputs, to_array
from bsg_models.zoo.node_features import NetworkConfig, NodeFeatures, ShownDropout
from bsg_models.zoo.sage import MeanConv

NETWORKS = [name for name in ZOO if isinstance(ZOO[name].config, NetworkConfig)]
SMALL = ("model.width=8", "model.embedding=4", "training.epochs=4", "training.validate_every=2")


def configure(name: str, *settings: str) -> RunConfig:
    tables = override(find_config(name).model_dump(mode="json"), [*SMALL, *settings])
    return validate_config(tables, source="test")


def building(
    counts: list[list[float]], *, others: list[list[float]], visited: list[bool], share: list[float]
) -> Data:
    categories = tuple(f"category {number}" for number in range(len(others[0])))
    seen = observe_building(
        counts, hidden_share=share, visited=visited, others=others, vocabulary=categories
    )
    return to_graph(seen, edges=("up", "down"), targets=seen.inputs)


def test_the_head_is_shrinkage_with_a_prior_of_its_own() -> None:
    """With mean m and shape r everywhere it is the Gamma-Poisson model of a = r, b = r / m."""
    head = PriorHead(NetworkConfig(width=4), 2).eval()
    head.start(torch.tensor([2.0, 0.5]))
    tilts = torch.tensor([[0.5, -0.5], [1.0, 0.3]])
    with torch.no_grad():
        head.shape.bias.copy_(torch.log(torch.tensor([3.0, 0.7])))
        head.tilt.bias.copy_(tilts.flatten())
    seen = observe_building(
        [[9, 1], [3, 0], [6, 1], [0, 0]],
        hidden_share=[0.5, 0.5, 0.2, 1.0],
        visited=[True, True, True, False],
    )
    posterior = head(torch.randn(4, 4), to_graph(seen, edges=("up", "down")))
    model = GammaPoissonModel(GammaPoissonConfig(tilted=2), ModelInputs(classes=2))
    model.tilts.copy_(tilts)
    model.shape.copy_(torch.tensor([3.0, 0.7]))
    model.rate.copy_(torch.tensor([3.0 / 2.0, 0.7 / 0.5]))
    expected = model.predict(seen).hidden_counts
    found = [to_array(part) for part in (posterior.mean, posterior.dispersion)]
    np.testing.assert_allclose(found[0][1:], expected.means[0, 1:], rtol=1e-5)
    np.testing.assert_allclose(found[1][1:], expected.dispersions[0, 1:], rtol=1e-5)
    assert expected.tilts is not None
    for found_tilt, tilt in zip(posterior.tilts, expected.tilts[:, 0, 1:], strict=True):
        np.testing.assert_allclose(to_array(found_tilt)[1:], tilt, rtol=1e-5)
    assert found[0][3].tolist() == pytest.approx([2.0, 0.5])  # nothing seen: the prior


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
    counts, *parts = map(torch.from_numpy, (hidden, mean, r))
    found = cell_loss(counts, Posterior(*parts, []), likelihood=likelihood)  # type: ignore[arg-type]
    np.testing.assert_allclose(found.numpy(), expected, rtol=1e-6)


def test_the_loss_of_tilted_counts_is_their_log_probability() -> None:
    rng = np.random.default_rng(0)
    hidden = rng.poisson(1.0, (6, 3)).astype(float)
    mean, r, tilts = rng.gamma(2, 1, (6, 3)), rng.gamma(2, 1, (6, 3)), rng.normal(0, 1, (2, 6, 3))
    expected = replace(negative_binomial(mean, r), tilts=tilts[:, None]).log_probability(hidden)
    counts, *parts = map(torch.from_numpy, (hidden, mean, r))
    posterior = Posterior(*parts, list(torch.from_numpy(tilts)))
    found = cell_loss(counts, posterior, likelihood="negative-binomial")
    np.testing.assert_allclose(found.numpy(), -expected, rtol=1e-9)


def test_dropout_leaves_what_is_told_of_the_mask() -> None:
    features = torch.ones(50, 8)
    dropped = ShownDropout(0.5, slice(2, 5)).train()(features)
    assert (dropped[:, 2:5] == 1).all()
    assert set(dropped[:, [0, 1, 5, 6, 7]].unique().tolist()) == {0.0, 2.0}
    assert torch.equal(ShownDropout(0.5, slice(2, 5)).eval()(features), features)


def test_surroundings_by_hand() -> None:
    """Two rooms: one of 12 m² and known kind, one of which nothing is known."""
    config = NetworkConfig(reads=("size", "labels", "kind", "source"))
    features = NodeFeatures(config, 1, 0)
    labels = list_room_labels()
    around = Surroundings.of_rooms(
        [12 * math.e, None], ["kitchen", None], building_kind="office", source="behavior"
    )
    seen = replace(observe_building([[1.0], [1.0], [0.0]]), surroundings=around)
    graphs = to_graph(seen, edges=("up", "down"))
    told = features.eval()(graphs)[:, 3:]
    assert told[:, :2].tolist() == [[0, 0], [pytest.approx(1.0, abs=1e-6), 1], [0, 0]]
    kitchen = [float(label == "kitchen") for label in labels]
    assert told[1, 2 : 2 + len(labels)].tolist() == kitchen
    assert not told[[0, 2], 2 : 2 + len(labels)].any()
    rest = told[:, 2 + len(labels) :]
    assert [row.nonzero().flatten().tolist() for row in rest] == [[1, len(BUILDING_KINDS) + 1]] * 3
    torch.manual_seed(0)
    forgetting = NodeFeatures(config.model_copy(update={"forget": 0.999}), 1, 0).train()
    assert not forgetting(graphs)[:, 3:].any()


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
        ("mask", ("hidden_share", "visited")),
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
    for key in ("hidden_share", "visited", "x", "others"):
        mixed = graphs.clone()
        mixed[key] = other[key]
        same = torch.equal(features(graphs)[1], features(mixed)[1])
        assert same == (key not in changed), key


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
def test_a_likelihood_is_the_distribution_that_is_given(
    likelihood: str, dataset: Path, tmp_path: Path
) -> None:
    config = configure("ceci-sage", f"model.likelihood={likelihood}", "model.calibrate=false")
    list(train_run(config, dataset, tmp_path / "run"))
    model = restore_model(tmp_path / "run" / BEST, load_checkpoint(tmp_path / "run" / BEST))
    seen = read_split(Dataset.open(dataset), "test", vocabulary=model.vocabulary).seen
    distribution = model.predict(seen.take([0])).hidden_counts.take(np.array([1, 2]))
    assert (distribution.dispersions < 1e9).all() == (likelihood == "negative-binomial")


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
    data = Dataset.open(dataset)
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
    list(train_run(configure("ceci-sage"), dataset, tmp_path / "run"))
    longer = configure("ceci-sage", "training.epochs=9")
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
    data = Dataset.open(dataset)
    scenes = scenes_of(data, "train")

    def sample(
        mask: MaskRecipe, *, draw: int = 0, vocabulary: tuple[str, ...] = vocabulary
    ) -> Observation:
        return sample_masked(data, scenes, mask=mask, draw=draw, vocabulary=vocabulary).seen

    whole, half = sample(MaskRecipe(fraction=0.0)), sample(MaskRecipe())
    assert (half.others <= whole.others).all()
    of_rooms = np.zeros((len(half), 3), dtype=int)
    np.add.at(of_rooms, half.building[~half.is_building], half.others[~half.is_building])
    assert (half.others[half.is_building] == of_rooms).all()
    # Every room of the fixture has a floor and a wall.
    assert (whole.others[~whole.is_building, 1:] == 1).all()
    share = half.others[half.is_building].sum() / whole.others[whole.is_building].sum()
    assert 0.3 < share < 0.7
    rooms = sample(MaskRecipe(strategy="rooms"), draw=1)
    for number in range(len(rooms)):
        one = rooms.take([number])
        assert (~one.visited).any()
        assert (one.others[~one.visited] == 0).all()
        assert (one.hidden_share[~one.visited] == 1).all()
        assert (one.hidden_share[one.visited & ~one.is_building] == 0).all()
    narrow = sample(MaskRecipe(), vocabulary=("wall",))  # a mask does not depend on who reads it
    assert (half.others[:, [2]] == narrow.others).all()


def test_the_fraction_varies_from_mask_to_mask_and_not_from_run_to_run(dataset: Path) -> None:
    data = Dataset.open(dataset)

    def shares(draw: int) -> list[float]:
        masked = sample_masked(
            data,
            scenes_of(data, "train"),
            mask=MaskRecipe(),
            draw=draw,
            fractions=(0.1, 0.9),
        )
        return [float(share) for share in masked.seen.hidden_share[masked.seen.is_building]]

    assert shares(0) == shares(0) != shares(1)
    assert len(set(shares(0))) > 3
    # A share is a 32-bit float, and 0.9 is a little above the 64-bit one.
    assert all(0.1 <= round(share, 6) <= 0.9 for share in shares(0))


def test_an_observation_without_other_categories_gets_an_answer_and_one_of_others_an_error(
    dataset: Path,
) -> None:
    data = Dataset.open(dataset)
    model = new_model(configure("ceci-sage"), data).eval()
    assert isinstance(model, CountNetwork)
    torch.nn.init.normal_(model.head.mean.weight, std=0.1)  # as if trained: it reads its features
    seen = read_split(data, "test", vocabulary=model.vocabulary).seen.take([0])
    nothing = replace(seen, others=np.zeros_like(seen.others))
    unasked = replace(seen, vocabulary=(), others=seen.others[:, :0])
    np.testing.assert_array_equal(model.predict(unasked).hidden, model.predict(nothing).hidden)
    assert not np.array_equal(model.predict(seen).hidden, model.predict(nothing).hidden)
    foreign = replace(
        seen,
        vocabulary=tuple("abcdefg"),
        others=np.ones((len(seen.inputs), 7), dtype=np.int64),
    )
    with pytest.raises(MismatchError, match=r"make it with vocabulary=model\.vocabulary"):
        model.predict(foreign)
    narrow = new_model(configure("ceci-sage", "data.min_scenes=99"), data)
    assert narrow.vocabulary == ()
    assert np.isfinite(narrow.predict(read_split(data, "test").seen.take([0])).hidden).all()


def test_a_batch_without_rooms_has_no_loss(dataset: Path) -> None:
    model = new_model(configure("ceci-sage"), Dataset.open(dataset))
    assert isinstance(model, CountNetwork)
    alone = observe_building([[3] * 45])
    loss = model.loss(model.graph_of(alone, alone.inputs))
    assert loss.item() == 0
    loss.backward()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize(
    ("ours", "of_pyg"),
    [
        (lambda: NormalisedConv(4, 4), lambda: GCNConv(4, 4)),
        (lambda: MeanConv(4, 4), lambda: SAGEConv(4, 4)),
    ],
    ids=["normalised", "mean"],
)
def test_convolutions_that_write_no_file_are_pygs_to_the_bit(
    ours: Callable[[], nn.Module], of_pyg: Callable[[], nn.Module]
) -> None:
    mine, theirs = ours(), of_pyg()
    mine.load_state_dict(theirs.state_dict())
    h = torch.randn(5, 4)
    edges = torch.tensor([[0, 1, 2, 3, 4, 1, 2], [1, 0, 0, 0, 0, 2, 1]])
    found, expected = (
        torch.autograd.grad(convolution(x, edges).square().sum(), x)[0]
        for convolution, x in ((mine, h.clone().requires_grad_()), (theirs, h.requires_grad_()))
    )
    assert torch.equal(mine(h, edges), theirs(h, edges))
    assert torch.equal(found, expected)
