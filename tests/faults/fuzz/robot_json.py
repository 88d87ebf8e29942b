"""A robot's graph in our JSON: `bsg_data.observation.robot_json`."""

from __future__ import annotations

from pathlib import Path

from bsg_data.observation.robot_json import read_robot_graph
from fuzz.target import Target, encode, load_map, put

_GRAPH = {
    "format": "bsg-partial-graph",
    "version": 1,
    "scene_id": "s",
    "hidden_share": 0.5,
    "building_kind": "home",
    "source": "hm3d",
    "rooms": [
        {
            "id": "kitchen",
            "label": "kitchen",
            "position": [0.5, 1, 2],
            "box": [[0, 0, 0], [4, 3, 2.5]],
            "footprint": [[0, 0], [4, 0], [4, 3]],
            "floor_index": 0,
            "floor_area": 12.5,
            "room_type": {"kitchen": 0.75, "bar": 0.25},
            "visited": True,
            "hidden_share": 0.25,
            "hidden_share_sd": 0.125,
        },
        {"id": "hall", "visited": False, "room_type": "hallway"},
        {"id": "bath", "seconds_inside": 5, "floor_in_view": 0.5, "walls_in_view": 0.5},
    ],
    "objects": [
        {"id": "o1", "room": "kitchen", "category": "chair", "position": [1, 1, 1]},
        {"id": "o2", "room": None, "category": "zzqx", "corrected": "chair", "class": "chair"},
    ],
    "adjacency": [["kitchen", "hall"]],
}


def seeds() -> dict[str, bytes]:
    """Return a graph that says all there is to say, one that says nothing, and one with a mark."""
    small = encode({"scene_id": "s", "rooms": []})
    return {"full": encode(_GRAPH), "small": small, "mark": b"\xef\xbb\xbf" + small}


def read(folder: Path, data: bytes) -> object:
    """Read a file."""
    return read_robot_graph(put(folder, "graph.json", data), class_map=load_map())


TARGET = Target(
    name="robot-json",
    read=read,
    seeds=seeds,
    words=(
        "hidden_share",
        "room_type",
        "bsg-belief-graph",
        "partial",
        "withheld",
        "\\ud800",
        "1e9",
    ),
    most=2_000,
)
