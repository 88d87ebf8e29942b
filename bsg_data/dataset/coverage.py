"""How much of a dataset a class map covers, and what it leaves out."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

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


def measure_coverage(dataset: Path, class_map: ClassMap, *, most: int = 20) -> Coverage:
    """Look every object of a dataset up in a class map, which may be another than its own."""
    names = read_table(dataset, "objects", columns=["raw_category"]).to_pandas()["raw_category"]
    parts = dict.fromkeys(get_args(Role), 0)
    left_out: Counter[str] = Counter()
    for name, count in names.value_counts().items():
        known = class_map.classify(str(name))
        parts[known.role] += int(count)
        if known.role == "left-out":
            left_out[str(known.category)] += int(count)
    ranked = sorted(left_out.items(), key=lambda item: (-item[1], item[0]))
    return Coverage(
        objects=len(names),
        **{role.replace("-", "_"): count for role, count in parts.items()},
        most_left_out=tuple(ranked[:most]),
    )
