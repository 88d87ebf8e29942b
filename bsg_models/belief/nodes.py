"""Convert a belief graph to nodes with attributes, as networkx and Spark-DSG hold them.

Nodes are numbered: 0 the building, then rooms, objects and blind nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from bsg_data.observation.robot_json import encode_robot_graph
from bsg_models.belief.belief_graph import BeliefGraph, BlindNode
from bsg_models.belief.consistency import check_beliefs
from bsg_models.belief.header import Header, decode_whole_header, parse_partial
from bsg_models.errors import BeliefFileError

Kind = Literal["building", "room", "object", "blind"]
EdgeKind = Literal["contains", "expects", "adjacent"]
Attributes = Mapping[str, Any]
KINDS: tuple[Kind, ...] = ("building", "room", "object", "blind")  # in the order of their numbers


@dataclass(frozen=True, slots=True)
class Node:
    """A node of a belief graph.

    Attributes:
        kind: building, room, object or blind.
        parent: number of the node that contains or expects it; None for the building.
        attributes: its kind, and everything known or believed about it, ready for JSON.
    """

    kind: Kind
    parent: int | None
    attributes: Attributes


def encode_nodes(belief: BeliefGraph) -> Iterator[Node]:
    """Yield the nodes of a belief graph in the order of their numbers."""
    partial, classes = belief.partial, belief.partial.class_space.classes
    document = encode_robot_graph(partial)
    for number, room in enumerate([{}, *document["rooms"]]):
        kind: Kind = "room" if number else "building"
        beliefs = {
            "expected": belief.expected[number].tolist(),
            "presence": belief.presence[number].tolist(),
        }
        yield Node(kind, 0 if number else None, {"kind": kind, **room, **beliefs})
    for obj, entry in zip(partial.objects, document["objects"], strict=True):
        yield Node("object", obj.room_index, {"kind": "object", **entry})
    for node in belief.blind:
        blind = {"class": classes[node.class_index], "expected": node.expected}
        attributes = {"kind": "blind", **blind, "presence": node.presence}
        yield Node("blind", node.room_index, attributes)


def encode_edges(belief: BeliefGraph, nodes: Sequence[Node]) -> Iterator[tuple[int, int, EdgeKind]]:
    """Yield the edges (source, target, kind) of a belief graph, adjacency once."""
    for number, node in enumerate(nodes):
        if node.parent is not None:
            yield node.parent, number, "expects" if node.kind == "blind" else "contains"
    for a, b in belief.partial.adjacency:
        yield a, b, "adjacent"


def decode_nodes(
    header: Any,
    nodes: Sequence[Attributes],
    edges: Sequence[tuple[int, int, str]],
    *,
    path: Path,
) -> BeliefGraph:
    """Return the belief graph of `encode_nodes` and `encode_edges`.

    Args:
        header: of `encode_whole_header`.
        nodes: attributes in the order of the nodes' numbers.
        edges: (source, target, kind).
        path: their origin, for errors.

    Raises:
        BeliefFileError: if they do not form a belief graph.
    """
    checked = decode_whole_header(header, path=path)
    try:
        belief = _assemble(checked, nodes, edges, path)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise BeliefFileError(f"{path}: expected nodes of a belief graph ({error!r})") from error
    check_beliefs(belief, path=path)
    return belief


def _assemble(
    header: Header, nodes: Sequence[Attributes], edges: Sequence[tuple[int, int, str]], path: Path
) -> BeliefGraph:
    by_kind = {kind: [node for node in nodes if node["kind"] == kind] for kind in KINDS}
    if [node for kind in KINDS for node in by_kind[kind]] != list(nodes):
        raise BeliefFileError(f"{path}: expected nodes in the order {', '.join(KINDS)}")
    (building,) = by_kind["building"]
    rooms = by_kind["room"]
    document = {
        **header.partial.model_dump(),
        "rooms": [_without(room, "kind", "expected", "presence") for room in rooms],
        "objects": [_without(obj, "kind") for obj in by_kind["object"]],
        "adjacency": [
            [rooms[a - 1]["id"], rooms[b - 1]["id"]] for a, b, kind in edges if kind == "adjacent"
        ],
    }
    partial = parse_partial(
        document, path=path, class_space=header.class_space, class_map=header.class_map
    )
    room_of = {target: source for source, target, kind in edges if kind == "expects"}
    class_index = {name: index for index, name in enumerate(header.class_space.classes)}
    blind = tuple(
        BlindNode(
            room_of[number],
            class_index[node["class"]],
            float(node["expected"]),
            float(node["presence"]),
        )
        for number, node in enumerate(by_kind["blind"], len(nodes) - len(by_kind["blind"]))
    )
    expected, presence = (
        np.array([node[name] for node in (building, *rooms)], dtype=np.float64)
        for name in ("expected", "presence")
    )
    return BeliefGraph(partial, expected, presence, blind, header.mode, header.model)


def _without(attributes: Attributes, *names: str) -> dict[str, Any]:
    return {key: value for key, value in attributes.items() if key not in names}
