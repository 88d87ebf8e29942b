"""Spark-DSG files: what Hydra wrote is read and comes back as it was, with beliefs in it."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from dsg_files import symbol, write_graph
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_beliefs import CLASS_SPACE, make_belief

from bsg_data.errors import BSGError
from bsg_data.observation.hidden_share import VAGUE, estimate_hidden_share
from bsg_data.observation.partial_graph import PartialGraph
from bsg_models.belief.annotation import strip_annotation
from bsg_models.belief.belief_graph import BeliefGraph, believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import from_hidden_counts
from bsg_models.belief.graph_file import open_graph_file
from bsg_models.belief.header import encode_whole_header
from bsg_models.belief.hydra import (
    annotate_hydra,
    read_hydra,
    read_hydra_belief,
    strip_hydra,
    write_hydra,
)
from bsg_models.belief.nodes import KINDS, encode_edges, encode_nodes
from bsg_models.errors import HydraError

spark_dsg = pytest.importorskip("spark_dsg")
SAMPLE = REPOSITORY.parent / "shared" / "sources" / "hydra_apartment_dsg.json.gz"


@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 2**32 - 1), mode=st.sampled_from(["complete", "unseen"]))
def test_a_belief_graph_is_read_back(tmp_path: Path, seed: int, mode: str) -> None:
    belief = make_belief(seed, mode=mode)
    write_hydra(belief, tmp_path / "hydra.json")
    assert read_hydra_belief(tmp_path / "hydra.json") == belief


def test_spark_dsg_shows_blind_nodes_as_predicted(tmp_path: Path) -> None:
    belief = make_belief(7)
    write_hydra(belief, tmp_path / "belief.json")
    graph = spark_dsg.DynamicSceneGraph.load(str(tmp_path / "belief.json"))
    blind = list(graph.get_layer("BLIND").nodes)
    assert len(blind) == len(belief.blind)
    assert all(node.attributes.is_predicted for node in blind)
    assert {node.attributes.name for node in blind} <= set(CLASS_SPACE.classes)
    assert len(list(graph.get_layer("ROOMS").nodes)) == len(belief.partial.rooms)
    assert not any(node.attributes.is_predicted for node in graph.get_layer("OBJECTS").nodes)
    for room in graph.get_layer("ROOMS").nodes:
        assert spark_dsg.NodeSymbol(room.get_parent()).category == "B", "a blind node is below"
    assert read_hydra(tmp_path / "belief.json") == belief.partial, "a robot would go on from it"


def write_numbered(belief: BeliefGraph, path: Path) -> None:
    """Write a belief graph as `write_hydra` did before annotations: nodes by number."""
    nodes = list(encode_nodes(belief))
    symbols = [symbol("BROb"[KINDS.index(one.kind)], place) for place, one in enumerate(nodes)]
    layers = {"building": 5, "room": 4, "object": 2, "blind": 10}
    graph = {
        "nodes": [
            {
                "id": symbols[place],
                "layer": layers[one.kind],
                "attributes": {"name": "x", "metadata": {"bsg": dict(one.attributes)}},
            }
            for place, one in enumerate(nodes)
        ],
        "edges": [
            {
                "source": symbols[b],
                "target": symbols[a],
                "info": {"metadata": {"bsg": {"kind": kind}}},
            }
            for a, b, kind in encode_edges(belief, nodes)
        ],
        "metadata": {"bsg": encode_whole_header(belief)},
    }
    path.write_text(json.dumps(graph))


@settings(
    max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 2**32 - 1))
def test_graphs_of_the_first_form_are_read(tmp_path: Path, seed: int) -> None:
    belief = make_belief(seed)
    path = tmp_path / "old.json"
    write_numbered(belief, path)
    assert read_hydra_belief(path) == belief
    assert read_hydra(path) == belief.partial
    assert open_graph_file(path).hydra is None, "it is ours, and is written anew"


def test_a_graph_of_the_first_form_that_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    write_numbered(make_belief(3), path)
    graph = json.loads(path.read_text())
    del graph["nodes"][0]["attributes"]["metadata"]
    path.write_text(json.dumps(graph))
    with pytest.raises(HydraError, match=r"old\.json: expected nodes and edges with"):
        read_hydra_belief(path)


def believe_something(graph: PartialGraph) -> BeliefGraph:
    """Return random beliefs about a graph, with blind nodes in its rooms."""
    inputs = graph.histograms().astype(float)
    hidden = poisson(np.random.default_rng(0).gamma(0.1, 5.0, inputs.shape))
    return believe(graph, from_hidden_counts(inputs, hidden), mode="unseen", model="random")


def write_like_hydra(path: Path) -> None:
    """Write a graph with spark_dsg: two rooms with places, objects, a label space, a mesh."""
    dsg = spark_dsg
    graph = dsg.DynamicSceneGraph()
    building = dsg.SemanticNodeAttributes()
    graph.add_node("BUILDINGS", dsg.NodeSymbol("B", 0), building)
    for number in range(2):
        room, place = dsg.RoomNodeAttributes(), dsg.PlaceNodeAttributes()
        room.position = np.array([1e-5, 0.1 + 0.2, float(number)])
        room.name = str(dsg.NodeSymbol("R", number))
        graph.add_node("ROOMS", dsg.NodeSymbol("R", number), room)
        graph.add_node("PLACES", dsg.NodeSymbol("p", number), place)
        graph.insert_edge(dsg.NodeSymbol("B", 0), dsg.NodeSymbol("R", number))
        graph.insert_edge(dsg.NodeSymbol("R", number), dsg.NodeSymbol("p", number))
    graph.insert_edge(dsg.NodeSymbol("R", 0), dsg.NodeSymbol("R", 1))
    for number in range(5):
        thing = dsg.ObjectNodeAttributes()
        thing.semantic_label, thing.name = number % 3, str(dsg.NodeSymbol("O", number))
        graph.add_node("OBJECTS", dsg.NodeSymbol("O", number), thing)
        graph.insert_edge(dsg.NodeSymbol("p", number % 2), dsg.NodeSymbol("O", number))
    graph.set_labelspace(dsg.Labelspace({0: "sofa", 1: "tv_monitor"}), 2, 0)
    graph.metadata.add({"run": {"seconds": 0.1}})
    mesh = dsg.Mesh()
    mesh.set_vertices(np.arange(24, dtype=np.float64).reshape(6, 4) / 7)
    graph.mesh = mesh
    graph.save(str(path), include_mesh=True)


def list_nodes(graph: Any) -> dict[int, tuple[str, int | None]]:
    """Return what spark_dsg shows of each node, and its parent."""
    return {one.id.value: (str(one.attributes), one.get_parent()) for one in graph.nodes}


def test_spark_dsg_finds_its_own_graph_again(tmp_path: Path) -> None:
    path, out = tmp_path / "dsg.json", tmp_path / "out.json"
    write_like_hydra(path)
    belief = believe_something(read_hydra(path))
    assert belief.blind
    annotate_hydra(belief, path, out)
    load = spark_dsg.DynamicSceneGraph.load
    before, after = load(str(path)), load(str(out))
    blind = {one.id.value: one for one in after.get_layer("BLIND").nodes}
    assert len(blind) == len(belief.blind)
    assert all(one.attributes.is_predicted for one in blind.values())
    for one, node in zip(belief.blind, blind.values(), strict=True):
        assert node.get_parent() == spark_dsg.NodeSymbol("R", one.room_index - 1).value
    shown = {key: value for key, value in list_nodes(after).items() if key not in blind}
    assert shown == list_nodes(before)
    assert len(list(after.edges)) == len(list(before.edges)) + len(blind)
    assert after.get_labelspace(2, 0).labels_to_names == {0: "sofa", 1: "tv_monitor"}
    assert after.metadata.get()["run"] == {"seconds": 0.1}
    np.testing.assert_array_equal(after.mesh.get_vertices(), before.mesh.get_vertices())
    # Back without loss, also when spark_dsg has written it again.
    assert read_hydra_belief(out) == belief
    after.save(str(tmp_path / "again.json"))
    assert read_hydra_belief(tmp_path / "again.json") == belief
    strip_hydra(out, tmp_path / "bare.json")
    assert (tmp_path / "bare.json").read_bytes() == path.read_bytes()


def test_a_binary_graph_is_converted(tmp_path: Path) -> None:
    path, binary = tmp_path / "dsg.json", tmp_path / "dsg.sparkdsg"
    write_like_hydra(path)
    spark_dsg.DynamicSceneGraph.load(str(path)).save(str(binary))
    graph = read_hydra(binary, labels="mpcat40")
    assert graph == read_hydra(path, labels="mpcat40")
    annotate_hydra(believe_something(graph), binary, tmp_path / "out.json")
    assert read_hydra_belief(tmp_path / "out.json") == believe_something(graph)
    binary.write_bytes(b"no graph")
    with pytest.raises(HydraError, match="found one that spark_dsg cannot load"):
        read_hydra(binary)
    with pytest.raises(HydraError, match=r"none\.sparkdsg: cannot be read"):
        read_hydra(tmp_path / "none.sparkdsg")


def test_a_belief_about_other_rooms_is_refused(tmp_path: Path) -> None:
    path = write_graph(tmp_path / "dsg.json")
    with pytest.raises(HydraError, match=r"dsg\.json: has no room 'r0', of which something"):
        annotate_hydra(make_belief(1), path, tmp_path / "out.json")
    with pytest.raises(HydraError, match=r"ends in \.json"):
        annotate_hydra(believe_something(read_hydra(path)), path, tmp_path / "out.json.gz")
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(not SAMPLE.is_file(), reason="no sample here")
def test_the_recorded_apartment_comes_back_as_it_was(tmp_path: Path) -> None:
    original = gzip.decompress(SAMPLE.read_bytes())
    (tmp_path / "labels.yaml").write_text(
        "label_names: [{label: 5, name: chair}, {label: 11, name: lamp}, {label: 16, name: table}]"
    )
    graph = read_hydra(SAMPLE, labels=str(tmp_path / "labels.yaml"))
    assert [(obj.room_index, obj.raw_category) for obj in graph.objects] == [
        *((0, "chair"), (1, "lamp"), (0, "table"), (0, "table")),
        *((0, "chair"), (1, "chair"), (1, "lamp")),
    ]
    belief, out = believe_something(graph), tmp_path / "out.json"
    annotate_hydra(belief, SAMPLE, out)
    assert read_hydra_belief(out) == belief
    text = out.read_text("utf-8")
    assert strip_annotation(text).encode() == original
    (tmp_path / "plain.json").write_bytes(original)
    load = spark_dsg.DynamicSceneGraph.load
    before, after = load(str(tmp_path / "plain.json")), load(str(out))
    blind = {one.id.value for one in after.nodes} - {one.id.value for one in before.nodes}
    assert len(blind) == len(belief.blind) > 0
    shown = {key: value for key, value in list_nodes(after).items() if key not in blind}
    assert shown == list_nodes(before), "the room is in its building, and all else where it was"
    # The rooms of objects are those that spark_dsg finds above them.
    for obj in before.get_layer("OBJECTS").nodes:
        above = {before.get_node(obj.get_parent()).get_parent(), obj.get_parent()}
        (index,) = [one.room_index for one in graph.objects if one.name == str(obj.id)]
        assert (spark_dsg.NodeSymbol("R", 0).value in above) == (index == 1)


def test_a_graph_of_hydra_is_read_through_its_labels(tmp_path: Path) -> None:
    dsg = spark_dsg
    graph = dsg.DynamicSceneGraph()
    room = dsg.RoomNodeAttributes()
    room.name, room.position = "kitchen", np.array([1.0, 2.0, 0.0])
    room.metadata.set(
        {"bsg": {"floor_area": 9.5, "room_type": "Open kitchen", "floor_in_view": 0.5}}
    )
    graph.add_node("ROOMS", dsg.NodeSymbol("R", 0), room)
    other = dsg.RoomNodeAttributes()
    other.position = np.array([5.0, 2.0, 0.0])
    graph.add_node("ROOMS", dsg.NodeSymbol("R", 1), other)
    graph.insert_edge(dsg.NodeSymbol("R", 0).value, dsg.NodeSymbol("R", 1).value)
    place = dsg.PlaceNodeAttributes()
    place.position = np.array([1.0, 2.0, 1.0])
    graph.add_node("PLACES", dsg.NodeSymbol("p", 0), place)
    graph.insert_edge(dsg.NodeSymbol("R", 0).value, dsg.NodeSymbol("p", 0).value)
    for number, (label, parent) in enumerate([(7, "p"), (10, "p"), (99, None)]):
        attributes = dsg.ObjectNodeAttributes()
        attributes.semantic_label, attributes.name = label, "zzqx_12"
        attributes.position = np.array([1.5, 2.5, 0.5])
        graph.add_node("OBJECTS", dsg.NodeSymbol("O", number), attributes)
        if parent:
            symbol = dsg.NodeSymbol(parent, 0)
            graph.insert_edge(symbol.value, dsg.NodeSymbol("O", number).value)
    graph.metadata.set({"bsg": {"partial": {"building_kind": "office", "source": "mp3d"}}})
    graph.set_labelspace(dsg.Labelspace({7: "sofa", 10: "tv_monitor"}), 2, 0)
    path = tmp_path / "office.json"
    graph.save(str(path))
    found = read_hydra(path, labels="mpcat40")
    assert [room.label for room in found.rooms] == ["kitchen", None]
    assert found.adjacency == ((1, 2),)
    names = [(obj.room_index, obj.raw_category, obj.class_index) for obj in found.objects]
    classes = {name: number for number, name in enumerate(CLASS_SPACE.classes)}
    assert names == [(1, "couch", classes["couch"]), (1, "tv", classes["tv"]), (0, "zzqx", None)]
    assert found.objects[0].position == (1.5, 2.5, 0.5)
    assert (found.building_kind, found.source) == ("office", "mp3d")
    assert [one.share for one in found.rooms] == [estimate_hidden_share(floor_in_view=0.5), VAGUE]
    assert [(one.floor_area, one.room_type) for one in found.rooms] == [
        (9.5, "kitchen"),
        (None, None),
    ]
    graph.metadata.set({"bsg": {"partial": {"building_kind": "castle"}}})
    graph.save(str(path))
    with pytest.raises(HydraError, match=r"building_kind: .*known are home.*in metadata"):
        read_hydra(path)
    with pytest.raises(BSGError, match="ade20k, mpcat40"):
        read_hydra(path, labels="nyu40")


def test_spark_dsg_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    folder = tmp_path / "folder.json"
    folder.mkdir()
    with pytest.raises(BSGError, match="cannot be written"):
        write_hydra(make_belief(2), folder)
    with pytest.raises(BSGError, match=r"ends in \.json"):
        write_hydra(make_belief(2), tmp_path / "belief")
    assert list(tmp_path.iterdir()) == [folder]
    write_hydra(make_belief(2), tmp_path / "new" / "belief.json")
    assert read_hydra_belief(tmp_path / "new" / "belief.json") == make_belief(2)


def test_a_file_that_is_none_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    for text in ("{", "{}", "[1, 2]"):
        path.write_text(text)
        for read in (read_hydra, read_hydra_belief):
            with pytest.raises(HydraError, match=r"x\.json: expected a Spark-DSG graph") as caught:
                read(path)
            assert "\n" not in str(caught.value)
            assert caught.value.__cause__ is not None
    with pytest.raises(HydraError, match=r"none\.json: cannot be read"):
        read_hydra(tmp_path / "none.json")


def test_a_graph_without_beliefs_is_no_belief_graph(tmp_path: Path) -> None:
    spark_dsg.DynamicSceneGraph().save(str(tmp_path / "x.json"))
    with pytest.raises(HydraError, match="`read_hydra` reads what was seen"):
        read_hydra_belief(tmp_path / "x.json")
