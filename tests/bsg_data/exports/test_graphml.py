"""Buildings as GraphML: networkx reads from it the graph of the node-link JSON."""

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
from bsg_data.exports.export import export_dataset
from bsg_data.exports.graphml import encode_graphml
from bsg_data.exports.node_link import encode_node_link
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


def test_a_building_by_hand() -> None:
    (data,) = encode_graphml(HOME, CLASSES).files.values()
    lines = data.decode().splitlines()
    for what, name, kind in (("node", "class_index", "int"), ("edge", "distance_m", "double")):
        key = f'<key id="{what}.{name}" for="{what}" attr.name="{name}" attr.type="{kind}"/>'
        assert lines.count(key) == 1
    door = '<data key="edge.kind">adjacent</data><data key="edge.method">door</data>'
    assert lines[-4:-2] == [
        f'<edge source="{a}" target="{b}">{door}<data key="edge.distance_m">3.5</data></edge>'
        for a, b in ((1, 2), (2, 1))
    ]


@pytest.mark.parametrize("name", ['<b>&amp; "q" \' ]]>', "a\r\nb\rc\td ", "Küche 😀", "", " "])
def test_any_name_is_the_same_in_both_formats(name: str) -> None:
    graph = name_room(name)
    encoded = encode_graphml(graph, CLASSES)
    assert (encoded.rooms, encoded.objects, encoded.note) == (2, 3, None)
    nodes, edges = read_graphml(encoded.files["home 1.graphml"])
    assert (nodes, edges) == read_node_link(
        encode_node_link(graph, CLASSES).files["home 1.node-link.json"]
    )
    assert nodes[1]["source_label"] == name  # type: ignore[index]


def test_a_character_that_xml_cannot_hold_is_replaced_and_said() -> None:
    encoded = encode_graphml(name_room("a\x00b\x1b\ufffe"), CLASSES)
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
