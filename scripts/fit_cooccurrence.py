"""Count which classes meet in the rooms of BEHAVIOR: mappings/behavior-cooccurrence-v1.csv.

    bsg-data build --source behavior combined_room_object_list.json --out behavior
    python scripts/fit_cooccurrence.py behavior > mappings/behavior-cooccurrence-v1.csv

docs/sources.md says where the list is. A row is a pair of classes that meet in rooms of at least
three buildings, so that no row tells of one building; a class that fewer buildings have is left
out. A pair of listed classes without a row meets in two buildings at most.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bsg_data.dataset.dataset import Dataset

FEWEST = 3  # buildings that a number is of


def count_pairs(
    buildings: list[npt.NDArray[np.int64]], classes: tuple[str, ...]
) -> Iterator[tuple[str | int, ...]]:
    """Yield class, class, rooms with both, rooms with the first, with the second, and rooms.

    Args:
        buildings: `[R, C]` counts of the rooms of each.
        classes: `[C]` their names.
    """
    there = [(rooms > 0).astype(np.int64) for rooms in buildings]
    together = np.array([rooms.T @ rooms for rooms in there])
    met, both = (together > 0).sum(axis=0), together.sum(axis=0)
    listed = np.flatnonzero(met.diagonal() >= FEWEST)
    for a in listed:
        for b in listed[listed > a]:
            if met[a, b] >= FEWEST:
                numbers = (both[a, b], both[a, a], both[b, b], sum(map(len, there)))
                yield classes[a], classes[b], *map(int, numbers)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("dataset", type=Path)
    data = Dataset.open(parser.parse_args().dataset)
    kinds = {source.kind for source in data.manifest.sources}
    if kinds != {"behavior"}:
        sys.exit(f"{data.path}: expected a dataset of behavior alone, found {', '.join(kinds)}")
    buildings = [data.cells(scene)[1:] for scene in data.scene_ids]
    print("class_a,class_b,rooms_with_both,rooms_with_a,rooms_with_b,rooms")
    for row in count_pairs(buildings, data.manifest.class_space.classes):
        print(*row, sep=",")


if __name__ == "__main__":
    main()
