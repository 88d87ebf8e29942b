"""The shape of the house: who may import whom, what is public, what is never there."""

from __future__ import annotations

import ast
import graphlib
import importlib
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import REPOSITORY

FOLDERS = {
    "bsg_data": "bsg_data",
    "bsg_models": "bsg_models",
    "bsg_robot": "bsg_robot",
    "bsg_cli": "cli",
}

# The house, from the ground up. A room is a folder, or a file that lies beside the folders. Every
# room imports rooms of the lines above its own, and none of its own line.
HOUSE = (
    "bsg_data.arrays bsg_data.errors bsg_data.tables bsg_data.words",
    "bsg_data.records",
    "bsg_data.executors bsg_data.files bsg_data.recipes bsg_data.registry bsg_data.terms",
    "bsg_data.inputs",
    "bsg_data.seal",
    "bsg_data.places",
    "bsg_data.scene bsg_data.results",
    "bsg_data.geometry",
    "bsg_data.dataset",
    "bsg_data.sources",
    "bsg_data.observation",
    "bsg_data.build bsg_data.synthetic bsg_data.exports",
    "bsg_data.merge bsg_data.checks",
    "bsg_data.testing",
    "bsg_data.extend",
    "bsg_models.arrays bsg_models.errors bsg_models.special_functions",
    "bsg_models.belief",
    "bsg_models.search",
    "bsg_models.inputs",
    "bsg_models.zoo",
    "bsg_models.ceci",
    "bsg_models.runs bsg_models.evaluation",
    "bsg_models.rendering",
    "bsg_models.training",
    "bsg_models.testing",
    "bsg_models.studies",
    "bsg_robot.errors bsg_robot.tables",
    "bsg_robot.things",
    "bsg_robot.graph",
    "bsg_robot.answers",
    "bsg_robot.service bsg_robot.ros",
    "bsg_cli",
)
FLOOR = {room: floor for floor, rooms in enumerate(HOUSE) for room in rooms.split()}


def imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield str(node.module)
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def modules(package: str) -> dict[str, ast.Module]:
    """Return every file of a package by its dotted name, without the roots of the packages."""
    folder = REPOSITORY / FOLDERS[package]
    found = {}
    for path in sorted(folder.rglob("*.py")):
        parts = path.relative_to(folder).with_suffix("").parts
        if path.name == "__init__.py":
            parts = parts[:-1]
        if parts:
            found[".".join((package, *parts))] = ast.parse(path.read_text("utf-8"))
    return found


MODULES = {name: tree for package in FOLDERS for name, tree in modules(package).items()}


def room_of(module: str) -> str | None:
    """Return the room of a module of ours; None for another's, and for the root of a package."""
    package, _, rest = module.partition(".")
    if package not in FOLDERS or not rest:
        return package if package == "bsg_cli" else None
    return "bsg_cli" if package == "bsg_cli" else f"{package}.{rest.split('.')[0]}"


def arrows_of(name: str) -> set[str]:
    """Return the modules of ours that a module imports."""
    return {target for target in imported(MODULES[name]) if target in MODULES}


def test_every_room_has_its_place_in_the_house() -> None:
    assert {room_of(name) for name in MODULES} == set(FLOOR)


def test_a_room_imports_only_rooms_below() -> None:
    for name in MODULES:
        room = str(room_of(name))
        for target in arrows_of(name):
            other = str(room_of(target))
            assert other == room or FLOOR[other] < FLOOR[room], f"{name} imports {target}"


def test_a_library_module_imports_from_modules_not_from_a_root() -> None:
    for name, tree in MODULES.items():
        if not name.startswith("bsg_cli"):
            outside = {module for module in imported(tree) if module not in MODULES}
            assert not {"bsg_data", "bsg_models", "bsg_robot"} & outside, name


def test_no_module_imports_itself_by_a_circle() -> None:
    graph = {name: arrows_of(name) - {name} for name in MODULES}
    assert list(graphlib.TopologicalSorter(graph).static_order())


def test_rooms_are_folders_of_depth_two_whose_init_is_a_docstring() -> None:
    for package in ("bsg_data", "bsg_models", "bsg_robot"):
        for init in (REPOSITORY / package).glob("*/**/__init__.py"):
            assert init.parent.parent.name == package, f"{init} is too deep"
            body = ast.parse(init.read_text("utf-8")).body
            assert len(body) == 1, f"{init}: more than a docstring"
            assert ast.get_docstring(ast.Module(body, [])), f"{init}: no docstring"


HEAVY = "matplotlib networkx pandas PIL pyarrow scipy shapely torch torch_geometric trimesh"
FORBID = f"import sys; sys.modules.update(dict.fromkeys({HEAVY!r}.split()))\n"
HOME = str(REPOSITORY / "docs" / "home.json")
# What runs without these libraries: part → the module that it needs, and its code.
LIGHT = {
    "the roots": (
        None,
        "import bsg_data, bsg_models, bsg_robot\nassert 'numpy' not in sys.modules",
    ),
    "the node": ("rclpy", "import bsg_robot.ros.node"),
    "the service": ("mcp", "from bsg_robot.service import http, pool, tools"),
    "an answer of each model, in Python": (
        None,
        "import bsg_robot\nfrom bsg_models.runs.found_model import shipped_names\n"
        "for name in shipped_names():\n"
        f"    bsg_robot.open_graph({HOME!r}, model=name).where('microwave', here='hall')",
    ),
    "an answer of the command": (
        None,
        f"sys.argv[1:] = [{HOME!r}, '--find', 'microwave', '--from', 'living']\n"
        "from bsg_cli.belief import main\nmain()",
    ),
}


@pytest.mark.parametrize("part", LIGHT)
def test_what_answers_imports_nothing_heavy(part: str) -> None:
    needed, code = LIGHT[part]
    if needed:
        pytest.importorskip(needed, reason="needs the extras ros and serve")
    run_python(FORBID + code)


def test_bsg_data_and_its_command_import_without_torch_or_another_heavy_library() -> None:
    names = [*modules("bsg_data"), "bsg_cli.data"]
    run_python(
        "import sys, importlib\nsys.modules['torch'] = None\n"  # any `import torch` raises now
        f"for name in {names!r}: importlib.import_module(name)\n"
        "assert not {'matplotlib', 'scipy', 'shapely', 'trimesh'} & set(sys.modules)"
    )


def run_python(code: str) -> None:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("room", ["bsg_data", "bsg_data.extend", "bsg_models", "bsg_robot"])
def test_public_names_are_sorted_and_exist(room: str) -> None:
    package = importlib.import_module(room)
    stub = ast.parse(Path(str(package.__file__)).with_suffix(".pyi").read_text("utf-8"))
    listed = ast.literal_eval(stub.body[-1].value)  # type: ignore[attr-defined]
    assert listed == sorted(listed, key=lambda n: (not n.isupper(), not n[0].isupper(), n))
    assert sorted(listed) == sorted(package.__all__)  # what is imported in the stub is public
    for name in listed:  # constants, then classes, then functions
        thing = getattr(package, name)
        assert name.isupper() or thing.__doc__, f"{room}.{name} has no docstring"


def test_every_error_of_the_tree_is_drawn() -> None:
    errors = importlib.import_module("bsg_data.errors")
    drawn = re.findall(r"(\w+Error)\b {2,}", str(errors.__doc__))
    defined = {
        name: thing
        for package in ("bsg_data", "bsg_models", "bsg_robot")
        for name, thing in vars(importlib.import_module(f"{package}.errors")).items()
        if name.endswith("Error")
    }
    assert sorted(drawn) == sorted(defined)
    assert all(issubclass(error, errors.BSGError) for error in defined.values())


def test_libraries_are_silent_and_pickle_nothing() -> None:
    for name, tree in MODULES.items():
        if not name.startswith("bsg_cli"):
            calls = (n.func for n in ast.walk(tree) if isinstance(n, ast.Call))
            printed = [f for f in calls if isinstance(f, ast.Name) and f.id == "print"]
            assert not printed, f"{name} prints"
            assert not {"pickle", "click", "tqdm"} & {m.split(".")[0] for m in imported(tree)}
