"""Times: read in any form, shown as dates, and read back."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_models.belief.clock import has_stayed, read_time, show_time

NOON = 1795867200.0  # 2026-11-28, in UTC
TIMES = st.floats(-1e11, 1e11)


@pytest.mark.parametrize(
    "moment",
    [
        "2026-11-28T12:00:00Z",
        "2026-11-28T13:00:00+01:00",
        " 2026-11-28 12:00:00.000+00:00 ",
        "2026-11-28T04:30:00-07:30",
        datetime(2026, 11, 28, 12, tzinfo=timezone.utc),
        datetime(2026, 11, 28, 14, tzinfo=timezone(timedelta(hours=2))),
        int(NOON),
        np.float64(NOON),
        np.int64(NOON),
    ],
)
def test_one_moment_in_all_forms(moment: Any) -> None:
    assert read_time(moment) == NOON
    assert show_time(read_time(moment)) == "2026-11-28T12:00:00Z"


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("2026-11-28T12:00:00", "zone"),
        (datetime(2026, 11, 28), "zone"),
        (np.datetime64("2026-11-28"), "expected a time"),
        (float("nan"), "expected a time"),
        (np.float32("-inf"), "expected a time"),
        (NOON * 1000, "milliseconds"),
        (10**400, "milliseconds"),
        (True, "expected a time"),
        ("1795867200", "expected a time"),
        ("", "expected a time"),
        (None, "expected a time"),
    ],
)
def test_what_is_no_time_is_refused(value: Any, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        read_time(value)


@given(TIMES)
def test_a_time_that_was_read_is_shown_and_read_back(seconds: float) -> None:
    time = read_time(seconds)
    assert abs(time - seconds) <= 1e-6 + 1e-12 * abs(seconds)
    assert read_time(show_time(time)) == time
    assert read_time(str(show_time(time))) == time if time >= 1e8 else show_time(time) == time


@given(TIMES, TIMES, st.floats(1e-3, 1e9))
def test_half_of_the_things_have_moved_when_it_is_said(
    time: float, later: float, stays: float
) -> None:
    time, later = sorted([time, later])
    assert 0 <= has_stayed(time, later, stays) <= has_stayed(time, time, stays) == 1
    assert has_stayed(later, time, stays) == has_stayed(None, time, stays) == 1
    assert has_stayed(0.0, 3600 * stays, stays) == pytest.approx(0.5)
