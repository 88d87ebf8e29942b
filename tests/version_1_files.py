"""Turn a dataset of today into one of format version 1, by that version's description."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.dataset.histograms import to_histograms
from bsg_data.dataset.manifest import Manifest, encode_manifest, read_manifest
from bsg_data.dataset.schema import pairs_schema
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.dataset.version_1 import TABLES_1
from bsg_data.observation.masks_v1 import (
    sample_hidden_of_format_1,
    sample_visited_of_format_1,
)
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.connections import Connections
from bsg_data.scene.scene_graph import SceneGraph


def write_version_1(dataset: Path, *, mask: MaskRecipe | None = None) -> Manifest:
    """Turn a dataset into one of version 1, as that version's description says.

    Args:
        dataset: of today.
        mask: of two draws of pairs; without one it has neither pairs nor a split.

    Returns:
        the manifest that it had.
    """
    manifest = read_manifest(dataset)
    said = json.loads(encode_manifest(manifest))
    (source,) = said.pop("sources")
    space = said.pop("class_space")
    class_map = {**source["class_map"], "classes": space["classes"]}
    said.pop("resolved")
    said["format_version"] = 1
    said["source"] = {key: source[key] for key in ("kind", "version", "fingerprint")}
    said["class_map"] = class_map
    said["options"] = {"scenes_per_shard": said.pop("scenes_per_shard"), **source["options"]}
    chosen = None if mask is None else mask.model_dump(include={"strategy", "fraction", "seed"})
    said["pairs"] = chosen and {"mask": chosen, "draws": 2}
    kept = [*TABLES_1, *(("splits.parquet", "pairs") if mask else ())]
    said["split"] = said["split"] if mask else None
    said["files"] = [f for f in said["files"] if f["path"].split("/")[0] in kept]
    graphs = {graph.scene_id: graph for graph in read_scene_graphs(dataset)}
    for entry in said["files"]:
        path, table = dataset / entry["path"], entry["path"].split("/")[0]
        old = pq.read_table(path)
        if table in TABLES_1:
            old = _to_version_1(old, table, graphs)
        elif table == "pairs" and mask is not None:
            old = _draw_version_1(old, mask, graphs)
            entry["rows"] = len(old)
        words = {
            "bsg.table": table,
            "bsg.format_version": "1",
            "bsg.class_map": class_map["version"],
            "bsg.class_map_sha256": class_map["sha256"],
        }
        pq.write_table(old.replace_schema_metadata(words), path)
        data = path.read_bytes()
        entry.update(bytes=len(data), sha256=hashlib.sha256(data).hexdigest())
    if mask is None:
        (dataset / "splits.parquet").unlink(missing_ok=True)
        shutil.rmtree(dataset / "pairs", ignore_errors=True)
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


def _draw_version_1(table: pa.Table, mask: MaskRecipe, graphs: dict[str, SceneGraph]) -> pa.Table:
    """Return two draws of the scenes of a file of pairs, as version 1 drew them."""
    rows = []
    for scene in dict.fromkeys(table["scene_id"].to_pylist()):
        graph = graphs[scene]
        cells = np.zeros((len(graph.rooms) + 1, 45), dtype=np.int64)
        for obj in graph.objects:
            if obj.class_index is not None:
                cells[obj.room_index, obj.class_index] += 1
        known = Connections.of_pairs((edge.source, edge.target) for edge in graph.adjacency)
        for draw in range(2):
            visited = sample_visited_of_format_1(
                cells, mask, scene_id=scene, draw=draw, connections=known
            )
            hidden = sample_hidden_of_format_1(cells, visited, mask, scene_id=scene, draw=draw)
            columns = (visited, to_histograms(cells - hidden), to_histograms(cells))
            rows += [
                (scene, draw, node, bool(entered), seen.tolist(), there.tolist())
                for node, (entered, seen, there) in enumerate(zip(*columns, strict=True))
            ]
    schema = pairs_schema(45, told=False)
    named = [dict(zip(schema.names, row, strict=True)) for row in rows]
    return pa.Table.from_pylist(named, schema=schema)
