from __future__ import annotations

import json
from pathlib import Path

from data_commands import run


def test_map_shows_names_classes_and_near_misses() -> None:
    assert "→ corrected 'trash can' → class garbage bin" in run("map", "show", "TRASHCAN").stdout
    assert "class none (part of the building)" in run("map", "show", "wall").stdout
    shown = json.loads(run("map", "show", "garbage bin", "--json").stdout)
    assert "trash can" in shown["spellings"]
    assert "nearest: chair" in run("map", "show", "chairr", code=1).stdout
    assert "hm3d45-v1" in run("map", "list").stdout


def test_map_coverage_adds_up(dataset: Path) -> None:
    found = json.loads(run("map", "coverage", dataset, "--json").stdout)
    parts = ("classified", "structure", "nameless", "unmapped", "left_out")
    assert sum(found[part] for part in parts) == found["objects"]
