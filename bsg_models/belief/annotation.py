"""Write a belief graph into the text of an existing Spark-DSG graph, and remove it again.

    annotate(text, …)        the same text, byte for byte, with the belief added
    strip_annotation(text)   the same text without it

The belief graph goes under `metadata.bsg.belief` of the graph. Each room gets its histograms and
each object its class there, too. Blind nodes get a layer of their own, with an edge to the room
where each is expected. Every `belief` lists in `added` which keys were added, so that the user's
own content under `bsg` stays.
"""

from __future__ import annotations

import math
import string
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bsg_data.files import encode_json
from bsg_data.sources.dsg_file import name_symbol
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.document import encode_belief
from bsg_models.belief.json_text import (
    Edit,
    Part,
    append_parts,
    apply_edits,
    cut_parts,
    find_member,
    find_start,
    list_parts,
)
from bsg_models.errors import HydraError

BLIND_LAYER = "BLIND"
_WAY = ("metadata", "bsg", "belief")  # path of a belief in a graph, or in a node's attributes
_SYMBOLS = "xyz" + string.ascii_letters  # Hydra uses a, b, … for robots, and B, O, p, R, s, t
_COLOUR = (0, 204, 0)  # of blind nodes in the paper's figures
_NO_LABEL = 2**32 - 1
_NO_TURN = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}
_NOWHERE = [0.0, 0.0, 0.0]
# Older readers need corners, newer ones a size; both ignore unknown keys.
_NO_BOX = {
    "type": "INVALID",
    "min": _NOWHERE,
    "max": _NOWHERE,
    "dimensions": _NOWHERE,
    "world_P_center": _NOWHERE,
    "world_R_center": _NO_TURN,
}


@dataclass(frozen=True, slots=True)
class _Text:
    """The text of a graph, its start, and its members."""

    text: str
    start: int
    parts: tuple[Part, ...]

    @classmethod
    def of(cls, text: str) -> _Text:
        start = find_start(text)
        return cls(text, start, list_parts(text, start))

    def items(self, key: str) -> tuple[Part, ...]:
        """Return the items of a list, or the members of an object; empty if it is missing."""
        member = find_member(self.parts, key)
        return () if member is None else list_parts(self.text, member.start)

    def append(self, key: str, added: Sequence[str]) -> Iterator[Edit]:
        """Yield the edit that adds items to an existing list."""
        member = find_member(self.parts, key)
        if member is not None and added:
            yield append_parts(self.text, member.start, self.items(key), added)

    def attributes(self, node: Part) -> int:
        """Return the start of a node's attributes."""
        members = list_parts(self.text, node.start)
        return [part.start for part in members if part.key == "attributes"][-1]


def annotate(
    text: str, belief: BeliefGraph, *, rooms: Sequence[int], objects: Sequence[int | None]
) -> str:
    """Return the text of a graph with a belief graph in it; an older belief is replaced.

    Args:
        text: of a Spark-DSG graph.
        belief: about its content.
        rooms: ids of its rooms in the text, in the order of the belief graph.
        objects: ids of its objects, likewise; None for objects that are not in the text.

    Raises:
        HydraError: if something else stands at the place of a belief.
    """
    graph = _strip(_Text.of(text))
    nodes = {node.value["id"]: node for node in graph.items("nodes")}
    layer, name = _choose_layer(graph, nodes[rooms[0]].value["layer"] if rooms else 1)
    prefix = _choose_symbol(nodes)
    blind = [prefix << 56 | number for number in range(len(belief.blind))]
    record = {"layer": {"id": layer, "name": name}, "document": encode_belief(belief)}
    edits = [_say(graph.text, graph.start, graph.parts, record, "the graph")]
    for node, said in _describe(belief, rooms, objects):
        start = graph.attributes(nodes[node])
        parts = list_parts(graph.text, start)
        edits.append(_say(graph.text, start, parts, said, f"node {name_symbol(node)}"))
    if blind:
        added = _encode_blind(belief, [nodes[room].value for room in rooms], blind, layer)
        edits += graph.append("nodes", added)
        edits += graph.append("edges", _encode_edges(belief, rooms, blind))
        edits += graph.append("layer_ids", [str(layer)])
        edits += graph.append("layer_keys", [_dump({"layer": layer, "partition": 0})])
        edits += graph.append("layer_names", [_name_layer(graph, layer, name)])
    return apply_edits(graph.text, edits)


def strip_annotation(text: str) -> str:
    """Return the text of a graph as it was before `annotate`; without a belief, the text itself."""
    return _strip(_Text.of(text)).text


def _strip(graph: _Text) -> _Text:
    nodes, edges = graph.items("nodes"), graph.items("edges")
    marks = [_find_belief(node.value.get("attributes")) for node in nodes]
    blind = {place for place, mark in enumerate(marks) if mark and mark.get("kind") == "blind"}
    ids = {nodes[place].value["id"] for place in blind}
    edits = cut_parts(nodes, blind)
    edits += cut_parts(
        edges,
        [n for n, edge in enumerate(edges) if {edge.value["source"], edge.value["target"]} & ids],
    )
    for place, mark in enumerate(marks):
        if mark is not None and place not in blind:
            start = graph.attributes(nodes[place])
            edits += _unsay(graph.text, list_parts(graph.text, start))
    record = _find_belief({part.key: part.value for part in graph.parts})
    if record is not None:
        edits += _unsay(graph.text, graph.parts)
        if blind:
            edits += _cut_layer(graph, record.get("layer"))
    return _Text.of(apply_edits(graph.text, edits)) if edits else graph


def find_document(graph: Any) -> Any:
    """Return the document of the belief graph that `annotate` added; None without one."""
    record = _find_belief(graph)
    return None if record is None else record.get("document")


def _find_belief(held: Any) -> Mapping[str, Any] | None:
    """Return what `annotate` added under `metadata.bsg.belief` of a graph or a node.

    Blind nodes are added as a whole; their kind says so.
    """
    for key in _WAY:
        held = held.get(key) if isinstance(held, dict) else None
    if not isinstance(held, dict):
        return None
    return held if held.get("added") in _WAY or held.get("kind") == "blind" else None


def _say(
    text: str, start: int, parts: Sequence[Part], belief: Mapping[str, Any], where: str
) -> Edit:
    """Return the edit that adds a belief, and the objects around it, to the object at `start`."""
    for depth, key in enumerate(_WAY):
        found = find_member(parts, key)
        if found is None:
            break
        if not isinstance(found.value, dict):
            path, there = ".".join(_WAY[: depth + 1]), text[found.start : found.end][:40]
            raise HydraError(f"{where}: {path}: expected an object, found {there}")
        if depth == len(_WAY) - 1:
            raise HydraError(
                f"{where}: {'.'.join(_WAY)} is there already, and this program did not write it; "
                "rename it"
            )
        start, parts = found.start, list_parts(text, found.start)
    said: Any = {"added": key, **belief}
    for inner in reversed(_WAY[depth + 1 :]):
        said = {inner: said}
    return append_parts(text, start, parts, [f"{_dump(key)}:{_dump(said)}"])


def _unsay(text: str, parts: Sequence[Part]) -> list[Edit]:
    """Return the edits that remove a belief from the object with these parts.

    Objects that were added around it are removed too, unless they hold something else.
    """
    ways: list[tuple[Sequence[Part], int]] = []
    for key in _WAY:
        place = max(number for number, part in enumerate(parts) if part.key == key)
        ways.append((parts, place))
        held = parts[place]
        parts = list_parts(text, held.start)
    added, depth = held.value.get("added"), len(_WAY) - 1
    while added in _WAY[:depth] and len(ways[depth][0]) == 1:
        depth -= 1
    parts, place = ways[depth]
    return cut_parts(parts, [place])


def _describe(
    belief: BeliefGraph, rooms: Sequence[int], objects: Sequence[int | None]
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield the belief about each room and object, by its id in the file."""
    classes = belief.partial.class_space.classes
    for number, node in enumerate(rooms, 1):
        expected, presence = belief.expected[number].tolist(), belief.presence[number].tolist()
        yield (
            node,
            {
                "expected": dict(zip(classes, expected, strict=True)),
                "presence": dict(zip(classes, presence, strict=True)),
            },
        )
    for place, obj in zip(objects, belief.partial.objects, strict=True):
        if place is not None:
            name = None if obj.class_index is None else classes[obj.class_index]
            yield place, {"category": obj.category, "class": name}


def _encode_blind(
    belief: BeliefGraph, rooms: Sequence[Mapping[str, Any]], ids: Sequence[int], layer: int
) -> list[str]:
    """Return the texts of blind nodes: predicted objects, at the position of their room."""
    classes = belief.partial.class_space.classes
    texts = []
    for node, number in zip(belief.blind, ids, strict=True):
        room = rooms[node.room_index - 1]["attributes"]
        believed = {
            "kind": "blind",
            "class": classes[node.class_index],
            "expected": node.expected,
            "presence": node.presence,
        }
        attributes = {
            "type": "ObjectNodeAttributes",
            "name": classes[node.class_index],
            "position": _place(room.get("position")),
            "color": _colour_like(room.get("color")),
            "bounding_box": _NO_BOX,
            "semantic_label": _NO_LABEL,
            "is_active": False,
            "is_predicted": True,
            "last_update_time_ns": 0,
            "mesh_connections": [],
            "registered": False,
            "world_R_object": _NO_TURN,
            "metadata": {"bsg": {"belief": believed}},
        }
        texts.append(
            _dump({"attributes": attributes, "id": number, "layer": layer, "partition": 0})
        )
    return texts


def _place(position: Any) -> Any:
    """Return a position, or the origin if it is not finite (null or `NaN`)."""
    finite = isinstance(position, list) and all(
        isinstance(value, int | float) and math.isfinite(value) for value in position
    )
    return position if finite else _NOWHERE


def _colour_like(colour: Any) -> Any:
    """Return the colour of blind nodes in the file's own notation: a list, or by letters."""
    if isinstance(colour, dict):
        return dict(zip("rgb", _COLOUR, strict=True)) | ({"a": 255} if "a" in colour else {})
    return list(_COLOUR)


def _encode_edges(belief: BeliefGraph, rooms: Sequence[int], ids: Sequence[int]) -> list[str]:
    info = {"type": "EdgeAttributes", "weight": 1.0, "weighted": False}
    return [
        _dump({"info": info, "source": rooms[node.room_index - 1], "target": number})
        for node, number in zip(belief.blind, ids, strict=True)
    ]


def _choose_layer(graph: _Text, rooms: int) -> tuple[int, str]:
    """Return id and name of an unused layer below the rooms' layer.

    In Spark-DSG, the node of the higher layer is the parent of an edge. Above the rooms, blind
    nodes would become the rooms' parents, and the building would lose its rooms.
    """
    taken = {node.value["layer"] for node in graph.items("nodes")}
    taken |= {item.value for item in graph.items("layer_ids")}
    taken |= {item.value.get("layer") for item in graph.items("layer_keys")}
    mesh = find_member(graph.parts, "mesh_layer_id")
    taken |= {mesh.value} if mesh else set()
    names = set()
    for part in graph.items("layer_names"):
        names.add(str(part.key))
        taken.add(part.value["layer"] if isinstance(part.value, dict) else part.value)
    free = next((layer for layer in range(rooms) if layer not in taken), None)
    if free is None:
        raise HydraError(
            f"expected a free layer for blind nodes below the rooms', {rooms}; found all taken"
        )
    name = BLIND_LAYER
    while name in names:
        name += "_"
    return free, name


def _name_layer(graph: _Text, layer: int, name: str) -> str:
    """Return the member of `layer_names` for a layer, in the notation of the others."""
    plain = any(isinstance(part.value, int) for part in graph.items("layer_names"))
    return f"{_dump(name)}:{_dump(layer if plain else {'layer': layer, 'partition': 0})}"


def _cut_layer(graph: _Text, layer: Any) -> Iterator[Edit]:
    """Yield the edits that remove a layer of blind nodes from the lists of layers."""
    if not isinstance(layer, dict):
        return
    number, name = layer.get("id"), layer.get("name")

    def cut(key: str, ours: Iterable[bool]) -> Iterator[Edit]:
        yield from cut_parts(graph.items(key), [place for place, it in enumerate(ours) if it])

    key = {"layer": number, "partition": 0}
    yield from cut("layer_ids", (item.value == number for item in graph.items("layer_ids")))
    yield from cut("layer_keys", (item.value == key for item in graph.items("layer_keys")))
    yield from cut("layer_names", (part.key == name for part in graph.items("layer_names")))


def _choose_symbol(ids: Collection[int]) -> int:
    """Return an unused symbol letter, as its number."""
    taken = {number >> 56 for number in ids}
    free = next((ord(letter) for letter in _SYMBOLS if ord(letter) not in taken), None)
    if free is None:
        raise HydraError("expected a free letter for the symbols of blind nodes; found all taken")
    return free


def _dump(value: Any) -> str:
    return encode_json(value, separators=(",", ":"))
