"""Write buildings with all rooms and objects as GraphML, or as networkx's node-link JSON.

Nodes have the numbers of `SceneGraph`: 0 is the building, rooms and objects follow. A node has its
`kind` (building, room or object) and the columns of its row in the tables; what is null there is
absent. Edges are directed and have `kind`, `method` and `distance_m`; two adjacent rooms have one
in each direction. GraphML has no lists: a footprint is the text of a JSON list.
"""

from __future__ import annotations

import io
import re
from dataclasses import asdict
from typing import Any

import networkx as nx

from bsg_data.dataset.scenes import make_tables
from bsg_data.exports.catalogue import EncodedScene, ExportRow
from bsg_data.files import encode_json
from bsg_data.scene.scene_graph import SceneGraph

_TABLE_OF = {"building": "scenes", "room": "rooms", "object": "objects"}  # kind of node → table
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_REPLACED = "some names have characters that XML cannot hold; U+FFFD stands for each"


def _make_graph(graph: SceneGraph, classes: tuple[str, ...]) -> nx.DiGraph:
    made, tables = nx.DiGraph(), make_tables([graph], classes)
    for kind, name in _TABLE_OF.items():
        for row in tables[name].to_pylist():
            made.add_node(len(made), kind=kind, **_known(row))
    for edge in graph.edges():
        row = _known(asdict(edge))
        source, target = row.pop("source"), row.pop("target")
        made.add_edge(source, target, **row)
        if edge.kind == "adjacent":
            made.add_edge(target, source, **row)
    return made


def _known(row: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in row.items() if value is not None}


def _encode_node_link(graph: SceneGraph, classes: tuple[str, ...]) -> EncodedScene:
    document = nx.node_link_data(_make_graph(graph, classes), edges="edges")
    text = encode_json(document, ensure_ascii=False, separators=(",", ":"))
    files = {f"{graph.scene_id}.node-link.json": f"{text}\n".encode()}
    return EncodedScene(files, len(graph.rooms), objects=len(graph.objects))


def _encode_graphml(graph: SceneGraph, classes: tuple[str, ...]) -> EncodedScene:
    made = _make_graph(graph, classes)
    for _, node in made.nodes(data=True):
        if "footprint" in node:
            node["footprint"] = encode_json(node["footprint"])
    nx.write_graphml_xml(made, written := io.BytesIO())
    text = written.getvalue().decode()
    clean = _NO_XML.sub("\ufffd", text)
    data = clean.replace("\r", "&#13;").encode()  # a reader of XML takes a bare one for \n
    return EncodedScene(
        {f"{graph.scene_id}.graphml": data},
        len(graph.rooms),
        _REPLACED if clean != text else None,
        objects=len(graph.objects),
    )


NODE_LINK = ExportRow(
    summary="building, rooms and objects as networkx's node-link JSON, <scene>.node-link.json",
    encode=_encode_node_link,
)
GRAPHML = ExportRow(
    summary="building, rooms and objects as GraphML, <scene>.graphml",
    encode=_encode_graphml,
)
