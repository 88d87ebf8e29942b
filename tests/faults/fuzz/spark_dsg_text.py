"""Spark-DSG in JSON: `bsg_data.sources.spark_dsg` and `bsg_models.belief`."""

from __future__ import annotations

from pathlib import Path

from bsg_data.sources.spark_dsg import RobotGraphs
from bsg_models.belief.annotation import annotate, strip_annotation
from bsg_models.belief.graph_file import open_graph_file
from bsg_models.belief.hydra import read_hydra_belief
from bsg_models.errors import HydraError
from fuzz.belief_json import make_belief
from fuzz.target import Target, encode, load_map, put, read_source

_KITCHEN, _HALL, _PLACE, _CHAIR = (
    ord(c) << 56 | n for c, n in (("R", 0), ("R", 3), ("p", 0), ("O", 2))
)
_GRAPH = {
    "nodes": [
        {
            "id": _KITCHEN,
            "layer": 4,
            "partition": 0,
            "attributes": {
                "name": "kitchen",
                "position": [1, 1, 1],
                "bounding_box": {
                    "type": "AABB",
                    "world_P_center": [2, 1, 1],
                    "dimensions": [4, 2, 2],
                },
                "metadata": {"bsg": {"hidden_share": 0.5, "floor_area": 12}},
            },
        },
        {"id": _HALL, "layer": 4, "attributes": {"name": "R(3)", "position": [5, 1, None]}},
        {"id": _PLACE, "layer": 3, "attributes": {}},
        {
            "id": _CHAIR,
            "layer": 2,
            "attributes": {
                "name": "chair_1",
                "semantic_label": 7,
                "position": [1, 1, 1],
                "bounding_box": {
                    "type": "RAABB",
                    "world_P_center": [3, 1, 1],
                    "dimensions": [2, 1, 1],
                    "world_R_center": {"w": 0.5, "x": 0, "y": 0, "z": 0.5},
                },
                "color": {"r": 1, "g": 2, "b": 3, "a": 255},
            },
        },
    ],
    "edges": [
        {"source": _KITCHEN, "target": _PLACE, "info": {"weight": 1.0}},
        {"source": _PLACE, "target": _CHAIR},
        {"source": _KITCHEN, "target": _HALL},
    ],
    "layer_names": {"OBJECTS": {"layer": 2, "partition": 0}, "ROOMS": 4},
    "layer_ids": [2, 3, 4, 5],
    "metadata": {"labelspaces": {"_l2p0": [[7, "sofa"]]}, "bsg": {"partial": {"scene_id": "s"}}},
}


def seeds() -> dict[str, bytes]:
    """Return a graph, and the same with a belief graph in it."""
    belief = make_belief(("kitchen", "hall"))
    annotated = annotate(_GRAPH, belief, rooms=[_KITCHEN, _HALL], objects=[_CHAIR])
    return {"graph": encode(_GRAPH), "annotated": encode(annotated)}


def read(folder: Path, data: bytes) -> object:
    """Read a graph as a robot's, as a source, without what was put in, and as a belief graph."""
    path, class_map = put(folder, ".json", data), load_map()
    opened = open_graph_file(path, class_map=class_map)
    if opened.hydra is not None:
        strip_annotation(opened.hydra.document)
        read_source(RobotGraphs(path), class_map)
    try:
        return read_hydra_belief(path)
    except HydraError:
        return None


TARGET = Target(
    name="spark-dsg",
    read=read,
    seeds=seeds,
    words=("labelspaces", "bsg", "partial", "belief", "blind", "layer_names", "mesh", "partition"),
    most=8_000,
)
