"""Measure what a build takes beside reading the same files, and with two workers beside one.

A build of texts or of meshes reads the files, writes the dataset and flushes it to the disk. Two
workers are processes of a pool that has started already, as in a long build; their row is in
seconds of the clock.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import trimesh
from painted_meshes import Painting, write_painted
from timing import Speed, time_both

from bsg_data.build import build_dataset
from bsg_data.dataset.manifest import Totals
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic

TEXTS, MESHES, BUILDINGS, WORKERS = 145, 2, 512, 2


def measure(hm3d: Path | None) -> Iterator[Speed]:
    """Yield the rows of texts, of meshes and of workers."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        if hm3d is None:
            list(write_synthetic(place / "texts", scenes=TEXTS, seed=0))
        yield measure_texts(hm3d or place / "texts", place / "dataset")
        write_painted(place / "meshes", scenes=MESHES, seed=0, painting=Painting(size="full"))
        yield measure_meshes(place / "meshes", place / "dataset")
        yield measure_workers(place)


def measure_texts(raw: Path, out: Path) -> Speed:
    """Return what a build of annotation texts takes beside pandas reading them."""
    assert build(raw, out, meshes=False).objects == read_texts(raw)
    ours, theirs = time_both(lambda: build(raw, out, meshes=False), lambda: read_texts(raw))
    return Speed(
        what="a build of HM3D's texts" if raw.name != "texts" else "a build of texts",
        against="pandas reading the same texts",
        ours_s=ours,
        theirs_s=theirs,
        target=3,
    )


def measure_meshes(raw: Path, out: Path) -> Speed:
    """Return what a build of full-size meshes takes beside one pass of trimesh over them."""
    assert build(raw, out).placed == MESHES
    ours, theirs = time_both(lambda: build(raw, out), lambda: load_meshes(raw), repeats=3)
    return Speed(
        what=f"a build of {MESHES} full-size meshes",
        against="trimesh.load of the same files, textures unpacked",
        ours_s=ours,
        theirs_s=theirs,
        target=3,
    )


def measure_workers(place: Path) -> Speed:
    """Return what a build takes with two workers beside one."""
    raw = place / "many"
    list(write_synthetic(raw, scenes=BUILDINGS, seed=0))
    with ProcessPoolExecutor(WORKERS) as pool:
        build(raw, place / "started", pool)
        both, one = time_both(
            lambda: build(raw, place / "both", pool),
            lambda: build(raw, place / "one"),
            repeats=2,
            clock=time.perf_counter,
        )
    assert (place / "both/dataset.json").read_bytes() == (place / "one/dataset.json").read_bytes()
    return Speed(
        what=f"a build of {BUILDINGS} buildings with {WORKERS} workers, by the clock",
        against="the same with one",
        ours_s=both,
        theirs_s=one,
        target=1.8,
        at_least=True,
    )


def build(raw: Path, out: Path, pool: Executor | None = None, *, meshes: bool = True) -> Totals:
    """Build a dataset anew, and return what it holds."""
    return build_dataset(HM3DFolder(raw, meshes=meshes), out, force=True, executor=pool).totals


def read_texts(raw: Path) -> int:
    """Read annotation texts into one frame; return the number of its rows."""
    names = ["id", "colour", "name", "region"]
    files = sorted(raw.rglob("*.semantic.txt"))
    return len(pd.concat([pd.read_csv(f, skiprows=1, header=None, names=names) for f in files]))


def load_meshes(raw: Path) -> None:
    """Read meshes and their pixels."""
    for file in sorted(raw.rglob("*.glb")):
        for part in trimesh.load_scene(file).geometry.values():
            np.asarray(part.visual.material.baseColorTexture)
