"""The shape of the house: who may import whom, what is public, what is never there."""

from __future__ import annotations

import ast
import graphlib
import importlib
import subprocess
import sys
from collections.abc import Iterator

import pytest
from conftest import REPOSITORY

FOLDERS = {"bsg_data": "bsg_data", "bsg_models": "bsg_models", "bsg_cli": "cli"}
ROOMS = {"bsg_data": set(), "bsg_models": {"bsg_data"}, "bsg_cli": {"bsg_data", "bsg_models"}}

# What each file of a room imports from its own room: exactly this, so that a new arrow is a
# decision and not an accident.
IMPORTS = {
    "bsg_data": {
        "adjacency": "passages placement scene_graph",
        "annotations": "errors",
        "build": (
            "class_map errors executors lock manifest mesh_coverage publication recipes "
            "scene_graph schema shards sources"
        ),
        "card": "manifest schema",
        "categories": "class_map histograms manifest shards",
        "check": (
            "check_pairs check_tables class_map errors faults manifest publication schema shards"
        ),
        "check_pairs": "errors faults histograms manifest masks pairs recipes sources splits",
        "check_tables": "class_map faults manifest scene_graph sources",
        "class_map": "errors",
        "coverage": "class_map shards",
        "errors": "",
        "executors": "errors",
        "faults": "",
        "floor_plan": "",
        "frequencies": "errors histograms manifest",
        "furnishing": "floor_plan placement scene_graph",
        "gltf": "errors",
        "histograms": "errors manifest shards",
        "lock": "errors",
        "manifest": "class_map errors mesh_coverage recipes schema",
        "masks": "histograms recipes",
        "mesh_coverage": "recipes",
        "partial_graph": (
            "categories class_map errors histograms manifest masks recipes scene_graph shards"
        ),
        "robot_json": "class_map errors manifest partial_graph recipes scene_graph",
        "pairs": (
            "errors executors histograms lock manifest masks publication recipes schema shards "
            "splits"
        ),
        "passages": "",
        "placement": "scene_graph semantic_mesh",
        "publication": "card errors manifest shards",
        "recipes": "",
        "room_layouts": "adjacency class_map errors placement recipes scene_graph sources",
        "scene_graph": "",
        "scene_tables": "scene_graph schema",
        "schema": "",
        "semantic_mesh": "gltf mesh_coverage",
        "shards": "errors manifest scene_graph scene_tables schema",
        "sources": (
            "adjacency annotations class_map errors gltf mesh_coverage placement scene_graph "
            "semantic_mesh statistics"
        ),
        "splits": "errors lock manifest publication recipes schema shards",
        "statistics": "annotations errors",
        "synthetic": "annotations errors shards sources synthetic_geometry synthetic_rates",
        "synthetic_geometry": (
            "annotations class_map floor_plan furnishing placement synthetic_mesh"
        ),
        "synthetic_mesh": "floor_plan furnishing scene_graph",
        "synthetic_rates": "errors",
    },
    "bsg_models": {
        "baselines": "config expectation graph_dataset hidden_counts model",
        "belief": "expectation",
        "belief_files": "belief",
        "explorer": "belief",
        "hydra": "belief belief_files",
        "planners": "travel visiting_order",
        "predictor": "checkpoint expectation graph_dataset hidden_counts run_folder",
        "report": "",
        "boosting": (
            "calibration config errors families gamma_poisson graph_dataset hidden_counts "
            "masked_rooms model"
        ),
        "calibration": "expectation hidden_counts model room_sums",
        "checkpoint": "config errors model zoo",
        "comparison": (
            "checkpoint config errors evaluation expectation graph_dataset model run_folder zoo"
        ),
        "conditional": (
            "config expectation families graph_dataset hidden_counts masked_rooms model room_sums"
        ),
        "config": "errors families graph_dataset",
        "count_network": (
            "calibration config families graph_dataset hidden_counts model node_features"
        ),
        "deepsets": "count_network families",
        "ensemble": "calibration graph_dataset hidden_counts model",
        "errors": "",
        "evaluation": "expectation graph_dataset metrics model presence",
        "expectation": "hidden_counts",
        "families": "",
        "figures": "evaluation expectation learning_curve metrics",
        "gamma_poisson": "config expectation graph_dataset hidden_counts model room_sums",
        "gat": "families message_passing",
        "gcn": "expectation families model",
        "gin": "families message_passing",
        "gradient": (
            "checkpoint config errors graph_dataset learning_curve model optimiser run_folder"
        ),
        "graph_dataset": "search_masks",
        "hidden_counts": "",
        "leaderboard": (
            "checkpoint config errors evaluation families gradient graph_dataset run_folder "
            "training"
        ),
        "leaderboard_table": "evaluation leaderboard",
        "learning_curve": "errors",
        "masked_rooms": "config errors graph_dataset",
        "message_passing": "count_network families",
        "metrics": "",
        "mixture": "calibration config errors families graph_dataset hidden_counts model",
        "model": "config expectation graph_dataset",
        "naive_bayes": (
            "config expectation families graph_dataset hidden_counts masked_rooms model room_sums"
        ),
        "node_features": "families model",
        "optimiser": "config errors model",
        "presence": "metrics",
        "residual_gcn": "families message_passing",
        "room_sums": "hidden_counts model",
        "room_transformer": "count_network families model",
        "run_folder": "checkpoint config errors graph_dataset model",
        "sage": "families message_passing",
        "savings": "planners search search_cases search_study travel",
        "search": "planners travel",
        "search_beliefs": "graph_dataset model search_masks travel",
        "search_cases": "planners search travel worlds",
        "search_files": "savings search_study",
        "search_masks": "",
        "search_study": (
            "checkpoint graph_dataset model planners run_folder search search_beliefs search_cases "
            "training travel worlds"
        ),
        "search_trace": (
            "belief explorer graph_dataset planners predictor search search_cases search_study "
            "travel worlds"
        ),
        "training": (
            "calibration checkpoint config ensemble errors families gradient graph_dataset "
            "hidden_counts learning_curve model run_folder zoo"
        ),
        "travel": "",
        "visiting_order": "",
        "worlds": "travel",
        "zoo": (
            "baselines boosting conditional config deepsets ensemble errors families "
            "gamma_poisson gat gcn gin mixture model naive_bayes residual_gcn room_transformer "
            "sage"
        ),
    },
}
THIRD_PARTY = {
    "bsg_data": {
        "PIL",
        "matplotlib",
        "numpy",
        "pandas",
        "pyarrow",
        "pydantic",
        "scipy",
        "trimesh",
        "yaml",
    },
    "bsg_models": {
        "lightgbm",
        "matplotlib",
        "networkx",
        "numba",
        "numpy",
        "pandas",
        "pyarrow",
        "pydantic",
        "safetensors",
        "spark_dsg",
        "scipy",
        "torch",
        "torch_geometric",
    },
    "bsg_cli": {"click", "numpy", "pandas", "torch", "tqdm"},
}


def imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield str(node.module)


def modules(room: str) -> dict[str, ast.Module]:
    folder = REPOSITORY / FOLDERS[room]
    files = sorted(p for p in folder.glob("*.py") if p.stem != "__init__")
    return {path.stem: ast.parse(path.read_text("utf-8")) for path in files}


@pytest.mark.parametrize("room", IMPORTS)
def test_files_import_what_the_table_says(room: str) -> None:
    prefix = f"{room}."
    found = {
        name: " ".join(
            sorted({m.removeprefix(prefix) for m in imported(tree) if m.startswith(prefix)})
        )
        for name, tree in modules(room).items()
    }
    assert found == IMPORTS[room]


@pytest.mark.parametrize("room", IMPORTS)
def test_arrows_never_run_in_a_circle(room: str) -> None:
    graph = {name: set(arrows.split()) for name, arrows in IMPORTS[room].items()}
    assert len(list(graphlib.TopologicalSorter(graph).static_order())) == len(graph)


@pytest.mark.parametrize("room", FOLDERS)
def test_rooms_import_only_the_rooms_below(room: str) -> None:
    for name, tree in modules(room).items():
        others = {m.split(".")[0] for m in imported(tree)} & (set(FOLDERS) - {room})
        assert others <= ROOMS[room], f"{room}.{name} imports {others - ROOMS[room]}"


@pytest.mark.parametrize("room", THIRD_PARTY)
def test_rooms_use_only_the_libraries_that_they_may(room: str) -> None:
    for name, tree in modules(room).items():
        roots = {m.split(".")[0] for m in imported(tree)}
        foreign = roots - set(sys.stdlib_module_names) - set(FOLDERS)
        assert foreign <= THIRD_PARTY[room], f"{room}.{name} imports {foreign}"


def test_bsg_data_and_its_command_import_without_torch_or_another_heavy_library() -> None:
    names = [f"bsg_data.{name}" for name in modules("bsg_data")]
    code = (
        "import sys, importlib\n"
        "sys.modules['torch'] = None\n"  # any `import torch` raises now
        f"for name in {names!r}: importlib.import_module(name)\n"
        "import bsg_cli.data\n"
        "heavy = {'matplotlib', 'scipy', 'torch_geometric', 'trimesh'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("room", ["bsg_data", "bsg_models"])
def test_public_names_are_sorted_and_exist(room: str) -> None:
    package = importlib.import_module(room)
    isort = sorted(package.__all__, key=lambda n: (not n.isupper(), not n[0].isupper(), n))
    assert list(package.__all__) == isort  # constants, then classes, then functions
    for name in package.__all__:
        thing = getattr(package, name)
        assert name.isupper() or thing.__doc__, f"{room}.{name} has no docstring"


@pytest.mark.parametrize("room", FOLDERS)
def test_no_file_is_a_drawer(room: str) -> None:
    assert not {"utils", "util", "helpers", "common", "base", "misc"} & set(modules(room))


def test_libraries_are_silent_and_pickle_nothing() -> None:
    for room in ("bsg_data", "bsg_models"):
        for name, tree in modules(room).items():
            calls = (n.func for n in ast.walk(tree) if isinstance(n, ast.Call))
            printed = [f for f in calls if isinstance(f, ast.Name) and f.id == "print"]
            assert not printed, f"{room}.{name} prints"
            assert not {"pickle", "click", "tqdm"} & {m.split(".")[0] for m in imported(tree)}
