"""Define the one document of a belief graph: JSON, from which tables and networkx are derived."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError

from bsg_data.errors import MismatchError
from bsg_data.files import encode_json, write_bytes
from bsg_data.inputs.bounds import BELIEF
from bsg_data.inputs.documents import read_json
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import encode_robot_graph, parse_classified_graph
from bsg_data.recipes import Record, name_fault
from bsg_data.scene.class_space import ClassSpace, list_class_spaces, load_class_space
from bsg_models.belief.belief_graph import BeliefGraph, BlindNode, Mode
from bsg_models.belief.formats import FormatRow
from bsg_models.errors import BeliefFileError

FORMAT, VERSION = "bsg-belief-graph", 1

Count = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Probability = Annotated[float, Field(ge=0, le=1)]


class _Blind(Record):
    room: int = Field(ge=1)
    class_name: str = Field(alias="class")
    expected: Count
    presence: Probability


class _Document(Record):
    format: str
    version: int
    model: str
    mode: Mode
    class_space: ClassSpace
    partial: dict[str, Any]
    expected: list[list[Count]]
    presence: list[list[Probability]]
    blind: tuple[_Blind, ...]


def encode_belief(belief: BeliefGraph) -> dict[str, Any]:
    """Return a belief graph as a JSON document; `decode_belief` reads it back."""
    classes = belief.partial.class_space.classes
    return {
        "format": FORMAT,
        "version": VERSION,
        "model": belief.model,
        "mode": belief.mode,
        "class_space": belief.partial.class_space.model_dump(mode="json"),
        "partial": encode_robot_graph(belief.partial),
        "expected": belief.expected.tolist(),
        "presence": belief.presence.tolist(),
        "blind": [
            {
                "room": node.room_index,
                "class": classes[node.class_index],
                "expected": node.expected,
                "presence": node.presence,
            }
            for node in belief.blind
        ],
    }


def list_nodes(document: dict[str, Any]) -> Iterator[tuple[int | None, dict[str, Any]]]:
    """Yield the parent and the attributes of the nodes of a document, in their order.

    The building has the number 0; rooms, objects and blind nodes follow. Histograms are left out.
    """
    partial, rooms = document["partial"], {None: 0}
    facts = ("hidden_share", "building_kind", "source")
    yield None, {"kind": "building", **{name: partial[name] for name in facts}}
    for number, room in enumerate(partial["rooms"], 1):
        rooms[room["id"]] = number
        yield 0, {"kind": "room", **room}
    for obj in partial["objects"]:
        yield rooms[obj["room"]], {"kind": "object", **obj}
    for node in document["blind"]:
        yield node["room"], {"kind": "blind", **{key: node[key] for key in node if key != "room"}}


def list_edges(document: dict[str, Any]) -> Iterator[tuple[int, int, str]]:
    """Yield the edges (source, target, kind) of a document; adjacency in both directions."""
    for number, (parent, node) in enumerate(list_nodes(document)):
        if parent is not None:
            yield parent, number, "expects" if node["kind"] == "blind" else "contains"
    rooms = {room["id"]: number for number, room in enumerate(document["partial"]["rooms"], 1)}
    for a, b in document["partial"]["adjacency"]:
        yield rooms[a], rooms[b], "adjacent"
        yield rooms[b], rooms[a], "adjacent"


def decode_belief(document: Any, *, path: Path) -> BeliefGraph:
    """Return the belief graph of a JSON document.

    Raises:
        BeliefFileError: naming what is wrong with it.
        MismatchError: if its class space has changed since.
    """
    try:
        entries = _Document.model_validate(document)
    except ValidationError as error:
        raise BeliefFileError(
            f"{path}: {name_fault(error)}", code="belief-malformed", where=path
        ) from error
    if (entries.format, entries.version) != (FORMAT, VERSION):
        raise BeliefFileError(
            f"{path}: expected {FORMAT} {VERSION}, found {entries.format} {entries.version}; make "
            "it again with bsg-belief",
            code="version-foreign",
            where=path,
        )
    space = entries.class_space
    if space.name in list_class_spaces() and load_class_space(space.name) != space:
        raise MismatchError(
            f"{path}: class space {space.name} is not the published one",
            code="class-space-changed",
            where=path,
        )
    partial = parse_classified_graph(entries.partial, path=path, class_space=space)
    return _assemble(entries, partial, path)


def _assemble(entries: _Document, partial: PartialGraph, path: Path) -> BeliefGraph:
    fault = _find_fault(entries, partial)
    if fault is not None:
        raise BeliefFileError(f"{path}: {fault}", code="belief-inconsistent", where=path)
    index = {name: number for number, name in enumerate(entries.class_space.classes)}
    blind = (
        BlindNode(node.room, index[node.class_name], node.expected, node.presence)
        for node in entries.blind
    )
    tables = np.array(entries.expected), np.array(entries.presence)
    return BeliefGraph(partial, *tables, tuple(blind), entries.mode, entries.model)


def _find_fault(entries: _Document, partial: PartialGraph) -> str | None:
    """Return why beliefs do not belong to their partial graph."""
    rooms, classes = len(partial.rooms), entries.class_space.classes
    for table in (entries.expected, entries.presence):
        if len(table) != rooms + 1 or any(len(row) != len(classes) for row in table):
            return f"expected histograms of {rooms + 1} × {len(classes)}"
    if (np.array(entries.expected) < partial.histograms()).any():
        return "fewer objects are expected than were seen"
    for node in entries.blind:
        if node.room > rooms:
            return f"a blind node in room {node.room}; rooms are 1 to {rooms}"
        if node.class_name not in classes:
            return f"a blind node of {node.class_name!r}, which is no class"
    return None


def write_document(belief: BeliefGraph, path: Path) -> None:
    """Write a belief graph as JSON. A failed write leaves no partial file."""
    text = encode_json(encode_belief(belief), ensure_ascii=False, separators=(",", ":"))
    write_bytes(path, text.encode())


def read_document(path: Path) -> BeliefGraph:
    """Read a belief graph from JSON.

    Raises:
        BeliefFileError: if it cannot be read.
    """
    return decode_belief(read_json(path, BELIEF, error=BeliefFileError), path=path)


JSON = FormatRow("json", (".json",), write=write_document, read=read_document)
