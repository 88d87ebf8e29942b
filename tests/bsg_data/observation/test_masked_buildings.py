"""Masked buildings: sampled, read from stored pairs, and taken apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from one_building import observe_building, same_surroundings

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import (
    MaskedBuildings,
    sample_masked,
    stack_masked,
    stream_masked,
    vary_fractions,
)
from bsg_data.observation.masks import Layout
from bsg_data.observation.observation import stack
from bsg_data.observation.pairs import write_pairs
from bsg_data.observation.view import View
from bsg_data.recipes import MaskRecipe, PairsRecipe

VOCABULARY = ("floor", "wall")


@pytest.fixture
def masked() -> MaskedBuildings:
    """A building with two rooms, one with none, one with a room."""
    seen = stack(
        [
            observe_building([[3], [1], [2]], scene_id="a"),
            observe_building([[7]], scene_id="b"),
            observe_building([[4], [4]], scene_id="c"),
        ]
    )
    targets = np.array([[6], [2], [4], [7], [9], [9]])
    return MaskedBuildings(seen, targets, np.array([0, 5, 2]), np.array([0, 1, 2, 0, 0, 1]))


def test_buildings_are_taken_with_their_targets_and_draws(masked: MaskedBuildings) -> None:
    some = masked.take([2, 0])
    assert some.seen.scene_ids == ("c", "a")
    assert some.targets.ravel().tolist() == [9, 9, 6, 2, 4]
    assert some.hidden.ravel().tolist() == [5, 5, 3, 1, 2]
    assert some.draws.tolist() == [2, 0]


@pytest.mark.parametrize("strategy", ["uniform", "mixed"])
def test_stored_pairs_are_what_is_sampled_of_the_same_recipe(dataset: Path, strategy: str) -> None:
    recipe = MaskRecipe(strategy=strategy, fraction=0.6, seed=2, withhold=0.2)
    write_pairs(dataset, PairsRecipe(mask=recipe, draws=2), force=True)
    data = Dataset.open(dataset)
    stored = read_all(data, "train", vocabulary=VOCABULARY)
    scenes = data.splits["train"]
    assert stored.seen.scene_ids == tuple(scene for scene in scenes for _ in range(2))
    for draw in range(2):
        fresh = sample_masked(data, scenes, mask=recipe, draw=draw, vocabulary=VOCABULARY)
        same = stored.take(np.flatnonzero(stored.draws == draw))
        np.testing.assert_array_equal(fresh.targets, same.targets)
        np.testing.assert_array_equal(fresh.draws, same.draws)
        bare = sample_masked(data, scenes, mask=recipe, draw=draw).seen.unclassified
        assert bare.shape == (len(fresh.seen.inputs), 0)
        assert bare.dtype == fresh.seen.unclassified.dtype
        wall = sample_masked(data, scenes, mask=recipe, draw=draw, vocabulary=("zzqx", "wall"))
        np.testing.assert_array_equal(wall.seen.unclassified[:, 1], fresh.seen.unclassified[:, 1])
        assert not wall.seen.unclassified[:, 0].any()
        for name in ("starts", "inputs", "hidden_share", "visited", "withheld", "unclassified"):
            np.testing.assert_array_equal(getattr(fresh.seen, name), getattr(same.seen, name), name)
        ours, theirs = fresh.seen.surroundings, same.seen.surroundings
        assert same_surroundings(ours, theirs)


def test_pairs_that_another_numpy_drew_are_read_as_they_tell(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is stored of the view holds for the objects outside the classes, too."""
    write_pairs(dataset, PairsRecipe(mask=MaskRecipe(strategy="rooms"), draws=1), force=True)

    def views_of(layouts: list[Layout], *_: object) -> list[View]:
        return [View.of_rooms(np.zeros(one.shape[0] - 1), classes=one.shape[1]) for one in layouts]

    monkeypatch.setattr("bsg_data.observation.masked_buildings.sample_views", views_of)
    seen = read_all(Dataset.open(dataset), "train", vocabulary=("wall",)).seen
    assert not seen.unclassified[seen.hidden_share == 1].any()
    assert seen.unclassified.any()


def test_the_fraction_of_a_building_does_not_depend_on_its_objects(dataset: Path) -> None:
    data = Dataset.open(dataset)
    recipes = vary_fractions(MaskRecipe(), (0.2, 0.4), 0, len(data.scene_ids))
    masked = sample_masked(data, data.scene_ids, mask=recipes, draw=0)
    share = masked.seen.hidden_share[masked.seen.is_building]
    assert len(set(share.tolist())) > 3
    assert ((share > 0.199) & (share < 0.401)).all()
    np.testing.assert_allclose(share, share.astype(float).round(2), atol=1e-6)
    there = masked.targets[masked.seen.is_building].sum(axis=1)
    hidden = masked.hidden[masked.seen.is_building].sum(axis=1)
    assert hidden.tolist() == np.floor(share.astype(float).round(2) * there + 1e-9).tolist()


def read_all(data: Dataset, split: str, *, vocabulary: tuple[str, ...] = ()) -> MaskedBuildings:
    return stack_masked(list(stream_masked(data, split, vocabulary=vocabulary)))


def test_a_detector_overlooks_words_in_every_room_and_stored_pairs_agree(dataset: Path) -> None:
    recipe = MaskRecipe(strategy="rooms", detector=1.0)
    write_pairs(dataset, PairsRecipe(mask=recipe, draws=4), force=True)
    data = Dataset.open(dataset)
    stored = read_all(data, "train", vocabulary=VOCABULARY)
    assert not stored.seen.inputs[stored.seen.withheld].any()
    words = stored.seen.unclassified[stored.seen.is_building] > 0  # each building has every word
    assert 0 < words.mean() < 1
    for draw in range(4):
        scenes = data.splits["train"]
        fresh = sample_masked(data, scenes, mask=recipe, draw=draw, vocabulary=VOCABULARY)
        same = stored.take(np.flatnonzero(stored.draws == draw))
        for name in ("inputs", "withheld", "unclassified"):
            np.testing.assert_array_equal(getattr(fresh.seen, name), getattr(same.seen, name), name)
