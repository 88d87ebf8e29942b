"""Networks of hidden counts: features, head and loss by hand, and what each option does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import torch
from configurations import configure
from one_building import make_zoo_model, observe_building, surround_rooms
from scipy.special import logit

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import MismatchError
from bsg_data.scene.room_label import list_room_labels
from bsg_models.inputs.graphs import read_split
from bsg_models.inputs.nodes import EVIDENCE, to_nodes
from bsg_models.training.count_gradients import CountGradients, Dropout
from bsg_models.training.training import new_model
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.features import LabelPrior, NetworkConfig, NodeFeatures, tabulate_labels
from bsg_models.zoo.hand_prior import read_hand_table
from bsg_models.zoo.layers import NO_DROPOUT, Weight
from bsg_models.zoo.networks import CountNetwork, PriorHead, to_distribution

NETWORKS = [name for name in ZOO if isinstance(ZOO[name].config, NetworkConfig)]
SMALL = ("model.width=8", "model.embedding=4", "training.epochs=4", "training.validate_every=2")


def small(name: str, *settings: str) -> RunConfig:
    return configure(name, *SMALL, *settings)


def weights_of(shapes: Mapping[str, Weight]) -> dict[str, npt.NDArray[np.float32]]:
    """Return weights as a training starts from them, but for what is drawn at random."""
    return {name: np.full(row.shape, row.value, np.float32) for name, row in shapes.items()}


def shake(model: CountNetwork) -> CountNetwork:
    """Give a network some weights, as if it were trained."""
    rng = np.random.default_rng(0)
    model.load_state(
        {
            name: values + rng.normal(0, 0.1, values.shape) * (name in model.weights)
            for name, values in model.state().items()
        }
    )
    return model


def test_the_head_is_shrinkage_with_a_prior_of_its_own() -> None:
    """With mean m and shape r everywhere it is the Gamma-Poisson model of a = r, b = r / m."""
    head = PriorHead(NetworkConfig(width=4, components=1), 2)
    weights, tilts = weights_of(head.weights), np.array([[0.5, -0.5], [1.0, 0.3]])
    weights["head.mean.bias"] = np.log([2.0, 0.5])
    weights["head.shape.bias"] = np.log([3.0, 0.7])
    weights["head.tilt.bias"] = tilts.ravel()
    seen = observe_building(
        [[9, 1], [3, 0], [6, 1], [0, 0]],
        hidden_share=[0.5, 0.5, 0.2, 1.0],
        visited=[True, True, True, False],
    )
    encoded = np.random.default_rng(0).normal(size=(4, 4))
    nodes = to_nodes(seen)
    found = head(weights, encoded, nodes.x, nodes.share, None)
    assert not found.log_weight.any()
    model = make_zoo_model("gamma-poisson", classes=2, tilted=2)
    model.hold(tilts=tilts, shape=[3.0, 0.7], rate=[3.0 / 2.0, 0.7 / 0.5])
    expected = model.predict(seen).hidden_counts
    np.testing.assert_allclose(found.mean[0, 1:], expected.means[0, 1:], rtol=1e-5)
    np.testing.assert_allclose(found.dispersion[0, 1:], expected.dispersions[0, 1:], rtol=1e-5)
    assert expected.tilts is not None
    for found_tilt, tilt in zip(found.tilts, expected.tilts[:, 0, 1:], strict=True):
        np.testing.assert_allclose(found_tilt[0, 1:], tilt, rtol=1e-5)
    assert found.mean[0, 3].tolist() == pytest.approx([2.0, 0.5])  # nothing seen: the prior


@pytest.mark.parametrize("name", NETWORKS)
def test_numpy_answers_as_torch_trains(name: str, dataset: Path) -> None:
    """The same functions, of arrays and of tensors, for buildings of several sizes."""
    data = Dataset.open(dataset)
    model = new_model(small(name), data)
    assert isinstance(model, CountNetwork)
    seen = read_split(data, "train", vocabulary=model.vocabulary).seen
    network = CountGradients(shake(model))
    network.load_state(model.state())
    with torch.no_grad():
        trained = network(network.read(seen))
    answered = model.forward(model.weights, model.nodes_of(seen))
    for part in ("mean", "dispersion", "log_weight"):
        np.testing.assert_allclose(
            getattr(answered, part), getattr(trained, part), rtol=2e-5, atol=1e-5
        )
    np.testing.assert_allclose(answered.tilts, np.stack(trained.tilts), rtol=1e-5, atol=1e-5)


def test_the_loss_is_minus_the_log_probability_of_what_rooms_hide(dataset: Path) -> None:
    data = Dataset.open(dataset)
    model = new_model(small("ceci-sage"), data)
    assert isinstance(model, CountNetwork)
    network = CountGradients(model)
    network.load_state(shake(model).state())
    masked = read_split(data, "test", vocabulary=model.vocabulary)
    found = network.loss(network.read(masked.seen, masked.targets)).item()
    rooms = np.flatnonzero(~masked.seen.is_building)
    beliefs = model.predict_hidden_counts(masked.seen).take(rooms)
    expected = -beliefs.log_probability(masked.hidden[rooms].astype(float)).mean()
    assert found == pytest.approx(expected, rel=1e-5)


def test_features_by_hand() -> None:
    """Building with three rooms, the last unvisited; one class, two other categories."""
    features = NodeFeatures(NetworkConfig(embedding=2), 1, 2)
    weights = {"features.embedding.weight": np.array([[1.0, 0.0], [0.0, 10.0]])}
    seen = observe_building(
        [[3.0], [3.0], [0.0], [0.0]],
        hidden_share=[0.5, 0.5, 0.5, 1.0],
        visited=[True, True, True, False],
        unclassified=[[1.0, 5.0], [1.0, 0.0], [0.0, 5.0], [0.0, 0.0]],
        vocabulary=("tap", "wall"),
    )
    found = features(weights, to_nodes(seen))
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
    nodes = to_nodes(seen, reads=EVIDENCE).to(torch.device("cpu"))
    features = NodeFeatures(NetworkConfig(reads=tuple(EVIDENCE), forget=0.4), 1, 0)
    encoded, first = features({}, nodes), 3
    torch.manual_seed(0)
    trained = features.forget(nodes, Dropout())
    quiet = features.forget(nodes, NO_DROPOUT)
    for name, kind in EVIDENCE.items():
        columns = slice(first, first := first + kind.width())
        assert torch.equal(encoded[:, columns], nodes.evidence[name])
        assert quiet.evidence[name] is nodes.evidence[name]
        held = (trained.evidence[name] == nodes.evidence[name]).all(dim=1)
        assert held[1:].float().mean() == pytest.approx(1 if kind.of_building else 0.6, abs=0.05)
        assert not trained.evidence[name][~held].any()


def test_common_sense_of_a_label_is_of_presence_alone() -> None:
    """By hand: a bathroom's toilet in the shipped table, where the network knows nothing."""
    classes = ("toilet", "bed")
    sense = LabelPrior(2)
    known = {**weights_of(sense.weights), "labels.log_odds": tabulate_labels(classes)}
    table = read_hand_table()
    types, unlisted = table["room_types"], table["unlisted"]
    labels = np.zeros((4, len(list_room_labels())))
    bathroom, infirmary = map(list_room_labels().index, ("bathroom", "infirmary"))
    labels[1, bathroom], labels[2, infirmary] = 1.0, 1.0
    weights, toilets = zip(
        *((one["weight"], one["presence"].get("toilet", unlisted)) for one in types.values()),
        strict=True,
    )
    usual = np.average(np.clip(toilets, 0.01, 0.99), weights=weights)
    there = types["bathroom"]["presence"]["toilet"]
    odds = there / (1 - there) / (usual / (1 - usual))
    added = np.exp(sense(known, labels))
    assert added[1] == pytest.approx([np.sqrt(odds), added[1, 1]], rel=1e-5)
    assert odds > 5
    assert added[1, 1] < 0.5
    assert added[2, 1] > 2, "an infirmary has beds"
    assert (added[[0, 3]] == 1).all(), "of others nothing is known"
    head = PriorHead(NetworkConfig(width=4, components=1, tilted=0), 2)
    seen = observe_building([[1, 0], [1, 0], [0, 0], [0, 0]], hidden_share=[0.5, 0.5, 1.0, 1.0])
    weights, nodes = weights_of(head.weights), to_nodes(seen)
    one, other = (
        to_distribution(
            head(weights, np.zeros((4, 4)), nodes.x, nodes.share, sense(known, of_rooms))
        )
        for of_rooms in (labels, 0 * labels)
    )
    assert one.presence[1, 0] == pytest.approx(other.presence[1, 0])  # another one of what was seen
    changed = np.exp(logit(1 - other.presence) - logit(1 - one.presence))
    assert changed[1, 1] < changed[3, 1] == pytest.approx(1)
    assert changed[2, 1] > 1
    assert np.allclose(changed[3], 1)


def test_categories_that_an_observation_lacks_are_unseen_and_others_are_refused(
    dataset: Path,
) -> None:
    data = Dataset.open(dataset)
    model = new_model(small("ceci-sage"), data)
    assert isinstance(model, CountNetwork)
    shake(model)
    seen = read_split(data, "test", vocabulary=model.vocabulary).seen.take([0])
    nothing = replace(seen, unclassified=np.zeros_like(seen.unclassified))
    unasked = replace(seen, vocabulary=(), unclassified=seen.unclassified[:, :0])
    np.testing.assert_array_equal(model.predict(unasked).hidden, model.predict(nothing).hidden)
    assert not np.array_equal(model.predict(seen).hidden, model.predict(nothing).hidden)
    foreign = replace(seen, vocabulary=("a",), unclassified=seen.unclassified[:, :1])
    with pytest.raises(MismatchError):
        model.predict(foreign)
    narrow = new_model(small("ceci-sage", "data.min_scenes=99"), data)
    assert narrow.vocabulary == ()
    assert np.isfinite(narrow.predict(read_split(data, "test").seen.take([0])).hidden).all()


def test_a_batch_without_rooms_has_no_loss(dataset: Path) -> None:
    model = new_model(small("ceci-sage"), Dataset.open(dataset))
    assert isinstance(model, CountNetwork)
    alone = observe_building([[3] * 45])
    network = CountGradients(model)
    loss = network.loss(network.read(alone, alone.inputs))
    assert loss.item() == 0
    loss.backward()  # type: ignore[no-untyped-call]
