"""A dataset that is built or changed is the old one or the new at every moment."""

from __future__ import annotations

import shutil
from pathlib import Path

import pyarrow as pa
import pytest
from conftest import commit_manifest
from killed_process import snapshot
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import read_splits
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.schema import SPLITS
from bsg_data.dataset.shards import write_parquet
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_data.sources.hm3d import HM3DFolder


def test_files_of_the_users_stay(dataset: Path) -> None:
    """They are told, and stop what would remove them."""
    mine = ("notes.txt", "pairs/mine.parquet", "rooms/part-99999.parquet")
    for name in mine:
        (dataset / name).parent.mkdir(exist_ok=True)
        (dataset / name).write_text("mine")
    split_dataset(dataset, SplitRecipe(seed=1), force=True)
    write_pairs(dataset, PairsRecipe(draws=1))
    assert {fault.where for fault in check_dataset(dataset)} == {*mine}
    with refuses(DatasetError, "foreign-file", dataset):
        build_dataset(HM3DFolder(dataset.parent / "hm3d"), dataset, force=True)
    assert [(dataset / name).read_text() for name in mine] == ["mine"] * 3


@pytest.mark.parametrize("name", ["pairs", "splits"])
def test_links_in_a_dataset_lead_nowhere(dataset: Path, tmp_path: Path, name: str) -> None:
    outside = tmp_path / "outside"
    shutil.move(dataset / name, outside)
    (dataset / name).symlink_to(outside)
    before = snapshot(outside)
    with refuses(DatasetError, "link", dataset / name):
        write_pairs(dataset, PairsRecipe(draws=1), force=True)
    assert snapshot(outside) == before


@pytest.mark.parametrize("name", ["../../victim/evil", "training", "fold-", "train\n", ""])
def test_no_split_is_read_whose_name_could_lead_anywhere(dataset: Path, name: str) -> None:
    manifest = read_manifest(dataset)
    scenes = [scene for some in read_splits(dataset).values() for scene in some]
    table = pa.table([scenes, [name, *["train"] * (len(scenes) - 1)]], schema=SPLITS)
    path = "splits/ratios-00000000.parquet"
    entry = write_parquet(dataset, path, [table], table="splits", class_space=manifest.class_space)
    commit_manifest(dataset, manifest.with_table("splits", (entry,)))
    with refuses(DatasetError, "split-name", path):
        write_pairs(dataset, PairsRecipe(draws=1), force=True)
