"""Convert a belief graph to a networkx graph, and back without loss."""

from __future__ import annotations

from pathlib import Path

import networkx as nx

from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.header import encode_whole_header
from bsg_models.belief.nodes import decode_nodes, encode_edges, encode_nodes
from bsg_models.errors import BeliefFileError

_NAME = Path("networkx graph")  # in errors


def to_networkx(belief: BeliefGraph) -> nx.DiGraph:
    """Return a directed graph of building, rooms, objects and blind nodes.

    Nodes are numbered: 0 the building, then rooms, objects and blind nodes. Each has `kind`
    (`building`, `room`, `object` or `blind`) and its attributes; `graph.graph` holds the header.
    Edges have `kind`: `contains`, `expects` (room to blind node) or `adjacent` (both directions).
    """
    graph = nx.DiGraph(**encode_whole_header(belief))
    nodes = list(encode_nodes(belief))
    for number, node in enumerate(nodes):
        graph.add_node(number, **node.attributes)
    for source, target, kind in encode_edges(belief, nodes):
        graph.add_edge(source, target, kind=kind)
        if kind == "adjacent":
            graph.add_edge(target, source, kind=kind)
    return graph


def from_networkx(graph: nx.DiGraph) -> BeliefGraph:
    """Return the belief graph of a graph made by `to_networkx`.

    Raises:
        BeliefFileError: if it is not such a graph.
    """
    numbers = range(len(graph))
    if set(graph) != set(numbers):
        raise BeliefFileError(
            f"{_NAME}: expected nodes 0 to {len(graph) - 1}, as `to_networkx` has"
        )
    nodes = [graph.nodes[number] for number in numbers]
    edges = list(graph.edges(data="kind"))
    return decode_nodes(graph.graph, nodes, edges, path=_NAME)
