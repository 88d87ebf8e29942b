"""Measure whether beliefs about unvisited rooms improve as a robot searches the others.

    bsg-data pairs hm3d --mask rooms --draws 5 --force
    bsg-train --config ceci-sage --data hm3d --out run --set data.mask.strategy=rooms
    python scripts/measure/searched_rooms.py --data hm3d --run run

A robot begins with nothing seen and searches the rooms of every val building in random orders. The
gain is by how many nats a room that is still unvisited is less of a surprise (−log P of all that is
in it) once a quarter, a half and three quarters of the building were searched. With `--half-seen`
half of every object was seen before, and the gain is that about one room from searching all others.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import to_histograms
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, enter_room, mask_scene
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.scene_graph import SceneGraph
from bsg_models.inputs.folds import scenes_of
from bsg_models.runs.predictor import Predictor

Floats = npt.NDArray[np.float64]
ORDERS = 6


def val_scenes(dataset: Path) -> list[tuple[SceneGraph, npt.NDArray[np.int64]]]:
    """Return the val buildings of four rooms or more with their true histograms `[N, C]`."""
    data = Dataset.open(dataset)
    wanted = set(scenes_of(data, "val"))
    graphs = (graph for graph in read_scene_graphs(dataset) if graph.scene_id in wanted)
    return [(g, to_histograms(data.cells(g.scene_id))) for g in graphs if len(g.rooms) >= 4]


def measure_search(dataset: Path, run: Path, *, orders: int = ORDERS) -> Floats:
    """Return the gains of every building after a quarter, a half and three quarters, `[B, 3]`."""
    manifest, predictor = read_manifest(dataset), Predictor(run)
    gains = []
    for scene, truth in val_scenes(dataset):
        rooms = tuple(KnownRoom(str(room.region_id), 1.0, visited=False) for room in scene.rooms)
        nothing = PartialGraph(scene.scene_id, manifest.class_space, 1.0, rooms, ())
        before = surprises(predictor, nothing, truth)
        rng = np.random.default_rng(0)
        stops = {max(1, len(rooms) * quarter // 4) for quarter in (1, 2, 3)}
        each = []
        for _ in range(orders):
            graph, order, row = nothing, 1 + rng.permutation(len(rooms)), []
            for done, room in enumerate(order[:-1].tolist(), 1):
                graph = enter_room(graph, scene, room)
                if done in stops:
                    after = surprises(predictor, graph, truth)
                    row.append((before - after)[order[done:]].mean())
            each.append(row)
        gains.append(np.mean(each, axis=0))
    return np.array(gains)


def measure_half_seen(dataset: Path, run: Path) -> Floats:
    """Return the gain about each room from searching all others, half being seen before, `[R]`."""
    manifest, predictor = read_manifest(dataset), Predictor(run)
    gains = []
    for scene, truth in val_scenes(dataset):
        half = mask_scene(scene, MaskRecipe(), draw=0, class_space=manifest.class_space)
        before = surprises(predictor, half, truth)
        for room in range(1, len(scene.rooms) + 1):
            graph = half
            for other in set(range(1, len(scene.rooms) + 1)) - {room}:
                graph = enter_room(graph, scene, other)
            gains.append(before[room] - surprises(predictor, graph, truth)[room])
    return np.array(gains)


def surprises(predictor: Predictor, graph: PartialGraph, truth: npt.NDArray[np.int64]) -> Floats:
    """Return −log P of what every node hides, `[N]`."""
    hidden = (truth - graph.histograms()).astype(float)
    return np.asarray(-predictor(graph).log_probability(hidden).sum(axis=1))


def main() -> None:
    """Print the gains with their standard errors over buildings, or over rooms."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="Dataset, split.")
    parser.add_argument("--run", type=Path, required=True, help="Of a trained model.")
    parser.add_argument("--half-seen", action="store_true", help="Half was seen before.")
    options = parser.parse_args()
    if options.half_seen:
        found = {"all others": measure_half_seen(options.data, options.run)}
    else:
        gains = measure_search(options.data, options.run).T
        found = dict(zip(("a quarter", "a half", "three quarters"), gains, strict=True))
    for what, values in found.items():
        error = values.std() / np.sqrt(len(values))
        print(f"after {what}: {values.mean():+.2f} nats a room, standard error {error:.2f}")


if __name__ == "__main__":
    main()
