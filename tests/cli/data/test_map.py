from __future__ import annotations

import json
from pathlib import Path

from data_commands import run


def test_map_shows_names_classes_and_near_misses() -> None:
    assert "→ corrected 'trash can' → class garbage bin" in run("map", "show", "TRASHCAN").stdout
    assert "class none (part of the building)" in run("map", "show", "wall").stdout
    shown = json.loads(run("map", "show", "garbage bin", "--json").stdout)
    assert "trash can" in shown["spellings"]
    shown_in_another = run("map", "show", "sneakers").stdout
    assert "class none (known, but not counted)\nin hm3d-wide-v1: class shoe\n" in shown_in_another
    assert "by the rule 'spelling'" in run("map", "show", "chairr").stdout
    assert "nearest: chair" in run("map", "show", "chaair thing", code=1).stdout
    assert "hm3d45-v1" in run("map", "list").stdout


def test_coverage_adds_up_and_is_that_of_the_map_the_dataset_was_built_with(dataset: Path) -> None:
    (built,) = json.loads(run("map", "coverage", dataset, "--json").stdout).items()
    counted = ("classified", "structure", "nameless", "unmapped", "left_out")
    assert sum(built[1][name] for name in counted) == built[1]["objects"] > 0
    again = run("map", "coverage", dataset, "--class-map", built[0], "--json")
    assert json.loads(again.stdout) == {built[0]: built[1]}


def test_a_dataset_of_several_maps_is_told_from_one_map(dataset: Path, tmp_path: Path) -> None:
    assert run("map", "coverage", dataset, "--class-map", "hm3d45-v1").stderr == ""
    run("synth", "--out", tmp_path / "made", "--scenes", "2")
    made = ("--source", "synthetic", tmp_path / "made", "--class-map", "mp3d45-v1")
    run("build", *made, "--out", tmp_path / "other", "--workers", "1")
    run("merge", dataset, tmp_path / "other", "--out", tmp_path / "both")
    built = run("map", "coverage", tmp_path / "both")
    assert "hm3d45-v1, mp3d45-v1" in built.stdout
    assert built.stderr == ""
    one = run("map", "coverage", tmp_path / "both", "--class-map", "hm3d45-v1")
    assert "was built with several maps (hm3d45-v1, mp3d45-v1)" in one.stderr
