from __future__ import annotations

import re

import numpy as np
import pytest

from bsg_models.zoo import tree_text

lightgbm = pytest.importorskip("lightgbm")
RNG = np.random.default_rng(0)
FEATURES = RNG.random((300, 6))


@pytest.fixture(scope="module")
def text() -> str:
    """Three trees of four leaves, and the features that they read."""
    counts = RNG.poisson(1 + FEATURES[:, 0])
    recipe = {"objective": "poisson", "num_leaves": 4, "verbosity": -1, "num_threads": 1}
    return str(lightgbm.train(recipe, lightgbm.Dataset(FEATURES, counts), 3).model_to_string())


def prove_trees(text: str, *, trees: int = 3, leaves: int = 4, features: int = 6) -> str:
    return tree_text.prove_trees(text, trees=trees, leaves=leaves, features=features)


def answer(text: str) -> list[float]:
    booster = lightgbm.Booster(model_str=text)
    return list(booster.predict(FEATURES, raw_score=True, num_threads=1))


def test_proven_trees_answer_the_same(text: str) -> None:
    proven = prove_trees(text)
    assert answer(proven) == answer(text)
    assert prove_trees(proven) == proven
    assert lightgbm.Booster(model_str=proven).num_feature() == 6


def test_trees_of_one_leaf_are_read() -> None:
    constant = lightgbm.Dataset(FEATURES, np.ones(300))
    recipe = {"objective": "poisson", "verbosity": -1, "num_threads": 1}
    text = lightgbm.train(recipe, constant, 2).model_to_string()
    assert answer(prove_trees(text)) == answer(text)


def test_more_trees_leaves_or_features_than_configured_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected 2 trees at most, as configured; found 3"):
        prove_trees(text, trees=2)
    with pytest.raises(ValueError, match="num_leaves: expected numbers of 1 to 3"):
        prove_trees(text, leaves=3)
    for features in (5, 7):
        with pytest.raises(ValueError, match="max_feature_idx: expected"):
            prove_trees(text, features=features)


@pytest.mark.parametrize(
    ("line", "other"),
    [
        ("left_child=1 -1 -3", "left_child=0 -1 -3"),  # its own parent: hangs LightGBM
        ("left_child=1 -1 -3", "left_child=1 -1 -9"),  # a leaf that is not there
        ("left_child=1 -1 -3", "left_child=1 -1"),
        ("right_child=", "right_child=nan "),
        ("split_feature=", "split_feature=6 "),
        ("split_feature=", "split_feature=-1 "),
        ("num_leaves=4", "num_leaves=-5"),
        ("num_leaves=4", "num_leaves=2147483647"),
        ("num_leaves=4", "num_leaves=9999999999999999999999"),
        ("num_cat=0", "num_cat=1"),
        ("is_linear=0", "is_linear=1"),
        ("decision_type=2 2 2", "decision_type=2 2 3"),
        ("decision_type=2 2 2", "decision_type=2 2 99999999"),
        ("threshold=", "threshold=1e400 "),
        ("leaf_value=", "leaf_value=nan "),
        ("leaf_value=", "other="),
        ("num_tree_per_iteration=1", "num_tree_per_iteration=2"),
        ("max_feature_idx=5", "max_feature_idx=99999999"),
        ("max_feature_idx=5", "max_feature_idx=-1"),
    ],
)
def test_what_would_crash_or_hang_it_is_refused(text: str, line: str, other: str) -> None:
    assert line in text
    with pytest.raises(ValueError, match=r"expected|before its parent|not valid in trees"):
        prove_trees(text.replace(line, other, 1))


@pytest.mark.parametrize("number", ["1e400", "-1e309", "1e-400", "0180025895e-350", "-4e-310"])
def test_a_number_that_64_bits_do_not_hold_is_refused(text: str, number: str) -> None:
    changed = re.sub("threshold=[^ ]+", f"threshold={number}", text, count=1)
    with pytest.raises(ValueError, match="threshold: expected finite numbers"):
        prove_trees(changed)


@pytest.mark.parametrize("number", ["0", "-0.0", "0e-999", "1e-307", "1.0000000180025095e-35"])
def test_a_number_that_they_hold_is_kept_as_it_is(text: str, number: str) -> None:
    changed = re.sub("threshold=[^ ]+", f"threshold={number}", text, count=1)
    assert f"threshold={number} " in prove_trees(changed)


@pytest.mark.parametrize("line", ["tree_sizes=99999999 1 1", "feature_infos=[9", "shrinkage=x"])
def test_what_is_not_needed_is_not_handed_on(text: str, line: str) -> None:
    key = line.split("=")[0]
    lines = [line if one.startswith(f"{key}=") else one for one in text.split("\n")]
    assert prove_trees("\n".join(lines)) == prove_trees(text)
