"""Every source and mask of this project keeps the contract that others inherit."""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from conftest import write_twelve

from bsg_data.observation.masks import MASKS, Layout, Mask
from bsg_data.observation.view import View
from bsg_data.recipes import MaskRecipe
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


# The other rows keep the contract in the tests of their own files.
HERE = ("hm3d", "hm3d-stats", "synthetic")


@pytest.mark.parametrize("name", [name for name in SOURCES._rows if name not in HERE])
def test_every_other_source_keeps_the_contract_beside_its_own_tests(name: str) -> None:
    file = Path(__file__).with_name("sources").joinpath(f"test_{name.replace('-', '_')}.py")
    assert "(SourceContract):" in file.read_text("utf-8")


class TestSources(SourceContract):
    @pytest.fixture(autouse=True, params=HERE)
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


def look_carelessly(layout: Layout, recipe: MaskRecipe, rng: np.random.Generator) -> View:
    """Draw from a generator that is nobody's, and tell more of a building than is hidden there."""
    share = np.concatenate([[0.99], CHANCE.uniform(0.2, 0.8, layout.rooms)])
    nodes = np.arange(len(share))
    return View(nodes >= 0, share, np.zeros(layout.shape, dtype=bool), nodes)


CHANCE = np.random.default_rng(0)


@pytest.mark.parametrize(
    "proof",
    [
        MaskContract.test_views_are_sound_and_hide_what_they_say,
        MaskContract.test_what_is_told_is_true_in_the_mean,
        MaskContract.test_a_mask_depends_on_recipe_scene_and_draw_alone,
    ],
)
def test_a_careless_mask_is_found_out(
    proof: Callable[[MaskContract], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    module = ModuleType("careless")
    module.MASK = Mask("told too much", look_carelessly)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "careless", module)
    point = EntryPoint("careless", "careless:MASK", MASKS.group)
    monkeypatch.setitem(MASKS._rows, "careless", point)
    contract = MaskContract()
    contract.name = "careless"  # type: ignore[misc]
    with pytest.raises(AssertionError):
        proof(contract)
