"""Measure 100 masks of each of 145 buildings beside loops over draws and objects.

The loops delete single objects one after another, as the paper words it: rows of an array, or
elements of a Python list, which is the quicker loop. A few of their draws are timed and scaled up:
each takes as long as any other. All hide the same number of objects. A bound is what NumPy's
distribution alone takes for the same draws: its numbers are those of masks that are published.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from timing import Speed, time_both

from bsg_data.arrays import Counts, Ints
from bsg_data.build import build_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import to_histograms
from bsg_data.observation.pairs import sample_pairs
from bsg_data.recipes import PairsRecipe
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic

BUILDINGS, DRAWS, DRAWS_OF_LOOP = 145, 100, 2
Delete = Callable[[Counts, np.random.Generator], Counts]


def measure(hm3d: Path | None) -> Iterator[Speed]:
    """Yield what all draws of all buildings take, beside each loop."""
    with tempfile.TemporaryDirectory() as folder:
        data = build(Path(folder), hm3d)
        cells = {scene: data.cells(scene) for scene in data.scene_ids}
    for against, delete, target in (
        ("a NumPy loop over draws and objects", delete_rows, 30),
        ("a loop over draws and objects of a Python list", delete_elements, 20),
    ):
        left = loop(cells, delete)
        assert [shown[:, 0].sum() for shown in left] == [
            shown[np.arange(0, len(shown), len(there))][:DRAWS_OF_LOOP].sum()
            for shown, there in zip(map(draw, cells, cells.values()), cells.values(), strict=True)
        ]
        ours, theirs = time_both(
            lambda: [len(draw(*one)) for one in cells.items()],
            partial(loop, cells, delete),
            repeats=7,
        )
        what = f"{DRAWS} draws of masks of {BUILDINGS} buildings"
        yield Speed(what, against, ours, theirs * DRAWS / DRAWS_OF_LOOP, target, at_least=True)
    ours, theirs = time_both(
        lambda: [len(draw(*one)) for one in cells.items()],
        lambda: [draw_counts(there) for there in cells.values()],
    )
    yield Speed(what, "NumPy's hypergeometric distribution alone", ours, theirs, 2, kind="bound")


def build(folder: Path, hm3d: Path | None) -> Dataset:
    """Build HM3D's buildings, or as many synthetic ones, below a folder; open the dataset."""
    if hm3d is None:
        list(write_synthetic(folder / "buildings", scenes=BUILDINGS, seed=0))
    build_dataset(HM3DFolder(hm3d or folder / "buildings"), folder / "dataset")
    return Dataset.open(folder / "dataset")


def draw(scene: str, cells: Counts) -> Counts:
    """Return the histograms that all draws of a building show, `[draws · N, C]`."""
    return sample_pairs(cells, PairsRecipe(draws=DRAWS), scene_id=scene)[1]


def draw_counts(cells: Counts) -> None:
    """Draw how many of half of the objects are of each room and class, by new generators."""
    counts = cells[cells > 0]
    half = int(counts.sum()) // 2
    for number in range(DRAWS):
        rng = np.random.Generator(np.random.PCG64(number))
        rng.multivariate_hypergeometric(counts, half)


def loop(cells: dict[str, Counts], delete: Delete) -> list[Counts]:
    """Return what some draws of every building show, by a loop: `[draws, N, C]`."""
    rng = np.random.default_rng(0)
    return [
        to_histograms(np.stack([delete(there, rng) for _ in range(DRAWS_OF_LOOP)]))
        for there in cells.values()
    ]


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
