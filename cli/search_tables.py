"""Format the results of a search study: a table for each world."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby

import bsg_models
from bsg_data.tables import format_text


def format_results(results: Sequence[bsg_models.WorldResult]) -> Iterator[str]:
    """Yield a table of 80 characters for each world; the results are sorted by world."""
    for _, group in groupby(results, key=lambda one: one.world):
        yield _format_short(list(group))


def _format_short(tasks: Sequence[bsg_models.WorldResult]) -> str:
    """Return the table of one world: what each planner saves in each task, and its wins."""
    first = tasks[0]
    rows: list[list[object]] = []
    for name in first.savings:
        rows.append([name])
        for one in tasks:
            saving = one.savings[name]
            rows[-1] += [_percent(saving.saved), round(100 * saving.wins / one.searches)]
    header = [cell for one in tasks for cell in (f"{one.task}: saved, %", "wins, %")]
    buildings = f"{first.buildings} building{'s' if first.buildings > 1 else ''}"
    title = f"{first.world}: {first.searches:,} searches of {buildings} per task"
    return f"{title}{_rate_belief(first)}\n{format_text(rows, header=['planner', *header])}"


def _rate_belief(one: bsg_models.WorldResult) -> str:
    """Return a line that says how good the first belief is; no line without a belief."""
    if math.isnan(one.ranked_first):
        return ""
    return (
        f"\nthe likeliest room holds one in {one.ranked_first:.0%} of searches, a random room in "
        f"{one.chance:.0%}"
    )


def _percent(value: bsg_models.Estimate) -> str:
    """Return a share in per cent with its interval in whole per cent; a dash if unknown."""
    if math.isnan(value.value):
        return "-"
    text = f"{100 * value.value:.1f}"
    if math.isnan(value.low):
        return text
    return f"{text} ({round(100 * value.low)} to {round(100 * value.high)})"
