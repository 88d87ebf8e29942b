"""What a robot sees beyond the classes: the objects outside them, counted by category.

A shower dial says bathroom and a worktop says kitchen, though neither is one of the classes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from bsg_data.arrays import Counts
from bsg_data.dataset.histograms import count_cells
from bsg_data.dataset.manifest import Manifest, read_manifest
from bsg_data.dataset.shards import read_table
from bsg_data.scene.class_map import is_nameless

NO_CATEGORY = ""  # stands for nameless and unmapped objects: nothing to learn from


@dataclass(frozen=True, eq=False)
class OtherObjects:
    """The objects without a class of one scene.

    Attributes:
        categories: `[K]` names, sorted; `NO_CATEGORY` for objects that have none.
        cells: `[1 + R, K]` how many of each there are, row 0 the null region.
    """

    categories: tuple[str, ...]
    cells: Counts


def read_others(dataset: Path, *, manifest: Manifest | None = None) -> dict[str, OtherObjects]:
    """Read the objects without a class of every scene of a dataset."""
    manifest = manifest or read_manifest(dataset)
    scenes = read_table(dataset, "scenes", columns=["scene_id", "num_rooms"], manifest=manifest)
    columns = ["scene_id", "room_index", "category", "class_index"]
    objects = read_table(dataset, "objects", columns=columns, manifest=manifest)
    objects = objects.filter(objects["class_index"].is_null())
    categories = _name(pc.fill_null(objects["category"], NO_CATEGORY))
    rooms = objects["room_index"].to_numpy()
    order = objects["scene_id"].to_numpy(zero_copy_only=False)
    # Rows of a scene are together and in order.
    starts = np.flatnonzero(np.append(True, order[1:] != order[:-1])[: len(order)])
    ends = np.append(starts, len(order))[1:]
    rows = {order[a]: slice(a, b) for a, b in zip(starts, ends, strict=True)}
    found = {}
    for scene, size in zip(*scenes.to_pydict().values(), strict=True):
        own = rows.get(scene, slice(0, 0))
        names, kind = np.unique(categories[own].astype(str), return_inverse=True)
        cells = count_cells(rooms[own], kind, shape=(size + 1, len(names)))
        found[scene] = OtherObjects(tuple(names.tolist()), cells)
    return found


def _name(column: pa.ChunkedArray) -> npt.NDArray[np.object_]:
    encoded = column.combine_chunks().dictionary_encode()
    names = encoded.dictionary.to_pylist()
    known = np.array([NO_CATEGORY if is_nameless(name) else name for name in names], dtype=object)
    found: npt.NDArray[np.object_] = known[encoded.indices.to_numpy()] if len(column) else known
    return found


def choose_vocabulary(others: Iterable[OtherObjects], *, min_scenes: int) -> tuple[str, ...]:
    """Return the categories that occur in at least `min_scenes` of some scenes, sorted."""
    named = [name for one in others for name in one.categories if name != NO_CATEGORY]
    names, times = np.unique(np.array(named, dtype=str), return_counts=True)
    return tuple(names[times >= min_scenes].tolist())


def place_columns(categories: Sequence[str], vocabulary: Sequence[str]) -> npt.NDArray[np.int64]:
    """Return the column of the vocabulary of every category, -1 for one that is not in it.

    >>> place_columns(["tap", "zebra"], ["drawer", "tap"]).tolist()
    [1, -1]
    """
    number = {name: i for i, name in enumerate(vocabulary)}
    return np.array([number.get(name, -1) for name in categories], dtype=np.int64)
