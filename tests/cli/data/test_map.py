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


def test_map_coverage_adds_up(dataset: Path) -> None:
    found = json.loads(run("map", "coverage", dataset, "--json").stdout)
    parts = ("classified", "structure", "nameless", "unmapped", "left_out")
    assert sum(found[part] for part in parts) == found["objects"]


def test_a_rule_that_decides_is_named() -> None:
    assert "(by the rule 'separator')" in run("map", "show", "TV-stand").stdout
    shown = json.loads(run("map", "show", "sofas", "--json").stdout)
    assert (shown["class"], shown["rule"], shown["role"]) == ("couch", "number", "classified")
    run("map", "show", "sofas", "--class-map", "hm3d45-v1", code=1)


def test_maps_are_compared_over_one_dataset(dataset: Path) -> None:
    maps = ("--class-map", "hm3d45-v1", "--class-map", "hm3d45-v2")
    found = json.loads(run("map", "compare", dataset, *maps, "--json").stdout)
    chairs = {version: one["classes"]["chair"] for version, one in found.items()}
    assert chairs["hm3d45-v1"] == {"instances": 24, "rooms": 12, "buildings": 12, "doubles": 12}
    assert chairs["hm3d45-v2"] == chairs["hm3d45-v1"]
    text = run("map", "compare", dataset, *maps).stdout
    assert "two or more hm3d45-v2" in text
