"""Write buildings with all rooms and objects as GraphML, or as networkx's node-link JSON.

Nodes have the numbers of `SceneGraph`: 0 is the building, rooms and objects follow. A node has its
`kind` (building, room or object) and the columns of its row in the tables; what is null there is
absent. Edges are directed and have `kind`, `method` and `distance_m`; two adjacent rooms have one
in each direction. GraphML has no lists: a footprint is the text of a JSON list.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import asdict
from html import escape
from typing import Any

import pyarrow as pa

from bsg_data.dataset.scenes import make_tables
from bsg_data.dataset.schema import EDGES, TABLES
from bsg_data.exports.catalogue import EncodedScene, ExportRow
from bsg_data.files import encode_json
from bsg_data.scene.scene_graph import SceneGraph

TABLE_OF = {"building": "scenes", "room": "rooms", "object": "objects"}  # kind of node → table


def _encode_node_link(graph: SceneGraph, classes: tuple[str, ...]) -> EncodedScene:
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


NODE_LINK = ExportRow(
    summary="building, rooms and objects as networkx's node-link JSON, <scene>.node-link.json",
    encode=_encode_node_link,
)

_TYPES = {"string": "string", "bool": "boolean", "double": "double"}  # Arrow's → GraphML's
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_REPLACED = "some names have characters that XML cannot hold; U+FFFD stands for each"


def _encode_graphml(graph: SceneGraph, classes: tuple[str, ...]) -> EncodedScene:
    """Encode a building as GraphML, with one line for each node and edge."""
    text = "\n".join(_write_lines(graph, classes)) + "\n"
    clean = _NO_XML.sub("\ufffd", text)
    data = clean.replace("\r", "&#13;").encode()  # a reader of XML takes a bare one for \n
    return EncodedScene(
        {f"{graph.scene_id}.graphml": data},
        len(graph.rooms),
        _REPLACED if clean != text else None,
        objects=len(graph.objects),
    )


def _write_lines(graph: SceneGraph, classes: tuple[str, ...]) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
    yield from _declare("node", [field for name in TABLE_OF.values() for field in TABLES[name]])
    yield from _declare("edge", [EDGES.field(name) for name in ("method", "distance_m")])
    yield '<graph edgedefault="directed">'
    for node in list_nodes(graph, classes):
        yield f'<node id="{node.pop("id")}">{_write_data("node", node)}</node>'
    for edge in list_edges(graph):
        ends = f'source="{edge.pop("source")}" target="{edge.pop("target")}"'
        yield f"<edge {ends}>{_write_data('edge', edge)}</edge>"
    yield "</graph>"
    yield "</graphml>"


def _declare(what: str, fields: list[pa.Field]) -> Iterator[str]:
    """Declare the attributes of nodes or edges, each once."""
    types = {"kind": "string", **{field.name: _type_of(field.type) for field in fields}}
    for name, kind in types.items():
        yield f'<key id="{what}.{name}" for="{what}" attr.name="{name}" attr.type="{kind}"/>'


def _type_of(kind: pa.DataType) -> str:
    return "int" if pa.types.is_integer(kind) else _TYPES.get(str(kind), "string")


def _write_data(what: str, attributes: dict[str, Any]) -> str:
    return "".join(
        f'<data key="{what}.{name}">{_write_text(value)}</data>'
        for name, value in attributes.items()
    )


def _write_text(value: object) -> str:
    return escape(value if isinstance(value, str) else encode_json(value), quote=False)


GRAPHML = ExportRow(
    summary="building, rooms and objects as GraphML, <scene>.graphml",
    encode=_encode_graphml,
)
