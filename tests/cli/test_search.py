"""`bsg-search` at the command line."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from bsg_cli.search import main
from bsg_data.figure_file import FigureError
from bsg_data.inputs.bounded_file import hash_file


def run_command(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(one) for one in arguments])


def test_a_study_with_everything(dataset: Path, run: Path) -> None:
    few = ("--episodes", 6, "--workers", 1, "--resamples", 20, "--worlds", "tree:2-3,star")
    result = run_command("--model", run, "--data", dataset, *few, "--stop", "0.1", "--trace", 1)
    assert result.exit_code == 0, result.stderr
    assert "need 5 of them" in result.stderr  # intervals, of one building
    for word in ("star:1-10: 6 searches", "all: expected-cost stops by itself", "all: saved, %"):
        assert word in result.stdout
    assert "beyond routing" not in result.stdout
    out = run / "search"
    report = json.loads((out / "search.json").read_text("utf-8"))
    assert report["checkpoints_sha256"] == [hash_file(run / "best.safetensors")]
    assert len(report["standings"]) == 4
    assert report["standings"][0]["savings"]["nearest"]["saved"]["value"] == 0
    assert (out / "savings.png").stat().st_size > 10_000
    assert "Looking for" in (out / "trace.html").read_text("utf-8")
    again = run_command("--model", run, "--data", dataset, *few)
    assert again.exit_code == 1
    assert "--force" in again.stderr


def test_without_a_model_planners_have_no_belief(dataset: Path, tmp_path: Path) -> None:
    few = ("--episodes", 2, "--workers", 1, "--out", tmp_path / "out", "--split", "all")
    few += ("--no-model",)
    result = run_command("--data", dataset, *few, "--worlds", "star,layout", "--json")
    assert result.exit_code == 0, result.stderr
    report = json.loads(result.stdout)
    assert list(report["standings"][0]["savings"]) == ["nearest", "routing", "oracle"]
    assert "layout: 12 of 12 buildings left out" in result.stderr
    for refused in (("--planners", "ratio"), ("--stop", "0.1"), ("--trace", 0), ("--trace",)):
        result = run_command("--data", dataset, *few, *refused, "--force")
        assert result.exit_code == 2
        assert "--model" in result.stderr


def test_results_are_kept_if_the_figure_cannot_be_drawn(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(figure: object, path: Path) -> None:
        raise FigureError(f"{path.name}: no LaTeX")

    monkeypatch.setattr("bsg_models.rendering.figures._save", fail)
    few = ("--episodes", 1, "--workers", 1, "--out", tmp_path / "out", "--split", "all")
    result = run_command("--data", dataset, *few, "--no-model", "--worlds", "star")
    assert result.exit_code == 0, result.stderr
    assert "note: a figure is missing: savings.png: no LaTeX\n" in result.stderr
    assert "savings.png" not in result.stdout
    assert (tmp_path / "out" / "search.json").is_file()


@pytest.mark.usefixtures("shipped")
def test_a_search_that_names_no_model_takes_the_shipped_one(dataset: Path, tmp_path: Path) -> None:
    few = ("--episodes", 1, "--workers", 1, "--resamples", 0, "--worlds", "star", "--json")
    one = ("--artifacts", "bed", "--data", dataset, *few)
    result = run_command(*one, "--out", tmp_path / "a", "--planners", "nearest,greedy-belief")
    assert result.exit_code == 0, result.stderr
    assert "model: universal (shipped; trained on" in result.stderr
    assert json.loads(result.stdout)["model"] == "gamma-poisson"
    both = run_command(*one, "--no-model", "--model", "universal")
    assert both.exit_code == 2


def test_a_search_is_chosen_to_be_watched(dataset: Path, run: Path, tmp_path: Path) -> None:
    few = ("--episodes", 4, "--workers", 1, "--resamples", 0, "--worlds", "star")
    few += ("--planners", "ratio", "--out", tmp_path / "out")
    picture = tmp_path / "search.gif"
    result = run_command("--model", run, "--data", dataset, *few, "--trace", "--animation", picture)
    assert result.exit_code == 0, result.stderr
    assert f"the same as a picture: {picture}" in result.stdout
    page = (tmp_path / "out" / "trace.html").read_text("utf-8")
    assert "This search was chosen as worth watching" in page
    assert picture.read_bytes().startswith(b"GIF89a")


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (("--worlds", "ring"), 2, "no world 'ring'"),
        (("--worlds", "layout:1-2"), 2, "metres"),
        (("--planners", "nearest,fast"), 2, "no planner 'fast'"),
        (("--artifacts", "stove,spaceship"), 2, "no class 'spaceship'"),
        (("--truth", "posterior", "--trace", "0"), 2, "really there"),
        (("--fraction", "0"), 2, "--fraction"),
        (("--trace", "some"), 2, "'some' is not a valid integer"),
        (("--animation", "a.gif"), 2, "add --trace"),
        (("--trace", "--animation", "a.mp4"), 2, "ends in .gif or .png"),
        (("--stop", "2"), 2, "between 0 and 1"),
        (("--stop", "x"), 2, "expected numbers"),
        (("--stop", "0.1", "--task", "single"), 2, "--task all"),
        (("--split", "all"), 2, "trained on"),
        (("--scene", "nowhere"), 1, "not one of its test buildings"),
        (
            ("--trace", "1", "--episodes", "1", "--worlds", "star"),
            2,
            "has 1 searches, numbered from 0",
        ),
        (("--at-once", "40", "--episodes", "1", "--worlds", "star"), 1, "fewer than 40 artifacts"),
    ],
)
def test_wrong_use_is_said(
    options: tuple[str, ...], code: int, words: str, dataset: Path, run: Path
) -> None:
    result = run_command("--model", run, "--data", dataset, "--workers", 1, *options)
    assert result.exit_code == code, result.stderr
    assert words in result.stderr
    assert not (run / "search" / "search.json").exists()


def test_runs_that_cannot_be_asked(dataset: Path, run: Path, tmp_path: Path) -> None:
    missing = run_command("--model", tmp_path / "none", "--data", dataset, "--workers", 1)
    assert missing.exit_code == 1
    assert "none" in missing.stderr
    copy = Path(shutil.copytree(dataset, tmp_path / "copy"))
    manifest = copy / "dataset.json"
    manifest.write_text(manifest.read_text("utf-8").replace("hm3d45-v2", "hm3d45-v9"), "utf-8")
    other = run_command("--model", run, "--data", copy, "--workers", 1)
    assert other.exit_code == 1


def test_a_folder_that_cannot_be_written_is_said_before_the_search(
    dataset: Path, run: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    result = run_command("--model", run, "--data", dataset, "--out", tmp_path / "file")
    assert result.exit_code == 1
    assert "cannot be written" in result.stderr
