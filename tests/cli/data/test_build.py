"""`bsg-data build` and `merge`."""

from __future__ import annotations

import json
from pathlib import Path

from conftest import write_scene
from data_commands import run


def test_losses_are_reported_in_one_table(hm3d_folder: Path, tmp_path: Path) -> None:
    write_scene(hm3d_folder, "00042-broken00000", b"HM3D Semantic Annotations\n1,\x1b[31m\n")
    text = f'HM3D Semantic Annotations\n1,0A0A0A,"{"zzqx " * 20_000}",1\n'
    write_scene(hm3d_folder, "00042-long0000000", text.encode())
    result = run("build", "--hm3d", hm3d_folder, "--out", tmp_path / "d", "--workers", "1")
    assert result.stdout.startswith("13 scenes, 91 rooms, ")
    assert "skipped scenes: 1, unmapped objects: 67" in result.stdout
    assert "00042-broken00000" in result.stdout
    assert "zzqx thing" in result.stdout
    assert "\x1b" not in result.stdout  # a name cannot write to the terminal
    assert max(map(len, result.stdout.splitlines())) < 400, "a long name is cut"
    run("build", "--out", "x", code=2)
    run("build", "--out", "x", "--hm3d", "a", "--source", "hm3d-stats", "b", code=2)


def test_a_source_takes_options_and_a_map_of_its_own(tmp_path: Path) -> None:
    table = "scene,room,category\nflat,kitchen,Herd\nhouse,bath,toilet\n"
    (tmp_path / "objects.csv").write_text(table, "utf-8")
    (tmp_path / "mine.csv").write_text("raw_category,category,class\nHerd,stove,stove\n", "utf-8")
    words = ("build", "--source", "table", tmp_path / "objects.csv", "--out", tmp_path / "d")
    terms = ("licence=CC-BY-4.0", "homepage=https://example.org/?a=b", "citation=Doe, 2026")
    options = [word for term in terms for word in ("--option", term)]
    one = ("--workers", "1", "--class-map", tmp_path / "mine.csv")
    run(*words, *options, *one)
    (source,) = json.loads(run("info", tmp_path / "d", "--json").stdout)["sources"]
    assert source["terms"]["licence"] == "CC-BY-4.0"
    assert source["terms"]["homepage"] == "https://example.org/?a=b"
    plain = run(*words, *one, "--force").stdout
    assert "1 in 45 classes" in plain
    assert "toilet" in plain  # is in no row of the map
    for wrong in (["licence"], ["licence=MIT", "--option", "licence=MIT"]):
        run(*words, "--option", *wrong, code=2)
    assert "did you mean licence?" in run(*words, "--option", "license=MIT", code=1).stderr


def test_words_for_rooms_are_reported_and_taught(tmp_path: Path) -> None:
    table = "scene,room,category\nflat,soggiorno,sofa\nflat,soffitta,box\n"
    (tmp_path / "objects.csv").write_text(table, "utf-8")
    (tmp_path / "words.csv").write_text("source_label,label\nsoggiorno,living room\n", "utf-8")
    words = ("build", "--source", "table", tmp_path / "objects.csv", "--out", tmp_path / "d")
    words += ("--workers", "1")
    said = run(*words).stdout
    assert "kind of room not known" in said
    assert "--room-labels FILE" in said
    taught = run(*words, "--room-labels", tmp_path / "words.csv", "--force").stdout
    assert "soffitta" in taught
    assert "soggiorno" not in taught


def test_a_source_without_meshes_says_so(tmp_path: Path) -> None:
    (tmp_path / "objects.csv").write_text("scene,room,category\nflat,hall,box\n", "utf-8")
    words = ("--source", "table", tmp_path / "objects.csv", "--out", tmp_path / "d")
    assert "has no option 'meshes'" in run("build", *words, "--no-meshes", code=1).stderr
    run("synth", "--out", tmp_path / "made", "--scenes", "1")
    words = ("--source", "synthetic", tmp_path / "made", "--out", tmp_path / "d")
    assert "1 scenes" in run("build", *words, "--no-meshes", "--workers", "1").stdout


def test_two_datasets_become_one(dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "objects.csv").write_text("scene,room,category\nflat,hall,box\n", "utf-8")
    table = ("--source", "table", tmp_path / "objects.csv", "--workers", "1")
    run("build", *table, "--out", tmp_path / "other")
    words = ("merge", dataset, tmp_path / "other", "--out", tmp_path / "both")
    assert "13 scenes" in run(*words).stdout
    assert "--force" in run(*words, code=1).stderr
    run("merge", dataset, "--out", tmp_path / "more", code=2)
