"""The paper's system searches: what each choice moves is worked out by hand, from made searches."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import paper_search
import pytest


def saves(ratio: float, mean: float, median: float) -> dict[str, Any]:
    return {
        "saved": {"value": ratio, "low": ratio - 0.1, "high": ratio + 0.1},
        "mean": mean,
        "median": median,
    }


def keep(folder: Path, one: paper_search.Search, single: dict[str, Any], every: Any) -> None:
    """Write finished searches of two planners that save the same."""
    savings = [dict.fromkeys(paper_search.PLANNERS, of) for of in (single, every)]
    standings = [
        {"task": task, "savings": of} for task, of in zip(paper_search.TASKS, savings, strict=True)
    ]
    (folder / f"{one.name}_30.json").write_text(json.dumps(standings), "utf-8")


def test_the_ways_to_measure_are_compared_by_hand(tmp_path: Path) -> None:
    searches = [paper_search.Search("a@uniform", world) for world in paper_search.WORLDS]
    for place, one in enumerate(searches):
        near = saves(0.34, -1.0, 0.1), saves(0.45, -0.5, 0.2)
        far = saves(0.1, -2.0, 0.0), saves(0.0, -1.0, 0.0)
        keep(tmp_path, one, *(near if place == 0 else far))
    found = {one: paper_search.search(one, tmp_path, tmp_path, episodes=30) for one in searches}
    worlds = paper_search.tabulate_worlds(["a@uniform"], found)
    assert worlds.rows[0][2:4] == ["`single`", "34.0 (24.0 to 44.0)"]
    moves, nearest = paper_search.tabulate_choices(["a@uniform"], found)
    of = {row[1]: row[2:] for row in moves.rows}
    # Of the four worlds: (34 + 3 × 10) / 4 and (45 + 0) / 4; above in one of four, twice.
    assert of["ratio of sums"][::2] == ["16.0", "11.2", "2 of 8"]
    assert of["mean of ratios"][-1] == "8 of 8"
    assert nearest.rows[0][2:] == ["`star:1-10`", "every class", "ratio of sums", "34.0", "45.0"]


def test_a_search_of_other_episodes_is_another_search(tmp_path: Path) -> None:
    one = paper_search.Search("a@uniform", "layout")
    keep(tmp_path, one, saves(0.1, 0.1, 0.1), saves(0.1, 0.1, 0.1))
    assert paper_search.search(one, tmp_path, tmp_path, episodes=30)
    with pytest.raises(IndexError):
        paper_search.search(one, tmp_path, tmp_path, episodes=31)  # there is no leaderboard
