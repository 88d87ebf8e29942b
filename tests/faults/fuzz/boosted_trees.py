"""Boosted trees of a checkpoint, which LightGBM's C++ reads: `bsg_models.zoo.tree_text`.

What LightGBM does with other text is no finding but the end of the process.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bsg_models.zoo.tree_text import prove_trees
from fuzz.target import NoFileError, Target

_TREES = b"""tree
num_class=1
num_tree_per_iteration=1
max_feature_idx=2

Tree=0
num_leaves=3
num_cat=0
split_feature=0 2
threshold=0.5 1.0000000180025095e-35
decision_type=2 2
left_child=1 -1
right_child=-2 -3
leaf_value=0.25 -0.5 1e-05
is_linear=0
shrinkage=1


Tree=1
num_leaves=1
num_cat=0
leaf_value=0.125


end of trees
"""


def seeds() -> dict[str, bytes]:
    """Return two trees, of three leaves and of one."""
    return {"trees": _TREES}


def read(folder: Path, data: bytes) -> object:
    """Prove a text, and let LightGBM read and ask what was proven."""
    import lightgbm

    try:
        proven = prove_trees(
            data.decode("utf-8", "surrogateescape"), trees=100, leaves=1_024, features=3
        )
    except ValueError as error:
        raise NoFileError(str(error)) from error
    booster = lightgbm.Booster(model_str=proven)
    features = np.linspace(-1, 1, 4 * booster.num_feature()).reshape(4, -1)
    answers = booster.predict(features, raw_score=True, num_threads=1)
    assert np.isfinite(answers).all()
    return answers


TARGET = Target(
    name="boosted-trees",
    read=read,
    seeds=seeds,
    words=(
        "num_leaves=",
        "left_child=",
        "-1",
        "2147483647",
        "Tree=2\n",
        "end of trees",
        "\n\n",
        "0",
    ),
    most=500,
)
