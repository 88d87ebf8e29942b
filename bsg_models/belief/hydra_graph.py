"""Make the document of a new Spark-DSG graph from a partial graph that no Hydra wrote.

Facts without a Spark-DSG field go into metadata under `bsg`, and `read_hydra` reads them back.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import (
    GRAPH_WORDS,
    OBJECT_WORDS,
    ROOM_WORDS,
    encode_robot_graph,
)
from bsg_data.scene.scene_graph import Point
from bsg_models.belief.annotation import NO_BOX, NO_LABEL, NO_TURN, Document

_VERSION = {"major": 1, "minor": 1, "patch": 3}
_LAYERS = {"OBJECTS": 2, "PLACES": 3, "ROOMS": 4, "BUILDINGS": 5}
_COLOURS = {"BUILDINGS": (0, 24, 236), "ROOMS": (151, 2, 250), "OBJECTS": (255, 128, 0)}
_OWN: Mapping[str, Document] = {
    "BUILDINGS": {"type": "SemanticNodeAttributes"},
    "ROOMS": {"type": "RoomNodeAttributes", "semantic_class_probabilities": {}},
    "OBJECTS": {
        "type": "ObjectNodeAttributes",
        "mesh_connections": [],
        "registered": False,
        "world_R_object": NO_TURN,
    },
}
_ORIGIN = (0.0, 0.0, 0.0)


def select_keys(said: Any, keys: Collection[str]) -> dict[str, Any]:
    """Return the entries of metadata whose keys are those of a robot's JSON."""
    return {key: said[key] for key in keys if key in said} if isinstance(said, dict) else {}


def encode_dsg(partial: PartialGraph) -> Document:
    """Return a partial graph as the document of a Spark-DSG graph.

    An unknown position becomes the centre of the room, or the origin.
    """
    said = encode_robot_graph(partial)
    nodes = [_encode_node("BUILDINGS", 0, "building", _ORIGIN, {})]
    edges = []
    for number, room in enumerate(partial.rooms):
        facts = select_keys(said["rooms"][number], ROOM_WORDS)
        name = room.label or room.name
        nodes.append(_encode_node("ROOMS", number, name, room.position or _ORIGIN, facts))
        edges.append(_encode_edge("BUILDINGS", 0, "ROOMS", number))
    for number, obj in enumerate(partial.objects):
        around = partial.rooms[obj.room_index - 1].position if obj.room_index else None
        facts = select_keys(said["objects"][number], OBJECT_WORDS)
        position = obj.position or around or _ORIGIN
        nodes.append(_encode_node("OBJECTS", number, obj.raw_category, position, facts))
        above = ("ROOMS", obj.room_index - 1) if obj.room_index else ("BUILDINGS", 0)
        edges.append(_encode_edge(*above, "OBJECTS", number))
    edges += [_encode_edge("ROOMS", a - 1, "ROOMS", b - 1) for a, b in partial.adjacency]
    keys = {name: {"layer": layer, "partition": 0} for name, layer in _LAYERS.items()}
    return {
        "SPARK_DSG_header": {"project_name": "main", "version": _VERSION},
        "directed": False,
        "multigraph": False,
        "layer_ids": list(_LAYERS.values()),
        "layer_keys": list(keys.values()),
        "layer_names": keys,
        "metadata": {"bsg": {"partial": select_keys(said, GRAPH_WORDS)}},
        "nodes": nodes,
        "edges": edges,
    }


def _encode_node(layer: str, number: int, name: str, position: Point, said: Document) -> Document:
    red, green, blue = _COLOURS[layer]
    attributes = {
        **_OWN[layer],
        "name": name,
        "position": list(position),
        "color": {"r": red, "g": green, "b": blue, "a": 255},
        "bounding_box": NO_BOX,
        "semantic_label": NO_LABEL,
        "semantic_feature": {"rows": 0, "cols": 0, "data": None},
        "is_active": False,
        "is_predicted": False,
        "last_update_time_ns": 0,
        "metadata": {"bsg": said} if said else {},
    }
    place = {"layer": _LAYERS[layer], "partition": 0}
    return {"attributes": attributes, "id": _symbol(layer, number), **place}


def _encode_edge(layer: str, number: int, other: str, place: int) -> Document:
    info = {"type": "EdgeAttributes", "weight": 1.0, "weighted": False, "metadata": {}}
    return {"source": _symbol(layer, number), "target": _symbol(other, place), "info": info}


def _symbol(layer: str, number: int) -> int:
    return ord(layer[0]) << 56 | number
