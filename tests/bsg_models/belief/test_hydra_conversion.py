from __future__ import annotations

import sys
from pathlib import Path

import pytest

from bsg_models.belief import hydra_conversion
from bsg_models.belief.hydra_conversion import convert
from bsg_models.errors import HydraError

spark_dsg = pytest.importorskip("spark_dsg")


@pytest.fixture
def binary(tmp_path: Path) -> Path:
    graph = spark_dsg.DynamicSceneGraph()
    room = spark_dsg.RoomNodeAttributes()
    room.name = "kitchen"
    graph.add_node("ROOMS", spark_dsg.NodeSymbol("R", 0), room)
    graph.save(str(tmp_path / "graph.sparkdsg"), include_mesh=False)
    return tmp_path / "graph.sparkdsg"


def test_a_graph_is_converted(binary: Path) -> None:
    assert '"kitchen"' in convert(binary)


def test_a_length_that_asks_for_all_memory_is_refused(
    binary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Arrays are a byte of dd and four of their length; this one has 2³¹ names of attributes."""
    monkeypatch.setattr(hydra_conversion, "MAX_MEMORY", 2**28)
    data = binary.read_bytes()
    at = data.index(b"\xdd\x0e\x00\x00\x00NodeAttributes") - 4
    binary.write_bytes(data[:at] + (2**31 - 1).to_bytes(4, "little") + data[at + 4 :])
    with pytest.raises(HydraError, match="cannot load"):
        convert(binary)


def test_what_lies_in_the_working_directory_is_not_run(
    binary: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "spark_dsg.py").write_text("raise SystemExit(1)\n")
    (tmp_path / "json.py").write_text("raise SystemExit(1)\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])
    assert '"kitchen"' in convert(binary)


def test_without_the_library_it_is_named(binary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "spark_dsg", None)
    with pytest.raises(HydraError, match="need spark-dsg"):
        convert(binary)


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(HydraError, match="no such file"):
        convert(tmp_path / "none.sparkdsg")
