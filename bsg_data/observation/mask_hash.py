"""The hash of masks: who has the same masks of the same buildings has the same hash.

It is the sha256 of stored pairs in bytes that any language can make. Numbers are little-endian:

    "bsg-masks-1", line feed; the name of each class in UTF-8, a line feed after each; line feed
    for each scene, in the order of the UTF-8 bytes of its id:
        its id in UTF-8, a byte 0
        for each of its pairs, in the order of draw and node:
            draw int32, node_index int32, hidden_share float32, visited uint8,
            withheld uint8 [C], input int32 [C], target int32 [C]

It does not depend on files, compression, the order of rows or the split that a building is in.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.pairs import histogram_column, read_pairs, read_views, split_of_file
from bsg_data.recipes import PairsRecipe

ALL = "all"
_FORM = b"bsg-masks-1\n"


def hash_splits(data: Dataset) -> dict[str, str]:
    """Return the hash of the masks of every split that has pairs, and of `all` of them together.

    Raises:
        DatasetError: if a file of pairs is missing or not readable.
    """
    names = sorted({split_of_file(entry.path) for entry in data.manifest.files_of("pairs")})
    hashes = {name: hash_masks(data, [name]) for name in names}
    return {**hashes, ALL: hash_masks(data, names)} if names else {}


def hash_masks(data: Dataset, splits: Sequence[str]) -> str:
    """Return the sha256 of the stored pairs of some splits together, in hexadecimal digits.

    Args:
        data: an open dataset.
        splits: names of stored splits or folds, one or more.

    Raises:
        DatasetError: if one of them has no pairs, or they are not readable.
    """
    classes = data.manifest.class_space.classes
    found = hashlib.sha256(_FORM + "".join(f"{name}\n" for name in classes).encode() + b"\n")
    rows = [_pack(read_pairs(data.path, name, manifest=data.manifest), data) for name in splits]
    scenes = np.concatenate([names for names, _ in rows])
    packed = np.concatenate([own for _, own in rows])
    order = np.lexsort((packed["node"], packed["draw"], scenes))
    scenes, packed = scenes[order], packed[order]
    _, starts = np.unique(scenes, return_index=True)
    for first, last in zip(starts, [*starts[1:], len(scenes)], strict=True):
        found.update(bytes(scenes[first]) + b"\0")
        found.update(packed[first:last].tobytes())
    return found.hexdigest()


def _pack(table: pa.Table, data: Dataset) -> tuple[npt.NDArray[np.bytes_], npt.NDArray[np.void]]:
    """Return the scene id of every pair as bytes, and the pair as the record that is hashed."""
    classes = len(data.manifest.class_space.classes)
    record = np.dtype(
        [
            ("draw", "<i4"),
            ("node", "<i4"),
            ("hidden_share", "<f4"),
            ("visited", "u1"),
            ("withheld", "u1", (classes,)),
            ("input", "<i4", (classes,)),
            ("target", "<i4", (classes,)),
        ]
    )
    view = read_views(table, data.manifest.pairs or PairsRecipe())
    packed = np.empty(len(table), dtype=record)
    packed["draw"] = table["draw"].to_numpy()
    packed["node"] = table["node_index"].to_numpy()
    packed["hidden_share"] = view.told
    packed["visited"] = view.visited
    packed["withheld"] = view.withheld
    packed["input"] = histogram_column(table, "input")
    packed["target"] = histogram_column(table, "target")
    scenes = np.array([name.encode() for name in table["scene_id"].to_pylist()], dtype=np.bytes_)
    return scenes, packed
