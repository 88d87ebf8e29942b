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


def store(dataset: Path, mask: MaskRecipe, draws: int) -> tuple[Dataset, MaskedBuildings]:
    """Write pairs, and read those of train."""
    write_pairs(dataset, PairsRecipe(mask=mask, draws=draws), force=True)
    data = Dataset.open(dataset)
    return data, stack_masked(list(stream_masked(data, "train", vocabulary=VOCABULARY)))


def test_buildings_are_taken_with_their_targets_and_draws() -> None:
    seen = [
        observe_building([[3], [1], [2]], scene_id="a"),
        observe_building([[7]], scene_id="b"),
        observe_building([[4], [4]], scene_id="c"),
    ]
    targets = np.array([[6], [2], [4], [7], [9], [9]])
    nodes = np.array([0, 1, 2, 0, 0, 1])
    some = MaskedBuildings(stack(seen), targets, np.array([0, 5, 2]), nodes).take([2, 0])
    assert some.seen.scene_ids == ("c", "a")
    assert some.targets.ravel().tolist() == [9, 9, 6, 2, 4]
    assert some.hidden.ravel().tolist() == [5, 5, 3, 1, 2]
    assert some.draws.tolist() == [2, 0]


@pytest.mark.parametrize(
    "mask",
    [
        MaskRecipe(fraction=0.6, seed=2, withhold=0.2),
        MaskRecipe(strategy="mixed", fraction=0.6, seed=2, withhold=0.2),
        MaskRecipe(strategy="rooms", detector=1.0, parts=True),
    ],
)
def test_stored_pairs_are_what_is_sampled_of_the_same_recipe(
    dataset: Path, mask: MaskRecipe
) -> None:
    data, stored = store(dataset, mask, draws=3)
    scenes = data.splits["train"]
    assert stored.seen.scene_ids == tuple(scene for scene in scenes for _ in range(3))
    for draw in range(3):
        fresh = sample_masked(data, scenes, mask=mask, draw=draw, vocabulary=VOCABULARY)
        same = stored.take(np.flatnonzero(stored.draws == draw))
        np.testing.assert_array_equal(fresh.targets, same.targets)
        np.testing.assert_array_equal(fresh.draws, same.draws)
        for name in ("starts", "inputs", "hidden_share", "visited", "withheld", "unclassified"):
            np.testing.assert_array_equal(getattr(fresh.seen, name), getattr(same.seen, name), name)
        assert same_surroundings(fresh.seen.surroundings, same.seen.surroundings)


def test_a_vocabulary_changes_no_mask(dataset: Path) -> None:
    data = Dataset.open(dataset)
    none, wall, both = (
        sample_masked(data, data.scene_ids, mask=MaskRecipe(), draw=1, vocabulary=words).seen
        for words in ((), ("zzqx", "wall"), VOCABULARY)
    )
    assert none.unclassified.shape == (len(both.inputs), 0)
    assert none.unclassified.dtype == both.unclassified.dtype
    np.testing.assert_array_equal(none.inputs, both.inputs)
    np.testing.assert_array_equal(wall.unclassified[:, 1], both.unclassified[:, 1])
    assert not wall.unclassified[:, 0].any()


def test_a_detector_overlooks_words_in_every_room(dataset: Path) -> None:
    _, stored = store(dataset, MaskRecipe(strategy="rooms", detector=1.0), draws=4)
    assert not stored.seen.inputs[stored.seen.withheld].any()
    words = stored.seen.unclassified[stored.seen.is_building] > 0  # each building has every word
    assert 0 < words.mean() < 1


def test_pairs_that_another_numpy_drew_are_read_as_they_tell(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is stored of the view holds for the objects outside the classes, too."""

    def views_of(layouts: list[Layout], *_: object) -> list[View]:
        return [View.of_rooms(np.zeros(layout.rooms), classes=layout.classes) for layout in layouts]

    monkeypatch.setattr("bsg_data.observation.masked_buildings.sample_views", views_of)
    seen = store(dataset, MaskRecipe(strategy="rooms"), draws=1)[1].seen
    assert not seen.unclassified[seen.hidden_share == 1].any()
    assert seen.unclassified.any()


def test_the_fraction_of_a_building_does_not_depend_on_its_objects(dataset: Path) -> None:
    data = Dataset.open(dataset)
    recipes = vary_fractions(MaskRecipe(), (0.2, 0.4), 0, len(data.scene_ids))
    masked = sample_masked(data, data.scene_ids, mask=recipes, draw=0)
    first = masked.seen.is_building
    share = masked.seen.hidden_share[first].astype(float)
    assert len(set(share.tolist())) > 3
    assert ((share > 0.199) & (share < 0.401)).all()
    np.testing.assert_allclose(share, share.round(2), atol=1e-6)
    present, hidden = masked.targets[first].sum(axis=1), masked.hidden[first].sum(axis=1)
    assert hidden.tolist() == np.floor(share.round(2) * present + 1e-9).tolist()
