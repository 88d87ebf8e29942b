from __future__ import annotations

from pathlib import Path

import pytest

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_models.inputs.folds import Split, scenes_of, splits_of, vocabulary_of

PARTS: tuple[Split, ...] = ("train", "val", "test")


@pytest.fixture
def folded(dataset: Path) -> Path:
    """The twelve buildings in three folds of four, with one draw."""
    split_dataset(dataset, SplitRecipe(method="folds", ratios=None, folds=3), force=True)
    write_pairs(dataset, PairsRecipe(draws=1))
    return dataset


def test_folds_rotate_and_never_overlap(folded: Path) -> None:
    data = Dataset.open(folded)
    tested: list[str] = []
    for fold in range(3):
        parts = [scenes_of(data, part, fold=fold) for part in PARTS]
        assert sorted(scene for part in parts for scene in part) == sorted(data.scene_ids)
        tested += parts[2]
    assert sorted(tested) == sorted(data.scene_ids)
    for fold in (None, 3):
        with pytest.raises(DatasetError):
            scenes_of(data, "test", fold=fold)


def test_a_rotation_by_hand(folded: Path) -> None:
    """Fold 2 is the test split, half of fold 0 is for validation, and the rest for training."""
    data = Dataset.open(folded)
    first, second, third = (data.splits[f"fold-{k}"] for k in range(3))
    assert len(first) == len(second) == len(third) == 4
    assert scenes_of(data, "test", fold=2) == third
    assert scenes_of(data, "val", fold=2) == (first[0], first[2])
    assert scenes_of(data, "train", fold=2) == (first[1], first[3], *second)
    assert splits_of(data, "train", fold=2) == ("fold-0", "fold-1")


def test_a_fold_of_a_dataset_without_folds_and_an_empty_split_are_refused(dataset: Path) -> None:
    with pytest.raises(DatasetError):
        scenes_of(Dataset.open(dataset), "train", fold=0)
    split_dataset(dataset, SplitRecipe(ratios=(0.5, 0.5, 0.0)), force=True)
    with pytest.raises(DatasetError):
        scenes_of(Dataset.open(dataset), "test")


def test_a_vocabulary_is_of_the_scenes_that_are_asked_for(dataset: Path) -> None:
    """Rooms have a wall and a floor; all else of the fixture is a class or has no category."""
    data = Dataset.open(dataset)
    assert vocabulary_of(data, data.scene_ids, min_scenes=12) == ("floor", "wall")
    assert vocabulary_of(data, data.scene_ids, min_scenes=13) == ()
    some = data.scene_ids[:2]
    assert vocabulary_of(data, some, min_scenes=2) == ("floor", "wall")
    assert vocabulary_of(data, some, min_scenes=3) == ()
