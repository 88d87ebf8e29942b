"""Exports: files whole or absent, what is in the way, and a format of someone else's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from contracts import make_graphs
from dsg_files import robot_graph, write_graph
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.errors import DatasetError
from bsg_data.exports.catalogue import EXPORTS, EncodedScene, ExportRow
from bsg_data.exports.export import export_dataset
from bsg_data.scene.class_space import load_class_space
from bsg_data.scene.scene_graph import is_file_name
from bsg_data.sources.catalogue import open_source

ROW = "bsg_data.exports.habitat.ROW"


@pytest.fixture
def robots(tmp_path: Path) -> Path:
    """A dataset of two scenes with a box each, and one without any."""
    for name in ("a", "b"):
        write_graph(tmp_path / "graphs" / f"{name}.json")
    bare = robot_graph()
    for node in bare["nodes"]:
        node["attributes"].pop("bounding_box", None)
    write_graph(tmp_path / "graphs" / "c.json", bare)
    build_dataset(open_source("spark-dsg", tmp_path / "graphs"), tmp_path / "dataset")
    return tmp_path / "dataset"


def test_what_has_no_place_is_counted_and_files_in_the_way_stay(
    robots: Path, tmp_path: Path
) -> None:
    out, seen = tmp_path / "out", []
    out.mkdir()
    (out / "b.semantic_config.json").write_text("mine")
    (out / "other.txt").write_text("stays")
    with refuses(DatasetError, "path-taken", out / "b.semantic_config.json"):
        export_dataset(robots, out, to="habitat")
    assert sorted(path.name for path in out.iterdir()) == ["b.semantic_config.json", "other.txt"]
    assert (out / "b.semantic_config.json").read_text() == "mine"
    how: Any = {"force": True, "progress": lambda *step: seen.append(step)}
    done = export_dataset(robots, out, to="habitat", **how)
    assert (done.files, done.scenes, done.rooms) == (2, 2, 2)
    assert (done.left_out, done.rooms_left_out) == (("c",), 4)
    assert seen == [(1, 3), (2, 3), (3, 3)]
    names = ["a.semantic_config.json", "b.semantic_config.json", "other.txt"]
    assert sorted(path.name for path in out.iterdir()) == names
    assert (out / "b.semantic_config.json").read_text().startswith("{")
    assert (out / "other.txt").read_text() == "stays"


@pytest.mark.parametrize(
    ("file", "code"), [(None, "export-empty"), ("../a.json", "file-name")], ids=["none", "outside"]
)
def test_nothing_is_left_of_an_export_that_fails(
    file: str | None, code: str, robots: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {} if file is None else {file: b""}
    monkeypatch.setattr(ROW, ExportRow("half", lambda *_: EncodedScene(files, 0)))
    with refuses(DatasetError, code, robots if file is None else "a"):
        export_dataset(robots, tmp_path / "out", to="habitat")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", EXPORTS.names())
def test_a_scene_has_the_same_files_again_by_names_and_counts_that_are_its_own(name: str) -> None:
    named: list[str] = []
    for graph in make_graphs():
        encoded, again = (EXPORTS[name].encode(graph, load_class_space().classes) for _ in "ab")
        assert encoded == again
        assert 0 <= encoded.rooms <= len(graph.rooms)
        assert 0 <= encoded.objects <= len(graph.objects)
        assert encoded.files or not (encoded.rooms or encoded.objects)
        named += encoded.files
    assert all(is_file_name(file) for file in named)
    assert len(set(named)) == len(named), "a file is of one scene"
