"""No command writes into a dataset, or over a file of sealed results, wherever it is told to write.

Every option that names a place to write has a line here.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result
from conftest import KITCHEN, REPOSITORY, annotation_text, write_scene

from bsg_cli.registry import COMMANDS
from bsg_data import build_dataset
from bsg_data.extend import HM3DFolder
from bsg_data.seals import write_seal

# PLACE is where the option is told to write.
INTO = {
    "bsg-data synth --out": "bsg-data synth --scenes 1 --out PLACE",
    "bsg-data build --out": "bsg-data build --hm3d hm3d --workers 1 --out PLACE",
    "bsg-data merge --out": "bsg-data merge dataset single --out PLACE",
    "bsg-data export --out": "bsg-data export dataset --to habitat --out PLACE",
    "bsg-data info --figure": "bsg-data info dataset --figure PLACE.png",
    "bsg-train --out": "bsg-train --config gamma-poisson --data dataset --out PLACE",
    "bsg-evaluate --out": "bsg-evaluate run --data dataset --out PLACE",
    "bsg-evaluate --html": "bsg-evaluate run --data dataset --out new --html PLACE.html",
    "bsg-evaluate --write-predictions": (
        "bsg-evaluate run --data dataset --resamples 0 --out new --write-predictions PLACE"
    ),
    "bsg-leaderboard --out": (
        "bsg-leaderboard --data dataset --models doubled --folds 3 --workers 1 --out PLACE"
    ),
    "bsg-belief --out": "bsg-belief home.json --model run --out PLACE.json",
    "bsg-belief --hydra": "bsg-belief home.json --model run --hydra PLACE",
    "bsg-belief --tables": "bsg-belief home.json --model run --tables PLACE",
    "bsg-belief --html": "bsg-belief home.json --model run --html PLACE.html",
    "bsg-search --out": "bsg-search --data dataset --model run --workers 1 --out PLACE",
    "bsg-search --animation": (
        "bsg-search --data dataset --model run --workers 1 --out new --trace --animation PLACE.gif"
    ),
}
FILES = ("--figure", "--html", "--hydra", "--animation", "bsg-belief --out")  # these write one file
READ = {"--hm3d", "--hm3d-stats", "--room-layouts", "--predictions", "--show", "--data"}


def walk(words: tuple[str, ...], command: click.Command) -> Iterator[str]:
    """Yield every option of a command, and of the commands in it, that names a path."""
    for name, child in getattr(command, "commands", {}).items():
        yield from walk((*words, name), child)
    for param in command.params:
        if isinstance(param, click.Option) and isinstance(param.type, click.Path):
            yield f"{' '.join(words)} {param.opts[0]}"


def test_every_option_that_names_a_place_is_here() -> None:
    every = {option for name, command in COMMANDS.items() for option in walk((name,), command)}
    assert {option for option in every if option.split()[-1] not in READ} == set(INTO)


@pytest.fixture
def work(
    dataset: Path, run: Path, hm3d_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """A folder with all that the lines read, and `other`, the dataset that they would write into.

    The process works in it.
    """
    shutil.copytree(dataset, tmp_path / "other")
    shutil.copy(REPOSITORY / "docs" / "home.json", tmp_path / "home.json")
    write_scene(tmp_path / "one", "00900-singlescene", annotation_text({0: KITCHEN}))
    build_dataset(HM3DFolder(tmp_path / "one"), tmp_path / "single")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def snapshot(folder: Path) -> dict[str, bytes | None]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


def invoke(line: str, place: str) -> Result:
    name, *words = line.replace("PLACE", place).split()
    return CliRunner().invoke(COMMANDS[name], words)


@pytest.mark.parametrize("option", INTO)
def test_no_command_writes_into_a_dataset(option: str, work: Path) -> None:
    (work / "link").symlink_to(work / "other" / "objects")
    before = snapshot(work)
    for place in ("other/objects/place", "link/place"):
        done = invoke(INTO[option], place)
        assert done.exit_code == 1, done.output
        assert f"the dataset {work / 'other'}; choose another" in done.stderr
        assert snapshot(work) == before


@pytest.mark.parametrize("option", [name for name in INTO if name.endswith(FILES)])
def test_no_command_replaces_a_file_of_sealed_results(option: str, work: Path) -> None:
    line = INTO[option]
    suffix = line.rpartition("PLACE")[2]
    (work / "run" / f"mine{suffix}").write_text("measured")
    write_seal(work / "run", ["best.safetensors", f"mine{suffix}"])
    before = snapshot(work)
    done = invoke(f"{line} --force", "run/mine")
    assert done.exit_code == 1, done.output
    assert f"run/mine{suffix}: is one of the results that SHA256SUMS lists" in done.stderr
    assert snapshot(work) == before


def test_predictions_replace_none_of_sealed_results(work: Path) -> None:
    results = work / "results"
    results.mkdir()
    (results / "gamma-poisson-run.parquet").write_text("measured")
    write_seal(results, ["gamma-poisson-run.parquet"])
    before = snapshot(work)
    line = INTO["bsg-evaluate --write-predictions"]
    done = invoke(f"{line} --force", "results")
    assert done.exit_code == 1, done.output
    assert "gamma-poisson-run.parquet: is one of the results" in done.stderr
    assert snapshot(work) == before
