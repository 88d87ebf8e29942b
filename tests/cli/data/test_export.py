from __future__ import annotations

import json
from pathlib import Path

from data_commands import run
from dsg_files import write_graph


def test_rooms_are_written_and_counted(tmp_path: Path) -> None:
    write_graph(tmp_path / "graphs" / "a.json")
    build = ("build", "--workers", "1", "--out", tmp_path / "dataset")
    run(*build, "--source", "spark-dsg", tmp_path / "graphs")
    out = tmp_path / "regions"
    done = run("export", tmp_path / "dataset", "--to", "habitat", "--out", out)
    assert f"1 rooms of 1 scenes in 1 files in {out}" in done.stdout
    assert "rooms left out, because they have no box: 1" in done.stdout
    assert json.loads((out / "a.semantic_config.json").read_text())["region_annotations"]
    again = run("export", tmp_path / "dataset", "--to", "habitat", "--out", out, code=1)
    assert "--force replaces it" in again.stderr
    run("export", tmp_path / "dataset", "--to", "habitat", "--out", out, "--force")


def test_a_character_that_xml_cannot_hold_is_said(tmp_path: Path) -> None:
    (tmp_path / "rooms.csv").write_text(
        "scene,room,category\nflat,hall,la\ufffemp\nhouse,hall,lamp\n"
    )
    build = ("build", "--workers", "1", "--out", tmp_path / "dataset")
    run(*build, "--source", "table", tmp_path / "rooms.csv")
    done = run("export", tmp_path / "dataset", "--to", "graphml", "--out", tmp_path / "graphs")
    assert "2 rooms and 2 objects of 2 scenes in 2 files" in done.stdout
    assert "U+FFFD stands for each (1 scenes)" in done.stdout
