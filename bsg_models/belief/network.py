"""Convert a belief graph to a networkx graph, for its algorithms and file formats."""

from __future__ import annotations

import networkx as nx

from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.document import encode_belief, list_edges, list_nodes


def to_networkx(belief: BeliefGraph) -> nx.DiGraph:
    """Return a directed graph of building, rooms, objects and blind nodes.

    Nodes are numbered: 0 the building, then rooms, objects and blind nodes. Each has `kind`
    (`building`, `room`, `object` or `blind`) and its attributes; the building and rooms have their
    `expected` and `presence`. Edges have `kind`: `contains`, `expects` (room to blind node) or
    `adjacent` (both directions). `graph.graph` holds model, mode and classes.
    """
    document = encode_belief(belief)
    header = {key: document[key] for key in ("format", "version", "model", "mode", "class_space")}
    graph = nx.DiGraph(**header, scene_id=belief.partial.scene_id)
    for number, (_, node) in enumerate(list_nodes(document)):
        graph.add_node(number, **node)
    for name in ("expected", "presence"):
        for number, values in enumerate(document[name]):
            graph.nodes[number][name] = values
    graph.add_edges_from((a, b, {"kind": kind}) for a, b, kind in list_edges(document))
    return graph
