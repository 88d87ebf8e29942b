"""Measure masked pairs of many buildings beside a NumPy loop over draws and objects.

    python scripts/bench/draws.py

The loop deletes single objects one after another, as the paper words it: rows of an array, and for
a second comparison elements of a Python list, which is the quicker loop. A few draws of the loops
are timed and scaled up: each of their draws takes as long as any other.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from synthetic import build_synthetic
from timing import Speed, print_speeds, time_both

from bsg_data.arrays import Counts, Ints
from bsg_data.dataset.histograms import to_histograms
from bsg_data.observation.pairs import sample_pairs
from bsg_data.recipes import PairsRecipe

BUILDINGS, DRAWS, DRAWS_OF_LOOP = 145, 100, 2
Delete = Callable[[Counts, np.random.Generator], Counts]


def measure() -> Iterator[Speed]:
    """Yield what all draws of all buildings take, beside each loop."""
    with tempfile.TemporaryDirectory() as folder:
        data = build_synthetic(Path(folder), scenes=BUILDINGS)
        cells = {scene: data.cells(scene) for scene in data.scene_ids}
    for against, delete in (
        ("a NumPy loop over draws and objects", delete_rows),
        ("a loop over draws and objects of a Python list", delete_elements),
    ):
        ours, theirs = time_both(lambda: draw(cells), partial(loop, cells, delete), repeats=2)
        yield Speed(
            what=f"{DRAWS} draws of {BUILDINGS} buildings",
            against=against,
            ours_s=ours,
            theirs_s=theirs * DRAWS / DRAWS_OF_LOOP,
            target=30,
            at_least=True,
        )


def draw(cells: dict[str, Counts]) -> None:
    """Sample all draws of every building."""
    recipe = PairsRecipe(draws=DRAWS)
    for scene, there in cells.items():
        sample_pairs(there, recipe, scene_id=scene)


def loop(cells: dict[str, Counts], delete: Delete) -> None:
    """Sample some draws of every building by a loop."""
    rng = np.random.default_rng(0)
    for there in cells.values():
        shown = [delete(there, rng) for _ in range(DRAWS_OF_LOOP)]
        to_histograms(np.stack(shown))


def delete_rows(cells: Counts, rng: np.random.Generator) -> Counts:
    """Return the cells `[N, C]` without half of their objects, rows of an array."""
    objects = list_objects(cells)
    for _ in range(len(objects) // 2):
        objects = np.delete(objects, rng.integers(len(objects)), axis=0)
    shown = np.zeros_like(cells)
    np.add.at(shown, tuple(objects.T), 1)
    return shown


def delete_elements(cells: Counts, rng: np.random.Generator) -> Counts:
    """Return the cells `[N, C]` without half of their objects, elements of a list."""
    objects = list_objects(cells).tolist()
    shown = cells.copy()
    for _ in range(len(objects) // 2):
        room, kind = objects.pop(int(rng.integers(len(objects))))
        shown[room, kind] -= 1
    return shown


def list_objects(cells: Counts) -> Ints:
    """Return the room and the class of every object, `[O, 2]`."""
    return np.argwhere(cells).repeat(cells[cells > 0], axis=0)


if __name__ == "__main__":
    print_speeds(measure())
