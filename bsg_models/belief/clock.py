"""Read and show times: seconds of the clock of a home.

A time is a number of seconds, of any clock, or ISO 8601 with a zone; dates count from 1970 in UTC.
"""

from __future__ import annotations

import math
from datetime import datetime, timezone
from time import time as clock
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, WithJsonSchema

from bsg_data.words.shown import show_value

HOUR = 3600.0  # seconds
DAY = 24 * HOUR
_MOST = 1e11  # seconds: the year 5138; milliseconds are more
_DATED = 1e8  # seconds: later times are dates; a simulator's clock begins at 0
_HOW = 'a time, such as 1732800000 (seconds) or "2026-11-28T08:30:00+01:00" (ISO 8601)'


def read_time(value: object) -> float:
    """Return seconds, to the microsecond, of a number, a date with a zone, or its text.

    Raises:
        ValueError: for anything else.
    """
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(value.strip().replace("Z", "+00:00"))
        except ValueError:
            raise ValueError(f"expected {_HOW}, found {show_value(value)}") from None
    if isinstance(value, datetime):
        if value.tzinfo is None:
            raise ValueError(
                f"expected a time with its zone, found {value.isoformat()}; add Z or an offset "
                "such as +01:00"
            )
        value = value.timestamp()
    value = value.item() if isinstance(value, np.generic) else value
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < math.inf:
        raise ValueError(f"expected {_HOW}, found {show_value(value)}")
    if abs(value) > _MOST:
        raise ValueError(f"expected seconds, found {show_value(value)}; are these milliseconds?")
    return round(float(value), 6)


def read_now(value: object) -> float:
    """Return what time it is, as a person or a program says it: `now`, a text of seconds, a time.

    Raises:
        ValueError: for anything else.
    """
    if value == "now":
        return round(clock(), 6)
    try:
        return read_time(float(value) if isinstance(value, str) else value)
    except ValueError:
        return read_time(value)


def is_dated(time: float) -> bool:
    """Return whether a time is a date; a clock without dates begins at 0."""
    return time >= _DATED


def show_time(time: float | None) -> str | float | None:
    """Return a time as a document has it: a date in UTC, or seconds of a clock without dates.

    >>> show_time(1732800000.0), show_time(3600.0)
    ('2024-11-28T13:20:00Z', 3600.0)
    """
    if time is None or not is_dated(time):
        return time
    return datetime.fromtimestamp(time, timezone.utc).isoformat().replace("+00:00", "Z")


def say_ago(shown: str | float, now: float) -> str:
    """Return how long ago a time was, which is said as `show_time` returns it.

    >>> say_ago(3600.0, 3 * 3600.0), say_ago("2024-11-28T13:20:00Z", 1733059200.0)
    ('2 h ago', '3 days ago')
    """
    hours = (now - read_time(shown)) / HOUR
    if hours < 1:
        return "<1 h ago"
    return f"{hours:.0f} h ago" if hours < 48 else f"{hours / 24:.0f} days ago"


def has_stayed(time: float | None, now: float | None, stays: float) -> float:
    """Return P(a thing is still where it was at a time): 2^(−age / stays); 1 without a clock.

    Args:
        time: when it was seen there; None if nobody says.
        now: of the same clock.
        stays: hours after which half of such things are elsewhere.
    """
    if time is None or now is None or now <= time:
        return 1.0
    return float(2.0 ** (-(now - time) / HOUR / stays))


Time = Annotated[
    float,
    BeforeValidator(read_time),
    WithJsonSchema({"type": ["number", "string"], "description": "seconds, or ISO 8601"}),
]
