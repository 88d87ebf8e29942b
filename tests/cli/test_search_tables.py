from __future__ import annotations

import dataclasses

from bsg_cli.search_tables import format_results
from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.search.catalogue import PLANNERS
from bsg_models.studies.savings import Saving, WorldResult

NAN = float("nan")


def estimate(value: float, low: float = NAN, high: float = NAN) -> Estimate:
    return Estimate(value, low, high, nodes=200)


def saving(*saved: float) -> Saving:
    shares = (estimate(*saved), estimate(NAN), estimate(0.5))
    return Saving(*shares, -1.5, 0.25, wins=150, ties=20, losses=30, cost=12.345, entered=3.21)


def study(task: str, **changed: object) -> WorldResult:
    savings = {"nearest": saving(0, 0, 0), "ratio": saving(0.4321, 0.391, 0.466)}
    result = WorldResult("tree:1-10", task, 10, 200, 0.34, 0.12, savings)
    return dataclasses.replace(result, **changed)


def test_a_world_by_hand() -> None:
    (table,) = format_results([study("single"), study("all")])
    assert table.splitlines() == [
        "tree:1-10: 200 searches of 10 buildings per task",
        "the likeliest room holds one in 34% of searches, a random room in 12%",
        "planner  single: saved, %  wins, %  all: saved, %    wins, %",
        "nearest  0.0 (0 to 0)           75  0.0 (0 to 0)          75",
        "ratio    43.2 (39 to 47)        75  43.2 (39 to 47)       75",
    ]


def test_a_table_fits_80_characters_with_every_planner_of_ours() -> None:
    worst = {
        "world": "complete:1.5-10.5",
        "searches": 145_000,
        "savings": dict.fromkeys(PLANNERS, saving(-1.2345, -2.001, -1.001)),
    }
    (table,) = format_results([study("single", **worst), study("all", **worst)])
    assert max(map(len, table.splitlines())) <= 80


def test_what_is_unknown_is_a_dash_or_left_out() -> None:
    savings = {"nearest": saving(0), "ratio": saving(NAN)}
    (table,) = format_results([study("single", ranked_first=NAN, savings=savings)])
    assert "likeliest" not in table
    assert [line.split()[1] for line in table.splitlines()[-2:]] == ["0.0", "-"]
