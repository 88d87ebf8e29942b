"""Help, version, completion and hints, which every command has and which load nothing heavy."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version

import click
import pytest
from click.testing import CliRunner

from bsg_cli.registry import COMMANDS

HEAVY = ("matplotlib", "pandas", "pyarrow", "scipy", "torch", "torch_geometric", "trimesh")
ALL_WORDS = """
import sys
from bsg_cli.registry import COMMANDS

def leave(command, *words):
    try:
        command.main([*words])
    except SystemExit as end:
        return end.code

def walk(command, *words):
    yield words
    for name, child in getattr(command, "commands", {}).items():
        yield from walk(child, *words, name)

for name, command in COMMANDS.items():
    for words in walk(command):
        for word in ("--help", "-h", "--version"):
            assert leave(command, *words, word) == 0, (name, words, word)
        assert leave(command, *words, "--hlep") == 2, (name, words)
for words in (
    ("bsg-data", "buidl"),
    ("bsg-train", "--config", "ceci-sgae", "--print"),
    ("bsg-leaderboard", ".", "--models", "ceci-sgae"),
):
    assert leave(COMMANDS[words[0]], *words[1:]) != 0, words
loaded = HEAVY & set(sys.modules)
assert not loaded, loaded
"""


def test_helps_versions_and_typos_import_nothing_heavy() -> None:
    allowed = {"pyarrow"}  # a dataset that is named is looked at
    code = f"HEAVY = {set(HEAVY) - allowed!r}\n{ALL_WORDS}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_every_program_says_its_version() -> None:
    for name, command in COMMANDS.items():
        installed = f"{name}, version {version('belief-scene-graphs')}\n"
        assert CliRunner().invoke(command, ["--version"]).output == installed


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (("bsg-data", "buidl"), "Did you mean 'build'?"),
        (("bsg-data", "map", "covrage"), "Did you mean 'coverage'?"),
        (("bsg-train", "--confg", "x"), "--config"),
        (("bsg-train", "--config", "ceci-sgae"), "did you mean ceci-sage?"),
    ],
)
def test_a_typo_gets_the_nearest_name(words: tuple[str, ...], hint: str) -> None:
    result = CliRunner().invoke(COMMANDS[words[0]], words[1:])
    assert result.exit_code == 2
    assert hint in result.output


def test_commands_are_named_as_they_are_installed() -> None:
    assert {name: command.name for name, command in COMMANDS.items()} == {n: n for n in COMMANDS}
    assert all(isinstance(command, click.Command) for command in COMMANDS.values())
