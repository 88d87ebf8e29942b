"""Rooms by id or label, hidden shares that a person says, and ways between rooms."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from conftest import REPOSITORY
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_models.belief.partial_graph import PartialGraph
from bsg_robot.answers import ways as ways_
from bsg_robot.answers.seen_building import open_graph
from bsg_robot.answers.ways import add_places, measure_ways, read_costs
from bsg_robot.answers.words import find_room, set_hidden_shares
from bsg_robot.graph.robot_json import parse_robot_graph, read_robot_graph


def graph_of(places: list[Any], adjacency: list[tuple[int, int]]) -> PartialGraph:
    """Return a building of rooms a, b, … at some places, None where unknown."""
    rooms = [{"id": chr(97 + n), "position": place} for n, place in enumerate(places)]
    pairs = [[chr(96 + a), chr(96 + b)] for a, b in adjacency]
    document = {"scene_id": "home", "rooms": rooms, "adjacency": pairs}
    return parse_robot_graph(document, path=Path("graph"))


def test_ways_go_through_rooms_that_connect() -> None:
    graph = graph_of([[0, 0, 0], [3, 4, 0], [3, 0, 0]], [(1, 2), (2, 3)])
    ways = measure_ways(graph)
    assert ways.unit == "m"
    assert ways.costs[1, 1:].tolist() == [0, 5, 9]
    assert np.isinf(ways.edges[1, 3])


def test_a_room_whose_place_is_unknown_is_as_far_as_others_are() -> None:
    ways = measure_ways(graph_of([[0, 0, 0], [2, 0, 0], None, [6, 0, 0]], [(1, 2), (2, 3), (2, 4)]))
    assert ways.edges[2, 3] == 2  # the lower one of 2 and 4


def test_without_connections_ways_are_straight_and_nothing_guessed_shortens_them() -> None:
    for places in ([[0, 0, 0], [9, 0, 0], [10, 0, 0]], [[0, 0, 0], [20, 0, 0], [10, 0, 0], None]):
        costs = measure_ways(graph_of([*places, [0, 1, 0]], [])).costs
        where = [n for n, place in enumerate([*places, [0, 1, 0]], 1) if place]
        straight = np.array([place for place in places if place] + [[0, 1, 0]], dtype=float)
        lines = np.linalg.norm(straight[:, None] - straight, axis=2)
        np.testing.assert_allclose(costs[np.ix_(where, where)], lines)
        assert np.isfinite(costs[1:, 1:]).all()


def test_parts_that_no_edge_joins_are_joined_where_they_are_nearest() -> None:
    graph = graph_of([[0, 0, 0], [1, 0, 0], [5, 0, 0], [9, 0, 0]], [(1, 2), (3, 4)])
    ways = measure_ways(graph)
    assert ways.edges[2, 3] == 4
    assert ways.costs[1, 4] == 9
    far = measure_ways(graph_of([None] * 3, [(1, 2)]))
    assert far.costs[1, 3] == 2


def test_costs_that_are_given_take_the_place_of_measured_ones() -> None:
    graph = graph_of([None] * 3, [(1, 2), (2, 3)])
    ways = measure_ways(graph, {("a", "b"): 2.5})
    assert ways.unit == "given"
    assert ways.costs[2, 1] == 2.5
    assert ways.costs[1, 3] == 5, "the other way is taken for as long"
    assert measure_ways(graph, {("c", "a"): 0.5}).costs[1, 3] == 0.5
    assert np.isinf(measure_ways(graph, {("a", "b"): np.inf}).costs[1, 3])
    for wrong in ([1], {("a",): 1}, {"ab": 1}, {("a", "b"): -1}, {("a", "b"): np.nan}):
        with pytest.raises(RecipeError, match="costs: "):
            measure_ways(graph, wrong)  # type: ignore[arg-type]
    with refuses(RecipeError, "room-unknown", "cellar"):
        measure_ways(graph, {("a", "cellar"): 1})


@settings(max_examples=40)
@given(st.lists(st.tuples(*[st.integers(-5, 5)] * 3), min_size=2, max_size=12), st.data())
def test_parts_are_joined_by_the_shortest_edges(places: list[Any], data: st.DataObject) -> None:
    """networkx's minimum spanning tree, where edges that are there cost nothing, is as long."""
    rooms = range(1, len(places) + 1)
    every = [(a, b) for a in rooms for b in rooms if a < b]
    joined = data.draw(st.lists(st.sampled_from(every), min_size=1, max_size=8, unique=True))
    edges = measure_ways(graph_of(places, joined)).edges
    added = sum(edges[a, b] for a, b in every if np.isfinite(edges[a, b]) and (a, b) not in joined)
    full = nx.Graph()
    for a, b in every:
        line = float(np.linalg.norm(np.subtract(places[a - 1], places[b - 1])))
        full.add_edge(a, b, weight=0 if (a, b) in joined else line)
    assert added == pytest.approx(nx.minimum_spanning_tree(full).size(weight="weight"))


@pytest.mark.parametrize("rooms", [4, 200])
def test_a_way_may_cost_nothing(rooms: int) -> None:
    """Few rooms and many, between which ways are found by other algorithms."""
    names = [f"room {number}" for number in range(rooms)]
    document = {
        "scene_id": "home",
        "rooms": [{"id": name} for name in names],
        "adjacency": [[a, b] for a, b in pairwise(names)],
    }
    graph = parse_robot_graph(document, path=Path("graph"))
    ways = measure_ways(graph, {(names[0], names[1]): 0.0})
    assert ways.costs[1, 1:5].tolist() == [0, 0, 1, 2]
    assert ways.costs[rooms, 1] == rooms - 2


@settings(max_examples=40)
@given(st.data(), st.floats(0.01, 100))
def test_nothing_guessed_makes_a_way_shorter_than_it_was_said(data: Any, unit: float) -> None:
    """And all ways are in the unit of those that are said."""
    every = [(a, b) for a in "abcd" for b in "abcd" if a < b]
    pairs = data.draw(st.lists(st.sampled_from(every), unique=True, min_size=1))
    given = {ends: data.draw(st.integers(1, 9)) for ends in pairs}
    joined = data.draw(st.lists(st.sampled_from(every), unique=True, max_size=4))
    graph = graph_of([None] * 4, [(ord(a) - 96, ord(b) - 96) for a, b in joined])
    ways = measure_ways(graph, given)
    alone = nx.Graph()
    alone.add_weighted_edges_from((a, b, cost) for (a, b), cost in given.items())
    for a, b in given:
        least = nx.shortest_path_length(alone, a, b, weight="weight")
        assert ways.costs[ord(a) - 96, ord(b) - 96] == least
    scaled = measure_ways(graph, {ends: unit * cost for ends, cost in given.items()})
    np.testing.assert_allclose(scaled.costs, unit * ways.costs)


def test_a_garage_far_away_makes_rooms_that_are_not_found_yet_no_farther() -> None:
    near = [[0, 0, 0], [4, 0, 0], [8, 0, 0], [4, 4, 0], [8, 4, 0]]
    for pairs in ([], [(1, 2), (2, 3), (2, 4), (3, 5)]):
        before = measure_ways(graph_of(near, pairs)).usual
        garage = [(1, 6)] if pairs else []
        assert measure_ways(graph_of([*near, [40, 0, 0]], [*pairs, *garage])).usual == before
    for places in ([[0, 0, 0], [3, 0, 0], [300, 0, 0]], [[0, 0, 0], [300, 0, 0]]):
        assert measure_ways(graph_of(places, [])).usual < 20


def test_places_that_are_not_known_are_as_far_as_others_are() -> None:
    ways = add_places(
        measure_ways(graph_of([[0, 0, 0], [2, 0, 0], [6, 0, 0]], [(1, 2), (2, 3)])), 2
    )
    assert ways.costs.shape == (6, 6)
    assert ways.costs[1:4, 4:].tolist() == [[2, 2]] * 3
    assert ways.costs[4, 5] == 2
    assert ways.costs[4, 4] == 0
    assert (ways.costs[4, 1:4] > 2).all()


@pytest.fixture
def office() -> PartialGraph:
    return read_robot_graph(REPOSITORY / "docs" / "office.json")


def test_a_room_is_found_by_id_then_by_a_label_that_it_alone_has(office: PartialGraph) -> None:
    ids = [room.name for room in office.rooms]
    assert [find_room(office, name) for name in ids] == list(range(1, len(ids) + 1))
    assert find_room(office, "b: SHARED kitchen") == ids.index("kitchen") + 1
    with refuses(RecipeError, "room-unknown", "kitchn"):
        find_room(office, "kitchn")
    alike = replace(office, rooms=tuple(replace(r, label="room") for r in office.rooms))
    with refuses(RecipeError, "room-ambiguous", "Room"):
        find_room(alike, "Room")


def test_shares_of_all_rooms_and_of_single_ones(office: PartialGraph) -> None:
    assert set_hidden_shares(office) == office
    graph = set_hidden_shares(office, every=0.4, rooms={"kitchen": 0, "C: meeting room": 1})
    shares = {room.name: (room.hidden_share, room.visited) for room in graph.rooms}
    assert shares["kitchen"] == (0, True)
    assert shares["meeting-room"] == (0.99, False), "it shows something"
    empty = set_hidden_shares(replace(office, objects=()), rooms={"meeting-room": 1}).rooms[-1]
    assert (empty.hidden_share, empty.visited) == (1, False)
    assert shares["waiting-room"] == (0.4, True)
    assert all(room.hidden_share_sd == 0 for room in graph.rooms)
    bare = replace(office, rooms=(), objects=(), adjacency=())
    assert set_hidden_shares(bare, every=0.3).hidden_share == 0.3
    for wrong in ({"rooms": {"kitchen": -0.1}}, {"every": math.nan}, {"rooms": {"attic": 0.5}}):
        with pytest.raises(RecipeError):
            set_hidden_shares(office, **wrong)


@pytest.mark.parametrize(
    "said",
    [
        5,
        {"hall": 1},
        [["hall"]],
        [["hall", "kitchen"]],
        ["abc"],
        [[None, "kitchen", 1]],
        [["hall", "kitchen", 1]] * (ways_.MOST_PAIRS + 1),
        [["hall", "kitchen", 1], ["kitchen", "hall", 2]],
    ],
)
def test_a_list_of_costs_that_is_malformed_is_refused(said: Any) -> None:
    with refuses(RecipeError, "costs-malformed", "costs"):
        read_costs(said)


def test_from_a_room_that_is_not_found_yet_a_way_leads_back_to_rooms_behind_closed_doors() -> None:
    graph = graph_of([[0, 0, 0], [2, 0, 0], [6, 0, 0], [9, 0, 0]], [(1, 2)])
    closed = {(a, b): math.inf for a in "ab" for b in "cd"} | {("c", "d"): math.inf}
    costs = add_places(measure_ways(graph, closed), 1).costs
    assert np.isfinite(costs[5]).all()
    assert costs[2:5, 1].tolist() == [2, math.inf, math.inf]


def test_a_list_of_costs_is_read_as_python_has_them() -> None:
    rows = [["hall", 7, 3], ["hall", "bath", "closed"], ["bath", "hall", "closed"]]
    closed = dict.fromkeys([("hall", "bath"), ("bath", "hall")], math.inf)
    assert read_costs(rows) == {("hall", "7"): 3.0, **closed}
    assert read_costs(None) is None
    for cost in (-1, math.nan, math.inf, "shut", None, True):
        with refuses(RecipeError, "number-impossible"):
            read_costs([["hall", "kitchen", cost]])


def test_the_likeliest_room_needs_no_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ways_, "MOST_ROOMS", 1)
    seen = open_graph({"rooms": [{"id": "kitchen"}, {"id": "hall"}]})
    assert seen.next_room("fridge") == "kitchen"
    with refuses(RecipeError, "rooms-too-many"):
        seen.next_room("fridge", here="hall")


def test_many_rooms_that_all_connect_are_refused_and_a_row_of_them_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two thousand took 17 s: each is gone by for every pair of others."""
    monkeypatch.setattr("bsg_models.search.knowledge.MOST_JOINED", 8)
    row = [{"id": str(number), "position": [number, 0, 0]} for number in range(60)]
    pairs = [[str(a), str(a + 1)] for a in range(59)]
    assert open_graph({"rooms": row, "adjacency": pairs}).next_room("fridge", here="0") is not None
    pairs = [[str(a), str(b)] for b in range(60) for a in range(b)]
    with refuses(RecipeError, "rooms-too-many"):
        open_graph({"rooms": row, "adjacency": pairs}).next_room("fridge", here="0")
