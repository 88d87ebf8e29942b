from __future__ import annotations

import json
from pathlib import Path

import pytest
from data_commands import run


def test_every_building_and_room_has_a_pair_in_every_draw(dataset: Path) -> None:
    assert "--force" in run("pairs", dataset, code=1).stderr
    words = ("pairs", dataset, "--force", "--draws", "3", "--workers", "1")
    drawn = run(*words).stdout
    info = json.loads(run("info", dataset, "--json").stdout)
    rows = 3 * (info["totals"]["scenes"] + info["totals"]["rooms"])
    assert drawn.startswith(f"{rows:,} pairs: 3 draws")
    assert info["masks_sha256"]["all"] in drawn


def test_explore_withholds_and_hides_parts_if_so_asked(dataset: Path) -> None:
    words = ("--mask", "explore", "--withhold", "0.2", "--hide-parts")
    run("pairs", dataset, "--force", "--draws", "2", "--workers", "1", *words)
    mask = json.loads(run("info", dataset, "--json").stdout)["pairs"]["mask"]
    assert (mask["strategy"], mask["withhold"], mask["parts"]) == ("explore", 0.2, True)
    assert mask["exploration"]["glimpsed"] == 0.5
    assert "sound" in run("check", dataset).stdout
    for wrong in (("--withhold", "1.1"), ("--fraction", "nan"), ("--mask", "view")):
        run("pairs", dataset, "--force", *wrong, code=2)


@pytest.mark.parametrize("mask", ["uniform", "explore", "tour"])
def test_only_masks_that_read_connections_say_that_none_is_known(dataset: Path, mask: str) -> None:
    words = ("--force", "--draws", "1", "--workers", "1", "--mask", mask)
    said = run("pairs", dataset, *words).stderr
    assert ("no adjacency" in said) == (mask != "uniform")
