"""A name in a file loads no code: rows of our tables, and entry points of installed packages, do.

Names of modules and objects stand wherever a file names a model, a mask, a metric, a planner, a
source or a format. Nothing is imported, and the name is refused. The sources of the project are
read, too: what could run text of a file is in none of them.
"""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import REPOSITORY

from bsg_data.errors import BSGError
from bsg_data.exports.catalogue import EXPORTS
from bsg_data.observation.masks import MASKS
from bsg_data.registry import Registry
from bsg_data.sources.catalogue import SOURCES
from bsg_models.belief.formats import FORMATS
from bsg_models.evaluation.catalogue import METRICS
from bsg_models.search.catalogue import PLANNERS
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import validate_config
from bsg_models.zoo.construction import make_model

REGISTRIES = (EXPORTS, FORMATS, MASKS, METRICS, PLANNERS, SOURCES, ZOO)
CANARY = "canary_of_the_tests"  # a module that says so when it is imported
NAMES = (
    "os.system",
    "os:system",
    "builtins:eval",
    "builtins.eval",
    "subprocess:Popen",
    "bsg_data.registry:Registry",
    "bsg_models.zoo.mixture",
    CANARY,
    f"{CANARY}:run",
    f"{CANARY}.run",
    f"./{CANARY}.py",
    f"../{CANARY}",
    "__class__",
    "__init__",
    "__import__('os').system('true')",
    "{0.__class__}",
    "",
    "a\0b",
)
BUILTINS = {"eval", "exec", "compile", "__import__", "breakpoint"}
FORBIDDEN = {  # dotted names of what runs, or may run, what a file holds
    *BUILTINS,
    "importlib.import_module",  # a registry loads by entry points, whose names are not a file's
    *("pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal", "code"),
    *("torch.load", "torch.jit.load", "torch.hub", "numpy.fromfile", "runpy"),
    *("yaml.load", "yaml.load_all", "yaml.unsafe_load", "yaml.full_load", "yaml.Loader"),
    *("yaml.UnsafeLoader", "yaml.FullLoader", "pandas.read_pickle", "pandas.eval"),
    *("os.system", "os.popen", "pty", "ctypes", "xml.etree.ElementTree", "xml.dom"),
}
FORBIDDEN_METHODS = {"read_pickle", "to_pickle", "extractall", "unpack_archive"}
WORDS = {name.rpartition(".")[2] for name in FORBIDDEN} | FORBIDDEN_METHODS
SUSPECT = re.compile(rf"\b({'|'.join(WORDS)}|allow_pickle|shell)\b")
# What is allowed, and why: file → names.
ALLOWED = {
    "bsg_data/inputs/documents.py": {"yaml.load"},  # by a loader of text, lists and mappings alone
    "bsg_data/public_names.py": {"importlib.import_module"},  # of names that stand in a stub
    "bsg_data/dataset/commit.py": {"ctypes", "ctypes.CDLL"},  # of the C library
}


def sources() -> Iterator[Path]:
    for folder in ("bsg_data", "bsg_models", "cli", "mappings", "weights", "scripts"):
        yield from sorted((REPOSITORY / folder).rglob("*.py"))


def spell(node: ast.expr) -> tuple[str, ...]:
    """Return the parts of a dotted name; what is before a dot and is no name is empty."""
    if isinstance(node, ast.Attribute):
        return (*spell(node.value), node.attr)
    return (node.id,) if isinstance(node, ast.Name) else ("",)


def list_uses(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield every dotted name of a file that is imported or used, with its line; aliases spelt out.

    >>> [name for _, name in list_uses(ast.parse("import numpy as np; np.load"))]
    ['numpy', 'numpy.load', 'numpy']
    """
    known: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for one in node.names:
                known[one.asname or one.name.partition(".")[0]] = (
                    one.name if one.asname else one.name.partition(".")[0]
                )
                yield node.lineno, one.name
        elif isinstance(node, ast.ImportFrom):
            for one in node.names:
                known[one.asname or one.name] = f"{node.module}.{one.name}"
                yield node.lineno, f"{node.module}.{one.name}"
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute):
            head, *rest = spell(node)
            if head in known or head in BUILTINS:
                yield node.lineno, ".".join((known.get(head, head), *rest))
            elif rest and rest[-1] in FORBIDDEN_METHODS:
                yield node.lineno, rest[-1]


def find_faults(path: Path, text: str) -> Iterator[str]:
    if not SUSPECT.search(text):  # most files: to parse them all takes long
        return
    tree, name = ast.parse(text), path.relative_to(REPOSITORY).as_posix()
    for line, used in list_uses(tree):
        parts = used.split(".")
        starts = {".".join(parts[:end]) for end in range(1, len(parts) + 1)}
        wrong = starts & FORBIDDEN or parts[-1] in FORBIDDEN_METHODS
        if wrong and used not in ALLOWED.get(name, ()):
            yield f"{name}:{line}: {used}"
    for node in ast.walk(tree):
        if isinstance(node, ast.keyword) and node.arg in ("allow_pickle", "shell"):
            allowed = isinstance(node.value, ast.Constant) and node.value.value is False
            if not allowed:
                yield f"{name}:{node.value.lineno}: {node.arg}"
        elif isinstance(node, ast.Call) and spell(node.func) in (("np", "load"), ("numpy", "load")):
            refuses = any(word.arg == "allow_pickle" for word in node.keywords)
            if not refuses:
                yield f"{name}:{node.lineno}: numpy.load without allow_pickle=False"


@pytest.fixture
def canary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A module that could be imported, here and by a path from here."""
    text = "def run(*words):\n    raise AssertionError('ran')\n"
    (tmp_path / f"{CANARY}.py").write_text(text, "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    yield
    assert CANARY not in sys.modules


@pytest.mark.usefixtures("canary")
@pytest.mark.parametrize("registry", REGISTRIES, ids=lambda registry: registry.kind)
def test_a_registry_loads_its_rows_alone(registry: Registry[object]) -> None:
    before, misses = set(sys.modules), []
    for name in NAMES:
        try:
            registry[name]
        except BSGError:
            pass
        else:
            misses.append(f"{name!r} was loaded")
        misses += [f"{name!r} imported {module}" for module in set(sys.modules) - before]
    assert not misses


@pytest.mark.usefixtures("canary")
@pytest.mark.parametrize("name", NAMES)
def test_a_configuration_loads_nothing(name: str) -> None:
    for tables in (
        {"model": {"family": name}},
        {"model": {"family": "ensemble", "members": [name]}},
        {"model": {"family": "gamma-poisson"}, "data": {"mask": {"strategy": name}}},
        {"model": {"family": "mixture", name: 1}},
    ):
        before = set(sys.modules)
        with pytest.raises(BSGError):
            make_model(validate_config(json.loads(json.dumps(tables)), source="a test"), classes=45)
        assert {m for m in set(sys.modules) - before if not m.startswith("bsg_")} == set()


def test_no_source_runs_what_a_file_holds() -> None:
    tutorials = REPOSITORY / "scripts" / "site" / "execute.py"  # runs the pages of our own docs
    files = [path for path in sources() if path != tutorials]
    assert len(files) == len(list(sources())) - 1
    found = [fault for path in files for fault in find_faults(path, path.read_text("utf-8"))]
    assert found == []


@pytest.mark.parametrize(
    "text",
    [
        "eval('1')",
        "import pickle",
        "from pickle import loads",
        "import torch\ntorch.load('x')",
        "import torch as t\nt.load('x')",
        "import yaml\nyaml.load(x, Loader=yaml.FullLoader)",
        "import numpy as np\nnp.load(p)",
        "import numpy as np\nnp.load(p, allow_pickle=True)",
        "import subprocess\nsubprocess.run(x, shell=True)",
        "from importlib import import_module",
        "archive.extractall(out)",
        "import os\nos.system(x)",
    ],
)
def test_what_runs_a_file_is_found(text: str) -> None:
    assert list(find_faults(REPOSITORY / "bsg_data" / "here.py", text))


def test_a_folder_of_data_is_no_place_for_modules(tmp_path: Path) -> None:
    """A command does not import what lies in the folder that it is called in."""
    for name in ("json", "numpy", "bsg_data", "yaml", "sitecustomize"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('ran')\n", "utf-8")
    command = Path(sys.executable).with_name("bsg-data")
    done = subprocess.run(
        [str(command), "map", "show", "chair"], cwd=tmp_path, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "chair" in done.stdout
