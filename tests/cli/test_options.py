"""The options that commands share: names, numbers and paths that are refused at once."""

from __future__ import annotations

from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from bsg_cli import choices
from bsg_cli.options import split_names, workers_option
from bsg_cli.registry import COMMANDS
from bsg_data.errors import RecipeError
from bsg_models.zoo.config import find_config


def test_a_name_of_the_zoo_comes_before_a_file_of_that_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mixture").write_text("no TOML", "utf-8")
    assert choices.load_config("mixture") == find_config("mixture")
    assert choices.load_run("mixture", ("seed=3",))[0].seed == 3
    Path("mine").write_text('[model]\nfamily = "doubled"\n', "utf-8")
    assert choices.load_config("mine") == find_config("doubled")
    with pytest.raises(RecipeError):
        choices.load_config("mixtrue")


def test_a_list_has_each_name_once() -> None:
    assert split_names("star, tree,,star", option="--worlds") == ("star", "tree")
    assert split_names(None, option="--worlds") is None
    with pytest.raises(click.UsageError):
        split_names(" ,", option="--worlds")


@pytest.mark.parametrize("line", ["bsg-data pairs none", "bsg-search none --planners no"])
def test_a_missing_dataset_is_refused_before_the_work(line: str) -> None:
    name, *words = line.split()
    result = CliRunner().invoke(COMMANDS[name], words)
    assert (result.exit_code, result.stderr) == (1, "Error: none: no such folder\n")


def test_no_machine_is_asked_for_processes_without_end() -> None:
    command = click.command()(workers_option(lambda workers: click.echo(workers)))
    assert CliRunner().invoke(command, ["--workers", "3"]).output == "3\n"
    for number in ("0", "1025", "9" * 30):
        assert CliRunner().invoke(command, ["--workers", number]).exit_code == 2
