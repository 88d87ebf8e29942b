"""Every source and mask of this project keeps the contract that others inherit."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from conftest import write_twelve

from bsg_data.observation.masks import MASKS
from bsg_data.sources.catalogue import SOURCES
from bsg_data.sources.hm3d_stats import MEMBER
from bsg_data.synthetic.buildings import write_synthetic
from bsg_data.testing import MaskContract, SourceContract

STATISTICS = [
    "Scene Name,Region #,# Unique Categories,# Objects,Object Instances in Region,Category",
    "00801-bbbbbbbbbbb,0,1,1,bed_1",
    "00006-aaaaaaaaaaa,4,2,3,chair_12:chair_3:some_thing_7",
    "00006-aaaaaaaaaaa,-1,1,1,book_20",
]


class TestSources(SourceContract):
    @pytest.fixture(autouse=True, params=SOURCES.names())
    def _row(self, request: pytest.FixtureRequest) -> None:
        self.name = request.param

    def write_example(self, folder: Path) -> Path:
        if self.name == "synthetic":
            list(write_synthetic(folder / "synthetic", scenes=2, seed=0))
            return folder / "synthetic"
        if self.name == "hm3d":
            return write_twelve(folder / "hm3d")
        with zipfile.ZipFile(folder / "statistics.zip", "w") as archive:
            archive.writestr(MEMBER, "\n".join([*STATISTICS, ""]))
        return folder / "statistics.zip"


class TestMasks(MaskContract):
    @pytest.fixture(autouse=True, params=MASKS.names())
    def _row(self, request: pytest.FixtureRequest) -> None:
        self.name = request.param
