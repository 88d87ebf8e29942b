"""Every command of a script that a page prints can be typed: its own parser takes all of it."""

from __future__ import annotations

import argparse
import json
import re
import runpy
import shlex
import sys
from collections.abc import Iterator
from types import ModuleType

import click
import pytest
from click.testing import CliRunner
from conftest import REPOSITORY

from bsg_cli.registry import COMMANDS

DOCS = (REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").rglob("*.md")))
TAKEN, WRONG_USAGE = "the parser took it", 2
RESULTS = REPOSITORY / "docs" / "results"
SCRIPTS = sorted((REPOSITORY / "scripts").rglob("*.py"))
IN_BACKTICKS = re.compile(r"`((?:\w+=\S+ )?python scripts/[^`]*)`")
IN_LINES = re.compile(r"^ *((?:\w+=\S+ )?python scripts/(?:.*\\\n)*.*)$", re.MULTILINE)


def list_commands() -> Iterator[str]:
    """Yield the commands of all pages, and those with which scripts begin that parse options."""
    for path in (*DOCS, *SCRIPTS):
        text = path.read_text("utf-8")
        if path.suffix == ".py":
            text = text.split('"""')[1] if re.search(r"ArgumentParser|click\.command", text) else ""
        found = {*IN_BACKTICKS.findall(text), *IN_LINES.findall(text)}
        yield from sorted(one.replace("\\\n", " ") for one in found)


COMMANDS_OF_SCRIPTS = tuple(dict.fromkeys(list_commands()))


class Absent(ModuleType):
    """A library of one script, which is not installed here; it has every class."""

    def __getattr__(self, name: str) -> type:
        if name.startswith("_"):
            raise AttributeError(name)
        return type(name, (), {})


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
    monkeypatch.setitem(sys.modules, "pomdp_py", Absent("pomdp_py"))


def type_in(command: str, monkeypatch: pytest.MonkeyPatch) -> object:
    """Run a command up to its parser; return how it ended.

    Its folders of modules are those that Python and `PYTHONPATH` would give it.
    """
    words = shlex.split(command, comments=True)
    setting, words = (words[0], words[1:]) if "=" in words[0] else ("PYTHONPATH=", words)
    assert words[0] == "python", command
    script = REPOSITORY / words[1]
    for folder in (*filter(None, setting.partition("=")[2].split(":")), script.parent):
        assert (REPOSITORY / folder).is_dir(), command
        monkeypatch.syspath_prepend(str(REPOSITORY / folder))
    monkeypatch.setattr(sys, "argv", [str(script), *words[2:]])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(script), run_name="__main__")
    return ended.value.code


@pytest.mark.usefixtures("_stop_at_the_parser")
@pytest.mark.parametrize("command", COMMANDS_OF_SCRIPTS)
def test_a_printed_command_is_taken_whole(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert type_in(command, monkeypatch) == TAKEN


@pytest.mark.usefixtures("_stop_at_the_parser")
@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("--leaderboard board", ""),
        ("--leaderboard", "--board"),
        (" leaderboard ", " nothing "),
        (" --out docs/results/figures.json", ""),
    ],
)
def test_a_command_that_lacks_something_is_refused(
    right: str, wrong: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (command,) = (one for one in COMMANDS_OF_SCRIPTS if "report.py leaderboard" in one)
    assert right in command
    assert type_in(command.replace(right, wrong), monkeypatch) == WRONG_USAGE


def test_every_figure_has_its_whole_command_on_a_page() -> None:
    figures = json.loads((RESULTS / "figures.json").read_text("utf-8"))
    pages = "".join(page.read_text("utf-8") for page in RESULTS.glob("*.md"))
    for name, one in figures.items():
        command = one["made"]["command"]
        assert f"| {name} | `{command}` |" in pages
        assert command in COMMANDS_OF_SCRIPTS
        assert "--out docs/results/figures.json" in command


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
