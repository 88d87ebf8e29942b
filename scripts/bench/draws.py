"""Measure masked pairs of many buildings beside a NumPy loop over draws and objects.

    python scripts/bench/draws.py

The loop deletes single objects of a list one after another, as the paper words it. A few draws of
it are timed and scaled up: each of its draws takes as long as any other.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from synthetic import build_synthetic
from timing import Speed, print_speeds, time_both

from bsg_data.arrays import Counts
from bsg_data.dataset.histograms import to_histograms
from bsg_data.observation.pairs import sample_pairs
from bsg_data.recipes import PairsRecipe

BUILDINGS, DRAWS, DRAWS_OF_LOOP = 145, 100, 2


def measure() -> Iterator[Speed]:
    """Yield what all draws of all buildings take, both ways."""
    with tempfile.TemporaryDirectory() as folder:
        data = build_synthetic(Path(folder), scenes=BUILDINGS)
        cells = {scene: data.cells(scene) for scene in data.scene_ids}
    ours, theirs = time_both(lambda: draw(cells), lambda: loop(cells), repeats=3)
    yield Speed(
        what=f"{DRAWS} draws of {BUILDINGS} buildings",
        against="a NumPy loop over draws and objects",
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


def loop(cells: dict[str, Counts]) -> None:
    """Sample some draws of every building by the loop."""
    rng = np.random.default_rng(0)
    for there in cells.values():
        shown = [delete(there, rng) for _ in range(DRAWS_OF_LOOP)]
        to_histograms(np.stack(shown))


def delete(cells: Counts, rng: np.random.Generator) -> Counts:
    """Return the cells `[N, C]` without half of their objects, which are deleted one by one."""
    objects = np.argwhere(cells).repeat(cells[cells > 0], axis=0).tolist()
    shown = cells.copy()
    for _ in range(len(objects) // 2):
        room, kind = objects.pop(int(rng.integers(len(objects))))
        shown[room, kind] -= 1
    return shown


if __name__ == "__main__":
    print_speeds(measure())
