"""Spark-DSG files: one by hand, older and damaged ones, and what spark_dsg itself writes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dsg_files import Graph, node, robot_graph, symbol
from refusals import refuses

from bsg_data.errors import SourceError
from bsg_data.inputs.bounds import MAX_GRAPH_EDGES, MAX_GRAPH_LABELS, MAX_GRAPH_NODES
from bsg_data.scene.scene_graph import Box
from bsg_data.sources.dsg_file import DSGFile, name_symbol, parse_dsg

PATH = Path("dsg.json")


def parse(graph: Graph) -> DSGFile:
    return parse_dsg(graph, path=PATH)


def test_older_boxes_have_corners() -> None:
    graph = robot_graph()
    older = {"min": [1, 2, 3], "max": [2, 4, 6], "world_P_center": [1.5, 3, 4.5]}
    local = {"min": [-1, -2, -3], "max": [1, 2, 3], "world_P_center": [5, 5, 5]}
    graph["nodes"] += [
        node("O", 20, 2, bounding_box={"type": "AABB", **older}),
        node("O", 21, 2, bounding_box={"type": 1, **older}),
        node("O", 22, 2, bounding_box={"type": "OBB", **local}),
        node("O", 23, 2, bounding_box={"type": "INVALID", **older}),
        node("O", 24, 2, bounding_box={"type": "AABB", "min": [0, 0, 0]}),
    ]
    boxes = [obj.box for obj in parse(graph).objects[4:]]
    whole = Box((1, 2, 3), (2, 4, 6))
    assert boxes == [whole, whole, Box((4, 3, 2), (6, 7, 8)), None, None]


def as_version_1_0(graph: Graph) -> None:
    """Write as the recorded apartment does: no partitions; an agent has a prefix and a time."""
    graph["layer_ids"], graph["mesh_layer_id"] = [2, 3, 4, 5], 1
    graph["layer_names"] = {"OBJECTS": 2, "ROOMS": 4}
    for entry in graph["nodes"]:
        if entry.pop("partition"):
            entry |= {"prefix": 97, "timestamp": 1}


def as_version_1_1_2(graph: Graph) -> None:
    """Name layers by number and partition."""
    graph["layer_keys"] = [{"layer": 2, "partition": part} for part in (0, 97)]
    graph["layer_names"] = {"ROOMS": {"layer": 4, "partition": 0}}


def elsewhere(graph: Graph) -> None:
    """Put objects and rooms into layers and partitions of other numbers, and say so."""
    for entry in graph["nodes"]:
        if entry["layer"] == 2 and not entry["partition"]:
            entry["partition"] = 3
        entry["layer"] = {2: 6, 4: 20, 5: 30}.get(entry["layer"], 9)
    graph["layer_names"] = {
        "OBJECTS": {"layer": 6, "partition": 3},
        "ROOMS": {"layer": 20, "partition": 0},
    }
    graph["metadata"]["labelspaces"] = {"_l6p3": graph["metadata"]["labelspaces"]["_l2p0"]}


@pytest.mark.parametrize("form", [as_version_1_0, as_version_1_1_2, elsewhere])
def test_every_form_says_the_same(form: Callable[[Graph], None]) -> None:
    graph = robot_graph()
    form(graph)
    assert parse(graph) == parse(robot_graph())


def test_a_symbol_is_named_as_spark_dsg_names_it() -> None:
    dsg = pytest.importorskip("spark_dsg")
    for letter, number in (("R", 0), ("O", 12), ("x", 2**40)):
        assert name_symbol(symbol(letter, number)) == str(dsg.NodeSymbol(letter, number))
    assert name_symbol(7) == "7"


def test_numbers_that_repeat_give_way_to_places() -> None:
    graph = robot_graph()
    graph["nodes"].append(node("S", 3, 4))
    assert [room.index for room in parse(graph).rooms] == [0, 1, 2]


def too_large(graph: Graph) -> None:
    graph["metadata"] = {"labelspaces": {"_l2p0": [[5, "tv"]] * (MAX_GRAPH_LABELS + 1)}}


@pytest.mark.parametrize(
    "damage",
    [
        lambda graph: graph.pop("nodes"),
        lambda graph: graph["nodes"].append(graph["nodes"][0]),
        lambda graph: graph["nodes"][5]["attributes"].update(position=[0, 1e30, 0]),
        lambda graph: graph["nodes"][5]["attributes"]["bounding_box"].update(
            dimensions=["1", "x", "1"]
        ),
        too_large,
        *(
            pytest.param(
                lambda graph, kind=kind, bound=bound: graph.update(
                    {kind: graph[kind][:1] * (bound + 1)}
                ),
                marks=pytest.mark.heavy,
            )
            for kind, bound in (("nodes", MAX_GRAPH_NODES), ("edges", MAX_GRAPH_EDGES))
        ),
    ],
)
def test_a_damaged_or_vast_graph_is_named(damage: Callable[[Graph], object]) -> None:
    graph = robot_graph()
    damage(graph)
    with refuses(SourceError, "dsg-malformed", PATH):
        parse(graph)


def test_an_edge_without_its_node_is_left_out_and_counted() -> None:
    graph = robot_graph()
    whole = parse(graph)
    graph["edges"].append({"source": graph["nodes"][0]["id"], "target": 5})
    assert parse(graph) == replace(whole, lost=1)


def test_what_spark_dsg_writes_is_read_as_it_reads_it(tmp_path: Path) -> None:
    dsg = pytest.importorskip("spark_dsg")
    graph = dsg.DynamicSceneGraph()
    rng = np.random.default_rng(0)
    for number in range(6):
        attributes = dsg.ObjectNodeAttributes()
        attributes.name, attributes.semantic_label = f"thing {number}", number % 3
        attributes.position = rng.normal(size=3)
        attributes.bounding_box = dsg.BoundingBox(
            dsg.BoundingBoxType.OBB, rng.uniform(0.1, 3, 3), rng.normal(size=3), _turn(rng)
        )
        graph.add_node("OBJECTS", dsg.NodeSymbol("O", number), attributes)
    room = dsg.RoomNodeAttributes()
    room.name = "hall"
    graph.add_node("ROOMS", dsg.NodeSymbol("R", 1), room)
    graph.insert_edge(dsg.NodeSymbol("R", 1).value, dsg.NodeSymbol("O", 4).value)
    graph.set_labelspace(dsg.Labelspace({0: "chair", 1: "bed"}), 2, 0)
    graph.save(str(tmp_path / "dsg.json"), include_mesh=False)
    read = parse(json.loads((tmp_path / "dsg.json").read_text()))
    assert [obj.label_name for obj in read.objects] == ["chair", "bed", None] * 2
    assert [obj.room for obj in read.objects] == [None] * 4 + [0, None]
    assert (read.rooms[0].index, read.rooms[0].name) == (1, "hall")
    for number, found in enumerate(read.objects):
        corners = graph.get_node(
            dsg.NodeSymbol("O", number).value
        ).attributes.bounding_box.corners()
        assert found.box is not None
        assert found.box.minimum == pytest.approx(np.min(corners, axis=0), abs=1e-5)
        assert found.box.maximum == pytest.approx(np.max(corners, axis=0), abs=1e-5)


def _turn(rng: np.random.Generator) -> np.ndarray:
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return turn * np.sign(np.linalg.det(turn))
