"""Rooms of which nothing is known: a model is asked of the others alone, and of them beside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation, join
from bsg_models.belief.partial_graph import PartialGraph
from bsg_robot.answers.unknown_rooms import expect_apart, keep_rooms
from bsg_robot.graph.robot_json import parse_robot_graph

HOME = {
    "scene_id": "home",
    "rooms": [{"id": one, "visited": one in "ac"} for one in "abcd"],
    "objects": [
        {"id": "1", "room": "a", "category": "bed"},
        {"id": "2", "room": "c", "category": "sink"},
        {"id": "3", "category": "lamp"},
    ],
    "adjacency": [["a", "b"], ["a", "c"], ["c", "d"]],
    "looks": [{"room": "a", "thing": "mug"}],
}
KNOWN = np.array([True, False, True, False])


@pytest.fixture
def graph() -> PartialGraph:
    return parse_robot_graph(HOME, path=Path("home"))


class Jealous:
    """A model that shares two things of each class among all rooms that it hears of."""

    def __init__(self) -> None:
        self.heard: list[tuple[str, ...]] = []

    def __call__(self, *graphs: PartialGraph) -> Expectation:
        self.heard += (tuple(room.name for room in graph.rooms) for graph in graphs)
        return join([self._share(graph) for graph in graphs])

    @staticmethod
    def _share(graph: PartialGraph) -> Expectation:
        seen = graph.histograms().astype(float)
        each = 2.0 / len(graph.rooms)
        means = np.full(seen.shape, each)
        means[0] = 2.0
        return Expectation(seen, poisson(means))


def test_known_rooms_are_asked_about_alone(graph: PartialGraph) -> None:
    model = Jealous()
    apart = expect_apart(graph, KNOWN, model)
    assert model.heard == [("a", "c"), ("a", "c", "(unknown)")]
    presence = apart.every.presence[:, 0]
    alone, beside = 1 - np.exp(-2 / 2), 1 - np.exp(-2 / 3)
    assert presence[1:] == pytest.approx([alone, beside, alone, beside])
    whole = 1 - np.exp(-2) * np.exp(-2 / 3) ** 2
    assert presence[0] == pytest.approx(whole), "what the known ones have, and the others on top"
    assert np.array_equal(apart.every.inputs, graph.histograms())


@pytest.mark.parametrize("known", [True, False])
def test_rooms_that_are_all_known_or_all_unknown_are_asked_about_once(
    known: bool, graph: PartialGraph
) -> None:
    model = Jealous()
    apart = expect_apart(graph, np.full(4, known), model)
    assert model.heard == [("a", "b", "c", "d")]
    assert np.array_equal(apart.every.presence, Jealous()(graph).presence)


def test_more_rooms_of_which_nothing_is_known_change_no_other(graph: PartialGraph) -> None:
    fewer = keep_rooms(graph, np.array([0, 1, 2]))
    one = expect_apart(graph, KNOWN, Jealous()).every.presence
    other = expect_apart(fewer, KNOWN[:3], Jealous()).every.presence
    assert one[[1, 2, 3]] == pytest.approx(other[[1, 2, 3]])
    assert (one[0] >= other[0] - 1e-12).all()


def test_a_part_of_a_graph_by_hand(graph: PartialGraph) -> None:
    part = keep_rooms(graph, np.array([0, 2]))
    assert [room.name for room in part.rooms] == ["a", "c"]
    assert [(obj.name, obj.room_index) for obj in part.objects] == [("1", 1), ("2", 2), ("3", 0)]
    assert part.adjacency == ((1, 2),)
    assert part.hidden_share == pytest.approx(0.5)
