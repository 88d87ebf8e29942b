"""Beliefs in the text of a graph: only additions, taken out again without a trace."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dsg_files import Graph, node, robot_graph, symbol
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.sources.dsg_file import parse_dsg
from bsg_models.belief.annotation import annotate, find_document, strip_annotation
from bsg_models.belief.belief_graph import BeliefGraph, believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.document import encode_belief
from bsg_models.belief.expectation import from_hidden_counts
from bsg_models.belief.hydra_file import HydraFile
from bsg_models.errors import HydraError

# What no JSON library gives back: order, spelling, doubled keys, space, a byte order mark.
ODD = (
    '\ufeff { "zzz" : "\\u00e9é", "nodes":[\n'
    f'\t{{"id":{symbol("R", 0)},"layer":4,"attributes":{{"name":"R(0)",\n'
    '\t\t"position":[1e-05,0.10000000000000001,-0.0], "color":[255,0,0] ,\n'
    '\t\t"mine":{"b":1E2,"a":[ ]},"type":"RoomNodeAttributes"},"extra":null },\r\n'
    '\t{"layer":2, "attributes":{"name":"chair_3","semantic_label":1,"semantic_label":2},\n'
    f'"id":{symbol("O", 7)}}}\n ], "layer_ids":[9],\n'
    f'"edges":[ {{"source":{symbol("R", 0)},"target":{symbol("O", 7)},"info":{{"weight":1e0}}}}],\n'
    ' "layer_ids":[ 4 , 2 ], "unknown":{"metadata":{"bsg":{"belief":{"added":"bsg"}}}} }\n\n'
)


def open_text(text: str) -> HydraFile:
    path = Path("flat.json")
    return HydraFile(path, text, parse_dsg(text.removeprefix("\ufeff"), path=path))


def believe_something(file: HydraFile, seed: int = 0, *, most: float = 1.0) -> BeliefGraph:
    """Return random beliefs about a file."""
    rng = np.random.default_rng(seed)
    graph = file.partial()
    inputs = graph.histograms().astype(float)
    hidden = poisson(rng.gamma(0.1, most, inputs.shape))
    return believe(graph, from_hidden_counts(inputs, hidden), model=f"random {seed}")


def is_longer(text: str, original: str) -> bool:
    """Say whether all characters of a text are in a longer one, in their order."""
    rest = iter(text)
    return all(character in rest for character in original)


def test_odd_text_is_only_added_to() -> None:
    file = open_text(ODD)
    belief = believe_something(file, most=3)
    assert belief.blind
    text = file.annotated(belief)
    assert is_longer(text, ODD)
    assert strip_annotation(text) == ODD
    read = json.loads(text.removeprefix("\ufeff"))
    assert read["layer_ids"] == [4, 2, 0], "below the rooms, and free"
    room, chair, *blind = read["nodes"]
    (said,) = room["attributes"]["metadata"].values()
    assert said["belief"]["expected"].keys() == set(belief.partial.class_space.classes)
    assert chair["attributes"]["metadata"]["bsg"]["belief"]["class"] == "chair"
    assert [node["layer"] for node in blind] == [0] * len(belief.blind)
    assert {chr(node["id"] >> 56) for node in blind} == {"x"}
    assert all(node["attributes"]["position"] == [1e-05, 0.1, 0] for node in blind)
    assert all(node["attributes"]["color"] == [0, 204, 0] for node in blind), "spelt as its room's"
    assert read["edges"][1:] == [
        {
            "info": {"type": "EdgeAttributes", "weight": 1.0, "weighted": False},
            "source": symbol("R", 0),
            "target": node["id"],
        }
        for node in blind
    ]
    assert find_document(read) == json.loads(json.dumps(encode_belief(belief)))


def test_a_text_without_beliefs_stays() -> None:
    for text in (ODD, json.dumps(robot_graph()), json.dumps(robot_graph(), indent=2)):
        assert strip_annotation(text) == text
    assert find_document(robot_graph()) is None


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


def middle(graph: Graph) -> None:
    """Name layers by their numbers, as files of version 1.1.0 do."""
    graph["layer_names"] = {"OBJECTS": 2, "ROOMS": 4}
    graph["layer_ids"] = [2, 3, 4, 5]


def older(graph: Graph) -> None:
    """Leave out what old files do not have."""
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


forms = st.sampled_from([lambda graph: None, newer, middle, older, spoken])


@settings(deadline=None, max_examples=60)
@given(
    form=forms,
    indent=st.sampled_from([None, None, 0, 2, "\t"]),
    separators=st.sampled_from([(",", ":"), (", ", ": "), (" , ", " : ")]),
    sort=st.booleans(),
    end=st.sampled_from(["", "\n", "\r\n \n"]),
    seeds=st.tuples(st.integers(0, 99), st.integers(0, 99)),
    most=st.sampled_from([0.0, 1.0, 5.0]),
)
def test_what_is_put_in_is_taken_out(
    form: Any, indent: Any, separators: Any, sort: bool, end: str, seeds: Any, most: float
) -> None:
    graph = robot_graph()
    form(graph)
    text = json.dumps(graph, indent=indent, separators=separators, sort_keys=sort) + end
    file = open_text(text)
    first, second = (believe_something(file, seed, most=most) for seed in seeds)
    once = file.annotated(first)
    assert is_longer(once, text)
    assert strip_annotation(once) == text
    again = open_text(once)
    assert again.partial() == file.partial(), "what was seen is not what is believed"
    assert again.annotated(first) == once
    assert again.annotated(second) == file.annotated(second), "the second replaces the first"


def test_what_others_added_since_stays() -> None:
    file = open_text(json.dumps(robot_graph()))
    read = json.loads(file.annotated(believe_something(file, most=3)))
    room = read["nodes"][1]["attributes"]["metadata"]
    assert room["bsg"]["belief"]["added"] == "metadata"
    room["bsg"]["hidden_share"] = 0.1
    read["nodes"][2]["attributes"]["metadata"]["other"] = 1
    read["nodes"].append(node("O", 77, 2))
    read["layer_ids"] = [2, 0]
    left = json.loads(strip_annotation(json.dumps(read)))
    assert left["nodes"][1]["attributes"]["metadata"] == {"bsg": {"hidden_share": 0.1}}
    assert left["nodes"][2]["attributes"]["metadata"] == {"other": 1}
    assert left["nodes"][-1] == node("O", 77, 2)
    assert left["layer_ids"] == [2]
    assert left["metadata"] == robot_graph()["metadata"]
    assert len(left["nodes"]) == len(robot_graph()["nodes"]) + 1


def test_a_taken_layer_or_letter_is_left_alone() -> None:
    graph = robot_graph()
    graph["nodes"].append(node("x", 0, 0))
    file = open_text(json.dumps(graph))
    read = json.loads(file.annotated(believe_something(file, most=3)))
    blind = read["nodes"][len(graph["nodes"]) :]
    assert {(chr(one["id"] >> 56), one["layer"]) for one in blind} == {("y", 1)}
    graph["layer_ids"] = [0, 1, 2, 3]
    file = open_text(json.dumps(graph))
    with pytest.raises(HydraError, match=r"flat\.json: expected a free layer .* below the rooms'"):
        file.annotated(believe_something(file))


@pytest.mark.parametrize("metadata", [None, 3, {"bsg": []}, {"bsg": {"belief": "yes"}}])
def test_what_stands_in_the_way_is_named(metadata: Any) -> None:
    graph = robot_graph()
    graph["nodes"][1]["attributes"]["metadata"] = metadata
    file = open_text(json.dumps(graph))
    with pytest.raises(HydraError, match=r"flat\.json: node R\(0\): metadata.*expected an object"):
        file.annotated(believe_something(file))


def test_objects_that_the_file_does_not_have_are_in_the_document_alone() -> None:
    file = open_text(json.dumps(robot_graph()))
    belief = believe_something(file)
    rooms = [room.id for room in file.graph.rooms]
    text = annotate(file.text, belief, rooms=rooms, objects=[None] * len(belief.partial.objects))
    read = json.loads(text)
    assert "metadata" not in read["nodes"][5]["attributes"]
    assert len(find_document(read)["partial"]["objects"]) == 4
