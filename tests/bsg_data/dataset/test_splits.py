from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import read_splits
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.splits import assign_splits, split_dataset
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.recipes import SplitRecipe


def ids(number: int, split: str = "train") -> dict[str, str | None]:
    return {f"{split}{i:04d}": split for i in range(number)}


@pytest.mark.parametrize(
    ("number", "ratios", "sizes"),
    [
        (145, (0.8, 0.1, 0.1), (116, 15, 14)),
        (10, (0.8, 0.1, 0.1), (8, 1, 1)),
        (7, (0.5, 0.25, 0.25), (3, 2, 2)),
        (4, (0.5, 0.5, 0.0), (2, 2, 0)),
        (3, (1.0, 0.0, 0.0), (3, 0, 0)),
    ],
)
def test_sizes_by_largest_remainder(
    number: int, ratios: tuple[float, float, float], sizes: tuple[int, int, int]
) -> None:
    found = Counter(assign_splits(ids(number), SplitRecipe(ratios=ratios)).values())
    assert tuple(found[name] for name in ("train", "val", "test")) == sizes


@given(st.integers(20, 80), st.sampled_from([None, 2, 5]), st.integers(0, 3), st.randoms())
def test_a_split_depends_on_ids_and_recipe_and_folds_are_even(
    number: int, folds: int | None, seed: int, random: Any
) -> None:
    recipe = SplitRecipe(seed=seed)
    if folds:
        recipe = SplitRecipe(method="folds", ratios=None, folds=folds, seed=seed)
    shuffled = list(ids(number).items())
    random.shuffle(shuffled)
    chosen = assign_splits(dict(shuffled), recipe)
    assert chosen == assign_splits(ids(number), recipe)
    assert chosen != assign_splits(ids(number), recipe.model_copy(update={"seed": seed + 1}))
    assert list(chosen) == sorted(chosen)
    if folds:
        found = Counter(chosen.values())
        assert set(found) == {f"fold-{k}" for k in range(folds)}
        assert max(found.values()) - min(found.values()) <= 1


def test_official_holds_the_sources_val_out() -> None:
    for name in ("val", "minival"):
        chosen = assign_splits({**ids(20), **ids(5, name)}, OFFICIAL)
        assert Counter(chosen.values()) == {"train": 18, "val": 2, "test": 5}
        assert all(name in scene for scene, split in chosen.items() if split == "test")


OFFICIAL = SplitRecipe(method="official", ratios=(0.9, 0.1, 0.0))


@pytest.mark.parametrize(
    ("scenes", "recipe", "message"),
    [
        (ids(3), SplitRecipe(), "leave val and test empty|leave test empty"),
        (ids(3), SplitRecipe(method="folds", ratios=None, folds=4), "folds: expected at most"),
        (ids(20), OFFICIAL, "found 20 of train"),
        ({**ids(20), **ids(5, "val"), "a": None, "b": None}, OFFICIAL, "2 of None"),
    ],
)
def test_an_impossible_split_is_refused(
    scenes: dict[str, str | None], recipe: SplitRecipe, message: str
) -> None:
    with pytest.raises(RecipeError, match=message):
        assign_splits(scenes, recipe)


@pytest.mark.parametrize(
    "fields",
    [
        *({"ratios": ratios} for ratios in ((0.5, 0.1, 0.1), (1.5, -0.5, 0), (math.nan, 0.5, 0.5))),
        {"ratios": None},
        {"method": "folds"},
        {"method": "folds", "folds": 1},
    ],
)
def test_an_impossible_recipe_is_refused(fields: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=r"ratios|folds"):
        SplitRecipe(**fields)


def test_splitting_again_needs_force_and_removes_the_pairs(dataset: Path) -> None:
    before = read_splits(dataset)
    assert list(before) == ["train", "val", "test"]
    with pytest.raises(DatasetError, match="--force"):
        split_dataset(dataset, SplitRecipe(seed=1))
    assert read_splits(dataset) == before
    manifest = split_dataset(dataset, SplitRecipe(seed=1), force=True)
    assert manifest.pairs is None
    assert not manifest.files_of("pairs")
    assert not (dataset / "pairs").exists()
    assert read_splits(dataset) != before
    assert read_manifest(dataset) == manifest
    assert check_dataset(dataset) == ()
    split_dataset(dataset, SplitRecipe(method="folds", ratios=None, folds=12), force=True)
    assert list(read_splits(dataset)) == [f"fold-{k}" for k in range(12)]  # 2 before 10
