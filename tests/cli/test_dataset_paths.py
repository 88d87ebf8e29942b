"""A dataset that is missing is the first complaint of every command that reads one."""

from __future__ import annotations

import shutil
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result
from conftest import REPOSITORY

from bsg_cli.dataset_paths import DatasetPath
from bsg_cli.registry import COMMANDS

# command with a dataset that is missing → other things that are wrong
WRONG = {
    "bsg-data check none": ("--jsn", "more"),
    "bsg-data export none": ("--to unity", "--oput x"),
    "bsg-data info none": ("--figur x", "--figure"),
    "bsg-data map compare none": ("--class-map nothing", "--class-mapp hm3d45-v1"),
    "bsg-data map coverage none": ("--class-map nothing", "--zzqx"),
    "bsg-data merge none": ("", "nothing --out", "--ot x"),
    "bsg-data pairs none": ("--mask expl", "--fraction 3", "--fractoin 0.5", "--draws", "-x"),
    "bsg-data split none": ("--ratios 1 2", "--folds 1", "--official --folds 3", "--sed 3"),
    "bsg-belief --data none": ("--mode wrong", "--model no", "x.json", "--labels", "--tpo 3"),
    "bsg-evaluate --data none": ("", "no --split all", "no --resamples -1", "no --resmples 3"),
    "bsg-leaderboard --data none": ("--models no", "--masks no", "--folds 1", "--model mixture"),
    "bsg-search --data none": (
        "--planners no",
        "--worlds no",
        "--artifacts no",
        "--model no",
        "-q",
    ),
    "bsg-train --data none": ("", "--config no", "--config mixture", "--set", "--config a --ste b"),
}


def run(line: str) -> Result:
    name, *words = line.split()
    return CliRunner().invoke(COMMANDS[name], words)


def test_a_missing_dataset_is_the_first_complaint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for line in [f"{before} {after}" for before, others in WRONG.items() for after in others]:
        result = run(line)
        assert (result.exit_code, result.stderr) == (1, "Error: none: no such folder\n"), line


def test_every_command_that_reads_a_dataset_is_tried() -> None:
    def walk(line: str, command: click.Command) -> list[str]:
        below = getattr(command, "commands", {}).items()
        found = [one for name, child in below for one in walk(f"{line} {name}", child)]
        own = any(isinstance(param.type, DatasetPath) for param in command.params)
        return found + [line] * own

    reading = {line for name, command in COMMANDS.items() for line in walk(name, command)}
    assert reading == {line.removesuffix(" none").removesuffix(" --data") for line in WRONG}


@pytest.mark.parametrize(
    "line",
    [
        "bsg-data pairs --fractoin 0.5 none",
        "bsg-data pairs --forc none",
        "bsg-data pairs --mask=wrong none",
        "bsg-data pairs -q -xyz none -hq",
        "bsg-data pairs none --force=yes --no-such --draws",
        "bsg-search --dat none",
        "bsg-search --planners no --dta=none",
    ],
)
def test_it_is_found_behind_an_option_that_is_misspelt(line: str) -> None:
    assert run(line).stderr == "Error: none: no such folder\n"


def test_a_dataset_that_is_there_leaves_the_word_to_the_parser(dataset: Path) -> None:
    assert "No such option '--forse'" in run(f"bsg-data pairs {dataset} --forse").stderr


WORDS = ("-h", "-q", "-hq", "--force", "--forse", "--mask", "--mask=x", "--=x", "--", "-", "none")


def test_a_file_is_not_said_to_be_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("home.json").write_text("{}")
    result = run("bsg-train --data home.json --config mixture")
    assert result.exit_code == 1
    assert "home.json: is a file; expected the folder of a dataset" in result.stderr


@pytest.mark.parametrize(
    "line",
    [
        *("bsg-data check loop", "bsg-data info loop", "bsg-data split loop"),
        *(
            "bsg-data finalise loop",
            "bsg-train --config mixture --data loop",
        ),
        *("bsg-data build --hm3d . --out loop", "bsg-data build --hm3d . --parts 1/2 --out loop"),
        *("bsg-data build --hm3d loop --out new", "bsg-data synth --scenes 2 --out loop"),
        *("bsg-data synth --scenes 2 --out loop/new", "bsg-belief home.json --out loop/a.json"),
        *("bsg-belief home.json --html loop/new.html", "bsg-belief home.json --tables loop"),
    ],
)
def test_a_link_that_leads_to_itself_is_refused_in_a_line(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("loop").symlink_to("other")
    Path("other").symlink_to("loop")
    shutil.copy(REPOSITORY / "docs" / "home.json", tmp_path)
    result = run(line)
    assert result.exit_code == 1, result.output
    assert result.stderr.startswith("Error: ")
    assert result.stderr.count("\n") == 1
    assert "loop" in result.stderr
