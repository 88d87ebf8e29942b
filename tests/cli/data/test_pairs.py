from __future__ import annotations

import json
from pathlib import Path

import pytest
from data_commands import run


def test_every_building_and_room_has_a_pair_in_every_draw(dataset: Path) -> None:
    words = ("pairs", dataset, "--force", "--draws", "3", "--workers", "1", "--json")
    totals = json.loads(run("info", dataset, "--json").stdout)["totals"]
    assert json.loads(run(*words).stdout)["rows"] == 3 * (totals["scenes"] + totals["rooms"])


def test_pairs_that_are_there_need_force(dataset: Path) -> None:
    assert "--force" in run("pairs", dataset, code=1).stderr


@pytest.mark.parametrize(
    "words", [("--fraction", "1.5"), ("--fraction", "nan"), ("--mask", "view")]
)
def test_wrong_usage_is_exit_code_2(dataset: Path, words: tuple[str, str]) -> None:
    run("pairs", dataset, *words, code=2)
