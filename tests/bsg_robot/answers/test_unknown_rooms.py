"""Rooms of which nothing is known: a model is asked of the others alone, and of them beside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation, join
from bsg_models.belief.partial_graph import PartialGraph
from bsg_robot.answers.unknown_rooms import expect_apart
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


def test_known_rooms_are_asked_about_alone(graph: PartialGraph) -> None:
    """By a model that shares two things of each class among all rooms that it hears of."""
    heard: list[tuple[str, ...]] = []

    def share(*graphs: PartialGraph) -> Expectation:
        heard.extend(tuple(room.name for room in graph.rooms) for graph in graphs)
        seen = [graph.histograms().astype(float) for graph in graphs]
        means = [np.full(counts.shape, 2 / (len(counts) - 1)) for counts in seen]
        for of_graph in means:
            of_graph[0] = 2.0
        return join([Expectation(n, poisson(m)) for n, m in zip(seen, means, strict=True)])

    apart = expect_apart(graph, KNOWN, share)
    assert heard == [("a", "c"), ("a", "c", "(unknown)")]
    presence = apart.every.presence[:, 0]
    alone, beside = 1 - np.exp(-2 / 2), 1 - np.exp(-2 / 3)
    assert presence[1:] == pytest.approx([alone, beside, alone, beside])
    whole = 1 - np.exp(-2) * np.exp(-2 / 3) ** 2
    assert presence[0] == pytest.approx(whole), "what the known ones have, and the others on top"
    assert np.array_equal(apart.every.inputs, graph.histograms())
