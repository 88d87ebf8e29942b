"""A name in a file loads no code: rows of our tables, and entry points of installed packages, do.

Ruff's rules (S, and banned-api) find what could run text of a file in the sources of the project.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bsg_data.errors import BSGError
from bsg_data.exports.catalogue import EXPORTS
from bsg_data.observation.masks import MASKS
from bsg_data.sources.catalogue import SOURCES
from bsg_models.evaluation.catalogue import METRICS
from bsg_models.search.catalogue import PLANNERS
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import validate_config
from bsg_models.zoo.model import make_model
from bsg_robot.graph.formats import FORMATS

REGISTRIES = (EXPORTS, FORMATS, MASKS, METRICS, PLANNERS, SOURCES, ZOO)
CANARY = "canary_of_the_tests"  # a module that says so when it is imported
NAMES = (
    *("os.system", "os:system", "builtins:eval", "bsg_data.registry:Registry"),
    *("bsg_models.zoo.mixture", CANARY, f"{CANARY}:run", f"{CANARY}.run", f"./{CANARY}.py"),
    *("__class__", "__import__('os').system('true')", "{0.__class__}", "", "a\0b"),
)


@pytest.fixture
def canary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A module that could be imported, here and by a path from here."""
    text = "def run(*words):\n    raise AssertionError('ran')\n"
    (tmp_path / f"{CANARY}.py").write_text(text, "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    yield
    assert CANARY not in sys.modules


def ensemble(name: str) -> object:
    tables = {"model": {"family": "ensemble", "members": [name]}}
    return make_model(validate_config(tables, source="a test"), classes=45)


@pytest.mark.usefixtures("canary")
@pytest.mark.parametrize("load", [*(one.__getitem__ for one in REGISTRIES), ensemble])
def test_only_rows_of_a_table_are_loaded(load: Callable[[str], object]) -> None:
    before = set(sys.modules)
    for name in NAMES:
        with pytest.raises(BSGError):
            load(name)
    assert {m for m in set(sys.modules) - before if not m.startswith("bsg_")} == set()


@pytest.mark.heavy
def test_a_folder_of_data_is_no_place_for_modules(tmp_path: Path) -> None:
    for name in ("json", "numpy", "bsg_data", "sitecustomize"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('ran')\n", "utf-8")
    command = [str(Path(sys.executable).with_name("bsg-data")), "map", "show", "chair"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
