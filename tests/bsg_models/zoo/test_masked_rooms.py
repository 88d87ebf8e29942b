"""Samples of rooms under masks: streams that are the whole, samples that do not ask for batches."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import MaskedBuildings, sample_masked, stack_masked
from bsg_data.recipes import MaskRecipe
from bsg_models.inputs.folds import scenes_of
from bsg_models.studies.run_summary import summarise_run
from bsg_models.training.training import train_run
from bsg_models.zoo import presence_odds
from bsg_models.zoo.config import find_config
from bsg_models.zoo.masked_rooms import (
    choose_buildings,
    choose_within,
    stream_uniform,
    take_sample,
)
from bsg_models.zoo.settings import DataConfig


def names(masked: MaskedBuildings) -> list[tuple[str, int]]:
    """Return the scene and the draw of every building."""
    return list(zip(masked.seen.scene_ids, masked.draws.tolist(), strict=True))


def test_a_stream_is_all_draws_of_some_buildings_then_of_the_next(
    dataset: Path,
) -> None:
    data, choice = Dataset.open(dataset), DataConfig()
    scenes = scenes_of(data, "train")
    batches = list(stream_uniform(data, choice, draws=3))
    assert [len(batch) for batch in batches] == [len(scenes)] * 3
    for draw, batch in enumerate(batches):
        alone = sample_masked(data, scenes, mask=choice.mask, draw=draw)
        np.testing.assert_array_equal(batch.seen.inputs, alone.seen.inputs)


@settings(max_examples=100, deadline=None)
@given(sizes=st.lists(st.integers(0, 9), min_size=1, max_size=20), most=st.integers(0, 60))
def test_what_is_kept_is_within_the_bound_and_as_much_as_fits(sizes: list[int], most: int) -> None:
    keys = np.random.default_rng(len(sizes)).random(len(sizes))
    kept = choose_within(keys, sizes, most=most)
    number, order = int(kept.sum()), np.argsort(keys)
    assert kept[order[:number]].all()  # the lowest keys
    total = int(np.array(sizes)[kept].sum())
    assert total <= most or number == 1
    assert number == len(sizes) or total + sizes[order[number]] > most


@pytest.mark.parametrize("size", [1, 3, 100])
def test_a_sample_does_not_depend_on_batches(dataset: Path, size: int) -> None:
    data = Dataset.open(dataset)
    mask = MaskRecipe()
    whole = stack_masked([sample_masked(data, data.scene_ids, mask=mask, draw=d) for d in range(4)])
    for most in (10, 60, 10_000):
        expected, _ = take_sample([whole], most=most)
        found, number = take_sample(whole.batches(size), most=most)
        assert number == len(whole)
        assert names(found) == names(expected)
        np.testing.assert_array_equal(found.targets, expected.targets)
        assert len(found.targets) <= most or len(found) == 1
    assert names(take_sample([whole], most=len(whole.targets))[0]) == names(whole)


def test_buildings_beyond_the_bound_are_left_out(dataset: Path) -> None:
    data, choice = Dataset.open(dataset), DataConfig()
    every = scenes_of(data, "train")
    rooms = {scene: len(data.cells(scene)) - 1 for scene in every}
    assert choose_buildings(data, choice) == every
    some = choose_buildings(data, choice, most=sum(rooms.values()) // 2)
    assert 0 < len(some) < len(every)
    assert sum(rooms[scene] for scene in some) <= sum(rooms.values()) // 2
    assert list(some) == [scene for scene in every if scene in some]


def test_a_fit_to_a_sample_says_so(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def choose_few(data: Dataset, choice: DataConfig) -> tuple[str, ...]:
        return choose_buildings(data, choice, most=30)

    monkeypatch.setattr(presence_odds, "choose_buildings", choose_few)
    run = tmp_path / "run"
    list(train_run(find_config("prior-table"), dataset, run))
    (note,) = summarise_run(run).notes
    assert re.match(r"fitted to a random sample of \d of 10 training buildings", note)
