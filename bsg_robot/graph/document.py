"""Define the one document of a belief graph: JSON, from which tables and networkx are derived."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError

from bsg_data.files import encode_json, write_bytes
from bsg_data.inputs.bounds import BELIEF
from bsg_data.inputs.documents import read_json
from bsg_data.records import Listed, SaidRecord, name_fault
from bsg_data.scene.class_space import ClassSpace
from bsg_data.words.shown import SHOWN
from bsg_models.belief.belief_graph import BeliefGraph, BlindNode, Mode
from bsg_models.belief.partial_graph import PartialGraph
from bsg_robot.errors import BeliefFileError
from bsg_robot.graph.formats import FormatRow
from bsg_robot.graph.robot_json import encode_robot_graph, parse_robot_graph

if TYPE_CHECKING:
    import networkx as nx

_HEADER = ("format", "version", "model", "mode", "class_space")
_NO_FACTS = ("format", "version", "scene_id", "rooms", "objects", "adjacency")  # of a building
_Count = Annotated[float, Field(ge=0, allow_inf_nan=False)]
_Probability = Annotated[float, Field(ge=0, le=1)]


class _Blind(SaidRecord):
    room: int = Field(ge=1)
    class_name: str = Field(alias="class")
    expected: _Count
    presence: _Probability
    on: str | None = None


class _Document(SaidRecord):
    format: Literal["bsg-belief-graph"]
    version: Literal[1]
    model: str
    mode: Mode
    class_space: ClassSpace
    partial: dict[str, Any]
    expected: Listed[Listed[_Count]]
    presence: Listed[Listed[_Probability]]
    blind: Listed[_Blind]


def encode_belief(belief: BeliefGraph) -> dict[str, Any]:
    """Return a belief graph as a JSON document; `decode_belief` reads it back."""
    space = belief.partial.class_space
    blind = [
        {
            "room": node.room_index,
            "class": space.classes[node.class_index],
            "expected": node.expected,
            "presence": node.presence,
            **({} if node.on is None else {"on": node.on}),
        }
        for node in belief.blind
    ]
    return {
        "format": "bsg-belief-graph",
        "version": 1,
        "model": belief.model,
        "mode": belief.mode,
        "class_space": space.model_dump(mode="json"),
        "partial": encode_robot_graph(belief.partial),
        "expected": belief.expected.tolist(),
        "presence": belief.presence.tolist(),
        "blind": blind,
    }


def decode_belief(document: Any, *, path: Path) -> BeliefGraph:
    """Return the belief graph of a JSON document; the path is named in errors."""
    try:
        record = _Document.model_validate(document)
        partial = parse_robot_graph(record.partial, path=path, class_map=record.class_space)
        return _assemble(record, partial)
    except ValidationError as error:
        fault = name_fault(error)
        raise BeliefFileError(f"{path}: {fault}", code="belief-malformed", where=path) from error
    except ValueError as error:
        raise BeliefFileError(f"{path}: {error}", code="belief-inconsistent", where=path) from error


def _assemble(record: _Document, partial: PartialGraph) -> BeliefGraph:
    """Return the belief graph; a ValueError says why beliefs do not belong to their graph."""
    seen, classes = partial.histograms(), record.class_space.classes
    for table in (record.expected, record.presence):
        if len(table) != len(seen) or any(len(row) != len(classes) for row in table):
            raise ValueError(f"expected histograms of {len(seen)} × {len(classes)}")
    expected, presence = np.array(record.expected), np.array(record.presence)
    if (expected < seen).any():
        raise ValueError("fewer objects are expected than were seen")
    room_of = {obj.name: obj.room_index for obj in partial.objects}
    for node in record.blind:
        if node.room >= len(seen) or node.class_name not in classes:
            raise ValueError(
                f"a blind node of {node.class_name!r} in room {node.room}: expected known ones"
            )
        if node.on is not None and room_of.get(node.on) != node.room:
            raise ValueError(f"a blind node on {node.on[:SHOWN]!r}, which is not in its room")
    blind = (
        BlindNode(node.room, classes.index(node.class_name), node.expected, node.presence, node.on)
        for node in record.blind
    )
    return BeliefGraph(partial, expected, presence, tuple(blind), record.mode, record.model)


def list_nodes(document: dict[str, Any]) -> Iterator[tuple[int | None, dict[str, Any]]]:
    """Yield the parent and the attributes of the nodes of a document: what tables hold, too.

    The building has the number 0; rooms, objects and blind nodes follow. Histograms are left out.
    """
    partial, rooms = document["partial"], {None: 0}
    facts = {name: partial[name] for name in partial if name not in _NO_FACTS}
    yield None, {"kind": "building", **facts}
    for number, room in enumerate(partial["rooms"], 1):
        rooms[room["id"]] = number
        yield 0, {"kind": "room", **room}
    for obj in partial["objects"]:
        yield rooms[obj.get("room")], {"kind": "object", **obj}
    for node in document["blind"]:
        yield node["room"], {"kind": "blind", **{key: node[key] for key in node if key != "room"}}


def list_edges(document: dict[str, Any]) -> Iterator[tuple[int, int, str]]:
    """Yield the edges (source, target, kind) of a document; adjacency in both directions.

    What lies on an object, seen or expected, has an edge `on` to it.
    """
    nodes = [*list_nodes(document)]
    pieces = {node["id"]: n for n, (_, node) in enumerate(nodes) if node["kind"] == "object"}
    for number, (parent, node) in enumerate(nodes):
        if parent is not None:
            yield parent, number, "expects" if node["kind"] == "blind" else "contains"
        if node.get("on") is not None:
            yield number, pieces[node["on"]], "on"
    rooms = {room["id"]: number for number, room in enumerate(document["partial"]["rooms"], 1)}
    for a, b in document["partial"]["adjacency"]:
        yield rooms[a], rooms[b], "adjacent"
        yield rooms[b], rooms[a], "adjacent"


def to_networkx(belief: BeliefGraph) -> nx.DiGraph:
    """Return a directed graph of building, rooms, objects and blind nodes.

    Nodes are numbered: 0 the building, then rooms, objects and blind nodes. Each has `kind`
    (`building`, `room`, `object` or `blind`) and its attributes; the building and rooms have their
    `expected` and `presence`. Edges have `kind`: `contains`, `expects` (room to blind node) or
    `adjacent` (both directions). `graph.graph` holds model, mode and classes.
    """
    import networkx as nx

    document = encode_belief(belief)
    header = {key: document[key] for key in _HEADER}
    graph = nx.DiGraph(**header, scene_id=belief.partial.scene_id)
    for number, (_, node) in enumerate(list_nodes(document)):
        graph.add_node(number, **node)
    for name in ("expected", "presence"):
        for number, values in enumerate(document[name]):
            graph.nodes[number][name] = values
    graph.add_edges_from((a, b, {"kind": kind}) for a, b, kind in list_edges(document))
    return graph


def write_json(document: Any, path: Path) -> None:
    """Write a document as JSON without white space. A failed write leaves no partial file."""
    write_bytes(path, encode_json(document, ensure_ascii=False, separators=(",", ":")).encode())


def _write(belief: BeliefGraph, path: Path) -> None:
    write_json(encode_belief(belief), path)


def _read(path: Path) -> BeliefGraph:
    return decode_belief(read_json(path, BELIEF, error=BeliefFileError), path=path)


def _write_page(beliefs: Iterable[BeliefGraph], path: Path) -> None:
    from bsg_models.rendering.explorer import ShownBelief, write_explorer  # other formats need none

    write_explorer([ShownBelief(belief) for belief in beliefs], path)


JSON = FormatRow("json", (".json",), write=_write, read=_read)
HTML = FormatRow("html", (".html", ".htm"), write_all=_write_page)
