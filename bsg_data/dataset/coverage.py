"""Measure how much of a dataset a class map covers, and count its classes."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np
import pandas as pd

from bsg_data.arrays import Counts
from bsg_data.dataset.shards import stream_table
from bsg_data.files import AnyPath
from bsg_data.scene.class_map import ClassMap, Role


@dataclass(frozen=True, slots=True)
class Coverage:
    """The objects of a dataset, counted by the roles that a class map gives them.

    Attributes:
        objects: number of all objects, the sum of the next five.
        classified: objects with a class.
        structure: parts of the building: wall, floor, door, ...
        nameless: objects named blank, `unknown` or `unknown/...`.
        unmapped: objects whose name is not in the map.
        left_out: named objects outside the classes.
        most_left_out: (category, instances) of the most frequent left-out names.
    """

    objects: int
    classified: int
    structure: int
    nameless: int
    unmapped: int
    left_out: int
    most_left_out: tuple[tuple[str, int], ...]

    @property
    def share(self) -> float:
        """Objects with a class, divided by all objects that are not structure; 0 without any."""
        return self.classified / max(1, self.objects - self.structure)

    @property
    def share_of_named(self) -> float:
        """As `share`, but without the nameless objects."""
        return self.classified / max(1, self.objects - self.structure - self.nameless)


def measure_coverage(
    dataset: AnyPath, class_map: ClassMap | None = None, *, most: int = 20
) -> Coverage:
    """Measure how much of a dataset a class map covers.

    Args:
        dataset: folder of the dataset.
        class_map: map to look up every object in; None: the maps that the dataset was built with,
            one for each source.
        most: number of left-out names to list.
    """
    dataset = Path(dataset)
    roles: Counter[str] = Counter()
    left_out: Counter[str] = Counter()
    for (raw, category, role), count in _count_names(dataset).items():
        known = None if class_map is None else class_map.classify(raw)
        found, name = (role, category) if known is None else (known.role, known.category)
        roles[found] += count
        if found == "left-out":
            left_out[str(name)] += count
    ranked = sorted(left_out.items(), key=lambda item: (-item[1], item[0]))
    return Coverage(
        objects=sum(roles.values()),
        **{role.replace("-", "_"): roles[role] for role in get_args(Role)},
        most_left_out=tuple(ranked[:most]),
    )


def _count_names(dataset: Path) -> Counter[tuple[str, str | None, str]]:
    """Count the objects of a dataset by raw name, category and role, file by file."""
    columns = ["raw_category", "category", "role"]
    counts: Counter[tuple[str, str | None, str]] = Counter()
    for objects in stream_table(dataset, "objects", columns=columns):
        kinds = objects.group_by(columns, use_threads=False).aggregate([([], "count_all")])
        rows = zip(*(kinds[name].to_pylist() for name in columns), strict=True)
        counts.update(dict(zip(rows, kinds["count_all"].to_pylist(), strict=True)))
    return counts


def count_classes(dataset: AnyPath, class_map: ClassMap) -> pd.DataFrame:
    """Return one row per class of a class map, in the order of its class space.

    Every object of the dataset is looked up again in this map. Columns: `class`; `instances`;
    `rooms` and `buildings` with at least one instance; `doubles`, the rooms with two or more.
    """
    dataset = Path(dataset)
    columns = ["scene_id", "room_index", "raw_category"]
    totals = np.zeros((4, len(class_map.classes)), dtype=np.int64)
    index: dict[str, int | None] = {}
    for table in stream_table(dataset, "objects", columns=columns):
        objects = table.to_pandas(use_threads=False)
        for name in objects["raw_category"].unique():
            index.setdefault(name, class_map.classify(name).class_index)
        totals += _count_objects(objects.assign(kind=objects["raw_category"].map(index)), totals)
    counted = dict(zip(("instances", "rooms", "buildings", "doubles"), totals, strict=True))
    return pd.DataFrame({"class": class_map.classes, **counted})


def _count_objects(objects: pd.DataFrame, like: Counts) -> Counts:
    """Return instances, rooms, buildings and doubles of every class in some buildings, `[4, C]`."""
    objects = objects[objects["kind"].notna()]
    in_rooms = objects[objects["room_index"] > 0]
    each = in_rooms.groupby(["kind", "scene_id", "room_index"]).size()
    counts = (
        objects.groupby("kind").size(),
        each.groupby("kind").size(),
        objects.groupby("kind")["scene_id"].nunique(),
        (each >= 2).groupby("kind").sum(),
    )
    classes = range(like.shape[1])
    return np.stack([one.reindex(classes).fillna(0).astype(np.int64) for one in counts])
