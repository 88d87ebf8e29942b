"""A belief graph as a networkx graph: without loss, and a tree but for adjacency."""

from __future__ import annotations

import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_beliefs import CLASS_SPACE, make_belief

from bsg_models.belief.network import from_networkx, to_networkx
from bsg_models.errors import BeliefFileError


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), mode=st.sampled_from(["complete", "unseen"]))
def test_a_graph_is_read_back(seed: int, mode: str) -> None:
    belief = make_belief(seed, mode=mode)
    assert from_networkx(to_networkx(belief)) == belief


def test_the_order_in_which_nodes_were_added_does_not_matter() -> None:
    graph = to_networkx(make_belief(3))
    turned = nx.DiGraph(**graph.graph)
    turned.add_nodes_from(reversed(list(graph.nodes(data=True))))
    turned.add_edges_from(reversed(list(graph.edges(data=True))))
    assert from_networkx(turned) == make_belief(3)


def test_nodes_and_edges_have_kinds() -> None:
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
    assert graph.nodes[node]["class"] == CLASS_SPACE.classes[first.class_index]
    assert graph.edges[first.room_index, node]["kind"] == "expects"


def test_another_graph_is_refused() -> None:
    with pytest.raises(BeliefFileError, match="networkx graph"):
        from_networkx(nx.DiGraph())
    with pytest.raises(BeliefFileError, match="to_networkx"):
        from_networkx(nx.DiGraph([("a", "b")]))
    graph = to_networkx(make_belief(3))
    del graph.nodes[1]["id"]
    with pytest.raises(BeliefFileError, match=r"KeyError.*id"):
        from_networkx(graph)
    graph = to_networkx(make_belief(3))
    graph.nodes[len(graph) - 1]["class"] = "ufo"
    with pytest.raises(BeliefFileError, match="ufo"):
        from_networkx(graph)
