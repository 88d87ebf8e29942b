"""Histograms of classes at the nodes of interest (paper, section II: E × O).

Two arrays of the same shape `[N, C]`, N = 1 + R:

- *cells*: row 0 counts the objects of the null region, rows 1..R those of the rooms. Every object
  is in one cell, so masks are drawn on cells.
- *histograms*: the same, but row 0 counts the whole building.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Counts
from bsg_data.dataset.manifest import Manifest, read_manifest
from bsg_data.dataset.shards import read_table
from bsg_data.errors import DatasetError


def count_cells(
    room_index: npt.NDArray[np.integer], kind: npt.NDArray[np.integer], *, shape: tuple[int, int]
) -> Counts:
    """Count objects per room and kind.

    Args:
        room_index: `[O]` 0..R of every object.
        kind: `[O]` 0..K-1, a class or any other numbering of the objects.
        shape: (1 + R, K).

    Returns:
        `[1 + R, K]` cells.
    """
    flat = room_index.astype(np.int64) * shape[1] + kind.astype(np.int64)
    return np.bincount(flat, minlength=shape[0] * shape[1]).reshape(shape)


def to_histograms(cells: Counts) -> Counts:
    """Return cells `[..., N, C]` as histograms: row 0 becomes the sum over all rows.

    >>> to_histograms(np.array([[1, 0], [2, 3]])).tolist()
    [[3, 3], [2, 3]]
    """
    histograms = cells.copy()
    histograms[..., 0, :] = cells.sum(axis=-2)
    return histograms


def read_cells(dataset: Path, *, manifest: Manifest | None = None) -> dict[str, Counts]:
    """Read the cells `[1 + R, C]` of every scene of a dataset, in the order of the scenes."""
    manifest = manifest or read_manifest(dataset)
    scenes = read_table(dataset, "scenes", columns=["scene_id", "num_rooms"], manifest=manifest)
    columns = ["scene_id", "room_index", "class_index"]
    objects = read_table(dataset, "objects", columns=columns, manifest=manifest)
    objects = objects.filter(objects["class_index"].is_valid())
    ids = scenes["scene_id"].to_pylist()
    number_of = {scene_id: number for number, scene_id in enumerate(ids)}
    _require(set(objects["scene_id"].unique().to_pylist()) <= set(ids), dataset, "scene_id")
    encoded = objects["scene_id"].combine_chunks().dictionary_encode()
    codes = np.array([number_of[s] for s in encoded.dictionary.to_pylist()], dtype=np.int64)
    scene = codes[encoded.indices.to_numpy()] if len(objects) else np.zeros(0, dtype=np.int64)
    sizes = scenes["num_rooms"].to_numpy() + 1
    rooms, classes = objects["room_index"].to_numpy(), objects["class_index"].to_numpy()
    _require(bool((sizes >= 1).all() and (sizes < 1_000_000).all()), dataset, "num_rooms")
    _require(bool(((rooms >= 0) & (rooms < sizes[scene])).all()), dataset, "room_index")
    _require(bool((classes < len(manifest.class_map.classes)).all()), dataset, "class_index")
    starts = np.concatenate([[0], np.cumsum(sizes)])
    nodes = starts[scene] + rooms
    shape = (int(starts[-1]), len(manifest.class_map.classes))
    counts = count_cells(nodes, classes, shape=shape)
    return dict(zip(ids, np.split(counts, starts[1:-1]), strict=True))


def _require(sound: bool, dataset: Path, column: str) -> None:
    if not sound:
        raise DatasetError(
            f"{dataset}: a {column} in its tables is impossible; `bsg-data check` says where"
        )


def read_adjacency(
    dataset: Path, *, manifest: Manifest | None = None
) -> dict[str, list[tuple[int, int]]]:
    """Read the pairs of adjacent rooms of every scene that has any."""
    scenes = read_table(dataset, "scenes", columns=["scene_id", "num_rooms"], manifest=manifest)
    limit = dict(zip(*scenes.to_pydict().values(), strict=True))
    columns = ["scene_id", "source", "target", "kind"]
    edges = read_table(dataset, "edges", columns=columns, manifest=manifest).to_pandas()
    pairs: dict[str, list[tuple[int, int]]] = {}
    for row in edges[edges["kind"] == "adjacent"].itertuples():
        scene, source, target = str(row.scene_id), int(row.source), int(row.target)
        _require(1 <= source < target <= limit.get(scene, 0), dataset, "adjacent edge")
        pairs.setdefault(scene, []).append((source, target))
    return pairs
