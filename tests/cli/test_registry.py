"""Help, version, completion and hints, which every command has and which load nothing heavy."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from conftest import REPOSITORY

from bsg_cli.choices import classes_of_dataset
from bsg_cli.registry import COMMANDS
from bsg_data.scene.class_space import load_class_space

# command line, its last word unfinished → what is offered, among others
OFFERED = {
    "bsg-data bu": "build",
    "bsg-data info --fi": "--figure",
    "bsg-data pairs x --mask expl": "explore",
    "bsg-data map show x --class-map hm3d-w": "hm3d-wide-v1",
    "bsg-data export x --to hab": "habitat",
    "bsg-train --config ceci-s": "ceci-sage",
    "bsg-belief --model univ": "universal",
    "bsg-leaderboard --models doubled,mix": "doubled,mixture",
    "bsg-leaderboard --masks uniform,roo": "uniform,rooms",
    "bsg-search --worlds star,lay": "star,layout",
    "bsg-search --artifacts room": "room-specific",
    "bsg-search none --split a": "all",
}
# Refused before models are imported: command line → what is said.
REFUSED = {
    "bsg-belief office.json --find sink --from kitchn": "kitchen",
    "bsg-belief office.json --hidden-share attic=0.5": "attic",
    "bsg-belief misspelt.json": "rom",
    "bsg-belief office.json --out belief.txt": "belief.txt",
    "bsg-models verify misspelt.json": "misspelt.json",
}
ASK = """
import contextlib, io, json, os, sys
from bsg_cli.registry import COMMANDS

HEAVY = {"matplotlib", "pandas", "scipy", "torch", "torch_geometric", "trimesh"}

def run(line):
    name, *words = line.split(" ")
    sys.argv, out = [name], io.TextIOWrapper(io.BytesIO())
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            code = COMMANDS[name].main(words)
        except SystemExit as end:
            code = end.code
    out.flush()
    return code, out.buffer.getvalue().decode()

def complete(line):
    name = line.split(" ")[0]
    variable = f"_{name.upper().replace('-', '_')}_COMPLETE"
    os.environ |= {"COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}
    os.environ[variable] = "bash_complete"
    said = run(name)[1].splitlines()
    del os.environ[variable]
    return said

def walk(command, *words):
    yield words
    for name, child in getattr(command, "commands", {}).items():
        yield from walk(child, *words, name)

offered, refused = json.loads(sys.argv[1])
for line, name in offered.items():
    assert f"plain,{name}" in complete(line), line
listed = run("bsg-models list")[1]
assert listed.splitlines()[1].startswith("universal "), listed
for name, command in COMMANDS.items():
    for words in walk(command):
        for word in ("--help", "-h", "--version"):
            assert run(" ".join((name, *words, word)))[0] == 0, (name, words, word)
        assert run(" ".join((name, *words, "--hlep")))[0] == 2, (name, words)
assert not (HEAVY | {"pyarrow"}) & set(sys.modules)
for line in ("bsg-train --config ceci-sgae --print", "bsg-leaderboard . --models ceci-sgae"):
    assert run(line)[0] != 0, line
assert not HEAVY & set(sys.modules)
for line, word in refused.items():
    code, said = run(line)
    assert code and word in said, (line, code, said)
assert not {"pandas", "torch"} & set(sys.modules)
"""


def test_what_is_said_at_once_imports_nothing_heavy(tmp_path: Path) -> None:
    """Completion, the list of models, helps, versions, typos, and what needs no model."""
    objects = [{"id": "1", "rom": "hall", "category": "sink"}]
    misspelt = {"scene_id": "home", "rooms": [{"id": "hall"}], "objects": objects}
    (tmp_path / "misspelt.json").write_text(json.dumps(misspelt), "utf-8")
    shutil.copy(REPOSITORY / "docs" / "office.json", tmp_path)
    words = [sys.executable, "-c", ASK, json.dumps([OFFERED, REFUSED])]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


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
    ("text", "classes"),
    [
        (json.dumps({"class_space": {"classes": ["a", "b"]}}), ("a", "b")),
        ("{", load_class_space().classes),
        ("[" * 100_000, load_class_space().classes),
        ('{"class_space": 1}', load_class_space().classes),
    ],
)
def test_classes_are_those_of_the_dataset(
    tmp_path: Path, text: str, classes: tuple[str, ...]
) -> None:
    (tmp_path / "dataset.json").write_text(text)
    context = click.Context(COMMANDS["bsg-search"])
    assert classes_of_dataset(context) == load_class_space().classes
    context.params["dataset"] = tmp_path
    assert classes_of_dataset(context) == classes
