"""What every format states once of a belief graph: its format version, model, mode and class map.

In networkx and Spark-DSG it is the attributes of the graph, in parquet the metadata of a table. A
JSON document begins with it; there the partial graph is a document of its own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from bsg_data.dataset.manifest import ClassMapEntry
from bsg_data.errors import MismatchError
from bsg_data.observation.robot_json import Id, Share
from bsg_data.recipes import Record, name_fault
from bsg_data.scene.class_map import list_class_maps, load_class_map
from bsg_models.belief.belief_graph import BeliefGraph, Mode
from bsg_models.errors import BeliefFileError

FORMAT, VERSION = "bsg-belief-graph", 1


class PartialHeader(Record):
    """What is stated once of the partial graph."""

    format: Literal["bsg-partial-graph"] = "bsg-partial-graph"
    version: Literal[1] = 1
    scene_id: Id
    hidden_share: Share


class Header(Record):
    """What is stated once of a belief graph.

    Attributes:
        format: `bsg-belief-graph`.
        version: of the format.
        model: the name of the model that believes this.
        mode: how the blind nodes were chosen.
        class_map: whose classes the histograms have.
        partial: the same of the partial graph.
    """

    format: str
    version: int
    model: str
    mode: Mode
    class_map: ClassMapEntry
    partial: PartialHeader


def encode_header(belief: BeliefGraph) -> dict[str, Any]:
    """Return the header of a belief graph, without that of its partial graph."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "model": belief.model,
        "mode": belief.mode,
        "class_map": belief.partial.class_map.model_dump(mode="json"),
    }


def encode_whole_header(belief: BeliefGraph) -> dict[str, Any]:
    """Return the header of a belief graph with that of its partial graph."""
    partial = PartialHeader(
        scene_id=belief.partial.scene_id, hidden_share=belief.partial.hidden_share
    )
    return {**encode_header(belief), "partial": partial.model_dump()}


def decode_whole_header(entries: Any, *, path: Path) -> Header:
    """Return the header of `encode_whole_header`.

    Raises:
        BeliefFileError: naming what is wrong with it.
        MismatchError: if it is of a class map that is not here.
    """
    try:
        header = Header.model_validate(entries)
    except ValidationError as error:
        raise BeliefFileError(f"{path}: {name_fault(error)}") from error
    check_header(header.format, header.version, header.class_map, path=path)
    return header


def check_header(name: str, version: int, class_map: ClassMapEntry, *, path: Path) -> None:
    """Check that a file is of this format, and of a published class map.

    Raises:
        BeliefFileError: if it is of another format or version.
        MismatchError: if it is of a class map that is not here, or has changed.
    """
    if (name, version) != (FORMAT, VERSION):
        raise BeliefFileError(f"{path}: expected {FORMAT} {VERSION}, found {name} {version}")
    if class_map.version not in list_class_maps():
        raise MismatchError(f"{path}: class map {class_map.version!r} is no published one")
    if ClassMapEntry.of(load_class_map(class_map.version)) != class_map:
        raise MismatchError(f"{path}: class map {class_map.version} has changed since")
