from __future__ import annotations

import json
from pathlib import Path

from data_commands import run


def test_the_thread_from_buildings_to_proof(tmp_path: Path) -> None:
    buildings, out = tmp_path / "buildings", tmp_path / "dataset"
    run("synth", "--out", buildings, "--scenes", "12", "--seed", "3")
    built = json.loads(run("build", "--hm3d", buildings, "--out", out, "--json").stdout)
    assert built["totals"]["scenes"] == 12
    assert built["sources"][0]["kind"] == "synthetic"
    assert run("split", out).stdout == "train 10, val 1, test 1 buildings\n"
    pairs = json.loads(run("pairs", out, "--draws", "3", "--workers", "1", "--json").stdout)
    assert pairs["rows"] == 3 * (12 + built["totals"]["rooms"])
    assert run("check", out).stdout == f"{out}: sound\n"
    assert json.loads(run("check", out, "--json").stdout) == {"sound": True, "faults": []}
