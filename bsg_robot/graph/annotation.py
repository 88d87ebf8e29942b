"""Write beliefs into Hydra's scene graphs (Spark-DSG), and read them back exactly.

Every value, key and order of Hydra's graph stays. The belief graph goes under `metadata.bsg.belief`
of the graph. Each room gets its histograms and each object its class there, too. Blind nodes get a
layer of their own, with an edge to the room where each is expected. Every `belief` says in `added`
which key was new, so that the user's own content under `bsg` stays.
"""

from __future__ import annotations

import string
from collections.abc import Collection, Iterable, Iterator, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any, TypeVar

from bsg_data.files import AnyPath
from bsg_data.sources.dsg_file import name_symbol, parse_dsg
from bsg_models.belief.belief_graph import BeliefGraph, BlindNode
from bsg_robot.errors import HydraError
from bsg_robot.graph.document import decode_belief, encode_belief, write_json
from bsg_robot.graph.formats import FormatRow
from bsg_robot.graph.graph_file import GraphFile, open_graph_file
from bsg_robot.graph.hydra import find_belief, find_document

_Document = dict[str, Any]
_T = TypeVar("_T")
_SYMBOLS = "xyz" + string.ascii_letters  # Hydra uses a, b, … for robots, and B, O, p, R, s, t
_COLOUR = {"r": 0, "g": 204, "b": 0, "a": 255}  # of blind nodes in the paper's figures
_NO_TURN = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}
_NOWHERE = [0.0, 0.0, 0.0]
_BARE_NODE: _Document = {
    # Older readers need corners, newer ones a size; both ignore unknown keys.
    "bounding_box": {
        "type": "INVALID",
        "min": _NOWHERE,
        "max": _NOWHERE,
        "dimensions": _NOWHERE,
        "world_P_center": _NOWHERE,
        "world_R_center": _NO_TURN,
    },
    "semantic_label": 2**32 - 1,  # none
    "is_active": False,
    "is_predicted": False,
    "last_update_time_ns": 0,
}
_BARE_OBJECT: _Document = {
    "type": "ObjectNodeAttributes",
    "mesh_connections": [],
    "registered": False,
    "world_R_object": _NO_TURN,
}


def annotate_hydra(belief: BeliefGraph, original: AnyPath | GraphFile, path: AnyPath) -> None:
    """Write a Spark-DSG graph with the beliefs about it added; its own values and order stay.

    Blind nodes get a layer of their own, `BLIND`; everything else goes into metadata, under
    `bsg.belief`. A belief that the original already holds is replaced. A packed original is written
    unpacked, and a binary one as the JSON that spark_dsg makes of it.

    Args:
        belief: about the original.
        original: the graph that was read.
        path: of the file to write.

    Raises:
        HydraError: if the original is no Spark-DSG graph, or lacks a room of the belief, or the
            name does not end in .json.
        BSGError: if it cannot be read or written.
    """
    file = original if isinstance(original, GraphFile) else open_graph_file(Path(original))
    annotated, path = _annotated(_require_hydra(file), belief, file.path), Path(path)
    if path.suffix != ".json":
        raise HydraError(
            f"{path}: expected a name that ends in .json, by which readers recognise it",
            code="suffix-unknown",
            where=path,
        )
    write_json(annotated, path)


def _require_hydra(file: GraphFile) -> _Document:
    if file.document is None:
        raise HydraError(
            f"{file.path}: expected a Spark-DSG graph, found this project's JSON",
            code="dsg-malformed",
            where=file.path,
        )
    document: _Document = file.document
    return document


def _annotated(document: _Document, belief: BeliefGraph, path: Path) -> _Document:
    graph = parse_dsg(document, path=path)
    rooms, objects = (
        {str(node.said.get("id", node.symbol)): node.id for node in nodes}
        for nodes in (graph.rooms, graph.objects)
    )
    strange = [room.name for room in belief.partial.rooms if room.name not in rooms]
    if strange:
        raise HydraError(
            f"{path}: has no room {strange[0]!r}, of which something is believed; "
            "use `write_belief` for a .json",
            code="room-unknown",
            where=path,
        )
    return _annotate(
        document,
        belief,
        rooms=[rooms[room.name] for room in belief.partial.rooms],
        objects=[objects.get(obj.name) for obj in belief.partial.objects],
    )


def _annotate(
    document: _Document, belief: BeliefGraph, *, rooms: Sequence[int], objects: Sequence[int | None]
) -> _Document:
    """Return a graph with a belief graph in it; an older belief is replaced.

    `rooms` and `objects` are the ids in the document of those of the belief graph, in its order;
    None for objects that are not in the document.
    """
    graph = _strip(document)
    nodes = {node["id"]: node for node in graph["nodes"]}
    layer = _choose_layer(graph, nodes[rooms[0]]["layer"] if rooms else 1)
    symbols = {number >> 56 for number in nodes}
    prefix = _first_free(map(ord, _SYMBOLS), symbols, "letter for the symbols of blind nodes")
    _insert(graph, {"layer": layer, "document": encode_belief(belief)}, "the graph")
    for number, said in _describe(belief, rooms, objects):
        _insert(nodes[number]["attributes"], said, f"node {name_symbol(number)}")
    classes, place = belief.partial.class_space.classes, {"layer": layer["id"], "partition": 0}
    info = {"type": "EdgeAttributes", "weight": 1.0, "weighted": False}
    for number, node in enumerate(belief.blind, prefix << 56):
        room = nodes[rooms[node.room_index - 1]]
        attributes = _describe_blind(node, classes[node.class_index], room["attributes"])
        graph["nodes"].append({"attributes": attributes, "id": number, **place})
        graph["edges"].append({"info": info, "source": room["id"], "target": number})
    if belief.blind:
        _add_layer(graph, layer)
    return graph


def _strip(document: _Document) -> _Document:
    """Return a graph as it was before `_annotate`; without a belief, an equal graph."""
    graph = {key: one if key == "mesh" else deepcopy(one) for key, one in document.items()}
    blind, nodes = set(), []
    for node in graph["nodes"]:
        said = find_belief(node["attributes"])
        if said is not None and said.get("kind") == "blind":
            blind.add(node["id"])
            continue
        nodes.append(node)
        if said is not None:
            _remove(node["attributes"])
    edges = graph["edges"]
    graph["nodes"] = nodes
    graph["edges"] = [edge for edge in edges if not {edge["source"], edge["target"]} & blind]
    record = find_belief(graph)
    if record is not None:
        if blind and isinstance(record.get("layer"), dict):
            _remove_layer(graph, record["layer"])
        _remove(graph)
    return graph


def _insert(held: _Document, belief: _Document, where: str) -> None:
    """Put a belief into a graph or attributes, under `metadata.bsg`."""
    metadata = held.get("metadata", {})
    bsg = metadata.get("bsg", {}) if isinstance(metadata, dict) else None
    if not isinstance(bsg, dict) or "belief" in bsg:
        raise HydraError(
            f"{where}: expected objects in metadata and bsg without a belief, found "
            f"{str(metadata)[:40]}; rename what this program did not write",
            code="metadata-taken",
            where=where,
        )
    added = "metadata" if "metadata" not in held else "belief" if "bsg" in metadata else "bsg"
    bsg["belief"] = {"added": added, **belief}
    metadata["bsg"], held["metadata"] = bsg, metadata


def _remove(held: _Document) -> None:
    """Remove the belief from a graph or attributes, and what was added for it and is empty."""
    metadata = held["metadata"]
    added = metadata["bsg"].pop("belief").get("added")
    if not metadata["bsg"] and added != "belief":
        del metadata["bsg"]
    if not metadata and added == "metadata":
        del held["metadata"]


def _describe(
    belief: BeliefGraph, rooms: Sequence[int], objects: Sequence[int | None]
) -> Iterator[tuple[int, _Document]]:
    """Yield what is believed about each room and object, by its id in the document."""
    classes = belief.partial.class_space.classes
    for number, room in enumerate(rooms, 1):
        tables = {"expected": belief.expected, "presence": belief.presence}
        yield (
            room,
            {
                name: dict(zip(classes, table[number].tolist(), strict=True))
                for name, table in tables.items()
            },
        )
    for place, obj in zip(objects, belief.partial.objects, strict=True):
        if place is not None:
            name = None if obj.class_index is None else classes[obj.class_index]
            yield place, {"category": obj.category, "class": name}


def _describe_blind(node: BlindNode, name: str, room: _Document) -> _Document:
    """Return the attributes of a blind node: a predicted object, at the position of its room."""
    position, colour = room.get("position"), room.get("color")
    own: Any = list(_COLOUR.values())[:3]
    if isinstance(colour, dict):  # the file's own notation
        own = {key: value for key, value in _COLOUR.items() if key != "a" or key in colour}
    believed: _Document = {"class": name, "expected": node.expected, "presence": node.presence}
    if node.on is not None:
        believed["on"] = node.on
    return {
        **_BARE_OBJECT,
        **_BARE_NODE,
        "name": name,
        "position": _NOWHERE if position is None or None in position else position,
        "color": own,
        "is_predicted": True,
        "metadata": {"bsg": {"belief": {"kind": "blind", **believed}}},
    }


def _choose_layer(graph: _Document, rooms: int) -> _Document:
    """Return id and name of an unused layer below the rooms' layer.

    In Spark-DSG, the node of the higher layer is the parent of an edge. Above the rooms, blind
    nodes would become the rooms' parents, and the building would lose its rooms.
    """
    names = graph.get("layer_names", {})
    keys = [*graph.get("layer_keys", ()), *names.values()]
    taken = {node["layer"] for node in graph["nodes"]} | set(graph.get("layer_ids", ()))
    taken |= {key["layer"] if isinstance(key, dict) else key for key in keys}
    taken.add(graph.get("mesh_layer_id"))
    name = "BLIND"
    while name in names:
        name += "_"
    return {"id": _first_free(range(rooms), taken, "layer below the rooms'"), "name": name}


def _first_free(candidates: Iterable[_T], taken: Collection[_T], what: str) -> _T:
    for one in candidates:
        if one not in taken:
            return one
    raise HydraError(f"expected a free {what}, found all taken", code="layers-taken")


def _add_layer(graph: _Document, layer: _Document) -> None:
    """Add a layer to the lists that a graph has, in their notation."""
    key = {"layer": layer["id"], "partition": 0}
    for member, entry in (("layer_ids", layer["id"]), ("layer_keys", key)):
        if member in graph:
            graph[member].append(entry)
    if "layer_names" in graph:
        plain = any(isinstance(value, int) for value in graph["layer_names"].values())
        graph["layer_names"][layer["name"]] = layer["id"] if plain else key


def _remove_layer(graph: _Document, layer: _Document) -> None:
    """Remove the layer of blind nodes from the lists that a graph has."""
    number = layer.get("id")
    for member, entry in (("layer_ids", number), ("layer_keys", {"layer": number, "partition": 0})):
        if entry in graph.get(member, ()):
            graph[member].remove(entry)
    if "layer_names" in graph:
        names = graph["layer_names"].items()
        graph["layer_names"] = {name: key for name, key in names if name != layer.get("name")}


def _read(path: Path) -> BeliefGraph:
    document = find_document(_require_hydra(open_graph_file(path)))
    if document is None:
        raise HydraError(
            f"{path}: expected a belief graph that `annotate_hydra` wrote, found a Spark-DSG "
            "file without one; `read_graph` reads what was seen",
            code="belief-missing",
            where=path,
        )
    return decode_belief(document, path=path)


SPARK_DSG = FormatRow("spark-dsg", (".dsg.json",), read=_read)
