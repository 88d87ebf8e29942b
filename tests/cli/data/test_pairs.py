from __future__ import annotations

import json
from pathlib import Path

import pytest
from data_commands import run


def test_every_building_and_room_has_a_pair_in_every_draw(dataset: Path) -> None:
    words = ("pairs", dataset, "--force", "--draws", "3", "--workers", "1", "--json")
    totals = json.loads(run("info", dataset, "--json").stdout)["totals"]
    drawn = json.loads(run(*words).stdout)
    assert drawn["rows"] == 3 * (totals["scenes"] + totals["rooms"])
    assert (
        drawn["masks_sha256"] == json.loads(run("info", dataset, "--json").stdout)["masks_sha256"]
    )
    assert drawn["masks_sha256"]["all"] in run(*words[:-1]).stdout


def test_pairs_that_are_there_need_force(dataset: Path) -> None:
    assert "--force" in run("pairs", dataset, code=1).stderr


@pytest.mark.parametrize(
    "words", [("--fraction", "1.5"), ("--fraction", "nan"), ("--mask", "view")]
)
def test_wrong_usage_is_exit_code_2(dataset: Path, words: tuple[str, str]) -> None:
    run("pairs", dataset, *words, code=2)


def test_explore_withholds_and_hides_parts_if_so_asked(dataset: Path) -> None:
    words = ("--mask", "explore", "--withhold", "0.2", "--parts")
    answer = run("pairs", dataset, "--force", "--draws", "2", *words, "--json")
    mask = json.loads(answer.stdout)["recipe"]["mask"]
    assert (mask["strategy"], mask["withhold"], mask["parts"]) == ("explore", 0.2, True)
    assert mask["exploration"]["glimpsed"] == 0.5
    assert "sound" in run("check", dataset).stdout
    run("pairs", dataset, "--force", "--withhold", "1.1", code=2)
