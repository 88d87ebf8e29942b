"""Help, version, completion and hints, which every command has and which load nothing heavy."""

from __future__ import annotations

import os
import subprocess
import sys

import click
import pytest
from click.testing import CliRunner

from bsg_cli.registry import COMMANDS

HEAVY = ("matplotlib", "numba", "pandas", "pyarrow", "scipy", "torch", "torch_geometric", "trimesh")
ALL_WORDS = """
import sys
from bsg_cli.registry import COMMANDS

def leave(command, *words):
    try:
        command.main([*words])
    except SystemExit as end:
        return end.code

for name, command in COMMANDS.items():
    below = [()] + [(child,) for child in getattr(command, "commands", ())]
    for words in below:
        assert leave(command, *words, "--help") == 0, (name, words)
        assert leave(command, *words, "-h") == 0, (name, words)
        assert leave(command, *words, "--hlep") == 2, (name, words)
    assert leave(command, "--version") == 0, name
for words in (
    ("bsg-data", "buidl"),
    ("bsg-train", "--config", "ceci-sgae", "--print-config"),
    ("bsg-leaderboard", "--data", ".", "--models", "ceci-sgae"),
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


@pytest.mark.parametrize("name", COMMANDS)
def test_version_is_that_of_the_project(name: str) -> None:
    result = CliRunner().invoke(COMMANDS[name], ["--version"])
    assert result.output.startswith(f"{name}, version ")


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


@pytest.mark.parametrize(
    "words",
    [
        ("bsg-belief", "--run", "none", "--data", "none", "--mode", "wrong"),
        ("bsg-data", "pairs", "none"),
        ("bsg-evaluate", "none", "--data", "none"),
        ("bsg-leaderboard", "--data", "none", "--models", "none"),
        ("bsg-search", "--data", "none", "--run", "none"),
        ("bsg-train", "--data", "none", "--out", "x", "--config", "none"),
    ],
)
def test_a_missing_dataset_is_the_first_complaint(words: tuple[str, ...]) -> None:
    result = CliRunner().invoke(COMMANDS[words[0]], words[1:])
    assert result.exit_code in (1, 2)
    assert "none: no such folder" in result.output


@pytest.mark.parametrize(
    ("words", "expected"),
    [(("bsg-data", "bu"), "build"), (("bsg-train", "--config", "ceci-s"), "ceci-sage")],
)
def test_completion_names_what_fits(words: tuple[str, ...], expected: str) -> None:
    variable = f"_{words[0].upper().replace('-', '_')}_COMPLETE"
    code = (
        "import sys\n"
        "from bsg_cli.registry import COMMANDS\n"
        f"sys.argv = [{words[0]!r}]\n"
        f"try: COMMANDS[{words[0]!r}].main()\n"
        f"finally: assert not set({HEAVY!r}) & set(sys.modules)\n"
    )
    asked = {
        variable: "bash_complete",
        "COMP_WORDS": " ".join(words),
        "COMP_CWORD": str(len(words) - 1),
    }
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **asked}
    )
    assert done.stderr == ""
    assert f"plain,{expected}" in done.stdout.splitlines()


def test_commands_are_named_as_they_are_installed() -> None:
    assert {name: command.name for name, command in COMMANDS.items()} == {n: n for n in COMMANDS}
    assert all(isinstance(command, click.Command) for command in COMMANDS.values())
