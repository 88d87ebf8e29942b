"""Exports: files whole or absent, what is in the way, and a format of someone else's."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY
from dsg_files import robot_graph, write_graph

from bsg_data import registry
from bsg_data.build import build_dataset
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.exports.catalogue import EXPORTS, EncodedScene, ExportRow
from bsg_data.exports.export import export_dataset
from bsg_data.scene.scene_graph import SceneGraph
from bsg_data.sources.spark_dsg import RobotGraphs
from bsg_data.testing import ExportContract

NAMES = """
from bsg_data.exports.catalogue import EXPORTS, EncodedScene, ExportRow

def encode(graph):
    return EncodedScene({f"{graph.scene_id}.txt": b"rooms"}, len(graph.rooms))

ROW = ExportRow("the names of scenes", encode)
"""


@pytest.fixture
def robots(tmp_path: Path) -> Path:
    """A dataset of two scenes with a box each, and one without any."""
    for name in ("a", "b"):
        write_graph(tmp_path / "graphs" / f"{name}.json")
    bare = robot_graph()
    for node in bare["nodes"]:
        node["attributes"].pop("bounding_box", None)
    write_graph(tmp_path / "graphs" / "c.json", bare)
    build_dataset(RobotGraphs(tmp_path / "graphs"), tmp_path / "dataset")
    return tmp_path / "dataset"


def test_what_has_no_place_is_counted(robots: Path, tmp_path: Path) -> None:
    seen = []
    done = export_dataset(
        robots, tmp_path / "out", to="habitat", progress=lambda *step: seen.append(step)
    )
    assert (done.files, done.scenes, done.rooms) == (2, 2, 2)
    assert (done.left_out, done.rooms_left_out) == (("c",), 4)
    assert seen == [(1, 3), (2, 3), (3, 3)]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "a.semantic_config.json",
        "b.semantic_config.json",
    ]


def test_files_in_the_way_are_replaced_under_force_alone(robots: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "b.semantic_config.json").write_text("mine")
    (out / "other.txt").write_text("stays")
    with pytest.raises(DatasetError, match=r"b\.semantic_config\.json: exists; --force replaces"):
        export_dataset(robots, out, to="habitat")
    assert sorted(path.name for path in out.iterdir()) == ["b.semantic_config.json", "other.txt"]
    assert (out / "b.semantic_config.json").read_text() == "mine"
    export_dataset(robots, out, to="habitat", force=True)
    assert (out / "b.semantic_config.json").read_text().startswith("{")
    assert (out / "other.txt").read_text() == "stays"


def test_nothing_is_left_of_an_export_that_fails(
    robots: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def encode(graph: SceneGraph) -> EncodedScene:
        if graph.scene_id == "b":
            raise KeyboardInterrupt
        return EncodedScene({graph.scene_id: b""}, 0)

    monkeypatch.setattr("bsg_data.exports.habitat.ROW", ExportRow("half", encode))
    with pytest.raises(KeyboardInterrupt):
        export_dataset(robots, tmp_path / "out", to="habitat")
    assert not (tmp_path / "out").exists()


def test_a_dataset_without_places_is_an_error(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(
        DatasetError, match="none of its 12 scenes has anything for the export 'habitat'"
    ):
        export_dataset(dataset, tmp_path / "out", to="habitat")
    assert not (tmp_path / "out").exists()


def test_a_name_that_leads_out_of_the_folder_is_refused(
    robots: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = ExportRow("out", lambda graph: EncodedScene({"../a.json": b""}, 0))
    monkeypatch.setattr("bsg_data.exports.habitat.ROW", row)
    with pytest.raises(DatasetError, match=r"'\.\./a\.json' is no file name"):
        export_dataset(robots, tmp_path / "out", to="habitat")


def test_an_unknown_export_is_named_with_the_nearest(robots: Path, tmp_path: Path) -> None:
    with pytest.raises(RecipeError, match="no export 'habitats'; did you mean habitat"):
        export_dataset(robots, tmp_path / "out", to="habitats")
    assert not (tmp_path / "out").exists()


def test_an_installed_entry_point_is_an_export(
    robots: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "package"
    (package / "names_export-1.0.dist-info").mkdir(parents=True)
    (package / "names_export.py").write_text(NAMES)
    info = package / "names_export-1.0.dist-info"
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: names-export\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[bsg_data.exports]\nnames = names_export:ROW\n")
    monkeypatch.syspath_prepend(str(package))
    registry._installed.cache_clear()
    try:
        done = export_dataset(robots, tmp_path / "out", to="names")
    finally:
        registry._installed.cache_clear()
        sys.modules.pop("names_export", None)
    assert (done.files, done.rooms) == (3, 6)
    assert (tmp_path / "out" / "a.txt").read_bytes() == b"rooms"


class TestExports(ExportContract):
    @pytest.fixture(autouse=True, params=EXPORTS.names())
    def _row(self, request: pytest.FixtureRequest) -> None:
        self.name = request.param


def test_the_example_of_the_docs_is_an_export(
    robots: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last lines of Python in docs/export.md."""
    text = (REPOSITORY / "docs" / "export.md").read_text("utf-8")
    names: dict[str, ExportRow] = {}
    exec(compile(text.split("```python\n")[-1].split("```")[0], "docs/export.md", "exec"), names)
    monkeypatch.setattr("bsg_data.exports.habitat.ROW", names["ROW"])
    done = export_dataset(robots, tmp_path / "out", to="habitat")
    assert (done.files, done.rooms, done.left_out) == (2, 2, ("c",))
    assert (tmp_path / "out" / "a.areas.json").read_text() == '{"0": 8.0}'
