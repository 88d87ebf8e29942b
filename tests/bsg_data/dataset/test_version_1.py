"""A dataset of format version 1, made from one of version 2 by hand, is read as the same."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from version_1_files import write_version_1

from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.shards import read_scene_graphs, read_table
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import MismatchError
from bsg_data.recipes import SplitRecipe


def test_version_1_is_read_as_what_it_was(dataset: Path) -> None:
    graphs = list(read_scene_graphs(dataset))
    objects = read_table(dataset, "objects", columns=["scene_id", "role", "class"])
    cells = Dataset.open(dataset).cells(graphs[0].scene_id)
    before = write_version_1(dataset)
    manifest = read_manifest(dataset)
    assert manifest.format_version == 1
    assert manifest.class_space == before.class_space
    assert manifest.sources == before.sources
    assert list(read_scene_graphs(dataset)) == graphs
    assert read_table(dataset, "objects", columns=["scene_id", "role", "class"]) == objects
    assert (Dataset.open(dataset).cells(graphs[0].scene_id) == cells).all()
    assert check_dataset(dataset) == ()


def test_version_1_is_not_written(dataset: Path) -> None:
    write_version_1(dataset)
    with pytest.raises(MismatchError, match="bsg-data upgrade"):
        split_dataset(dataset, SplitRecipe())


def test_damage_to_version_1_is_found(dataset: Path) -> None:
    write_version_1(dataset)
    path = dataset / "edges" / "part-00000.parquet"
    table = pq.read_table(path)
    swapped = table.set_column(
        1, table.schema.field("source"), pa.array([9] * len(table), pa.int32())
    )
    pq.write_table(swapped, path)
    assert any("is not what the manifest says" in fault.what for fault in check_dataset(dataset))
