from __future__ import annotations

import gzip
import io
import json
from pathlib import Path

import pytest
from conftest import REPOSITORY
from dsg_files import robot_graph, write_graph

from bsg_data.errors import BSGError, RecipeError
from bsg_data.inputs.bounds import Bound
from bsg_data.observation.robot_json import read_robot_graph
from bsg_models.belief import graph_file
from bsg_models.belief.graph_file import open_graph_file, read_graph
from bsg_models.belief.hydra import read_hydra

OFFICE = REPOSITORY / "docs" / "office.json"


def test_our_own_graph_is_known_by_its_content(tmp_path: Path) -> None:
    assert read_graph(OFFICE) == read_robot_graph(OFFICE)
    with pytest.raises(RecipeError, match="labels are for Hydra's graphs"):
        read_graph(OFFICE, labels="ade20k")
    with pytest.raises(BSGError, match="cannot be read"):
        read_graph(tmp_path / "none.json")
    (tmp_path / "broken.json").write_text("{")
    with pytest.raises(BSGError, match="no JSON"):
        read_graph(tmp_path / "broken.json")


def test_a_graph_of_hydra_is_known_by_its_content(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = write_graph(tmp_path / "dsg.json")  # without a header, as old versions are
    packed = tmp_path / "dsg.json.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert read_graph(plain, labels="mpcat40") == read_hydra(plain, labels="mpcat40")
    assert read_graph(packed) == read_graph(plain)
    file = open_graph_file(packed)
    assert file.hydra is not None
    assert file.hydra.text == json.dumps(robot_graph())
    assert file.notes == file.hydra.notes()
    ours = open_graph_file(OFFICE)
    assert (ours.hydra, ours.notes) == (None, ())

    class Standard:
        buffer = io.BytesIO(plain.read_bytes())

    monkeypatch.setattr("sys.stdin", Standard())
    piped = open_graph_file(Path("-"))
    assert piped.graph.rooms == file.graph.rooms
    assert piped.hydra is not None, "its text is kept, to be annotated"


@pytest.mark.parametrize("stream", [None, io.StringIO("{}")])
def test_a_closed_standard_input_is_refused(
    monkeypatch: pytest.MonkeyPatch, stream: io.StringIO | None
) -> None:
    monkeypatch.setattr("sys.stdin", stream)
    with pytest.raises(BSGError, match="standard input: expected a robot's graph, found it closed"):
        open_graph_file(Path("-"))


def test_the_bound_of_a_graph_counts_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "graph.json"
    path.write_text(json.dumps({"scene_id": "ü" * 30, "rooms": []}, ensure_ascii=False), "utf-8")
    size = path.stat().st_size
    assert size == len(path.read_text("utf-8")) + 30
    monkeypatch.setattr(graph_file, "ROBOT", Bound("graph", size))
    assert read_graph(path).scene_id == "ü" * 30
    monkeypatch.setattr(graph_file, "ROBOT", Bound("graph", size - 1))
    with pytest.raises(BSGError, match=f"expected at most {size - 1} bytes"):
        read_graph(path)
