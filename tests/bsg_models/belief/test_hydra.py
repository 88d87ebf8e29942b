"""Spark-DSG files: what Hydra wrote is read, and what we write is read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_beliefs import CLASS_SPACE, make_belief

from bsg_data.errors import BSGError
from bsg_data.observation.hidden_share import ShareBelief
from bsg_models.belief.hydra import read_hydra, read_hydra_belief, write_hydra
from bsg_models.errors import HydraError

spark_dsg = pytest.importorskip("spark_dsg")


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
    again = read_hydra(tmp_path / "belief.json")  # a robot would go on from it
    np.testing.assert_array_equal(again.histograms(), belief.partial.histograms())


def test_a_graph_of_hydra_is_read_through_its_labels(tmp_path: Path) -> None:
    dsg = spark_dsg
    graph = dsg.DynamicSceneGraph()
    room = dsg.RoomNodeAttributes()
    room.name, room.position = "kitchen", np.array([1.0, 2.0, 0.0])
    room.metadata.set(
        {"bsg": {"floor_area": 9.5, "room_type": "Open kitchen", "hidden_share_sd": 0.2}}
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
    assert [one.share for one in found.rooms] == [ShareBelief(0.5, 0.2), ShareBelief(0.5)]
    assert [(one.floor_area, one.room_type) for one in found.rooms] == [
        (9.5, "kitchen"),
        (None, None),
    ]
    graph.metadata.set({"bsg": {"partial": {"building_kind": "castle"}}})
    graph.save(str(path))
    with pytest.raises(HydraError, match=r"metadata: building_kind: .*known are home"):
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
            with pytest.raises(HydraError, match=r"x\.json: expected a Spark-DSG file") as caught:
                read(path)
            assert "\n" not in str(caught.value)
            assert caught.value.__cause__ is not None
    with pytest.raises(HydraError, match="no such file"):
        read_hydra(tmp_path / "none.json")


def test_a_graph_without_beliefs_is_no_belief_graph(tmp_path: Path) -> None:
    spark_dsg.DynamicSceneGraph().save(str(tmp_path / "x.json"))
    with pytest.raises(HydraError, match="`read_hydra` reads what was seen"):
        read_hydra_belief(tmp_path / "x.json")
