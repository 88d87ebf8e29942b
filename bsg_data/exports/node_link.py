"""Write buildings with rooms and objects as networkx's node-link JSON, `<scene>.node-link.json`.

Nodes have the numbers of `SceneGraph`: 0 is the building, rooms and objects follow. A node has its
`kind` (building, room or object) and the columns of its row in the tables; what is null there is
absent. Edges are directed and have `kind`, `method` and `distance_m`; two adjacent rooms have one
in each direction.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from bsg_data.dataset.shards import make_tables
from bsg_data.exports.catalogue import EncodedScene, ExportRow
from bsg_data.files import encode_json
from bsg_data.scene.scene_graph import SceneGraph

TABLE_OF = {"building": "scenes", "room": "rooms", "object": "objects"}  # kind of node → table


def encode_node_link(graph: SceneGraph, classes: tuple[str, ...]) -> EncodedScene:
    """Encode a building in the shape of `networkx.node_link_data`."""
    document = {
        "directed": True,
        "multigraph": False,
        "graph": {},
        "nodes": [*list_nodes(graph, classes)],
        "edges": [*list_edges(graph)],
    }
    text = encode_json(document, ensure_ascii=False, separators=(",", ":"))
    files = {f"{graph.scene_id}.node-link.json": f"{text}\n".encode()}
    return EncodedScene(files, len(graph.rooms), objects=len(graph.objects))


def list_nodes(graph: SceneGraph, classes: tuple[str, ...]) -> Iterator[dict[str, Any]]:
    """Yield `id`, `kind` and the attributes of every node, in the order of the ids."""
    tables = make_tables([graph], classes)
    rows = ((kind, row) for kind, name in TABLE_OF.items() for row in tables[name].to_pylist())
    for number, (kind, row) in enumerate(rows):
        yield {"id": number, "kind": kind, **_known(row)}


def list_edges(graph: SceneGraph) -> Iterator[dict[str, Any]]:
    """Yield `source`, `target` and the attributes of every edge."""
    for edge in graph.edges():
        row = _known(asdict(edge))
        yield row
        if edge.kind == "adjacent":
            yield row | {"source": edge.target, "target": edge.source}


def _known(row: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in row.items() if value is not None}


ROW = ExportRow(
    summary="building, rooms and objects as networkx's node-link JSON, <scene>.node-link.json",
    encode=encode_node_link,
)
