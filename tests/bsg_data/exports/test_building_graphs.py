"""Buildings as GraphML and as node-link JSON: networkx reads one graph from both."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from typing import Any

import networkx as nx
import pytest
from whole_home import CLASSES, HOME

from bsg_data.exports.building_graphs import GRAPHML, NODE_LINK
from bsg_data.scene.scene_graph import SceneGraph

Read = tuple[dict[int, Any], list[Any]]  # nodes and edges, with their attributes


def name_room(name: str) -> SceneGraph:
    """Return the home with another name of its first room."""
    kitchen, other = HOME.rooms
    return replace(HOME, rooms=(replace(kitchen, source_label=name), other))


def list_content(graph: nx.DiGraph) -> Read:
    assert type(graph) is nx.DiGraph
    return dict(graph.nodes(data=True)), sorted(graph.edges(data=True), key=str)


def read_graphml(data: bytes) -> Read:
    graph = nx.read_graphml(io.BytesIO(data), node_type=int)
    for _, node in graph.nodes(data=True):
        if "footprint" in node:
            node["footprint"] = json.loads(node["footprint"])
    return list_content(graph)


def read_node_link(data: bytes) -> Read:
    return list_content(nx.node_link_graph(json.loads(data), edges="edges"))


@pytest.mark.parametrize("name", ['<b>&amp; "q" \' ]]>', "a\r\nb\rc\td ", "Küche 😀", "", " "])
def test_any_name_is_the_same_in_both_formats(name: str) -> None:
    encoded = GRAPHML.encode(name_room(name), CLASSES)
    assert (encoded.rooms, encoded.objects, encoded.note) == (2, 3, None)
    found = read_graphml(encoded.files["home 1.graphml"])
    other = NODE_LINK.encode(name_room(name), CLASSES).files["home 1.node-link.json"]
    assert found == read_node_link(other)
    assert found[0][1]["source_label"] == name


def test_a_character_that_xml_cannot_hold_is_replaced_and_said() -> None:
    encoded = GRAPHML.encode(name_room("a\x00b\x1b\ufffe"), CLASSES)
    nodes, _ = read_graphml(encoded.files["home 1.graphml"])
    assert nodes[1]["source_label"] == "a\ufffdb\ufffd\ufffd"
    assert "U+FFFD" in str(encoded.note)


def test_a_building_by_hand() -> None:
    data = NODE_LINK.encode(HOME, CLASSES).files["home 1.node-link.json"]
    nodes, edges = read_node_link(data)
    assert [node["kind"] for node in nodes.values()] == ["building", *["room"] * 2, *["object"] * 3]
    assert nodes[1]["footprint"] == [0, 0, 4, 0, 4, 3]
    assert (nodes[3]["class"], nodes[3]["class_index"], nodes[3]["box_max_z"]) == ("chair", 1, 3)
    shared = {"kind": "room", "scene_id": "home 1"}
    assert nodes[2] == {**shared, "room_index": 2, "region_id": 9}, "what is null is absent"
    inside = {"kind": "contains", "method": "annotation"}
    beside = {"kind": "adjacent", "method": "door", "distance_m": 3.5}
    contained = [(a, b, inside) for a, b in ((0, 1), (0, 2), (0, 4), (2, 3), (2, 5))]
    assert edges == sorted([*contained, (1, 2, beside), (2, 1, beside)], key=str)
