"""What the tab key offers, in a process of its own, and that nothing heavy is imported for it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import click
import pytest

from bsg_cli.choices import classes_of_dataset
from bsg_cli.registry import COMMANDS
from bsg_data.scene.class_space import load_class_space

# command line, its last word unfinished → what is offered, among others
OFFERED = {
    "bsg-data bu": "build",
    "bsg-data map cov": "coverage",
    "bsg-data info --fi": "--figure",
    "bsg-data pairs x --mask expl": "explore",
    "bsg-data map show x --class-map hm3d-w": "hm3d-wide-v1",
    "bsg-data build --source proc": "procthor",
    "bsg-data export x --to hab": "habitat",
    "bsg-train --config ceci-s": "ceci-sage",
    "bsg-belief --model univ": "universal",
    "bsg-belief --split te": "test",
    "bsg-evaluate x --model univ": "universal",
    "bsg-models show univ": "universal",
    "bsg-leaderboard --models doubled,mix": "doubled,mixture",
    "bsg-leaderboard --masks uniform,roo": "uniform,rooms",
    "bsg-search --planners nearest,rat": "nearest,ratio",
    "bsg-search --worlds star,lay": "star,layout",
    "bsg-search --artifacts bed,sto": "bed,stove",
    "bsg-search --artifacts room": "room-specific",
    "bsg-search none --split a": "all",
}
ASK = """
import contextlib, io, json, os, sys
from bsg_cli.registry import COMMANDS

said = {}
for line in json.loads(sys.argv[1]):
    words = line.split(" ")
    variable = f"_{words[0].upper().replace('-', '_')}_COMPLETE"
    os.environ |= {"COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    os.environ[variable] = "bash_complete"
    sys.argv = words[:1]
    out = io.TextIOWrapper(io.BytesIO())
    with contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
        COMMANDS[words[0]].main()
    del os.environ[variable]
    out.flush()
    said[line] = out.buffer.getvalue().decode().splitlines()
print(json.dumps([said, sorted(sys.modules)]))
"""


def test_the_tab_key_offers_names_and_imports_nothing_heavy() -> None:
    done = subprocess.run(
        [sys.executable, "-c", ASK, json.dumps(list(OFFERED))], capture_output=True, text=True
    )
    assert done.stderr == ""
    said, modules = json.loads(done.stdout)
    for line, name in OFFERED.items():
        assert f"plain,{name}" in said[line], line
    heavy = {"matplotlib", "pandas", "pyarrow", "scipy", "torch", "trimesh"}
    assert not heavy & set(modules)


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
