"""Turn a dataset of today into one of format version 1, by that version's description."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.dataset.manifest import Manifest, read_manifest
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.dataset.version_1 import TABLES_1
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
