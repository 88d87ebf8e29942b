"""A partial graph as a new Spark-DSG graph, which says all that the partial graph does."""

from __future__ import annotations

import json
from pathlib import Path

from conftest import REPOSITORY
from dsg_files import symbol
from hypothesis import given, settings
from hypothesis import strategies as st
from random_beliefs import make_belief

from bsg_data.observation.robot_json import read_robot_graph
from bsg_data.sources.dsg_file import parse_dsg
from bsg_models.belief.dsg_document import encode_dsg
from bsg_models.belief.hydra_file import HydraFile


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_partial_graph_is_read_back(seed: int) -> None:
    partial = make_belief(seed).partial
    text = json.dumps(encode_dsg(partial))
    path = Path("new.json")
    assert HydraFile(path, text, parse_dsg(text, path=path)).partial() == partial


def test_the_office_by_hand() -> None:
    document = encode_dsg(read_robot_graph(REPOSITORY / "docs" / "office.json"))
    building, room, *_ = document["nodes"]
    assert (building["id"], building["layer"]) == (symbol("B", 0), 5)
    assert (room["id"], room["layer"]) == (symbol("R", 0), 4)
    assert room["attributes"]["name"] == "A: waiting room"
    assert room["attributes"]["metadata"]["bsg"]["room_type"] == "lobby"
    edges = {(edge["source"], edge["target"]) for edge in document["edges"]}
    assert (symbol("B", 0), symbol("R", 1)) in edges
    assert (symbol("R", 0), symbol("O", 0)) in edges
