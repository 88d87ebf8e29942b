from __future__ import annotations

import hashlib
import struct
from pathlib import Path

from one_building import read_pairs
from refusals import refuses

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.mask_hash import hash_splits
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe


def hash_slowly(data: Dataset, split: str) -> str:
    """Follow the words of the form, a number at a time."""
    classes = data.manifest.class_space.classes
    rows = read_pairs(data.path, split).to_pylist()
    rows.sort(key=lambda row: (row["scene_id"].encode(), row["draw"], row["node_index"]))
    text = b"bsg-masks-1\n" + "".join(f"{name}\n" for name in classes).encode() + b"\n"
    before = None
    for row in rows:
        if row["scene_id"] != before:
            before = row["scene_id"]
            text += before.encode() + b"\0"
        text += struct.pack(
            "<iif?", *(row[k] for k in ("draw", "node_index", "hidden_share", "visited"))
        )
        text += bytes(row["withheld"])
        text += struct.pack(f"<{len(classes)}i", *row["input"])
        text += struct.pack(f"<{len(classes)}i", *row["target"])
    return hashlib.sha256(text).hexdigest()


def test_the_hash_is_of_the_form_that_the_module_states(dataset: Path) -> None:
    write_pairs(
        dataset, PairsRecipe(mask=MaskRecipe(strategy="explore", withhold=0.2), draws=2), force=True
    )
    data = Dataset.open(dataset)
    hashes = hash_splits(data)
    assert list(hashes) == ["test", "train", "val", "all"]
    for split in ("test", "train", "val"):
        assert hashes[split] == hash_slowly(data, split)


def test_the_hash_of_all_does_not_depend_on_the_split_and_does_on_the_seed(dataset: Path) -> None:
    before = hash_splits(Dataset.open(dataset))
    split_dataset(dataset, SplitRecipe(method="folds", ratios=None, folds=3), force=True)
    write_pairs(dataset, PairsRecipe(draws=4))
    folds = hash_splits(Dataset.open(dataset))
    assert list(folds) == ["fold-0", "fold-1", "fold-2", "all"]
    assert folds["all"] == before["all"]
    write_pairs(dataset, PairsRecipe(mask=MaskRecipe(seed=1), draws=4), force=True)
    assert not set(hash_splits(Dataset.open(dataset)).values()) & set(folds.values())


def test_without_pairs_there_is_no_hash(dataset: Path) -> None:
    split_dataset(dataset, SplitRecipe(seed=1), force=True)
    data = Dataset.open(dataset)
    assert hash_splits(data) == {}
    with refuses(DatasetError, "pairs-missing", where="test"):
        hash_splits(data, ["test"])
