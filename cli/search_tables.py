"""Format the results of a search study: a short table per world, or a long one per task."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby

import bsg_models
from bsg_data.tables import format_text


def format_results(
    results: Sequence[bsg_models.WorldResult], *, all_columns: bool = False
) -> Iterator[str]:
    """Yield a table of 80 characters for each world, or a wider one for each world and task.

    Args:
        results: results, sorted by world.
        all_columns: whether to show every figure of a planner.
    """
    for _, group in groupby(results, key=lambda one: one.world):
        tasks = list(group)
        yield from map(_format_long, tasks) if all_columns else [_format_short(tasks)]
        yield from (_format_stops(one) for one in tasks if one.stops)


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
    title = f"{first.world}: {first.searches:,} searches of {first.buildings} buildings per task"
    return f"{title}{_rate_belief(first)}\n{format_text(rows, header=['planner', *header])}"


def _format_long(one: bsg_models.WorldResult) -> str:
    """Return the table of one world and task with every figure of each planner."""
    header = (
        *("planner", "saved, %", "beyond routing", "of the oracle's", "mean", "median"),
        *("wins", "ties", "losses", "cost", "rooms"),
    )
    rows = [
        (
            *(name, _percent(saving.saved)),
            *(
                _percent(share, interval=False)
                for share in (saving.beyond_routing, saving.of_oracle)
            ),
            *(f"{100 * share:.1f}" for share in (saving.mean, saving.median)),
            *(saving.wins, saving.ties, saving.losses),
            *(f"{saving.cost:.2f}", f"{saving.entered:.1f}"),
        )
        for name, saving in one.savings.items()
    ]
    title = f"{one.world}, {one.task}: {one.searches:,} searches of {one.buildings} buildings"
    return f"{title}{_rate_belief(one)}\n{format_text(rows, header=header)}"


def _format_stops(one: bsg_models.WorldResult) -> str:
    rows = [
        (
            name,
            *map(_percent, (stop.saved, stop.missed, stop.incomplete)),
            f"{stop.entered:.1f}",
        )
        for name, stop in one.stops.items()
    ]
    header = ("stops at", "saved, %", "missed, %", "incomplete, %", "rooms")
    title = f"{one.task}: expected-cost stops by itself; baseline: all rooms, nearest first"
    return f"{title}\n{format_text(rows, header=header, numeric=header)}"


def _rate_belief(one: bsg_models.WorldResult) -> str:
    """Return a line that says how good the first belief is; no line without a belief."""
    if math.isnan(one.ranked_first):
        return ""
    return (
        f"\nthe likeliest room holds one in {one.ranked_first:.0%} of searches, a random room in "
        f"{one.chance:.0%}"
    )


def _percent(value: bsg_models.Estimate, *, interval: bool = True) -> str:
    """Return a share in per cent with its interval in whole per cent; a dash if unknown."""
    if math.isnan(value.value):
        return "-"
    text = f"{100 * value.value:.1f}"
    if not interval or math.isnan(value.low):
        return text
    return f"{text} ({round(100 * value.low)} to {round(100 * value.high)})"
