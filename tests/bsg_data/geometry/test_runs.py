"""Runs of equal values, beside the groups of itertools."""

from __future__ import annotations

from itertools import groupby

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.geometry.runs import find_runs


@given(st.lists(st.integers(0, 2)))
def test_runs_are_groups(values: list[int]) -> None:
    starts, named = find_runs(np.array(values, dtype=np.int64))
    assert named.tolist() == [value for value, _ in groupby(values)]
    assert np.repeat(named, np.diff(starts, append=len(values))).tolist() == values
