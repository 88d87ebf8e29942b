"""Buildings as GraphML and as node-link JSON: networkx reads one graph from both."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import networkx as nx
import pytest
from data_commands import run
from whole_home import CLASSES, HOME

from bsg_data.build import build_dataset
from bsg_data.exports.building_graphs import _encode_graphml, _encode_node_link
from bsg_data.exports.export import export_dataset
from bsg_data.scene.scene_graph import SceneGraph
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.room_layouts import WithLayouts
from bsg_data.synthetic.buildings import write_synthetic

Read = tuple[dict[object, object], list[object]]  # nodes and edges, with their attributes


def name_room(name: str) -> SceneGraph:
    """Return the home with another name of its first room."""
    kitchen, other = HOME.rooms
    return replace(HOME, rooms=(replace(kitchen, source_label=name), other))


def read_graphml(data: bytes) -> Read:
    graph = nx.read_graphml(io.BytesIO(data), node_type=int)
    assert type(graph) is nx.DiGraph
    for _, node in graph.nodes(data=True):
        if "footprint" in node:
            node["footprint"] = json.loads(node["footprint"])
    return dict(graph.nodes(data=True)), sorted(graph.edges(data=True), key=str)


def read_node_link(data: bytes) -> Read:
    graph = nx.node_link_graph(json.loads(data), edges="edges")
    return dict(graph.nodes(data=True)), sorted(graph.edges(data=True), key=str)


@pytest.mark.parametrize("name", ['<b>&amp; "q" \' ]]>', "a\r\nb\rc\td ", "Küche 😀", "", " "])
def test_any_name_is_the_same_in_both_formats(name: str) -> None:
    graph = name_room(name)
    encoded = _encode_graphml(graph, CLASSES)
    assert (encoded.rooms, encoded.objects, encoded.note) == (2, 3, None)
    nodes, edges = read_graphml(encoded.files["home 1.graphml"])
    assert (nodes, edges) == read_node_link(
        _encode_node_link(graph, CLASSES).files["home 1.node-link.json"]
    )
    assert nodes[1]["source_label"] == name  # type: ignore[index]


def test_a_character_that_xml_cannot_hold_is_replaced_and_said() -> None:
    encoded = _encode_graphml(name_room("a\x00b\x1b\ufffe"), CLASSES)
    nodes, _ = read_graphml(encoded.files["home 1.graphml"])
    assert nodes[1]["source_label"] == "a\ufffdb\ufffd\ufffd"  # type: ignore[index]
    assert encoded.note is not None
    assert "U+FFFD" in encoded.note


@pytest.fixture
def placed(tmp_path: Path) -> Iterator[Path]:
    """A dataset of synthetic buildings with labels, boxes and connections."""
    list(write_synthetic(tmp_path / "buildings", scenes=3, seed=0))
    source = WithLayouts(HM3DFolder(tmp_path / "buildings"), tmp_path / "buildings" / "layouts")
    build_dataset(source, tmp_path / "dataset")
    return tmp_path / "dataset"


def test_both_formats_are_one_graph_with_what_info_counts(placed: Path, tmp_path: Path) -> None:
    for to in ("graphml", "networkx"):
        export_dataset(placed, tmp_path / to, to=to)
    number = dict.fromkeys(("building", "room", "object", "adjacent"), 0)
    for path in (tmp_path / "graphml").iterdir():
        nodes, edges = read_graphml(path.read_bytes())
        other = tmp_path / "networkx" / path.with_suffix(".node-link.json").name
        assert (nodes, edges) == read_node_link(other.read_bytes())
        for node in nodes.values():
            number[node["kind"]] += 1  # type: ignore[index]
        number["adjacent"] += sum(edge[2]["kind"] == "adjacent" for edge in edges)  # type: ignore[index]
    said = run("info", placed).stdout.partition("\n")[0]
    assert f"{number['building']} scenes, {number['room']:,} rooms, {number['object']:,}" in said
    assert f" {number['adjacent'] // 2:,} pairs of adjacent rooms" in said


def test_a_building_by_hand_as_node_link() -> None:
    encoded = _encode_node_link(HOME, CLASSES)
    assert (encoded.rooms, encoded.objects, encoded.note) == (2, 3, None)
    document = json.loads(encoded.files["home 1.node-link.json"])
    building, kitchen, other, chair, loose, clock = document.pop("nodes")
    edges = [tuple(edge.values()) for edge in document.pop("edges")]
    assert document == {"directed": True, "multigraph": False, "graph": {}}
    assert (building["kind"], building["num_objects"]) == ("building", 3)
    assert "source_split" not in building, "what is null is absent"
    shared = {"kind": "room", "scene_id": "home 1"}
    assert other == {"id": 2, **shared, "room_index": 2, "region_id": 9}
    assert kitchen == {
        "id": 1,
        **shared,
        "room_index": 1,
        "region_id": 4,
        "label": "kitchen",
        "source_label": "Küche",
        "centroid_x": 1,
        "centroid_y": 2,
        "centroid_z": 1.5,
        "floor_index": 0,
        "footprint": [0, 0, 4, 0, 4, 3],
    }
    assert (chair["class"], chair["class_index"], chair["box_max_z"]) == ("chair", 1, 3)
    assert (clock["category"], clock["area"], clock.get("class")) == ("clock", 0.5, None)
    assert loose == {
        "id": 4,
        "kind": "object",
        "scene_id": "home 1",
        "object_index": 2,
        "instance_id": 8,
        "room_index": 0,
        "raw_category": "",
        "role": "unmapped",
        "has_geometry": False,
    }
    assert edges == [
        (0, 1, "contains", "annotation"),
        (0, 2, "contains", "annotation"),
        (2, 3, "contains", "annotation"),
        (0, 4, "contains", "annotation"),
        (2, 5, "contains", "annotation"),
        (1, 2, "adjacent", "door", 3.5),
        (2, 1, "adjacent", "door", 3.5),
    ]
