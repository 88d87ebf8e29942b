"""Write beliefs into Hydra's scene graphs (Spark-DSG).

`annotate_hydra` writes Hydra's graph with the beliefs added: every value, key and order stays.
A belief graph of another origin becomes a new file. Both are read back exactly.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bsg_data.files import AnyPath
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import (
    GRAPH_WORDS,
    OBJECT_WORDS,
    ROOM_WORDS,
    encode_robot_graph,
)
from bsg_data.sources.dsg_file import parse_dsg
from bsg_models.belief.annotation import (
    BARE_NODE,
    BARE_OBJECT,
    Document,
    annotate,
    find_document,
)
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.document import decode_belief, write_json
from bsg_models.belief.formats import FormatRow
from bsg_models.belief.graph_file import GraphFile, open_graph_file
from bsg_models.errors import HydraError

_LAYERS = {"OBJECTS": 2, "PLACES": 3, "ROOMS": 4, "BUILDINGS": 5}
_OF_LAYER: dict[str, Document] = {
    "BUILDINGS": {"type": "SemanticNodeAttributes"},
    "ROOMS": {"type": "RoomNodeAttributes", "semantic_class_probabilities": {}},
    "OBJECTS": BARE_OBJECT,
}
_COLOURS = {"BUILDINGS": (0, 24, 236), "ROOMS": (151, 2, 250), "OBJECTS": (255, 128, 0)}


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
    _write(_annotated(_require_hydra(file), belief, file.path), Path(path))


def _require_hydra(file: GraphFile) -> Document:
    if file.document is None:
        raise HydraError(
            f"{file.path}: expected a Spark-DSG graph, found this project's JSON",
            code="dsg-malformed",
            where=file.path,
        )
    document: Document = file.document
    return document


def _annotated(document: Document, belief: BeliefGraph, path: Path) -> Document:
    graph = parse_dsg(document, path=path)
    rooms, objects = (
        {str(node.said.get("id", node.symbol)): node.id for node in nodes}
        for nodes in (graph.rooms, graph.objects)
    )
    strange = [room.name for room in belief.partial.rooms if room.name not in rooms]
    if strange:
        raise HydraError(
            f"{path}: has no room {strange[0]!r}, of which something is believed; "
            "use `write_belief` for a new graph",
            code="room-unknown",
            where=path,
        )
    return annotate(
        document,
        belief,
        rooms=[rooms[room.name] for room in belief.partial.rooms],
        objects=[objects.get(obj.name) for obj in belief.partial.objects],
    )


def _write_new(belief: BeliefGraph, path: Path) -> None:
    _write(_annotated(_encode_graph(belief.partial), belief, path), path)


def _read(path: Path) -> BeliefGraph:
    document = find_document(_require_hydra(open_graph_file(path)))
    if document is None:
        raise HydraError(
            f"{path}: expected a belief graph that `annotate_hydra` or `write_belief` wrote, found "
            "a Spark-DSG file without one; `read_graph` reads what was seen",
            code="belief-missing",
            where=path,
        )
    return decode_belief(document, path=path)


def _write(document: Document, path: Path) -> None:
    if path.suffix != ".json":
        raise HydraError(
            f"{path}: expected a name that ends in .json, by which readers recognise it",
            code="suffix-unknown",
            where=path,
        )
    write_json(document, path)


def _encode_graph(partial: PartialGraph) -> Document:
    """Return a partial graph that no Hydra wrote as the document of a Spark-DSG graph.

    Facts without a field go into metadata. An unknown position becomes the centre of the room, or
    the origin.
    """
    said, origin = encode_robot_graph(partial), (0.0, 0.0, 0.0)
    nodes, edges = [_encode_node("BUILDINGS", 0, "building", origin, {})], []
    for number, (room, facts) in enumerate(zip(partial.rooms, said["rooms"], strict=True)):
        named = room.label or room.name
        held = {key: facts[key] for key in ROOM_WORDS if key in facts}
        nodes.append(_encode_node("ROOMS", number, named, room.position or origin, held))
        edges.append(("BUILDINGS", 0, "ROOMS", number))
    for number, (obj, facts) in enumerate(zip(partial.objects, said["objects"], strict=True)):
        around = partial.rooms[obj.room_index - 1].position if obj.room_index else None
        position = obj.position or around or origin
        held = {key: facts[key] for key in OBJECT_WORDS if key in facts}
        nodes.append(_encode_node("OBJECTS", number, obj.raw_category, position, held))
        above = ("ROOMS", obj.room_index - 1) if obj.room_index else ("BUILDINGS", 0)
        edges.append((*above, "OBJECTS", number))
    edges += [("ROOMS", a - 1, "ROOMS", b - 1) for a, b in partial.adjacency]
    info = {"type": "EdgeAttributes", "weight": 1.0, "weighted": False, "metadata": {}}
    keys = {name: {"layer": layer, "partition": 0} for name, layer in _LAYERS.items()}
    return {
        "SPARK_DSG_header": {
            "project_name": "main",
            "version": {"major": 1, "minor": 1, "patch": 3},
        },
        "directed": False,
        "multigraph": False,
        "layer_ids": list(_LAYERS.values()),
        "layer_keys": list(keys.values()),
        "layer_names": keys,
        "metadata": {"bsg": {"partial": {key: said[key] for key in GRAPH_WORDS if key in said}}},
        "nodes": nodes,
        "edges": [
            {"source": _symbol(layer, a), "target": _symbol(other, b), "info": info}
            for layer, a, other, b in edges
        ],
    }


def _encode_node(layer: str, number: int, name: str, position: Any, said: Document) -> Document:
    red, green, blue = _COLOURS[layer]
    attributes = {
        **_OF_LAYER[layer],
        **BARE_NODE,
        "name": name,
        "position": position,
        "color": {"r": red, "g": green, "b": blue, "a": 255},
        "semantic_feature": {"rows": 0, "cols": 0, "data": None},
        "metadata": {"bsg": said} if said else {},
    }
    place = {"layer": _LAYERS[layer], "partition": 0}
    return {"attributes": attributes, "id": _symbol(layer, number), **place}


def _symbol(layer: str, number: int) -> int:
    return ord(layer[0]) << 56 | number


SPARK_DSG = FormatRow("spark-dsg", (".dsg.json",), write=_write_new, read=_read)
