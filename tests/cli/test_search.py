"""`bsg-search` at the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from commands import runner

from bsg_cli.search import main
from bsg_data.inputs.bounded_file import hash_file

run_command = runner(main)


def test_a_study_with_everything(dataset: Path, run: Path) -> None:
    few = ("--episodes", 6, "--workers", 1, "--worlds", "tree:2-3,star")
    result = run_command(dataset, "--model", run, *few, "--trace", 1)
    assert "need 5 of them" in result.stderr  # intervals, of one building
    for word in ("star:1-10: 6 searches", "all: saved, %"):
        assert word in result.stdout
    out = run / "search"
    report = json.loads((out / "search.json").read_text("utf-8"))
    assert report["checkpoints_sha256"] == [hash_file(run / "best.safetensors")]
    assert len(report["standings"]) == 4
    assert report["standings"][0]["savings"]["nearest"]["saved"]["value"] == 0
    assert (out / "savings.png").stat().st_size > 10_000
    page = (out / "search.html").read_text("utf-8")
    rows = re.findall(r"<td[^>]*>greedy-belief</td><td[^>]*>([^<]+)</td>", page)
    assert rows == re.findall(r"^greedy-belief +(\S+(?: \(.*?\))?)  ", result.stdout, re.MULTILINE)
    assert len(rows) == page.count("<table>") == 2
    assert page.count("data:image/png;base64,") == 1
    assert "Looking for" in (out / "trace.html").read_text("utf-8")
    assert "--force" in run_command(dataset, "--model", run, *few, code=1).stderr


def test_without_a_model_planners_have_no_belief(dataset: Path, tmp_path: Path) -> None:
    few = ("--episodes", 2, "--workers", 1, "--out", tmp_path / "out", "--split", "all")
    few += ("--model", "none")
    result = run_command(dataset, *few, "--worlds", "star,layout", "--json")
    report = json.loads(result.stdout)
    assert list(report["standings"][0]["savings"]) == ["nearest", "routing", "oracle"]
    assert "layout: 12 of 12 buildings left out" in result.stderr
    for refused in (("--planners", "ratio"), ("--trace", 0), ("--trace",)):
        assert "--model" in run_command(dataset, *few, *refused, "--force", code=2).stderr


@pytest.mark.usefixtures("shipped")
def test_a_search_that_names_no_model_takes_the_shipped_one(dataset: Path, tmp_path: Path) -> None:
    few = ("--episodes", 1, "--workers", 1, "--worlds", "star", "--json")
    one = (dataset, "--artifacts", "bed", *few)
    result = run_command(*one, "--out", tmp_path / "a", "--planners", "nearest,greedy-belief")
    assert json.loads(result.stdout)["model"] == "gamma-poisson"
    run_command(*one, "--model", "none", "--model", "universal", code=2)


@pytest.mark.parametrize(
    ("options", "code"),
    [
        (("--worlds", "ring"), 2),
        (("--trace", "some"), 2),
        (("--scene", "nowhere"), 1),
    ],
)
def test_wrong_use_is_refused(
    options: tuple[str, ...], code: int, dataset: Path, run: Path
) -> None:
    run_command(dataset, "--model", run, "--workers", 1, *options, code=code)
    assert not (run / "search").exists()
