"""Add a belief graph to the document of a Spark-DSG graph, and remove it again.

    annotate(document, …)         the same document with the belief added
    strip_annotation(document)    the document without it

The belief graph goes under `metadata.bsg.belief` of the graph. Each room gets its histograms and
each object its class there, too. Blind nodes get a layer of their own, with an edge to the room
where each is expected. Every `belief` says in `added` which key was new, so that the user's own
content under `bsg` stays. Documents are not changed: what changes is copied.
"""

from __future__ import annotations

import math
import string
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from bsg_data.sources.dsg_file import name_symbol
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.document import encode_belief
from bsg_models.errors import HydraError

Document = dict[str, Any]
BLIND_LAYER = "BLIND"
_PATH = ("metadata", "bsg", "belief")  # of a belief in a graph, or in a node's attributes
_SYMBOLS = "xyz" + string.ascii_letters  # Hydra uses a, b, … for robots, and B, O, p, R, s, t
_COLOUR = (0, 204, 0)  # of blind nodes in the paper's figures
NO_LABEL = 2**32 - 1
NO_TURN = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}
_NOWHERE = [0.0, 0.0, 0.0]
# Older readers need corners, newer ones a size; both ignore unknown keys.
NO_BOX = {
    "type": "INVALID",
    "min": _NOWHERE,
    "max": _NOWHERE,
    "dimensions": _NOWHERE,
    "world_P_center": _NOWHERE,
    "world_R_center": NO_TURN,
}


def annotate(
    document: Document, belief: BeliefGraph, *, rooms: Sequence[int], objects: Sequence[int | None]
) -> Document:
    """Return a graph with a belief graph in it; an older belief is replaced.

    Args:
        document: of a Spark-DSG graph.
        belief: about its content.
        rooms: ids of its rooms in the document, in the order of the belief graph.
        objects: ids of its objects, likewise; None for objects that are not in the document.

    Raises:
        HydraError: if something else stands at the place of a belief.
    """
    graph = strip_annotation(document)
    nodes = {node["id"]: node for node in graph["nodes"]}
    layer, name = _choose_layer(graph, nodes[rooms[0]]["layer"] if rooms else 1)
    prefix = _choose_symbol(nodes)
    record = {"layer": {"id": layer, "name": name}, "document": encode_belief(belief)}
    graph = _insert(graph, _PATH, record, "the graph")
    for number, said in _describe(belief, rooms, objects):
        where = f"node {name_symbol(number)}"
        attributes = _insert(nodes[number]["attributes"], _PATH, said, where)
        nodes[number] = {**nodes[number], "attributes": attributes}
    blind = [
        _encode_blind(belief, place, nodes[rooms[node.room_index - 1]], layer, prefix)
        for place, node in enumerate(belief.blind)
    ]
    graph["nodes"] = [*nodes.values(), *blind]
    info = {"type": "EdgeAttributes", "weight": 1.0, "weighted": False}
    graph["edges"] = graph["edges"] + [
        {"info": info, "source": rooms[node.room_index - 1], "target": one["id"]}
        for node, one in zip(belief.blind, blind, strict=True)
    ]
    return _add_layer(graph, layer, name) if blind else graph


def strip_annotation(document: Document) -> Document:
    """Return a graph as it was before `annotate`; without a belief, an equal graph."""
    beliefs = {node["id"]: _find_belief(node.get("attributes")) for node in document["nodes"]}
    blind = {number for number, said in beliefs.items() if said and said.get("kind") == "blind"}
    graph = {**document, "nodes": []}
    for node in document["nodes"]:
        if beliefs[node["id"]] is None:
            graph["nodes"].append(node)
        elif node["id"] not in blind:
            graph["nodes"].append({**node, "attributes": _remove(node["attributes"])})
    graph["edges"] = [e for e in document["edges"] if not {e["source"], e["target"]} & blind]
    record = _find_belief(document)
    if record is None:
        return graph
    return _remove(_remove_layer(graph, record.get("layer")) if blind else graph)


def find_document(graph: Any) -> Any:
    """Return the document of the belief graph that `annotate` added; None without one."""
    record = _find_belief(graph)
    return None if record is None else record.get("document")


def _find_belief(held: Any) -> Mapping[str, Any] | None:
    """Return what `annotate` added to a graph or a node.

    Blind nodes are added as a whole; their kind says so.
    """
    for key in _PATH:
        held = held.get(key) if isinstance(held, dict) else None
    if not isinstance(held, dict):
        return None
    return held if held.get("added") in _PATH or held.get("kind") == "blind" else None


def _insert(held: Any, path: Sequence[str], belief: Mapping[str, Any], where: str) -> Document:
    """Return an object with a belief at a path in it, and with the objects around it."""
    if not isinstance(held, dict):
        raise HydraError(
            f"{where}: expected an object around {'.'.join(path)}, found {str(held)[:40]}",
            code="metadata-taken",
            where=where,
        )
    key, *inner = path
    if key in held and not inner:
        raise HydraError(
            f"{where}: {'.'.join(_PATH)} is there already, and this program did not write it; "
            "rename it",
            code="metadata-taken",
            where=where,
        )
    if key in held:
        return {**held, key: _insert(held[key], inner, belief, where)}
    said: Any = {"added": key, **belief}
    for outer in reversed(inner):
        said = {outer: said}
    return {**held, key: said}


def _remove(held: Document) -> Document:
    """Return an object without its belief, and without what was added around it and is empty."""
    added = (_find_belief(held) or {}).get("added")
    ours = _PATH[_PATH.index(added) :] if added in _PATH else ()

    def cut(held: Document, path: Sequence[str]) -> Document:
        key, *inner = path
        left = cut(held[key], inner) if inner else {}
        if inner and (left or key not in ours):
            return {**held, key: left}
        return {name: value for name, value in held.items() if name != key}

    return cut(held, _PATH)


def _describe(
    belief: BeliefGraph, rooms: Sequence[int], objects: Sequence[int | None]
) -> Iterator[tuple[int, Document]]:
    """Yield the belief about each room and object, by its id in the file."""
    classes = belief.partial.class_space.classes
    for number, node in enumerate(rooms, 1):
        tables = {"expected": belief.expected[number], "presence": belief.presence[number]}
        yield (
            node,
            {
                name: dict(zip(classes, values.tolist(), strict=True))
                for name, values in tables.items()
            },
        )
    for place, obj in zip(objects, belief.partial.objects, strict=True):
        if place is not None:
            name = None if obj.class_index is None else classes[obj.class_index]
            yield place, {"category": obj.category, "class": name}


def _encode_blind(
    belief: BeliefGraph, place: int, room: Document, layer: int, prefix: int
) -> Document:
    """Return a blind node: a predicted object, at the position of its room."""
    node = belief.blind[place]
    name = belief.partial.class_space.classes[node.class_index]
    believed = {"class": name, "expected": node.expected, "presence": node.presence}
    attributes = {
        "type": "ObjectNodeAttributes",
        "name": name,
        "position": _position_of(room),
        "color": _colour_like(room["attributes"].get("color")),
        "bounding_box": NO_BOX,
        "semantic_label": NO_LABEL,
        "is_active": False,
        "is_predicted": True,
        "last_update_time_ns": 0,
        "mesh_connections": [],
        "registered": False,
        "world_R_object": NO_TURN,
        "metadata": {"bsg": {"belief": {"kind": "blind", **believed}}},
    }
    return {"attributes": attributes, "id": prefix << 56 | place, "layer": layer, "partition": 0}


def _position_of(room: Document) -> Any:
    """Return the position of a room, or the origin if it is not finite (null or `NaN`)."""
    position = room["attributes"].get("position")
    finite = isinstance(position, list) and all(
        isinstance(value, int | float) and math.isfinite(value) for value in position
    )
    return position if finite else _NOWHERE


def _colour_like(colour: Any) -> Any:
    """Return the colour of blind nodes in the file's own notation: a list, or by letters."""
    if isinstance(colour, dict):
        return dict(zip("rgb", _COLOUR, strict=True)) | ({"a": 255} if "a" in colour else {})
    return list(_COLOUR)


def _choose_layer(graph: Document, rooms: int) -> tuple[int, str]:
    """Return id and name of an unused layer below the rooms' layer.

    In Spark-DSG, the node of the higher layer is the parent of an edge. Above the rooms, blind
    nodes would become the rooms' parents, and the building would lose its rooms.
    """
    names = graph.get("layer_names", {})
    keys = [*graph.get("layer_keys", ()), *names.values()]
    taken = {node["layer"] for node in graph["nodes"]} | set(graph.get("layer_ids", ()))
    taken |= {key["layer"] if isinstance(key, dict) else key for key in keys}
    taken.add(graph.get("mesh_layer_id"))
    free = next((layer for layer in range(rooms) if layer not in taken), None)
    if free is None:
        raise HydraError(
            f"expected a free layer for blind nodes below the rooms', {rooms}; found all taken",
            code="layers-taken",
        )
    name = BLIND_LAYER
    while name in names:
        name += "_"
    return free, name


def _add_layer(graph: Document, layer: int, name: str) -> Document:
    """Return a graph with one more layer in the lists that it has, in their notation."""
    graph, key = dict(graph), {"layer": layer, "partition": 0}
    for member, entry in (("layer_ids", layer), ("layer_keys", key)):
        if member in graph:
            graph[member] = [*graph[member], entry]
    if "layer_names" in graph:
        plain = any(isinstance(value, int) for value in graph["layer_names"].values())
        graph["layer_names"] = {**graph["layer_names"], name: layer if plain else key}
    return graph


def _remove_layer(graph: Document, layer: Any) -> Document:
    """Return a graph without the layer of blind nodes in its lists of layers."""
    if not isinstance(layer, dict):
        return graph
    graph, number = dict(graph), layer.get("id")
    for member, entry in (("layer_ids", number), ("layer_keys", {"layer": number, "partition": 0})):
        if member in graph:
            graph[member] = [one for one in graph[member] if one != entry]
    if "layer_names" in graph:
        names = graph["layer_names"].items()
        graph["layer_names"] = {name: key for name, key in names if name != layer.get("name")}
    return graph


def _choose_symbol(ids: Collection[int]) -> int:
    """Return an unused symbol letter, as its number."""
    taken = {number >> 56 for number in ids}
    free = next((ord(letter) for letter in _SYMBOLS if ord(letter) not in taken), None)
    if free is None:
        raise HydraError(
            "expected a free letter for the symbols of blind nodes; found all taken",
            code="symbols-taken",
        )
    return free
