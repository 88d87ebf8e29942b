from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_models.inputs.batches import in_batches
from bsg_models.inputs.graphs import read_split


@pytest.fixture
def masked(dataset: Path) -> MaskedBuildings:
    return read_split(Dataset.open(dataset), "train")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)
@given(cuts=st.lists(st.integers(1, 35), max_size=5), size=st.integers(1, 45))
def test_batches_do_not_depend_on_the_parts(
    masked: MaskedBuildings, cuts: list[int], size: int
) -> None:
    ends = sorted({0, *cuts, len(masked)})
    parts = [masked.take(range(a, b)) for a, b in itertools.pairwise(ends)]
    batches = list(in_batches(parts, size))
    assert [len(some) for some in batches[:-1]] == [size] * (len(batches) - 1)
    expected = list(masked.batches(size))
    assert len(batches) == len(expected)
    for some, same in zip(batches, expected, strict=True):
        assert some.seen.scene_ids == same.seen.scene_ids
        assert np.array_equal(some.draws, same.draws)
        assert np.array_equal(some.seen.inputs, same.seen.inputs)
        assert np.array_equal(some.targets, same.targets)


def test_nothing_comes_in_no_batch() -> None:
    assert list(in_batches([], 4)) == []
