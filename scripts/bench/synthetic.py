"""Datasets of synthetic buildings, which benchmarks are run on."""

from __future__ import annotations

from pathlib import Path

from bsg_data.build import build_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic


def build_synthetic(folder: Path, *, scenes: int) -> Dataset:
    """Write synthetic buildings below a folder, build them to `folder/dataset`, and open that."""
    list(write_synthetic(folder / "buildings", scenes=scenes, seed=0))
    build_dataset(HM3DFolder(folder / "buildings"), folder / "dataset")
    return Dataset.open(folder / "dataset")
