"""A Spark-DSG graph, written by hand: two rooms, four objects, an agent, and a place each."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

Graph = dict[str, Any]


def symbol(letter: str, number: int) -> int:
    """Return the id of a node: its letter in the highest byte, and its number."""
    return ord(letter) << 56 | number


def node(letter: str, number: int, layer: int, **attributes: Any) -> Graph:
    """Return a node with its symbol as its name."""
    held = {"name": f"{letter}({number})", "position": [number, 0.0, 0.5], **attributes}
    return {"id": symbol(letter, number), "layer": layer, "partition": 0, "attributes": held}


def edge(one: tuple[str, int], other: tuple[str, int]) -> Graph:
    """Return an edge between two symbols."""
    return {"source": symbol(*one), "target": symbol(*other), "info": {"weight": 1.0}}


def box(kind: str, centre: list[float], size: list[float], w: float = 1.0, z: float = 0.0) -> Graph:
    """Return a bounding box as newer files have it, turned about z."""
    turn = {"w": w, "x": 0.0, "y": 0.0, "z": z}
    return {"type": kind, "world_P_center": centre, "dimensions": size, "world_R_center": turn}


def robot_graph() -> Graph:
    """Return the graph: a kitchen, R(0), beside R(3), whose name nobody gave."""
    half = 0.5**0.5
    return {
        "nodes": [
            node("B", 0, 5, name="B(0)"),
            node("R", 0, 4, name="kitchen", bounding_box=box("AABB", [2, 1, 1], [4, 2, 2])),
            node("R", 3, 4, bounding_box={"type": "INVALID"}),
            node("p", 0, 3),
            node("p", 1, 3),
            node("O", 2, 2, semantic_label=7, bounding_box=box("AABB", [1, 1, 1], [2, 1, 1])),
            node(
                "O",
                5,
                2,
                semantic_label=10,
                bounding_box=box("RAABB", [3, 1, 1], [2, 1, 1], w=half, z=half),
            ),
            node("O", 6, 2, name="chair_12", semantic_label=2**32 - 1),
            node("O", 9, 2, semantic_label=99, position=[None, None, None]),
            {
                "id": symbol("a", 1),
                "layer": 2,
                "partition": 97,
                "attributes": {"type": "AgentNodeAttributes", "position": [0, 0, 0]},
            },
        ],
        "edges": [
            edge(("B", 0), ("R", 0)),
            edge(("B", 0), ("R", 3)),
            edge(("R", 3), ("R", 0)),
            edge(("R", 0), ("R", 3)),
            edge(("R", 0), ("p", 0)),
            edge(("p", 0), ("p", 1)),
            edge(("p", 0), ("O", 2)),
            edge(("O", 5), ("p", 0)),
            edge(("p", 1), ("O", 6)),
            edge(("R", 3), ("O", 9)),
        ],
        "metadata": {"labelspaces": {"_l2p0": [[7, "sofa"], [10, "tv_monitor"]]}},
        "mesh": {"vertices": [[0.0, 0.0, 0.0]]},
    }


def write_graph(path: Path, graph: Graph | None = None) -> Path:
    """Write a graph as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(robot_graph() if graph is None else graph), "utf-8")
    return path
