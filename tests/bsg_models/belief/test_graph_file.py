from __future__ import annotations

import gzip
import io
import json
from pathlib import Path

import pytest
from conftest import REPOSITORY
from dsg_files import robot_graph, write_graph
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_data.inputs.bounds import Bound
from bsg_data.observation.robot_json import RobotGraphError, read_robot_graph
from bsg_models.belief import graph_file
from bsg_models.belief.graph_file import open_graph_file, read_graph
from bsg_models.belief.hydra import read_hydra

OFFICE = REPOSITORY / "docs" / "office.json"


def test_our_own_graph_is_known_by_its_content(tmp_path: Path) -> None:
    assert read_graph(OFFICE) == read_robot_graph(OFFICE)
    with refuses(RecipeError, "labels-unused", OFFICE):
        read_graph(OFFICE, labels="ade20k")
    broken = tmp_path / "broken.json"
    for text in ("{", '{"scene_id": "a", "scene_id": "b", "rooms": []}'):
        broken.write_text(text)
        with refuses(RobotGraphError, "json-malformed", broken):
            read_graph(broken)


def test_a_graph_of_hydra_is_known_by_its_content(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = write_graph(tmp_path / "dsg.json")  # without a header, as old versions are
    packed = tmp_path / "dsg.json.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert read_graph(plain, labels="mpcat40") == read_hydra(plain, labels="mpcat40")
    file = open_graph_file(packed)
    assert file.graph == read_graph(plain)
    assert file.hydra is not None
    assert file.hydra.document == robot_graph()
    assert file.notes == tuple(file.hydra.notes())

    class Standard:
        buffer = io.BytesIO(plain.read_bytes())

    monkeypatch.setattr("sys.stdin", Standard())
    piped = open_graph_file(Path("-"))
    assert piped.graph.rooms == file.graph.rooms
    assert piped.hydra is not None, "it is kept, to be annotated"


def test_the_bound_of_a_graph_counts_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "graph.json"
    path.write_text(json.dumps({"scene_id": "ü" * 30, "rooms": []}, ensure_ascii=False), "utf-8")
    size = path.stat().st_size
    monkeypatch.setattr(graph_file, "ROBOT", Bound("graph", size))
    assert read_graph(path).scene_id == "ü" * 30
    monkeypatch.setattr(graph_file, "ROBOT", Bound("graph", size - 1))
    with refuses(RobotGraphError, "file-too-large", path):
        read_graph(path)
