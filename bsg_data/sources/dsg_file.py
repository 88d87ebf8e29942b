"""Spark-DSG JSON as Hydra writes it: nodes in layers, edges, and names of labels.

Objects are layer 2, places 3, rooms 4, buildings 5, unless `layer_names` says otherwise; the
agents, which share layer 2, are another partition of it or of another type. A node's id is a
symbol: a letter in the highest byte, and a number below it. What metadata say under `bsg` is kept
as it is; the mesh and all else of a file are left alone. Metres; the axes of the robot's map, z up.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import Field

from bsg_data.errors import SourceError
from bsg_data.inputs.bounds import MAX_GRAPH_EDGES, MAX_GRAPH_LABELS, MAX_GRAPH_NODES
from bsg_data.records import ForeignRecord, Keyed, Listed, Metres
from bsg_data.scene.scene_graph import Box, Point
from bsg_data.sources.annotation_files import validate

_LAYERS = {"OBJECTS": 2, "ROOMS": 4}
_AGENT = "AgentNodeAttributes"
_SYMBOL = re.compile(r"[A-Za-z]\([0-9]+\)")  # the name of a node that nobody named
_NO_LABEL = 2**32 - 1
_BOX_TYPES = ("INVALID", "AABB", "OBB", "RAABB")  # older files have their numbers
_INDEX = 2**56 - 1

_Number = Annotated[int, Field(ge=0, lt=2**64, strict=True)]
_Small = Annotated[int, Field(ge=-(2**31), lt=2**32, strict=True)]
_Triple = tuple[Metres | None, Metres | None, Metres | None]  # null stands for what is not finite


class _Quaternion(ForeignRecord):
    w: Annotated[float, Field(ge=-1.01, le=1.01)] = 1.0
    x: Annotated[float, Field(ge=-1.01, le=1.01)] = 0.0
    y: Annotated[float, Field(ge=-1.01, le=1.01)] = 0.0
    z: Annotated[float, Field(ge=-1.01, le=1.01)] = 0.0


class _BoundingBox(ForeignRecord):
    type: str | int = "INVALID"
    min: _Triple | None = None
    max: _Triple | None = None
    dimensions: _Triple | None = None
    centre: Annotated[_Triple | None, Field(alias="world_P_center")] = None
    turn: Annotated[_Quaternion, Field(alias="world_R_center")] = _Quaternion()


class _Attributes(ForeignRecord):
    type: Annotated[str, Field(max_length=200)] = ""
    name: Annotated[str, Field(max_length=1000)] = ""
    position: _Triple | None = None
    semantic_label: _Small | None = None
    bounding_box: _BoundingBox | None = None
    metadata: dict[str, Any] | None = None


class _Node(ForeignRecord):
    id: _Number
    layer: _Small
    partition: _Small = 0
    attributes: _Attributes


class _Edge(ForeignRecord):
    source: _Number
    target: _Number


class _LayerKey(ForeignRecord):
    layer: _Small
    partition: _Small = 0


_Labels = Annotated[Listed[tuple[_Small, str]], Field(max_length=MAX_GRAPH_LABELS)]


class _Metadata(ForeignRecord):
    labelspaces: Keyed[str, _Labels] = Field(default_factory=dict)
    bsg: Any = None


class _Graph(ForeignRecord):
    nodes: Annotated[Listed[_Node], Field(max_length=MAX_GRAPH_NODES)]
    edges: Annotated[Listed[_Edge], Field(max_length=MAX_GRAPH_EDGES)]
    layer_names: Keyed[str, _LayerKey | _Small] = Field(default_factory=dict)
    layer_ids: Listed[_Small] = ()
    layer_keys: Listed[_LayerKey] = ()
    metadata: _Metadata | None = None


@dataclass(frozen=True, slots=True)
class DSGNode:
    """A node of a robot's graph."""

    id: int  # its symbol as a number, unique in the file
    index: int  # the number of its symbol, 3 of `O(3)`; its rank among its kind if numbers repeat
    name: str | None  # its own; None if that is its symbol, or empty
    label: int | None  # the number of its label; None without one
    label_name: str | None  # the name that the file has for its label; None without one
    position: Point | None  # metres; None where it is not finite
    box: Box | None  # axis-aligned, around the node's own; metres; None without one
    room: int | None = None  # number of its room among the rooms; None without one, and for rooms
    # what its metadata say under `bsg`; empty without
    bsg: Mapping[str, Any] = field(default_factory=dict)

    @property
    def symbol(self) -> str:
        """Its symbol as Spark-DSG writes it, `R(3)`."""
        return name_symbol(self.id)


@dataclass(frozen=True, slots=True)
class DSGFile:
    """What a robot's graph says of a building."""

    rooms: tuple[DSGNode, ...]  # in the order of their ids
    objects: tuple[DSGNode, ...]  # in the order of their ids
    adjacency: tuple[tuple[int, int], ...]  # pairs of numbers of rooms, ascending and once each
    links: int = 0  # edges between two objects, of which neither is the parent
    lost: int = 0  # edges to nodes that are not there, which are left out
    # what its metadata say under `bsg`; empty without
    bsg: Mapping[str, Any] = field(default_factory=dict)


def name_symbol(number: int) -> str:
    """Return a node's id as Spark-DSG writes it: a letter, and a number in brackets.

    >>> name_symbol(ord("R") << 56 | 3), name_symbol(3)
    ('R(3)', '3')
    """
    letter = chr(number >> 56)
    return f"{letter}({number & _INDEX})" if letter.isascii() and letter.isalpha() else str(number)


def parse_dsg(document: Any, *, path: Path) -> DSGFile:
    """Parse the JSON document of a Spark-DSG file; the path is named in errors."""
    expected = "a Spark-DSG graph"
    graph = validate(_Graph, document, where=path, expected=expected, code="dsg-malformed")
    known = {node.id for node in graph.nodes}
    if fault := _find_fault(graph, known):
        raise SourceError(f"{path}: {fault}", code="dsg-malformed", where=path)
    edges = [edge for edge in graph.edges if edge.source in known and edge.target in known]
    rooms, objects = (_nodes_of(graph, name) for name in ("ROOMS", "OBJECTS"))
    number_of = {node.id: number for number, node in enumerate(rooms)}
    room_of = _find_rooms(graph, _find_parents(graph.nodes, edges), number_of)
    ends = [(number_of.get(edge.source), number_of.get(edge.target)) for edge in edges]
    things = {node.id for node in objects}
    joined = {(min(a, b), max(a, b)) for a, b in ends if a is not None and b is not None}
    return DSGFile(
        rooms=tuple(_describe(rooms, graph, {})),
        objects=tuple(_describe(objects, graph, room_of)),
        adjacency=tuple(sorted((a, b) for a, b in joined if a != b)),
        links=sum(edge.source in things and edge.target in things for edge in edges),
        lost=len(graph.edges) - len(edges),
        bsg=_as_mapping(graph.metadata.bsg if graph.metadata else None),
    )


def _find_fault(graph: _Graph, known: Collection[int]) -> str:
    if not (graph.nodes or graph.layer_names or graph.layer_ids or graph.layer_keys):
        return (
            "expected a robot's graph, found neither nodes nor layers: a Spark-DSG graph lists its "
            "layers, also one without nodes; our JSON has `rooms`"
        )
    twice = len(known) < len(graph.nodes)
    return "expected nodes with an id each, found an id twice" if twice else ""


def _as_mapping(entries: Any) -> dict[str, Any]:
    return entries if isinstance(entries, dict) else {}


def _nodes_of(graph: _Graph, name: str) -> list[_Node]:
    """Return the nodes of a layer by their ids, without agents."""
    key = graph.layer_names.get(name, _LAYERS[name])
    layer, partition = (key.layer, key.partition) if isinstance(key, _LayerKey) else (key, 0)
    found = [
        node
        for node in graph.nodes
        if (node.layer, node.partition) == (layer, partition) and node.attributes.type != _AGENT
    ]
    return sorted(found, key=lambda node: node.id)


def _find_parents(nodes: Iterable[_Node], edges: Iterable[_Edge]) -> dict[int, int]:
    """Return the parent of every node that has one: the node of a higher layer, by an edge."""
    layer = {node.id: node.layer for node in nodes}
    parents: dict[int, int] = {}
    for edge in edges:
        child, parent = sorted((edge.source, edge.target), key=layer.__getitem__)
        if layer[child] < layer[parent]:
            parents[child] = min(parent, parents.get(child, parent))
    return parents


def _find_rooms(
    graph: _Graph, above: Mapping[int, int], number_of: Mapping[int, int]
) -> dict[int, int]:
    """Return node → number of the first room above it, by way of places; layers only rise."""
    found: dict[int, int] = {}
    for node in sorted(graph.nodes, key=lambda node: -node.layer):
        parent = above.get(node.id, node.id)
        room = number_of.get(parent, found.get(parent))
        if parent != node.id and room is not None:
            found[node.id] = room
    return found


def _describe(nodes: list[_Node], graph: _Graph, room_of: Mapping[int, int]) -> Iterator[DSGNode]:
    indices = [node.id & _INDEX for node in nodes]
    if len(set(indices)) < len(indices) or max(indices, default=0) >= 2**31:
        indices = list(range(len(nodes)))
    spaces = graph.metadata.labelspaces if graph.metadata else {}
    names = {space: dict(labels) for space, labels in spaces.items()}
    for node, index in zip(nodes, indices, strict=True):
        attributes = node.attributes
        label = None if attributes.semantic_label == _NO_LABEL else attributes.semantic_label
        named = names.get(f"_l{node.layer}p{node.partition}", {})
        name = attributes.name.strip()
        yield DSGNode(
            id=node.id,
            index=index,
            name=None if _SYMBOL.fullmatch(name) or not name else name,
            label=label,
            label_name=None if label is None else named.get(label) or None,
            position=_point(attributes.position),
            box=None if attributes.bounding_box is None else _enclose(attributes.bounding_box),
            room=room_of.get(node.id),
            bsg=_as_mapping((attributes.metadata or {}).get("bsg")),
        )


def _point(values: _Triple | None) -> Point | None:
    if values is None:
        return None
    x, y, z = (math.nan if value is None else value for value in values)
    return (x, y, z) if math.isfinite(x + y + z) else None


def _enclose(box: _BoundingBox) -> Box | None:
    """Return the axis-aligned box around a box; None for an invalid one.

    Newer files have `dimensions` around `world_P_center`. Older ones have `min` and `max`, which
    are the box itself if it is axis-aligned, and else its corners before it is turned and moved.
    """
    kind = box.type
    if isinstance(kind, int):
        kind = _BOX_TYPES[kind] if 0 <= kind < len(_BOX_TYPES) else "INVALID"
    size, centre = _point(box.dimensions), _point(box.centre)
    low, high = _point(box.min), _point(box.max)
    if size is not None:
        ends = np.array([[-0.5], [0.5]]) * size
    elif low and high:
        ends = np.array([low, high])
    else:
        return None
    if size is not None or kind != "AABB":
        if centre is None or kind not in _BOX_TYPES[1:]:
            return None
        turn = np.eye(3) if kind == "AABB" else _rotation(box.turn)
        ends = ends[_CORNERS, range(3)] @ turn.T + np.array(centre)
    return Box.around(ends)


_CORNERS = np.array([*product((0, 1), repeat=3)])


def _rotation(turn: _Quaternion) -> npt.NDArray[np.float64]:
    """Return the rotation of a quaternion as a matrix `[3, 3]`; an empty one turns nothing."""
    q = np.array([turn.w, turn.x, turn.y, turn.z])
    length = float(np.linalg.norm(q))
    if length < 1e-6:
        return np.eye(3)
    w, x, y, z = q / length
    rows: Any = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows)
