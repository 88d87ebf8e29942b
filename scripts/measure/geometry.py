"""Compare a dataset built from synthetic meshes with the truth that `bsg-data synth` wrote.

    bsg-data synth --out places --scenes 20 --geometry --size full
    bsg-data build --hm3d places --out placed
    python scripts/measure/geometry.py --buildings places --data placed

The script prints how far boxes are from the truth, over all scenes. It then prints precision,
recall and F1 of the adjacency: by method, from boxes alone, and for every building.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.geometry.passages import find_passages
from bsg_data.scene.scene_graph import Box, SceneGraph

LEAST_TEXELS = 100  # an instance with as many or fewer is not compared
Pairs = set[tuple[int, int]]


def box_errors(graph: SceneGraph, truth: dict[str, Any], which: str) -> list[float]:
    """Return the largest error of a corner coordinate of every instance's box, metres."""
    errors = []
    for obj in graph.objects:
        true = truth["instances"].get(str(obj.instance_id))
        if true is None or true["texels"] <= LEAST_TEXELS or true[which] is None:
            continue
        box: Box | None = obj.box if which == "box" else obj.part_box
        if which == "main_box" and true["box"] == true["main_box"]:
            continue  # nothing of it is painted astray
        found = [box.minimum, box.maximum] if box is not None else np.full((2, 3), np.inf)
        errors.append(float(np.abs(np.subtract(found, true[which])).max()))
    return errors


def true_pairs(graph: SceneGraph, truth: dict[str, Any]) -> Pairs:
    """Return the pairs of rooms that connect, as room indices, ascending."""
    index = {room.region_id: room.room_index for room in graph.rooms}
    pairs = ((index[a], index[b]) for a, b, _ in truth["connections"])
    return {(min(pair), max(pair)) for pair in pairs}


def found_pairs(graph: SceneGraph, method: str | None) -> Pairs:
    """Return the adjacency of a scene graph, all of it or of one method."""
    return {(e.source, e.target) for e in graph.adjacency if method in (None, e.method)}


def by_boxes_alone(graph: SceneGraph) -> Pairs:
    """Return the pairs that the rule for boxes finds without any object."""
    rooms = [room for room in graph.rooms if room.box is not None]
    boxes = np.array([[r.box.minimum, r.box.maximum] for r in rooms if r.box]).reshape(-1, 2, 3)
    return {(rooms[a].room_index, rooms[b].room_index) for a, b in find_passages(boxes)}


def score(rows: Iterable[tuple[Pairs, Pairs]]) -> npt.NDArray[np.float64]:
    """Return pooled precision, recall and F1 of (found, true) pairs."""
    rows = list(rows)
    right = sum(len(found & true) for found, true in rows)
    found, true = sum(len(found) for found, _ in rows), sum(len(true) for _, true in rows)
    parts = (right / max(found, 1), right / max(true, 1), 2 * right / max(found + true, 1))
    return np.array(parts)


def main() -> None:
    """Read both and print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--buildings", type=Path, required=True)
    parser.add_argument("--data", type=Path, required=True)
    options = parser.parse_args()
    graphs = list(read_scene_graphs(options.data))
    truths = {
        graph.scene_id: json.loads(path.read_text("utf-8"))
        for graph in graphs
        for path in options.buildings.glob(f"*/{graph.scene_id}/*.truth.json")
    }
    wrong = sum(graph.up_axis != truths[graph.scene_id]["up_axis"] for graph in graphs)
    print(f"{len(graphs)} buildings; up axis wrong in {wrong}")
    for which, what in (("box", "boxes"), ("main_box", "largest parts of instances with specks")):
        errors = np.array([e for g in graphs for e in box_errors(g, truths[g.scene_id], which)])
        if len(errors):
            print(
                f"{what}: {len(errors):,} of more than {LEAST_TEXELS} texels; error median "
                f"{np.median(errors):.4f} m, largest {errors.max():.4f} m, "
                f"{np.mean(errors <= 0.02):.2%} within 2 cm"
            )
    meshes = read_manifest(options.data).meshes.values()
    sums = all(m.texels == m.listed + m.snapped + m.black + m.unlisted for m in meshes)
    print(f"coverage adds up to all texels: {'yes' if sums else 'NO'}")
    true = {graph.scene_id: true_pairs(graph, truths[graph.scene_id]) for graph in graphs}
    rows = {"all": None, "door": "door", "stairs": "stairs", "boxes, the rest": "boxes"}
    print(f"\n{'adjacency':24s}precision  recall  F1")
    for name, method in rows.items():
        parts = score((found_pairs(g, method), true[g.scene_id]) for g in graphs)
        print(f"{name:24s}" + "      ".join(f"{v:.2f}" for v in parts))
    parts = score((by_boxes_alone(g), true[g.scene_id]) for g in graphs)
    print(f"{'from boxes alone':24s}" + "      ".join(f"{v:.2f}" for v in parts) + "\n")
    for graph in graphs:
        parts = score([(found_pairs(graph, None), true[graph.scene_id])])
        print(f"{graph.scene_id:24s}" + "      ".join(f"{v:.2f}" for v in parts))


if __name__ == "__main__":
    main()
