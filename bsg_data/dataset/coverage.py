"""How much of a dataset a class map covers, what it leaves out, and how often each class occurs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import pandas as pd

from bsg_data.dataset.shards import read_table
from bsg_data.scene.class_map import ClassMap, Role


@dataclass(frozen=True, slots=True)
class Coverage:
    """The objects of a dataset by what a class map makes of them; the five parts add up.

    Attributes:
        objects: all of them.
        classified: with a class.
        structure: parts of the building: wall, floor, door, ...
        nameless: blank, `unknown`, or `unknown/` and something.
        unmapped: whose name the map does not know.
        left_out: named objects that are outside the classes.
        most_left_out: (category, instances) of the most frequent of these.
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
        """Share of the objects that are not structure which have a class; 0 without any."""
        return self.classified / max(1, self.objects - self.structure)

    @property
    def share_of_named(self) -> float:
        """The same without the nameless objects."""
        return self.classified / max(1, self.objects - self.structure - self.nameless)


def measure_coverage(
    dataset: Path, class_map: ClassMap | None = None, *, most: int = 20
) -> Coverage:
    """Measure how much of a dataset a class map covers.

    Args:
        dataset: its folder.
        class_map: by which every object is looked up; None takes what the dataset was built with,
            which is a map for each source.
        most: how many of the names that are left out are listed.
    """
    columns = ["raw_category", "category", "role"]
    objects = read_table(dataset, "objects", columns=columns).to_pandas()
    if class_map is not None:
        known = {name: class_map.classify(name) for name in objects["raw_category"].unique()}
        objects["role"] = objects["raw_category"].map({k: v.role for k, v in known.items()})
        objects["category"] = objects["raw_category"].map({k: v.category for k, v in known.items()})
    parts = {role: int((objects["role"] == role).sum()) for role in get_args(Role)}
    left_out = objects.loc[objects["role"] == "left-out", "category"].value_counts()
    ranked = sorted(left_out.items(), key=lambda item: (-item[1], str(item[0])))
    return Coverage(
        objects=len(objects),
        **{role.replace("-", "_"): count for role, count in parts.items()},
        most_left_out=tuple((str(name), int(count)) for name, count in ranked[:most]),
    )


def count_classes(dataset: Path, class_map: ClassMap) -> pd.DataFrame:
    """Return one row a class of a class map, in the order of its space.

    Columns: `class`, `instances`, and `rooms`, `buildings` that hold one; `doubles`, the rooms that
    hold two or more. Every object of the dataset is looked up again.
    """
    columns = ["scene_id", "room_index", "raw_category"]
    objects = read_table(dataset, "objects", columns=columns).to_pandas()
    index = {
        name: class_map.classify(name).class_index for name in objects["raw_category"].unique()
    }
    objects["class"] = objects["raw_category"].map(index)
    objects = objects[objects["class"].notna()]
    in_rooms = objects[objects["room_index"] > 0]
    each = in_rooms.groupby(["class", "scene_id", "room_index"]).size()
    frame = pd.DataFrame(
        {
            "instances": objects.groupby("class").size(),
            "rooms": each.groupby("class").size(),
            "buildings": objects.groupby("class")["scene_id"].nunique(),
            "doubles": (each >= 2).groupby("class").sum(),
        }
    )
    frame = frame.reindex(range(len(class_map.classes))).fillna(0).astype("int64")
    frame.insert(0, "class", class_map.classes)
    return frame.reset_index(drop=True)
