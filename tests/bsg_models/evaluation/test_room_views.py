from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from one_building import observe_building
from torch.nn.functional import binary_cross_entropy

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import MaskedBuildings, sample_masked, stack_masked
from bsg_data.observation.observation import stack
from bsg_data.recipes import MaskRecipe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation, from_hidden_counts
from bsg_models.evaluation.measurement import Measurement, read_truth
from bsg_models.evaluation.room_views import (
    VIEWS,
    add_room_views,
    compare_room_views,
    measure_room_views,
    view_of,
)


def sample(dataset: Path, strategy: str, *, draws: int = 3) -> MaskedBuildings:
    data = Dataset.open(dataset)
    mask = MaskRecipe(strategy=strategy)
    scenes = sorted(data.scene_ids)
    return stack_masked([sample_masked(data, scenes, mask=mask, draw=d) for d in range(draws)])


def believe(masked: MaskedBuildings, seed: int = 1) -> Expectation:
    rates = np.random.default_rng(seed).gamma(1.0, 1.0, masked.targets.shape)
    return from_hidden_counts(masked.seen.inputs.astype(float), poisson(rates))


def test_views_by_hand() -> None:
    """A building, a room that is half seen, one that was searched, one glimpsed and one closed."""
    seen = observe_building(
        [[0, 0]] * 5, hidden_share=[0.5, 0.5, 0.0, 0.8, 1.0], visited=[True] * 3 + [False] * 2
    )
    assert view_of(seen).tolist() == [-1, 0, -1, 1, 2]


def test_two_rooms_by_hand() -> None:
    """Two half seen rooms with rates 1 and 2 of one class: none is hidden, and one is."""
    seen = observe_building([[0], [0], [0]], hidden_share=[0.5] * 3)
    masked = MaskedBuildings(stack([seen]), np.array([[1], [0], [1]]), np.zeros(1, dtype=int))
    rates = np.array([[3.0], [1.0], [2.0]])
    views = measure_room_views(from_hidden_counts(np.zeros((3, 1)), poisson(rates)), masked)
    found = views.evaluate()
    assert found["half-seen/nll"] == pytest.approx((1 + 2 - np.log(2)) / 2)
    assert found["half-seen/present"] == 0.5
    presence = 1 - np.exp(-rates[1:, 0])
    assert found["half-seen/presence"] == pytest.approx(presence.mean())
    expected = pytest.approx((1 - np.log(presence[1])) / 2)
    assert found["half-seen/presence_log_loss"] == expected
    assert found["half-seen/presence_log_loss/0"] == expected
    assert np.isnan(found["unvisited/nll"])
    assert (views.count_nodes("half-seen/nll"), views.count_nodes("unvisited/nll")) == (2, 0)
    with pytest.raises(ValueError, match="no value 'nlls'"):
        views.average("nlls")


def test_the_presence_log_loss_is_torchs(dataset: Path) -> None:
    masked = sample(dataset, "explore")
    beliefs = believe(masked)
    found = measure_room_views(beliefs, masked).average("presence_log_loss")
    for number, view in enumerate(VIEWS):
        rows = np.flatnonzero(view_of(masked.seen) == number)
        assert len(rows), view
        presence = np.clip(beliefs.presence[rows, 3], 1 - np.exp(-1e-3), 1)
        present = (masked.hidden[rows, 3] > 0).astype(float)
        expected = binary_cross_entropy(torch.from_numpy(presence), torch.from_numpy(present))
        assert found[number, 3] == pytest.approx(float(expected))


@pytest.mark.parametrize("strategy", ["uniform", "frontier"])
def test_without_searched_rooms_the_views_add_up_to_the_metric_of_all_rooms(
    dataset: Path, strategy: str
) -> None:
    masked = sample(dataset, strategy)
    beliefs = believe(masked)
    views = measure_room_views(beliefs, masked)
    rooms = int((~masked.seen.is_building).sum())
    assert views.rooms.sum() == rooms
    weights = np.random.default_rng(0).integers(0, 3, len(views.scene_ids)).astype(float)
    metric = Measurement(read_truth(masked), beliefs).evaluate(weights)["rooms/hidden_nll"]
    cells = (weights @ views.rooms).sum() * masked.targets.shape[1]
    assert (weights @ views.nll.sum(axis=(1, 2))) / cells == pytest.approx(metric)


def test_batches_add_up_to_the_whole(dataset: Path) -> None:
    masked = sample(dataset, "explore")
    whole = measure_room_views(believe(masked), masked)
    beliefs, parts, first = believe(masked), [], 0
    for some in masked.batches(7):
        rows = np.arange(first, first + len(some.targets))
        first += len(rows)
        inputs, law = beliefs.inputs[rows], beliefs.hidden_counts.take(rows)
        parts.append(measure_room_views(from_hidden_counts(inputs, law), some))
    added = add_room_views(parts)
    assert added.scene_ids == whole.scene_ids
    assert added.evaluate() == pytest.approx(whole.evaluate(), nan_ok=True)
    with pytest.raises(ValueError, match="found none"):
        add_room_views([])


def test_a_paired_difference_of_a_model_that_believes_the_truth(dataset: Path) -> None:
    """Rates near the hidden counts beat random ones in every view; none differs from itself."""
    masked = sample(dataset, "explore")
    near = np.maximum(masked.hidden.astype(float), 0.05)
    good = from_hidden_counts(masked.seen.inputs.astype(float), poisson(near))
    ours, theirs = (measure_room_views(some, masked) for some in (good, believe(masked)))
    found = compare_room_views(ours, theirs, resamples=20)
    for view in VIEWS:
        assert found[f"{view}/nll"].high < 0
        assert found[f"{view}/present"].value == 0
    same = compare_room_views(ours, ours, resamples=20)
    assert {estimate.value for estimate in same.values()} == {0.0}
    other = sample(dataset, "rooms")
    with pytest.raises(ValueError, match="other rooms"):
        compare_room_views(ours, measure_room_views(believe(other), other))
    with pytest.raises(ValueError, match="the masked buildings have"):
        measure_room_views(good, other.take([0]))
