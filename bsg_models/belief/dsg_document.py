"""Write a partial graph as a new Spark-DSG graph, if it does not come from a Spark-DSG file.

Facts without a Spark-DSG field go into metadata under `bsg`, and `read_hydra` reads them back.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import (
    GRAPH_WORDS,
    OBJECT_WORDS,
    ROOM_WORDS,
    encode_robot_graph,
)
from bsg_data.scene.scene_graph import Point
from bsg_models.belief.hydra_file import select_words

_VERSION = {"major": 1, "minor": 1, "patch": 3}
_LAYERS = {"OBJECTS": 2, "PLACES": 3, "ROOMS": 4, "BUILDINGS": 5}
_COLOURS = {"BUILDINGS": (0, 24, 236), "ROOMS": (151, 2, 250), "OBJECTS": (255, 128, 0)}
_SYMBOLS = {"BUILDINGS": "B", "ROOMS": "R", "OBJECTS": "O"}
_NO_TURN = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}
_NO_BOX = {
    "type": "INVALID",
    "dimensions": [0.0, 0.0, 0.0],
    "world_P_center": [0.0, 0.0, 0.0],
    "world_R_center": _NO_TURN,
}
_OWN: Mapping[str, Mapping[str, Any]] = {
    "BUILDINGS": {"type": "SemanticNodeAttributes"},
    "ROOMS": {"type": "RoomNodeAttributes", "semantic_class_probabilities": {}},
    "OBJECTS": {
        "type": "ObjectNodeAttributes",
        "mesh_connections": [],
        "registered": False,
        "world_R_object": _NO_TURN,
    },
}
_ORIGIN = (0.0, 0.0, 0.0)


def encode_dsg(partial: PartialGraph) -> dict[str, Any]:
    """Return a partial graph as the document of a Spark-DSG graph.

    An unknown position becomes the centre of the room, or the origin.
    """
    said = encode_robot_graph(partial)
    nodes = [_encode_node("BUILDINGS", 0, "building", _ORIGIN, {})]
    edges = []
    for number, room in enumerate(partial.rooms):
        words = select_words(said["rooms"][number], ROOM_WORDS)
        name = room.label or room.name
        nodes.append(_encode_node("ROOMS", number, name, room.position or _ORIGIN, words))
        edges.append(_encode_edge("BUILDINGS", 0, "ROOMS", number))
    for number, obj in enumerate(partial.objects):
        around = partial.rooms[obj.room_index - 1].position if obj.room_index else None
        words = select_words(said["objects"][number], OBJECT_WORDS)
        position = obj.position or around or _ORIGIN
        nodes.append(_encode_node("OBJECTS", number, obj.raw_category, position, words))
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
        "metadata": {"bsg": {"partial": select_words(said, GRAPH_WORDS)}},
        "nodes": nodes,
        "edges": edges,
    }


def _encode_node(
    layer: str, number: int, name: str, position: Point, said: Mapping[str, Any]
) -> dict[str, Any]:
    red, green, blue = _COLOURS[layer]
    attributes = {
        **_OWN[layer],
        "name": name,
        "position": position,
        "color": {"r": red, "g": green, "b": blue, "a": 255},
        "bounding_box": _NO_BOX,
        "semantic_label": 2**32 - 1,
        "semantic_feature": {"rows": 0, "cols": 0, "data": None},
        "is_active": False,
        "is_predicted": False,
        "last_update_time_ns": 0,
        "metadata": {"bsg": said} if said else {},
    }
    place = {"layer": _LAYERS[layer], "partition": 0}
    return {"attributes": attributes, "id": _symbol(layer, number), **place}


def _encode_edge(layer: str, number: int, other: str, place: int) -> dict[str, Any]:
    info = {"type": "EdgeAttributes", "weight": 1.0, "weighted": False, "metadata": {}}
    return {"source": _symbol(layer, number), "target": _symbol(other, place), "info": info}


def _symbol(layer: str, number: int) -> int:
    return ord(_SYMBOLS[layer]) << 56 | number
