"""Every command of a script that a page prints can be typed: its own parser takes all of it.

A command with a commit behind it is of a script that has left the tree, and stands there.
"""

from __future__ import annotations

import argparse
import json
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Iterator

import click
import pytest
from click.testing import CliRunner
from conftest import REPOSITORY

from bsg_cli.registry import COMMANDS

DOCS = (REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").rglob("*.md")))
TAKEN, WRONG_USAGE = "the parser took it", 2
RESULTS = REPOSITORY / "docs" / "results"
FIGURES = json.loads((RESULTS / "figures.json").read_text("utf-8"))
SCRIPTS = sorted((REPOSITORY / "scripts").rglob("*.py"))
IN_BACKTICKS = re.compile(r"`(python scripts/[^`]*)`(?! at [0-9a-f]{8})")
IN_LINES = re.compile(r"^ *(python scripts/(?:.*\\\n)*.*)$", re.MULTILINE)
BEHIND = re.compile(r"`(?:python )?(scripts/\S+\.py)[^`]*` at (?:commit )?([0-9a-f]{8})")


def list_commands() -> Iterator[str]:
    """Yield the commands of pages and figures, and those with which scripts with options begin."""
    for one in FIGURES.values():
        if "last_in" not in one["made"]:
            yield one["made"]["command"]
    for path in (*DOCS, *SCRIPTS):
        text = path.read_text("utf-8")
        if path.suffix == ".py":
            text = text.split('"""')[1] if re.search(r"ArgumentParser|click\.command", text) else ""
        found = {*IN_BACKTICKS.findall(text), *IN_LINES.findall(text)}
        yield from sorted(one.replace("\\\n", " ") for one in found)


COMMANDS_OF_SCRIPTS = tuple(dict.fromkeys(list_commands()))


@pytest.fixture
def _stop_at_the_parser(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let scripts go no further than their parsers, which read what `sys.argv` says."""
    parse = argparse.ArgumentParser.parse_args

    def stop(parser: argparse.ArgumentParser, *_: object) -> None:
        parse(parser, sys.argv[1:])
        sys.exit(TAKEN)

    def halt(*_: object) -> None:
        sys.exit(TAKEN)

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", stop)
    monkeypatch.setattr(click.Command, "invoke", halt)


def type_in(command: str, monkeypatch: pytest.MonkeyPatch) -> object:
    """Run a command up to its parser; return how it ended."""
    _, name, *words = shlex.split(command, comments=True)
    script = REPOSITORY / name
    monkeypatch.syspath_prepend(str(script.parent))
    monkeypatch.setattr(sys, "argv", [str(script), *words])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(script), run_name="__main__")
    return ended.value.code


@pytest.mark.usefixtures("_stop_at_the_parser")
@pytest.mark.parametrize("command", COMMANDS_OF_SCRIPTS)
def test_a_printed_command_is_taken_whole(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert type_in(command, monkeypatch) == TAKEN


@pytest.mark.usefixtures("_stop_at_the_parser")
def test_a_command_that_lacks_something_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    (command,) = (one for one in COMMANDS_OF_SCRIPTS if "report.py leaderboard" in one)
    assert type_in(command.replace("--leaderboard", "--board"), monkeypatch) == WRONG_USAGE


def test_every_figure_on_a_page_has_its_whole_command_on_one() -> None:
    pages = "".join(page.read_text("utf-8") for page in RESULTS.parent.rglob("*.md"))
    shown = set(re.findall(r"<!-- generated: figures (\w+)/", pages))
    assert len(shown) >= 10
    for name in shown:
        made = FIGURES[name]["made"]
        behind = f"at {made['last_in']} " if "last_in" in made else ""
        assert f"| {name} | `{made['command']}` {behind}| {made['commit']} |" in pages


def test_a_command_writes_the_figures_and_one_behind_a_commit_is_of_no_script_here() -> None:
    for one in FIGURES.values():
        command, last_in = one["made"]["command"], one["made"].get("last_in")
        assert (command in COMMANDS_OF_SCRIPTS) == (last_in is None)
        assert "--out docs/results/figures.json" in command


def test_a_script_behind_a_commit_stands_there() -> None:
    made = (one["made"] for one in FIGURES.values())
    told = [f"`{one['command']}` at {one['last_in']}" for one in made if "last_in" in one]
    behind = set(BEHIND.findall("\n".join([*told, *(page.read_text("utf-8") for page in DOCS)])))
    assert len(behind) >= 5
    for script, commit in behind:
        if not is_in_git(commit):
            pytest.skip("this checkout does not have old commits")
        assert is_in_git(f"{commit}:{script}"), script


def is_in_git(name: str) -> bool:
    words = ["git", "cat-file", "-e", name]
    return not subprocess.run(words, cwd=REPOSITORY, capture_output=True).returncode


def test_the_options_of_the_commands_around_them_exist() -> None:
    """Of `bsg-data` and the like, in the lines that make what the scripts read."""
    for page in RESULTS.glob("*.md"):
        text = page.read_text("utf-8").replace("\\\n", "")
        for line in re.findall(r"^ *(bsg-.*)$", text, re.MULTILINE):
            for command in line.split(" && "):
                name, *words = shlex.split(command)
                shown = CliRunner().invoke(COMMANDS[name], [*words, "--help"])
                assert shown.exit_code == 0, command
                for option in (word for word in words if word.startswith("--")):
                    assert option in shown.output, command
