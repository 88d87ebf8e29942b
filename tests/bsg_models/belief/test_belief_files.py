"""Belief graphs written and read back without loss, in every format."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_beliefs import CLASS_MAP, make_belief

from bsg_data.errors import BSGError
from bsg_models.belief.belief_files import (
    BeliefFileError,
    decode_belief,
    encode_belief,
    from_networkx,
    read_belief,
    read_tables,
    to_networkx,
    write_belief,
    write_tables,
)
from bsg_models.belief.hydra import read_hydra, read_hydra_belief, write_hydra

NODE = {"room": 1, "class": "bed", "expected": 1, "presence": 1}


@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 2**32 - 1), mode=st.sampled_from(["complete", "unseen"]))
def test_every_format_gives_the_same_graph_back(tmp_path: Path, seed: int, mode: str) -> None:
    belief = make_belief(seed, mode=mode)
    assert decode_belief(json.loads(json.dumps(encode_belief(belief))), path=Path("x")) == belief
    assert from_networkx(to_networkx(belief)) == belief
    write_belief(belief, tmp_path / "belief.json")
    assert read_belief(tmp_path / "belief.json") == belief
    other = make_belief(seed + 1, mode=mode, scene_id="t")
    write_tables([other, belief], tmp_path / "tables")
    assert list(read_tables(tmp_path / "tables")) == [belief, other]
    write_hydra(belief, tmp_path / "hydra.json")
    assert read_hydra_belief(tmp_path / "hydra.json") == belief


def test_a_networkx_graph_says_what_is_where() -> None:
    belief = make_belief(3)
    graph = to_networkx(belief)
    kinds = nx.get_node_attributes(graph, "kind")
    rooms, objects = len(belief.partial.rooms), len(belief.partial.objects)
    assert list(kinds.values()).count("blind") == len(belief.blind)
    assert len(graph) == 1 + rooms + objects + len(belief.blind)
    contains = [(a, b) for a, b, kind in graph.edges(data="kind") if kind != "adjacent"]
    assert nx.is_arborescence(nx.DiGraph(contains))
    first = belief.blind[0]
    node = 1 + rooms + objects
    assert graph.nodes[node]["class"] == CLASS_MAP.classes[first.class_index]
    assert graph.edges[first.room_index, node]["kind"] == "expects"


def test_tables_open_with_pandas(tmp_path: Path) -> None:
    belief = make_belief(5)
    write_tables([belief], tmp_path)
    nodes = pd.read_parquet(tmp_path / "nodes.parquet")
    assert (nodes["kind"] == "blind").sum() == len(belief.blind)
    histograms = pd.read_parquet(tmp_path / "histograms.parquet")
    np.testing.assert_array_equal(np.stack(histograms["expected"].tolist()), belief.expected)


def test_spark_dsg_shows_blind_nodes_as_predicted(tmp_path: Path) -> None:
    spark_dsg = pytest.importorskip("spark_dsg")
    belief = make_belief(7)
    write_hydra(belief, tmp_path / "belief.json")
    graph = spark_dsg.DynamicSceneGraph.load(str(tmp_path / "belief.json"))
    blind = list(graph.get_layer("BLIND").nodes)
    assert len(blind) == len(belief.blind)
    assert all(node.attributes.is_predicted for node in blind)
    assert {node.attributes.name for node in blind} <= set(CLASS_MAP.classes)
    assert len(list(graph.get_layer("ROOMS").nodes)) == len(belief.partial.rooms)
    assert not any(node.attributes.is_predicted for node in graph.get_layer("OBJECTS").nodes)
    again = read_hydra(tmp_path / "belief.json")  # a robot would go on from it
    np.testing.assert_array_equal(again.histograms(), belief.partial.histograms())


def test_a_graph_of_hydra_is_read_through_its_labels(tmp_path: Path) -> None:
    dsg = pytest.importorskip("spark_dsg")
    graph = dsg.DynamicSceneGraph()
    room = dsg.RoomNodeAttributes()
    room.name, room.position = "kitchen", np.array([1.0, 2.0, 0.0])
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
    graph.set_labelspace(dsg.Labelspace({7: "sofa", 10: "tv_monitor"}), 2, 0)
    path = tmp_path / "office.json"
    graph.save(str(path))
    found = read_hydra(path, labels="mpcat40")
    assert [room.label for room in found.rooms] == ["kitchen", None]
    assert found.adjacency == ((1, 2),)
    names = [(obj.room_index, obj.raw_category, obj.class_index) for obj in found.objects]
    classes = {name: number for number, name in enumerate(CLASS_MAP.classes)}
    assert names == [(1, "couch", classes["couch"]), (1, "tv", classes["tv"]), (0, "zzqx", None)]
    assert found.objects[0].position == (1.5, 2.5, 0.5)
    with pytest.raises(BSGError, match="ade20k, mpcat40"):
        read_hydra(path, labels="nyu40")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda d: d.pop("expected"), "expected: Field required"),
        (lambda d: d.update(version=9), "found bsg-belief-graph 9"),
        (lambda d: d["expected"].pop(), "expected histograms"),
        (
            lambda d: d["blind"].append({"room": 1, "class": "ufo", "expected": 1, "presence": 1}),
            "ufo",
        ),
        (
            lambda d: d["blind"].append({"room": 1, "class": "bed", "expected": 1, "presence": 2}),
            "presence",
        ),
        (lambda d: d["expected"][1].__setitem__(0, -5), "expected.1.0"),
        (lambda d: d["expected"][1].__setitem__(0, float("inf")), "expected.1.0"),
        (lambda d: d["presence"][1].__setitem__(0, 7), "presence.1.0"),
        (lambda d: d["expected"][1].pop(), "expected histograms"),
        (lambda d: d["class_map"].update(version="/etc/passwd.csv"), "is no published one"),
        (lambda d: d["class_map"].update(sha256="1" * 64), "has changed since"),
        (lambda d: d["partial"].update(rooms=3), "rooms"),
    ],
)
def test_a_file_that_is_wrong_is_refused_with_the_reason(
    tmp_path: Path, change: Any, expected: str
) -> None:
    document = encode_belief(make_belief(1))
    change(document)
    path = tmp_path / "belief.json"
    path.write_text(json.dumps(document))
    with pytest.raises(BSGError, match=expected):
        read_belief(path)


def test_tables_that_were_edited_are_refused(tmp_path: Path) -> None:
    write_tables([make_belief(4)], tmp_path)
    path = tmp_path / "nodes.parquet"
    table = pq.read_table(path)
    for wrong in (table.drop_columns(["kind"]), table.slice(1), table.replace_schema_metadata({})):
        pq.write_table(wrong, path)
        with pytest.raises(BeliefFileError):
            list(read_tables(tmp_path))


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


def test_files_that_are_none_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text("{")
    for read in (read_belief, read_hydra, read_hydra_belief):
        with pytest.raises(BSGError, match=r"x\.json"):
            read(path)
    with pytest.raises(BeliefFileError, match="no tables"):
        list(read_tables(tmp_path))
    with pytest.raises(BeliefFileError, match="to_networkx"):
        from_networkx(nx.DiGraph())
    with pytest.raises(BeliefFileError, match="two belief graphs of s"):
        write_tables([make_belief(1), make_belief(2)], tmp_path / "tables")
