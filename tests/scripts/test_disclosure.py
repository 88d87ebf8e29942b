"""Buildings that are put into weights are found there; an attack finds those that are known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from disclosure import find_disclosed, measure_membership

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import MaskedBuildings, sample_masked
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_data.seal import SEAL
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.runs.checkpoint import load_checkpoint, save_checkpoint
from bsg_models.zoo.model import BeliefModel, ModelInputs
from bsg_models.zoo.settings import ModelConfig


def change(
    path: Path, *, header: dict[str, Any] | None = None, **tensors: npt.NDArray[Any]
) -> None:
    """Write a checkpoint again, with other fields and more tensors."""
    old = load_checkpoint(path)
    save_checkpoint(path, old.header.model_copy(update=header or {}), {**old.tensors, **tensors})
    (path.parent / SEAL).unlink(missing_ok=True)


def test_rows_of_buildings_are_found(dataset: Path, run: Path) -> None:
    data, path = Dataset.open(dataset), run / "best.safetensors"
    found = find_disclosed(path, data)
    assert (found.faults, found.scenes) == ((), 12)
    assert "none of these was found" in str(found)
    room = data.cells(data.scene_ids[0])[1]
    change(path, copied=np.stack([np.ones(45), room / 4]))
    faults = " ".join(find_disclosed(path, data).faults)
    assert "copied has 1 rows that are the histogram of a room" in faults


def test_words_that_name_a_building_are_found(dataset: Path, run: Path) -> None:
    data, path = Dataset.open(dataset), run / "best.safetensors"
    hash_of_one = data.splits["train"][0].partition("-")[2]
    change(path, header={"vocabulary": ("wall", "towel rail", hash_of_one)})
    found = find_disclosed(path, data)
    assert f"its header names the building {hash_of_one}" in found.faults
    assert "2 categories are in fewer than 4 training buildings" in " ".join(found.faults)
    assert found.least_scenes == 0


class Knowing(BeliefModel):
    """A model that knows some buildings by heart, and of others expects one of each class."""

    def __init__(self, known: dict[str, Floats]) -> None:
        super().__init__(ModelConfig(family="knowing"), ModelInputs(classes=45))
        self._known = known

    def predict(self, seen: Observation) -> Expectation:
        """Return what is hidden, where it is known."""
        parts = [
            self._known.get(scene, np.ones((stop - start, 45)))
            for scene, start, stop in zip(
                seen.scene_ids, seen.starts, seen.starts[1:], strict=False
            )
        ]
        return Expectation(seen.inputs.astype(float), poisson(np.concatenate(parts)))


def masked(data: Dataset, scenes: tuple[str, ...]) -> MaskedBuildings:
    return sample_masked(data, scenes, mask=MaskRecipe(), draw=0)


def test_the_attack_tells_what_is_known_by_heart(dataset: Path) -> None:
    data = Dataset.open(dataset)
    inside, outside = data.scene_ids[:8], data.scene_ids[8:]
    ours = masked(data, inside)
    hidden = np.maximum(ours.hidden, 1e-3).astype(float)
    known = {
        scene: hidden[start:stop]
        for scene, start, stop in zip(inside, ours.seen.starts, ours.seen.starts[1:], strict=False)
    }
    found = measure_membership(Knowing(known), ours, masked(data, outside))
    assert found.auc == 1
    assert found.inside < found.outside
    assert found.buildings == (8, 4)
    assert found.error == pytest.approx(np.sqrt(13 / (12 * 32)))  # by hand
