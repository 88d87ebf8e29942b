"""A dataset of format version 1, made from one of version 2 by hand, is read as the same."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import Manifest, read_manifest
from bsg_data.dataset.shards import read_scene_graphs, read_table
from bsg_data.dataset.splits import split_dataset
from bsg_data.dataset.version_1 import TABLES_1
from bsg_data.errors import MismatchError
from bsg_data.recipes import SplitRecipe
from bsg_data.scene.scene_graph import SceneGraph


def write_version_1(dataset: Path) -> Manifest:
    """Turn a dataset into one of version 1, as that version's description says.

    Returns:
        the manifest that it had.
    """
    manifest = read_manifest(dataset)
    said = json.loads((dataset / "dataset.json").read_text("utf-8"))
    (source,) = said.pop("sources")
    space = said.pop("class_space")
    class_map = {**source["class_map"], "classes": space["classes"]}
    said.pop("resolved")
    said["format_version"] = 1
    said["source"] = {key: source[key] for key in ("kind", "version", "fingerprint")}
    said["class_map"] = class_map
    said["options"] = {"scenes_per_shard": said.pop("scenes_per_shard"), **source["options"]}
    said["split"] = said["pairs"] = None
    said["files"] = [f for f in said["files"] if f["path"].split("/")[0] in TABLES_1]
    graphs = {graph.scene_id: graph for graph in read_scene_graphs(dataset)}
    for entry in said["files"]:
        path, table = dataset / entry["path"], entry["path"].split("/")[0]
        old = _to_version_1(pq.read_table(path), table, graphs)
        words = {
            "bsg.table": table,
            "bsg.format_version": "1",
            "bsg.class_map": class_map["version"],
            "bsg.class_map_sha256": class_map["sha256"],
        }
        pq.write_table(old.replace_schema_metadata(words), path)
        data = path.read_bytes()
        entry.update(bytes=len(data), sha256=hashlib.sha256(data).hexdigest())
    for path in (*(dataset / "pairs").glob("*"), dataset / "splits.parquet"):
        path.unlink()
    (dataset / "pairs").rmdir()
    (dataset / "dataset.json").write_text(json.dumps(said), "utf-8")
    return manifest


def _to_version_1(table: pa.Table, name: str, graphs: dict[str, SceneGraph]) -> pa.Table:
    rows = table.to_pylist()
    for row in rows:
        if name == "rooms":
            row["label"] = "room"
        if name == "edges":
            rooms = len(graphs[row["scene_id"]].rooms)
            for end in ("source", "target"):
                behind = rooms if row[f"{end}_kind"] == "object" else 0
                row[end] = row[f"{end}_index"] + behind
    return pa.Table.from_pylist(rows, schema=TABLES_1[name])


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
    assert any("was changed" in fault.what for fault in check_dataset(dataset))
