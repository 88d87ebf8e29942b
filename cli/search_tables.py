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
    rows = [
        (name, *(cell for one in tasks for cell in _short_cells(one, one.savings[name])))
        for name in first.savings
    ]
    header = [cell for one in tasks for cell in (f"{one.task}: saved, %", "wins, %")]
    return "\n".join(
        [
            f"{first.world}: {first.searches:,} searches of {first.buildings} buildings per task",
            *_ranked_first(first),
            format_text(rows, header=["planner", *header]),
        ]
    )


def _short_cells(one: bsg_models.WorldResult, saving: bsg_models.Saving) -> tuple[object, ...]:
    return _percent(saving.saved), round(100 * saving.wins / one.searches)


def _format_long(one: bsg_models.WorldResult) -> str:
    """Return the table of one world and task with every figure of each planner."""
    header = (
        *("planner", "saved, %", "beyond routing", "of the oracle's", "mean", "median"),
        *("wins", "ties", "losses", "cost", "rooms"),
    )
    rows = [
        (
            name,
            _percent(saving.saved),
            _percent(saving.beyond_routing, interval=False),
            _percent(saving.of_oracle, interval=False),
            f"{100 * saving.mean:.1f}",
            f"{100 * saving.median:.1f}",
            saving.wins,
            saving.ties,
            saving.losses,
            f"{saving.cost:.2f}",
            f"{saving.entered:.1f}",
        )
        for name, saving in one.savings.items()
    ]
    searches = f"{one.searches:,} searches of {one.buildings} buildings"
    lines = [f"{one.world}, {one.task}: {searches}", *_ranked_first(one)]
    return "\n".join([*lines, format_text(rows, header=header)])


def _format_stops(one: bsg_models.WorldResult) -> str:
    rows = [
        (
            name,
            _percent(stop.saved),
            _percent(stop.missed),
            _percent(stop.incomplete),
            f"{stop.entered:.1f}",
        )
        for name, stop in one.stops.items()
    ]
    header = ("stops at", "saved, %", "missed, %", "incomplete, %", "rooms")
    return (
        f"{one.task}: expected-cost stops by itself; baseline: all rooms, nearest first\n"
        + format_text(rows, header=header, numeric=header)
    )


def _ranked_first(one: bsg_models.WorldResult) -> list[str]:
    """Return a line that says how good the first belief is; no line without a belief."""
    if math.isnan(one.ranked_first):
        return []
    return [
        f"the likeliest room holds one in {one.ranked_first:.0%} of searches, a random room in "
        f"{one.chance:.0%}"
    ]


def _percent(value: bsg_models.Estimate, *, interval: bool = True) -> str:
    """Return a share in per cent with its interval in whole per cent; a dash if unknown."""
    if math.isnan(value.value):
        return "-"
    text = f"{100 * value.value:.1f}"
    if not interval or math.isnan(value.low):
        return text
    return f"{text} ({round(100 * value.low)} to {round(100 * value.high)})"
