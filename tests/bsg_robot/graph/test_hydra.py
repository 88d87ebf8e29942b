"""Spark-DSG files: what Hydra wrote is read and comes back as it was, with beliefs in it."""

from __future__ import annotations

import gzip
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from dsg_files import edge, robot_graph, symbol, write_graph
from random_beliefs import CLASS_SPACE, make_belief
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_models.belief.belief_graph import BeliefGraph, believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.partial_graph import PartialGraph
from bsg_robot.errors import HydraError
from bsg_robot.graph import graph_file
from bsg_robot.graph.annotation import SPARK_DSG, annotate_hydra
from bsg_robot.graph.graph_file import open_graph_file, parse_graph, read_graph
from bsg_robot.graph.robot_json import RobotGraphError, read_robot_graph

OFFICE = REPOSITORY / "docs" / "office.json"
SAMPLE = REPOSITORY.parent / "shared" / "sources" / "hydra_apartment_dsg.json.gz"


def believe_something(graph: PartialGraph, seed: int = 0, *, mean: float = 3.0) -> BeliefGraph:
    """Return random beliefs about a graph, with blind nodes in its rooms."""
    inputs = graph.histograms().astype(float)
    hidden = poisson(np.random.default_rng(seed).gamma(0.1, mean, inputs.shape))
    return believe(graph, Expectation(inputs, hidden), model=f"random {seed}")


def test_the_kind_of_a_graph_is_known_by_its_content(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert read_graph(OFFICE) == read_robot_graph(OFFICE)
    with refuses(RecipeError, "labels-unused", OFFICE):
        read_graph(OFFICE, labels="ade20k")
    broken = tmp_path / "broken.json"
    for text in ("{", '{"scene_id": "a", "scene_id": "b", "rooms": []}'):
        broken.write_text(text)
        with refuses(RobotGraphError, "json-malformed", broken):
            read_graph(broken)
    packed = tmp_path / "flat.json.gz"
    packed.write_bytes(gzip.compress(json.dumps(robot_graph()).encode()))
    file = open_graph_file(packed)
    assert file.document == robot_graph()

    class Standard:
        buffer = io.BytesIO(json.dumps(robot_graph()).encode())

    monkeypatch.setattr("sys.stdin", Standard())
    assert open_graph_file(Path("-")).graph.rooms == file.graph.rooms


def test_a_graph_by_hand(tmp_path: Path) -> None:
    graph = read_graph(write_graph(tmp_path / "flat.json"))
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
    found = read_graph(write_graph(tmp_path / "x.json", graph))
    assert (found.scene_id, found.building_kind, found.hidden_share) == ("home", "home", 0.75)
    room, other = found.rooms
    assert (room.name, room.hidden_share) == ("galley", 0.25)
    assert (room.room_type, room.floor_area) == ("kitchen", 8.5)  # null is left out
    assert (other.visited, other.hidden_share) == (False, 0.99), "it shows something"
    assert (found.objects[0].name, found.objects[0].category) == ("7", "armchair")
    for place, said in ((1, {"hidden_share": 7}), (1, {"hiden_share": 0.5}), (5, {"categry": "a"})):
        graph["nodes"][place]["attributes"]["metadata"] = {"bsg": said}
        with pytest.raises(RobotGraphError):
            read_graph(write_graph(tmp_path / "x.json", graph))


@pytest.mark.parametrize(
    ("labels", "expected", "notes"),
    [
        (None, ["label 7", "label 10"], 2),
        ("mpcat40", ["cabinet", "couch"], 3),
        ("own.csv", ["oven", "label 10"], 3),
    ],
)
def test_labels_without_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, labels: Any, expected: list[str], notes: int
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.csv").write_text("label,name\n7,oven\n")
    graph = robot_graph()
    del graph["metadata"]
    file = open_graph_file(write_graph(tmp_path / "flat.json", graph), labels=labels)
    found = [obj.raw_category for obj in file.graph.objects]
    assert found[:3] == [*expected, "chair"], "a name of one's own comes before a number's"
    assert len(file.notes) == notes


def test_an_edge_between_objects_does_not_say_which_lies_on_the_other() -> None:
    """Spark-DSG takes the two for siblings, whichever was written first; so nothing is guessed."""
    graph, before = robot_graph(), parse_graph(robot_graph(), path=Path("flat.json"))
    graph["edges"] += [edge(("O", 2), ("O", 5)), edge(("O", 9), ("O", 2))]
    file = parse_graph(graph, path=Path("flat.json"))
    assert file.graph == before.graph
    (note,) = {*file.notes} - {*before.notes}
    assert note.startswith("2 edges between objects not read: Spark-DSG does not say which")
    assert not any("edge" in said for said in before.notes), "agents are none"


def write_like_hydra(path: Path) -> Any:
    """Write a graph with spark_dsg: two rooms with places, objects, a label space, a mesh."""
    dsg = pytest.importorskip("spark_dsg")
    graph = dsg.DynamicSceneGraph()
    graph.add_node("BUILDINGS", dsg.NodeSymbol("B", 0), dsg.SemanticNodeAttributes())
    for number in range(2):
        room, place = dsg.RoomNodeAttributes(), dsg.PlaceNodeAttributes()
        room.position = np.array([1e-5, 0.1 + 0.2, float(number)])
        room.name = str(dsg.NodeSymbol("R", number))
        room.metadata.set({"mine": 3, "bsg": {"hidden_share": 0.25}})
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
    partial = {"scene_id": "home", "customs": [{"thing": "drinks", "room": "R(0)", "at": "O(2)"}]}
    graph.metadata.add({"run": {"seconds": 0.1}, "bsg": {"partial": partial}})
    mesh = dsg.Mesh()
    mesh.set_vertices(np.arange(24, dtype=np.float64).reshape(6, 4) / 7)
    graph.mesh = mesh
    graph.save(str(path), include_mesh=True)
    return dsg.DynamicSceneGraph.load


def list_nodes(graph: Any) -> dict[int, tuple[str, int | None]]:
    """Return what spark_dsg shows of each node, and its parent."""
    return {one.id.value: (str(one.attributes), one.get_parent()) for one in graph.nodes}


def test_spark_dsg_finds_its_own_graph_again(tmp_path: Path) -> None:
    path, out = tmp_path / "dsg.json", tmp_path / "out.json"
    load = write_like_hydra(path)
    belief = believe_something(read_graph(path))
    annotate_hydra(belief, path, out)
    before, after = load(str(path)), load(str(out))
    blind = {one.id.value: one for one in after.get_layer("BLIND").nodes}
    assert {chr(one >> 56) for one in blind} == {"x"}
    assert len(blind) == len(belief.blind) > 0
    for one, shown in zip(belief.blind, blind.values(), strict=True):
        assert shown.attributes.is_predicted
        assert shown.attributes.name == CLASS_SPACE.classes[one.class_index]
        assert shown.get_parent() == symbol("R", one.room_index - 1)
    assert len(list(after.edges)) == len(list(before.edges)) + len(blind)
    assert after.get_labelspace(2, 0).labels_to_names == {0: "sofa", 1: "tv_monitor"}
    assert after.metadata.get()["run"] == {"seconds": 0.1}
    np.testing.assert_array_equal(after.mesh.get_vertices(), before.mesh.get_vertices())
    room = after.get_node(symbol("R", 0)).attributes.metadata.get()
    assert (room["mine"], room["bsg"]["hidden_share"]) == (3, 0.25)
    assert room["bsg"]["belief"]["expected"].keys() == set(CLASS_SPACE.classes)
    after.save(str(tmp_path / "again.json"))
    assert SPARK_DSG.read(tmp_path / "again.json") == belief, "also when it was written again"


@pytest.mark.parametrize(("recorded", "mean"), [(False, 0.0), (True, 5.0)])
def test_what_is_put_in_is_read_back_and_a_second_belief_replaces_it(
    tmp_path: Path, recorded: bool, mean: float
) -> None:
    path, once, again = (tmp_path / name for name in ("dsg.json", "once.json", "again.json"))
    load = write_like_hydra(path)
    if recorded:
        if not SAMPLE.is_file():
            pytest.skip("no sample here")
        path.write_bytes(gzip.decompress(SAMPLE.read_bytes()))
    belief = believe_something(read_graph(path), mean=mean)
    annotate_hydra(belief, path, once)
    assert read_graph(once) == belief.partial, "seen is not what is believed"
    assert SPARK_DSG.read(once) == belief
    before, after = load(str(path)), load(str(once))
    nodes = list_nodes(before)
    assert {key: list_nodes(after)[key] for key in nodes} == nodes, "all else is where it was"
    assert after.num_nodes() - before.num_nodes() == len(belief.blind)
    annotate_hydra(believe_something(belief.partial, 100), once, again)
    annotate_hydra(belief, again, again)
    assert SPARK_DSG.read(again) == belief
    assert load(str(again)).num_nodes() == after.num_nodes()


def test_a_taken_layer_or_letter_is_left_alone(tmp_path: Path) -> None:
    path, out = tmp_path / "dsg.json", tmp_path / "out.json"
    load = write_like_hydra(path)
    dsg = pytest.importorskip("spark_dsg")
    graph = load(str(path))
    graph.add_layer(0, 0, "MINE")
    graph.add_node("MINE", dsg.NodeSymbol("x", 0), dsg.ObjectNodeAttributes())
    graph.save(str(path))
    belief = believe_something(read_graph(path))
    annotate_hydra(belief, path, out)
    annotated = load(str(out))
    blind = [one.id.category for one in annotated.get_layer("BLIND").nodes]
    assert blind == ["y"] * len(belief.blind)
    assert annotated.get_layer_key("BLIND").layer == 1
    graph.add_layer(1, 0, "MINE TOO")
    graph.save(str(path))
    with refuses(HydraError, "layers-taken"):
        annotate_hydra(belief, path, out)


def test_what_cannot_be_annotated_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("spark_dsg")
    path, out = write_graph(tmp_path / "dsg.json"), tmp_path / "out.json"
    belief = believe_something(read_graph(path))
    with refuses(HydraError, "room-unknown", path):
        annotate_hydra(make_belief(1), path, out)
    with refuses(HydraError, "suffix-unknown", tmp_path / "out.json.gz"):
        annotate_hydra(belief, path, tmp_path / "out.json.gz")
    with refuses(HydraError, "belief-missing", path):
        SPARK_DSG.read(path)
    with refuses(HydraError, "dsg-malformed", OFFICE):
        annotate_hydra(make_belief(1), OFFICE, out)
    with refuses(HydraError, "dsg-unloadable", path):  # readable, but not by Hydra
        annotate_hydra(belief, path, out)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with refuses(HydraError, "library-missing", path):
        annotate_hydra(belief, path, out)
    assert [*tmp_path.iterdir()] == [path]


def test_a_binary_graph_is_converted(tmp_path: Path) -> None:
    path, binary = tmp_path / "dsg.json", tmp_path / "dsg.sparkdsg"
    write_like_hydra(path)(str(path)).save(str(binary))
    graph = read_graph(binary, labels="mpcat40")
    assert graph == read_graph(path, labels="mpcat40")
    annotate_hydra(believe_something(graph), binary, tmp_path / "out.json")
    assert SPARK_DSG.read(tmp_path / "out.json") == believe_something(graph)
    binary.write_bytes(b"no graph")
    with refuses(HydraError, "dsg-unloadable", binary):
        read_graph(binary)


def test_a_graph_that_is_too_large_is_refused_before_it_is_parsed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(graph_file, "ROBOT", 20)
    monkeypatch.setattr(graph_file, "require_json", None)
    path = tmp_path / "a.json"
    path.write_text('{"kitchen": ["sink"], "hall": []}', "utf-8")
    with refuses(RobotGraphError, "file-too-large", path):
        read_graph(path)
