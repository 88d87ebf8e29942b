"""Models of a leaderboard's folder, each on the buildings that it never saw."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from fold_models import (
    hash_unsplit,
    list_models,
    mask_of,
    measure_masks,
    open_dataset,
    open_folds,
)
from tallies import tally_likelihood

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import encode_manifest, read_manifest
from bsg_data.errors import DatasetError
from bsg_data.observation.masked_buildings import stack_masked
from bsg_models.inputs.graphs import read_split


def test_all_models_are_listed_with_their_mask(board: Path) -> None:
    names = ("gamma-poisson@rooms", "mixture@rooms", "gamma-poisson@uniform", "mixture@uniform")
    assert list_models(board) == names
    assert list_models(board, ["uniform"]) == names[2:]


def test_every_building_is_asked_about_once_by_a_model_that_never_saw_it(board: Path) -> None:
    folds = list(open_folds(board, "mixture@uniform"))
    data = Dataset.open(board / "uniform" / "dataset")
    assert [one.fold for one in folds] == [0, 1, 2]
    assert sorted(scene for one in folds for scene in one.scenes) == sorted(data.scene_ids)
    for one in folds:
        assert one.scenes == data.splits[f"fold-{one.fold}"]


def test_masks_are_those_that_the_leaderboard_stored(board: Path) -> None:
    """Every scene's draws are there, as of the same recipe."""
    for one in open_folds(board, "gamma-poisson@rooms"):
        sampled = one.sample(mask_of(board, one.name, "rooms"), draws=2)
        stored = read_split(one.data, "test", fold=one.fold)
        order = np.lexsort((stored.draws, stored.seen.scene_ids))
        again = np.lexsort((sampled.draws, sampled.seen.scene_ids))
        a, b = stored.take(order), stack_masked([sampled.take(again)])
        np.testing.assert_array_equal(a.seen.inputs, b.seen.inputs)
        np.testing.assert_array_equal(a.seen.hidden_share, b.seen.hidden_share)


def test_the_likelihood_is_that_of_the_leaderboard(board: Path) -> None:
    report = json.loads((board / "leaderboard.json").read_text("utf-8"))
    for name in ("gamma-poisson", "mixture"):
        found = measure_masks(
            board, f"{name}@rooms", tally_likelihood, masks=["rooms"], draws=2, resamples=0
        )
        theirs = report["masks"]["rooms"][name]["metrics"]["rooms/hidden_nll"]
        assert found["rooms"].point["nll"] == pytest.approx(theirs["value"])
        assert found["rooms"].nodes["nll"] == theirs["nodes"]


def test_the_hash_is_that_of_the_dataset_before_it_was_split(board: Path) -> None:
    data = open_dataset(board, "mixture@rooms")
    whole = encode_manifest(read_manifest(board.parent / "dataset"))
    assert hash_unsplit(data) == hashlib.sha256(whole).hexdigest() != data.sha256


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("mixture", "expected NAME@MASK, as in ceci-sage@uniform"),
        ("mixture@explore", "has no models of mask 'explore'; it has rooms, uniform"),
        ("ceci-sage@rooms", r"ceci-sage: expected a trained run \(best.safetensors\)"),
    ],
)
def test_a_model_that_is_not_there_is_refused(board: Path, name: str, message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        list(open_folds(board, name))


def test_a_folder_without_a_leaderboard_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="found no model with all folds"):
        list_models(tmp_path)
