"""Spark-DSG files: what Hydra wrote is read and comes back as it was, with beliefs in it."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from dsg_files import Graph, node, robot_graph, symbol, write_graph
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_beliefs import CLASS_SPACE, make_belief
from refusals import refuses

from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.sources.label_space import load_label_space
from bsg_models.belief.annotation import find_document, strip_annotation
from bsg_models.belief.belief_graph import BeliefGraph, believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.document import encode_belief
from bsg_models.belief.expectation import from_hidden_counts
from bsg_models.belief.hydra import (
    HydraFile,
    annotate_hydra,
    read_hydra,
    read_hydra_belief,
    strip_hydra,
    write_hydra,
)
from bsg_models.errors import HydraError

SAMPLE = REPOSITORY.parent / "shared" / "sources" / "hydra_apartment_dsg.json.gz"


def open_document(document: Any) -> HydraFile:
    return HydraFile.of(document, path=Path("flat.json"))


def believe_something(graph: PartialGraph, seed: int = 0, *, most: float = 3.0) -> BeliefGraph:
    """Return random beliefs about a graph, with blind nodes in its rooms."""
    inputs = graph.histograms().astype(float)
    hidden = poisson(np.random.default_rng(seed).gamma(0.1, most, inputs.shape))
    return believe(graph, from_hidden_counts(inputs, hidden), model=f"random {seed}")


@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 2**32 - 1), mode=st.sampled_from(["complete", "unseen"]))
def test_a_belief_graph_is_read_back(tmp_path: Path, seed: int, mode: str) -> None:
    belief = make_belief(seed, mode=mode)
    write_hydra(belief, tmp_path / "hydra.json")
    assert read_hydra_belief(tmp_path / "hydra.json") == belief
    assert read_hydra(tmp_path / "hydra.json") == belief.partial, "a robot would go on from it"


def newer(graph: Graph) -> None:
    """Say layers as newer files do, and leave metadata empty everywhere."""
    graph["layer_names"] = {
        "OBJECTS": {"layer": 2, "partition": 0},
        "ROOMS": {"layer": 4, "partition": 0},
        "BLIND": {"layer": 0, "partition": 0},
    }
    graph["layer_keys"] = [{"layer": layer, "partition": 0} for layer in (2, 3, 4, 5)]
    for one in graph["nodes"]:
        one["attributes"]["metadata"] = {}


def older(graph: Graph) -> None:
    """Leave out what old files do not have."""
    graph["layer_names"] = {"OBJECTS": 2, "ROOMS": 4}
    graph["layer_ids"], graph["mesh_layer_id"] = [2, 3, 4, 5], 0
    for one in graph["nodes"]:
        one.pop("partition")
    graph["nodes"] = [one for one in graph["nodes"] if "type" not in one["attributes"]]
    del graph["metadata"]


def spoken(graph: Graph) -> None:
    """Say something under `bsg`, and something else."""
    graph["metadata"] |= {"bsg": {"partial": {"scene_id": "home"}}, "run": [1, {"x": None}]}
    graph["nodes"][1]["attributes"]["metadata"] = {"bsg": {"hidden_share": 0.25}}
    graph["nodes"][2]["attributes"]["metadata"] = {"mine": 3, "bsg": {}}


@settings(deadline=None, max_examples=60)
@given(
    form=st.sampled_from([lambda graph: None, newer, older, spoken]),
    sort=st.booleans(),
    seeds=st.tuples(st.integers(0, 99), st.integers(0, 99)),
    most=st.sampled_from([0.0, 1.0, 5.0]),
)
def test_what_is_put_in_is_taken_out(form: Any, sort: bool, seeds: Any, most: float) -> None:
    """Every key, value and order comes back; annotating leaves the document that was read."""
    graph = robot_graph()
    form(graph)
    text = json.dumps(graph, sort_keys=sort)
    file = open_document(json.loads(text))
    first, second = (believe_something(file.partial(), seed, most=most) for seed in seeds)
    once = file.annotated(first)
    assert json.dumps(file.document) == text
    assert json.dumps(strip_annotation(once)) == text
    again = open_document(json.loads(json.dumps(once)))
    assert again.partial() == file.partial(), "what was seen is not what is believed"
    assert again.annotated(first) == once
    assert again.annotated(second) == file.annotated(second), "the second replaces the first"


def test_an_annotation_by_hand() -> None:
    file = open_document(robot_graph())
    belief = believe_something(file.partial())
    read = file.annotated(belief)
    number = len(robot_graph()["nodes"])
    room, blind = read["nodes"][1], read["nodes"][number:]
    said = room["attributes"]["metadata"]["bsg"]["belief"]
    assert said["expected"].keys() == set(belief.partial.class_space.classes)
    assert len(blind) == len(belief.blind) > 0
    assert {chr(one["id"] >> 56) for one in blind} == {"x"}
    assert {one["layer"] for one in blind} == {0}, "below the rooms, and free"
    assert all(one["attributes"]["is_predicted"] for one in blind)
    assert [edge["target"] for edge in read["edges"][-len(blind) :]] == [one["id"] for one in blind]
    assert find_document(read) == encode_belief(belief)
    assert find_document(robot_graph()) is None


def test_what_others_added_since_stays() -> None:
    file = open_document(robot_graph())
    read = json.loads(json.dumps(file.annotated(believe_something(file.partial()))))
    room = read["nodes"][1]["attributes"]["metadata"]
    assert room["bsg"]["belief"]["added"] == "metadata"
    room["bsg"]["hidden_share"] = 0.1
    read["nodes"][2]["attributes"]["metadata"]["other"] = 1
    read["nodes"].append(node("O", 77, 2))
    read["layer_ids"] = [2, 0]
    left = strip_annotation(read)
    assert left["nodes"][1]["attributes"]["metadata"] == {"bsg": {"hidden_share": 0.1}}
    assert left["nodes"][2]["attributes"]["metadata"] == {"other": 1}
    assert left["nodes"][-1] == node("O", 77, 2)
    assert left["layer_ids"] == [2]
    assert left["metadata"] == robot_graph()["metadata"]
    assert len(left["nodes"]) == len(robot_graph()["nodes"]) + 1


def test_a_taken_layer_or_letter_is_left_alone() -> None:
    graph = robot_graph()
    graph["nodes"].append(node("x", 0, 0))
    file = open_document(graph)
    blind = file.annotated(believe_something(file.partial()))["nodes"][len(graph["nodes"]) :]
    assert {(chr(one["id"] >> 56), one["layer"]) for one in blind} == {("y", 1)}
    graph["layer_ids"] = [0, 1, 2, 3]
    with refuses(HydraError, "layers-taken"):
        file.annotated(believe_something(file.partial()))


@pytest.mark.parametrize("metadata", [None, 3, {"bsg": []}, {"bsg": {"belief": "yes"}}])
def test_what_stands_in_the_way_is_named(metadata: Any) -> None:
    graph = robot_graph()
    graph["nodes"][1]["attributes"]["metadata"] = metadata
    file = open_document(graph)
    with refuses(HydraError, "metadata-taken", "node R(0)"):
        file.annotated(believe_something(file.partial()))


def bare_graph() -> Graph:
    """Return the graph without names for its labels."""
    graph = robot_graph()
    del graph["metadata"]
    return graph


def test_a_graph_by_hand(tmp_path: Path) -> None:
    graph = read_hydra(write_graph(tmp_path / "flat.json"))
    assert (graph.scene_id, graph.adjacency, graph.hidden_share) == ("flat", ((1, 2),), 0.5)
    kitchen, other = graph.rooms
    assert (kitchen.name, kitchen.label, kitchen.room_type) == ("R(0)", "kitchen", "kitchen")
    assert kitchen.box is not None
    assert (other.name, other.label, other.room_type, other.box) == ("R(3)", None, None, None)
    assert [(obj.name, obj.room_index, obj.raw_category) for obj in graph.objects] == [
        ("O(2)", 1, "sofa"),
        ("O(5)", 1, "tv_monitor"),
        ("O(6)", 0, "chair"),
        ("O(9)", 2, "label 99"),
    ]


def test_what_a_robot_says_comes_first(tmp_path: Path) -> None:
    graph = robot_graph()
    graph["metadata"]["bsg"] = {
        "partial": {"scene_id": "home", "building_kind": "home", "hidden_share": 0.75},
        "else": 1,
    }
    said = {"id": "galley", "hidden_share": 0.25, "room_type": None, "floor_area": 8.5, "my": {}}
    graph["nodes"][1]["attributes"]["metadata"] = {"bsg": said}
    graph["nodes"][2]["attributes"]["metadata"] = {"bsg": {"visited": False}}
    graph["nodes"][5]["attributes"]["metadata"] = {"bsg": {"id": "7", "category": "armchair"}}
    found = read_hydra(write_graph(tmp_path / "x.json", graph))
    assert (found.scene_id, found.building_kind, found.hidden_share) == ("home", "home", 0.75)
    room, other = found.rooms
    assert (room.name, room.hidden_share) == ("galley", 0.25)
    assert (room.room_type, room.floor_area) == (None, 8.5)
    assert (other.visited, other.hidden_share) == (False, 1)
    assert (found.objects[0].name, found.objects[0].category) == ("7", "armchair")
    assert found.objects[0].room_index == 1
    said["hidden_share"] = 7
    with pytest.raises(HydraError):
        read_hydra(write_graph(tmp_path / "x.json", graph))


@pytest.mark.parametrize(
    ("labels", "expected", "notes"),
    [
        (None, ["label 7", "label 10"], 2),
        ("mpcat40", ["cabinet", "couch"], 3),
        ("ade20k", ["bed", "cabinet"], 2),
        ("own.csv", ["oven", "label 10"], 3),
    ],
)
def test_labels_without_names(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    labels: str | None,
    expected: list[str],
    notes: int,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.csv").write_text("label,name\n7,oven\n")
    space = None if labels is None else load_label_space(labels)
    file = open_document(bare_graph())
    found = [obj.raw_category for obj in file.partial(labels=space).objects]
    assert found[:3] == [*expected, "chair"], "a name of one's own comes before a number's"
    assert len(list(file.notes(space))) == notes


@pytest.mark.parametrize(
    ("place", "said"),
    [(1, {"hiden_share": 0.5}), (5, {"categry": "bed"}), (None, {"partial": {"buildng_kind": ""}})],
)
def test_a_misspelt_key_in_metadata_is_refused(
    tmp_path: Path, place: int | None, said: dict[str, Any]
) -> None:
    graph = robot_graph()
    held = graph if place is None else graph["nodes"][place]["attributes"]
    held["metadata"] = {"bsg": said}
    with refuses(HydraError, "key-unknown"):
        read_hydra(write_graph(tmp_path / "a.json", graph))
    held["metadata"] = {"bsg": {"mine": 1}}
    assert read_hydra(write_graph(tmp_path / "a.json", graph)).rooms, "keys of one's own stay"


def test_what_cannot_be_annotated_is_refused(tmp_path: Path) -> None:
    path = write_graph(tmp_path / "dsg.json")
    with refuses(HydraError, "room-unknown", path):
        annotate_hydra(make_belief(1), path, tmp_path / "out.json")
    with refuses(HydraError, "suffix-unknown", tmp_path / "out.json.gz"):
        annotate_hydra(believe_something(read_hydra(path)), path, tmp_path / "out.json.gz")
    with refuses(HydraError, "belief-missing", path):
        read_hydra_belief(path)
    assert list(tmp_path.iterdir()) == [path]


def write_like_hydra(path: Path) -> None:
    """Write a graph with spark_dsg: two rooms with places, objects, a label space, a mesh."""
    dsg = pytest.importorskip("spark_dsg")
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
    spark_dsg = pytest.importorskip("spark_dsg")
    belief = believe_something(read_hydra(path))
    annotate_hydra(belief, path, out)
    load = spark_dsg.DynamicSceneGraph.load
    before, after = load(str(path)), load(str(out))
    blind = {one.id.value: one for one in after.get_layer("BLIND").nodes}
    assert len(blind) == len(belief.blind) > 0
    assert {one.attributes.name for one in blind.values()} <= set(CLASS_SPACE.classes)
    for one, shown in zip(belief.blind, blind.values(), strict=True):
        assert shown.attributes.is_predicted
        assert shown.get_parent() == symbol("R", one.room_index - 1)
    rest = {key: value for key, value in list_nodes(after).items() if key not in blind}
    assert rest == list_nodes(before), "the rooms are in their building, and all else where it was"
    assert len(list(after.edges)) == len(list(before.edges)) + len(blind)
    assert after.get_labelspace(2, 0).labels_to_names == {0: "sofa", 1: "tv_monitor"}
    assert after.metadata.get()["run"] == {"seconds": 0.1}
    np.testing.assert_array_equal(after.mesh.get_vertices(), before.mesh.get_vertices())
    # Back without loss, also when spark_dsg has written it again.
    assert read_hydra_belief(out) == belief
    after.save(str(tmp_path / "again.json"))
    assert read_hydra_belief(tmp_path / "again.json") == belief
    strip_hydra(out, tmp_path / "bare.json")
    bare = json.loads((tmp_path / "bare.json").read_text("utf-8"))
    assert json.dumps(bare) == json.dumps(json.loads(path.read_text("utf-8")))


def test_a_binary_graph_is_converted(tmp_path: Path) -> None:
    path, binary = tmp_path / "dsg.json", tmp_path / "dsg.sparkdsg"
    write_like_hydra(path)
    pytest.importorskip("spark_dsg").DynamicSceneGraph.load(str(path)).save(str(binary))
    graph = read_hydra(binary, labels="mpcat40")
    assert graph == read_hydra(path, labels="mpcat40")
    annotate_hydra(believe_something(graph), binary, tmp_path / "out.json")
    assert read_hydra_belief(tmp_path / "out.json") == believe_something(graph)
    binary.write_bytes(b"no graph")
    with refuses(HydraError, "binary-unloadable", binary):
        read_hydra(binary)


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
    stripped = strip_annotation(json.loads(out.read_text("utf-8")))
    assert json.dumps(stripped) == json.dumps(json.loads(original))
