"""Robots' graphs as a source: one by hand, folders of Hydra's, label spaces, and a real one."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pytest
from conftest import REPOSITORY
from dsg_files import robot_graph, write_graph
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.errors import BSGError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Box, SceneGraph
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.label_space import _list_label_spaces, load_label_space
from bsg_data.testing import SourceContract

SAMPLE = REPOSITORY.parent / "shared" / "sources" / "hydra_apartment_dsg.json.gz"
HYDRA = """\
---
total_semantic_labels: 3
object_labels: [7, 10]
label_names:
  - {label: 7, name: chair}
  - {label: 10, name: bed}
  - {label: 99, name: shelf}
"""


class TestRobotGraphs(SourceContract):
    """The contract of all sources, on two graphs."""

    name = "spark-dsg"

    def write_example(self, folder: Path) -> Path:
        write_graph(folder / "first" / "backend" / "dsg.json")
        packed = folder / "second.json.gz"
        packed.write_bytes(gzip.compress(json.dumps(robot_graph()).encode()))
        return folder


def read(path: Path, labels: str | None = None) -> SceneGraph:
    """Return the only graph of a path."""
    source = open_source("spark-dsg", path, labels=labels)
    (ref,) = source.find().scenes
    return source.read(ref, load_class_map()).graph


def test_a_graph_by_hand(tmp_path: Path) -> None:
    graph = read(write_graph(tmp_path / "flat.json"))
    assert (graph.scene_id, graph.source, graph.up_axis) == ("flat", "spark-dsg", None)
    kitchen, other = graph.rooms
    assert (kitchen.region_id, kitchen.source_label, kitchen.label) == (0, "kitchen", "kitchen")
    assert (kitchen.box, kitchen.floor_area) == (Box((0, 0, 0), (4, 2, 2)), 8)
    assert (kitchen.floor_z, kitchen.floor_index) == (0, 0)
    assert (other.region_id, other.source_label, other.box) == (3, None, None)
    assert other.centroid == (3, 0, 0.5)
    (edge,) = graph.adjacency
    assert (edge.source, edge.target, edge.method) == (1, 2, "robot")
    assert edge.distance_m == pytest.approx((1 + 1 + 0.25) ** 0.5)
    names = [(obj.instance_id, obj.room_index, obj.raw_category) for obj in graph.objects]
    assert names == [(2, 1, "sofa"), (5, 1, "tv_monitor"), (6, 0, "chair"), (9, 2, "label 99")]
    sofa, screen, _, last = graph.objects
    assert sofa.box == Box((0, 0.5, 0.5), (2, 1.5, 1.5))
    assert screen.box is not None
    assert screen.box.minimum == pytest.approx((2.5, 0, 0.5)), "a quarter turn swaps its sides"
    assert screen.box.maximum == pytest.approx((3.5, 2, 1.5))
    assert last.centroid is None


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        (None, ["sofa", "tv_monitor", "chair", "label 99"]),
        ("mpcat40", ["couch", "tv", "chair", "label 99"]),
        ("own.yaml", ["chair", "bed", "chair", "shelf"]),
        ("own.csv", ["chair", "divan bed", "chair", "label 99"]),
    ],
)
def test_names_of_labels_come_from_their_space(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, labels: str | None, expected: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.yaml").write_text(HYDRA)
    Path("own.csv").write_text("label,name,category\n7,chair,\n10,bed,divan bed\n")
    graph = read(write_graph(tmp_path / "graphs" / "flat.json"), labels)
    assert [obj.raw_category for obj in graph.objects] == expected


def test_of_a_graph_with_and_without_its_mesh_one_is_read(tmp_path: Path) -> None:
    for name in ("dsg.json", "dsg_with_mesh.json"):
        write_graph(tmp_path / "run" / "backend" / name)
    write_graph(tmp_path / "alone" / "dsg_with_mesh.json")
    found = open_source("spark-dsg", tmp_path).find()
    assert [ref.scene_id for ref in found.scenes] == ["alone-dsg_with_mesh", "run-backend-dsg"]
    (second,) = found.duplicates
    assert (second.location, second.reason) == (
        "run/backend/dsg_with_mesh.json",
        "the graph beside it, with its mesh",
    )


def test_what_is_no_graph_is_skipped_with_the_reason(tmp_path: Path) -> None:
    write_graph(tmp_path / "graphs" / "flat.json")
    (tmp_path / "graphs" / "settings.json").write_text('{"rate": 5}')
    (tmp_path / "graphs" / "cut.json").write_text("{")
    manifest = build_dataset(open_source("spark-dsg", tmp_path / "graphs"), tmp_path / "both")
    cut, skip = manifest.skipped
    assert cut.reason.startswith("expected JSON")
    assert skip.location == "settings.json"
    assert skip.reason == "expected a Spark-DSG graph; nodes: Field required"


def test_published_spaces_translate_names() -> None:
    assert _list_label_spaces() == ("ade20k", "mpcat40")
    space = load_label_space("mpcat40")
    assert [space.translate(name) for name in ("tv_monitor", "zzqx")] == ["tv", "zzqx"]
    assert (space.usual[0], space.usual[22], space.usual[41]) == ("void", "tv_monitor", "unlabeled")
    larger = load_label_space("ade20k").usual
    assert sorted(larger) == list(range(150)), "as Hydra and networks count them, wall first"
    assert (larger[0], larger[19], larger[149]) == ("wall", "chair", "flag")


@pytest.mark.parametrize(
    ("name", "text", "code"),
    [
        ("nyu40", None, "label-space-unknown"),
        ("none.yaml", None, "file-unreadable"),
        ("a.yaml", b"label_names: [{label: x, name: bed}]", "label-space-malformed"),
        ("a.csv", b"label,name\n1,bed\n-1,chair\n", "label-space-malformed"),
        ("a.csv", b"label,name\n1,bed\n1,chair\n", "label-space-malformed"),
        ("a.csv", b"label,name\n1,b\xe9d\n", "label-space-malformed"),
    ],
)
def test_a_faulty_label_space_is_named_before_anything_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: bytes | None, code: str
) -> None:
    monkeypatch.chdir(tmp_path)
    write_graph(tmp_path / "flat.json")
    if text is not None:
        Path(name).write_bytes(text)
    with refuses(BSGError, code, name):
        open_source("spark-dsg", tmp_path, labels=name).find()


@pytest.mark.skipif(not SAMPLE.is_file(), reason="no sample here")
def test_the_real_graph_is_read() -> None:
    graph = read(SAMPLE)
    assert (graph.scene_id, len(graph.rooms), len(graph.objects)) == ("hydra_apartment_dsg", 1, 7)
    assert {obj.raw_category for obj in graph.objects} == {"label 5", "label 11", "label 16"}
    assert all(obj.box is not None for obj in graph.objects)
    assert sorted(obj.room_index for obj in graph.objects) == [0, 0, 0, 0, 1, 1, 1]
