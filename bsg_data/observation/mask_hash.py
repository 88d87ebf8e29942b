"""The hash of masks: two datasets with the same masks of the same buildings have the same hash.

It is the sha256 of the stored pairs in a byte layout that any language can write. Numbers are
little-endian:

    "bsg-masks-1", line feed; the name of each class in UTF-8, a line feed after each; line feed
    for each scene, in the order of the UTF-8 bytes of its id:
        its id in UTF-8, a byte 0
        for each of its pairs, in the order of draw and node:
            draw int32, node_index int32, hidden_share float32, visited uint8,
            withheld uint8 [C], input int32 [C], target int32 [C]

It does not depend on files, compression, the order of rows, or the splits of the buildings.
"""

from __future__ import annotations

import hashlib
import heapq
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.pairs import (
    list_column,
    read_views,
    split_of_file,
    stream_pairs,
)

ALL = "all"
_FORM = b"bsg-masks-1\n"


def hash_splits(data: Dataset, splits: Sequence[str] | None = None) -> dict[str, str]:
    """Return split → hash of its masks, and under `all` that of them together.

    Each file is read once. Memory holds one file of each split at a time.

    Args:
        data: an open dataset.
        splits: splits or folds; None for every one with pairs. Without any the answer is empty.

    Raises:
        DatasetError: if a file of pairs is missing, unreadable or not in order.
    """
    held = {split_of_file(entry.path) for entry in data.manifest.files_of("pairs")}
    names = sorted(held if splits is None else splits)
    if not names:
        return {}
    classes = data.manifest.class_space.classes
    begun = hashlib.sha256(_FORM + "".join(f"{name}\n" for name in classes).encode() + b"\n")
    found = {name: begun.copy() for name in (*names, ALL)}
    streams = (_pack_scenes(data, name) for name in names)
    for _, name, packed in heapq.merge(*streams, key=lambda scene: scene[0]):
        found[name].update(packed)
        found[ALL].update(packed)
    return {name: digest.hexdigest() for name, digest in found.items()}


def _pack_scenes(data: Dataset, split: str) -> Iterator[tuple[bytes, str, bytes]]:
    """Yield (scene, split, bytes to hash) of a split, in the order of the scenes."""
    last = b""
    for table in stream_pairs(data, split):
        scenes, packed = _pack(table, data)
        changes = np.flatnonzero(scenes[1:] != scenes[:-1]) + 1
        ends = [*changes.tolist(), len(scenes)] if len(scenes) else []
        for first, end in pairwise((0, *ends)):
            scene, rows = bytes(scenes[first]), packed[first:end]
            if scene < last:
                raise DatasetError(
                    f"{data.path}: the pairs of {split} are not sorted by scene, at "
                    f"{scene.decode()}; write them again with `bsg-data pairs --force`"
                )
            head = b"" if scene == last else scene + b"\0"  # a scene of many pairs comes in pieces
            last = scene
            yield scene, split, head + rows[np.lexsort((rows["node"], rows["draw"]))].tobytes()


def _pack(table: pa.Table, data: Dataset) -> tuple[npt.NDArray[np.bytes_], npt.NDArray[np.void]]:
    """Return the scene id of every pair as bytes, and the record to hash."""
    view, wide = read_views(table), (len(data.manifest.class_space.classes),)
    columns: list[tuple[str, str, tuple[int, ...], npt.NDArray[Any]]] = [
        ("draw", "<i4", (), table["draw"].to_numpy()),
        ("node", "<i4", (), view.nodes),
        ("hidden_share", "<f4", (), view.shares_float32),
        ("visited", "u1", (), view.visited),
        ("withheld", "u1", wide, view.withheld),
        ("input", "<i4", wide, list_column(table, "input")),
        ("target", "<i4", wide, list_column(table, "target")),
    ]
    packed = np.empty(len(table), dtype=np.dtype([column[:3] for column in columns]))
    for name, _, _, values in columns:
        packed[name] = values
    scenes = np.array([name.encode() for name in table["scene_id"].to_pylist()], dtype=np.bytes_)
    return scenes, packed
