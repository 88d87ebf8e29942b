"""Write a belief graph as one JSON document, and read it back without loss."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError

from bsg_data.dataset.manifest import ClassSpaceEntry
from bsg_data.files import encode_json, write_bytes
from bsg_data.inputs.bounds import BELIEF
from bsg_data.inputs.documents import read_json
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import encode_robot_graph
from bsg_data.recipes import Record, name_fault
from bsg_models.belief.belief_graph import BeliefGraph, BlindNode, Mode
from bsg_models.belief.consistency import check_beliefs
from bsg_models.belief.formats import FormatRow
from bsg_models.belief.header import check_class_space, encode_header, modernise, parse_partial
from bsg_models.errors import BeliefFileError

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
    class_space: ClassSpaceEntry
    class_map: str | None = None
    partial: dict[str, Any]
    expected: list[list[Count]]
    presence: list[list[Probability]]
    blind: list[_Blind]


def encode_belief(belief: BeliefGraph) -> dict[str, Any]:
    """Return a belief graph as a JSON document; `decode_belief` reads it back."""
    classes = belief.partial.class_space.classes
    return {
        **encode_header(belief),
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


def decode_belief(document: Any, *, path: Path) -> BeliefGraph:
    """Return the belief graph of a JSON document.

    Raises:
        BeliefFileError: naming what is wrong with it.
        MismatchError: if its class space has changed since.
    """
    try:
        entries = _Document.model_validate(modernise(document, path=path))
    except ValidationError as error:
        raise BeliefFileError(f"{path}: {name_fault(error)}") from error
    check_class_space(entries.class_space, path=path)
    partial = parse_partial(
        entries.partial,
        path=path,
        class_space=entries.class_space,
        class_map=entries.class_map,
    )
    shape = (len(partial.rooms) + 1, len(partial.class_space.classes))
    for histograms in (entries.expected, entries.presence):
        if len(histograms) != shape[0] or any(len(row) != shape[1] for row in histograms):
            raise BeliefFileError(f"{path}: expected histograms of {shape[0]} × {shape[1]}")
    belief = BeliefGraph(
        partial,
        np.array(entries.expected),
        np.array(entries.presence),
        tuple(_decode_blind(node, partial, path) for node in entries.blind),
        entries.mode,
        entries.model,
    )
    check_beliefs(belief, path=path)
    return belief


def _decode_blind(node: _Blind, partial: PartialGraph, path: Path) -> BlindNode:
    classes = partial.class_space.classes
    if node.class_name not in classes:
        raise BeliefFileError(f"{path}: a blind node of {node.class_name!r}, which is no class")
    return BlindNode(node.room, classes.index(node.class_name), node.expected, node.presence)


def write_document(belief: BeliefGraph, path: Path) -> None:
    """Write a belief graph as JSON. A failed write leaves no partial file."""
    text = encode_json(encode_belief(belief), ensure_ascii=False, separators=(",", ":"))
    write_bytes(path, text.encode())


def read_document(path: Path) -> BeliefGraph:
    """Read a belief graph from JSON.

    Raises:
        BeliefFileError: if it cannot be read.
    """
    document = read_json(path, BELIEF, error=BeliefFileError)
    return decode_belief(document, path=path)


JSON = FormatRow("json", (".json",), write=write_document, read=read_document)
