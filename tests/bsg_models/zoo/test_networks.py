"""Networks of hidden counts: features, head and loss by hand, and what each option does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from one_building import observe_building, surround_rooms
from torch_geometric.nn import GCNConv

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import MismatchError
from bsg_data.scene.room_label import list_room_labels
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.errors import TrainingError
from bsg_models.inputs.graphs import read_split
from bsg_models.inputs.nodes import EVIDENCE, to_nodes
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST, LAST
from bsg_models.training.training import new_model, train_run
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import RunConfig, find_config, override, validate_config
from bsg_models.zoo.features import LabelPrior, NetworkConfig, NodeFeatures, ShownDropout
from bsg_models.zoo.gamma_poisson import GammaPoissonConfig, GammaPoissonModel
from bsg_models.zoo.gcn import CECIGCN, GCNConfig
from bsg_models.zoo.model import ModelInputs, to_array
from bsg_models.zoo.networks import CountNetwork, PriorHead
from bsg_models.zoo.prior_table import read_prior_table

NETWORKS = [name for name in ZOO if isinstance(ZOO[name].config, NetworkConfig)]
SMALL = ("model.width=8", "model.embedding=4", "training.epochs=4", "training.validate_every=2")


def configure(name: str, *settings: str) -> RunConfig:
    tables = override(find_config(name).model_dump(mode="json"), [*SMALL, *settings])
    return validate_config(tables, source="test")


def test_the_head_is_shrinkage_with_a_prior_of_its_own() -> None:
    """With mean m and shape r everywhere it is the Gamma-Poisson model of a = r, b = r / m."""
    head = PriorHead(NetworkConfig(width=4, components=1), 2).eval()
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
    mean, dispersion, log_weight, found_tilts = head(torch.randn(4, 4), to_nodes(seen), None)
    assert not log_weight.any()
    model = GammaPoissonModel(GammaPoissonConfig(tilted=2), ModelInputs(classes=2))
    model.tilts.copy_(tilts)
    model.shape.copy_(torch.tensor([3.0, 0.7]))
    model.rate.copy_(torch.tensor([3.0 / 2.0, 0.7 / 0.5]))
    expected = model.predict(seen).hidden_counts
    found = [to_array(part[0]) for part in (mean, dispersion)]
    np.testing.assert_allclose(found[0][1:], expected.means[0, 1:], rtol=1e-5)
    np.testing.assert_allclose(found[1][1:], expected.dispersions[0, 1:], rtol=1e-5)
    assert expected.tilts is not None
    for found_tilt, tilt in zip(found_tilts, expected.tilts[:, 0, 1:], strict=True):
        np.testing.assert_allclose(to_array(found_tilt[0])[1:], tilt, rtol=1e-5)
    assert found[0][3].tolist() == pytest.approx([2.0, 0.5])  # nothing seen: the prior


def test_the_loss_is_minus_the_log_probability_of_what_rooms_hide(dataset: Path) -> None:
    data = Dataset.open(dataset)
    torch.manual_seed(0)
    model = new_model(configure("ceci-sage"), data).eval()
    assert isinstance(model, CountNetwork)
    for parameter in model.head.parameters():  # as if trained: no head is all zeros
        torch.nn.init.normal_(parameter, std=0.1)
    masked = read_split(data, "test", vocabulary=model.vocabulary)
    found = model.loss(model.nodes_of(masked.seen, masked.targets)).item()
    rooms = np.flatnonzero(~masked.seen.is_building)
    beliefs = model.predict_hidden_counts(masked.seen).take(rooms)
    expected = -beliefs.log_probability(masked.hidden[rooms].astype(float)).mean()
    assert found == pytest.approx(expected, rel=1e-5)


def test_dropout_leaves_what_is_told_of_the_mask() -> None:
    features = torch.ones(50, 8)
    dropped = ShownDropout(0.5, [slice(2, 4), slice(4, 5)]).train()(features)
    assert (dropped[:, 2:5] == 1).all()
    assert set(dropped[:, [0, 1, 5, 6, 7]].unique().tolist()) == {0.0, 2.0}
    assert torch.equal(ShownDropout(0.5, [slice(2, 5)]).eval()(features), features)


def test_features_by_hand() -> None:
    """Building with three rooms, the last unvisited; one class, two other categories."""
    features = NodeFeatures(NetworkConfig(embedding=2), 1, 2).eval()
    with torch.no_grad():
        features.embedding.weight.copy_(torch.tensor([[1.0, 0.0], [0.0, 10.0]]))
    seen = observe_building(
        [[3.0], [3.0], [0.0], [0.0]],
        hidden_share=[0.5, 0.5, 0.5, 1.0],
        visited=[True, True, True, False],
        others=[[1.0, 5.0], [1.0, 0.0], [0.0, 5.0], [0.0, 0.0]],
        vocabulary=("tap", "wall"),
    )
    found = features(to_nodes(seen)).detach().numpy()
    assert found.shape == (4, features.width)
    log3, rooms = np.log(4.0), np.log(4.0)
    # log count, presence, log total | odds, visited | embedding | building's log count,
    # siblings: presence and embedding, log rooms, is building
    # siblings are shrunk: three that show nothing are added to the one or two that there are
    first = [log3, 1, log3, 0, 1, 1, 0, log3, 0, 0, 10 / 4, rooms, 0]
    second = [0, 0, 0, 0, 1, 0, 10, log3, 1 / 4, 1 / 4, 0, rooms, 0]
    unseen = [0, 0, 0, np.log(49) / 2, 0, 0, 0, log3, 1 / 5, 1 / 5, 10 / 5, rooms, 0]
    np.testing.assert_allclose(found[1:], [first, second, unseen], rtol=1e-5)
    assert found[0, -1] == 1


def test_training_forgets_evidence_of_rooms_and_never_of_buildings() -> None:
    around = surround_rooms([30] * 999, ["kitchen"] * 999, building_kind="shop", source="mp3d")
    seen = observe_building(np.ones((1000, 1)).tolist(), surroundings=around)
    nodes = to_nodes(seen, reads=EVIDENCE)
    features = NodeFeatures(NetworkConfig(reads=tuple(EVIDENCE), forget=0.4), 1, 0)
    assert features.eval().forget(nodes) is nodes
    told = features(nodes)
    first = 3
    torch.manual_seed(0)
    trained = features.train().forget(nodes)
    for name, kind in EVIDENCE.items():
        columns = slice(first, first := first + kind.width)
        assert torch.equal(told[:, columns], nodes.evidence[name])
        kept = (trained.evidence[name] == nodes.evidence[name]).all(dim=1)
        assert kept[1:].float().mean() == pytest.approx(1 if kind.of_building else 0.6, abs=0.05)
        assert not trained.evidence[name][~kept].any()


def test_common_sense_of_a_label_is_of_presence_alone() -> None:
    """By hand: a bathroom's toilet in the shipped table, where the network knows nothing."""
    classes = ("toilet", "bed")
    sense = LabelPrior(2)
    sense.read_table(classes)
    presence, weight = read_prior_table("", classes).list_types(classes)
    labels = torch.zeros(4, len(list_room_labels()))
    bathroom, infirmary = map(list_room_labels().index, ("bathroom", "infirmary"))
    labels[1, bathroom] = labels[2, infirmary] = 1.0
    usual = float(weight @ presence[:, 0])
    odds = presence[bathroom, 0] / (1 - presence[bathroom, 0]) / (usual / (1 - usual))
    added = sense(labels).detach().exp().numpy()
    assert added[1] == pytest.approx([np.sqrt(odds), added[1, 1]], rel=1e-5)
    assert odds > 5
    assert added[1, 1] < 0.5
    assert (added[[0, 2, 3]] == 1).all(), "the table lists no infirmary; of others nothing is known"
    head = PriorHead(NetworkConfig(width=4, components=1, tilted=0), 2).eval()
    head.start(torch.tensor([1.0, 1.0]))
    seen = observe_building([[1, 0], [1, 0], [0, 0], [0, 0]], hidden_share=[0.5, 0.5, 1.0, 1.0])
    posterior = [
        head(torch.zeros(4, 4), to_nodes(seen), sense(one)) for one in (labels, 0 * labels)
    ]
    one, other = (
        CountDistribution(
            to_array(mean),
            to_array(r),
            to_array(log_weight.exp()),
            np.stack([to_array(tilt) for tilt in tilts]),
        )
        for mean, r, log_weight, tilts in posterior
    )
    assert one.presence[1, 0] == pytest.approx(other.presence[1, 0])  # another one of what was seen
    changed = np.exp(other.log_odds_of_none - one.log_odds_of_none)
    assert changed[1, 1] < changed[3, 1] == pytest.approx(1)
    assert np.allclose(changed[2:], 1)


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


def test_a_stopped_network_resumes_to_the_same_weights(dataset: Path, tmp_path: Path) -> None:
    config = configure("ceci-sage")
    list(train_run(config, dataset, tmp_path / "whole"))
    for report in train_run(config, dataset, tmp_path / "stopped"):
        if report.epoch == 3:
            break
    list(train_run(config, dataset, tmp_path / "stopped", resume=True))
    a, b = (load_checkpoint(tmp_path / name / LAST) for name in ("whole", "stopped"))
    assert a.header == b.header
    assert all(torch.equal(t, b.tensors[name]) for name, t in a.tensors.items())
    longer = configure("ceci-sage", "training.epochs=9")
    with pytest.raises(TrainingError):  # its learning rate falls over all epochs
        list(train_run(longer, dataset, tmp_path / "whole", resume=True))


def test_categories_that_an_observation_lacks_are_unseen_and_others_are_refused(
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
    foreign = replace(seen, vocabulary=("a",), others=seen.others[:, :1])
    with pytest.raises(MismatchError):
        model.predict(foreign)
    narrow = new_model(configure("ceci-sage", "data.min_scenes=99"), data)
    assert narrow.vocabulary == ()
    assert np.isfinite(narrow.predict(read_split(data, "test").seen.take([0])).hidden).all()


def test_a_batch_without_rooms_has_no_loss(dataset: Path) -> None:
    model = new_model(configure("ceci-sage"), Dataset.open(dataset))
    assert isinstance(model, CountNetwork)
    alone = observe_building([[3] * 45])
    loss = model.loss(model.nodes_of(alone, alone.inputs))
    assert loss.item() == 0
    loss.backward()  # type: ignore[no-untyped-call]


def test_the_gcn_normalises_once_what_pygs_layers_normalise_each() -> None:
    torch.manual_seed(0)
    model = CECIGCN(GCNConfig(depth=3, width=8, dropout=0.0), ModelInputs(classes=2)).eval()
    nodes = model.nodes_of(observe_building([[4, 2], [3, 0], [1, 2]]))
    x = nodes.x
    for layer, convolution in enumerate(model.convolutions):
        pygs = GCNConv(convolution.in_channels, convolution.out_channels)
        pygs.load_state_dict(convolution.state_dict())
        x = pygs(x, nodes.edges)
        if layer < len(model.blocks):
            x = model.blocks[layer](x)
    assert torch.equal(model(nodes), x)
