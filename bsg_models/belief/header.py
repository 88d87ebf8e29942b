"""Read and write the header of a belief graph: format version, model, mode and classes.

In networkx and Spark-DSG the header is in the attributes of the graph, in parquet in the metadata
of a table. A JSON document begins with it, and holds the partial graph as a document of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from bsg_data.dataset.manifest import ClassSpaceEntry
from bsg_data.errors import MismatchError
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import (
    BuildingKind,
    Id,
    parse_classified_graph,
    parse_robot_graph,
)
from bsg_data.observation.said_share import Share
from bsg_data.recipes import Record, name_fault
from bsg_data.scene.class_map import list_class_maps, load_class_map
from bsg_data.scene.class_space import list_class_spaces, load_class_space
from bsg_models.belief.belief_graph import BeliefGraph, Mode
from bsg_models.errors import BeliefFileError

FORMAT, VERSION = "bsg-belief-graph", 4
# Version 1 named a class map, by which the categories of its objects are read again. Version 2 had
# no surroundings. Version 3 had no uncertain hidden shares.
_MAPPED = 1
_READ = (_MAPPED, 2, 3, VERSION)


class PartialHeader(Record):
    """The header of the partial graph."""

    format: Literal["bsg-partial-graph"] = "bsg-partial-graph"
    version: Literal[1, 2, 3] = 3
    scene_id: Id
    hidden_share: Share
    building_kind: BuildingKind = None
    source: Id | None = None


class Header(Record):
    """The header of a belief graph.

    Attributes:
        format: `bsg-belief-graph`.
        version: of the format.
        model: name of the model.
        mode: how the blind nodes were chosen.
        class_space: classes of the histograms.
        partial: header of the partial graph.
        class_map: map for the categories of objects, in version 1 only.
    """

    format: str
    version: int
    model: str
    mode: Mode
    class_space: ClassSpaceEntry
    partial: PartialHeader
    class_map: str | None = None


def encode_header(belief: BeliefGraph) -> dict[str, Any]:
    """Return the header of a belief graph, without that of its partial graph."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "model": belief.model,
        "mode": belief.mode,
        "class_space": belief.partial.class_space.model_dump(mode="json"),
    }


def encode_whole_header(belief: BeliefGraph) -> dict[str, Any]:
    """Return the header of a belief graph with that of its partial graph."""
    partial = PartialHeader(
        scene_id=belief.partial.scene_id,
        hidden_share=belief.partial.hidden_share,
        building_kind=belief.partial.building_kind,
        source=belief.partial.source,
    )
    return {**encode_header(belief), "partial": partial.model_dump()}


def decode_whole_header(entries: Any, *, path: Path) -> Header:
    """Return the header of `encode_whole_header`.

    Raises:
        BeliefFileError: naming what is wrong with it.
        MismatchError: if its class space or map has changed, or its map is not installed.
    """
    try:
        header = Header.model_validate(modernise(entries, path=path))
    except ValidationError as error:
        raise BeliefFileError(f"{path}: {name_fault(error)}") from error
    check_class_space(header.class_space, path=path)
    return header


def modernise(entries: Any, *, path: Path) -> Any:
    """Return a header, or a document that begins with one, in the form of the current version.

    Raises:
        BeliefFileError: if it has another format or version.
        MismatchError: in version 1, if the class map has changed or is not installed.
    """
    if not isinstance(entries, Mapping):
        return entries
    found = (entries.get("format"), entries.get("version"))
    if found not in [(FORMAT, version) for version in _READ]:
        raise BeliefFileError(f"{path}: expected {FORMAT} {VERSION}, found {found[0]} {found[1]}")
    class_map = entries.get("class_map")
    if found[1] != _MAPPED or not isinstance(class_map, Mapping):
        return {key: value for key, value in entries.items() if key != "class_map"}
    version = class_map.get("version")
    if version not in list_class_maps():
        raise MismatchError(f"{path}: class map {version!r} is no published one")
    loaded = load_class_map(version)
    if class_map != {"version": version, "sha256": loaded.sha256, "classes": list(loaded.classes)}:
        raise MismatchError(f"{path}: class map {version} has changed since")
    space = ClassSpaceEntry.of(loaded.space).model_dump(mode="json")
    return {**entries, "class_map": version, "class_space": space}


def check_class_space(space: ClassSpaceEntry, *, path: Path) -> None:
    """Check that a class space is the one published under its name.

    Raises:
        MismatchError: if it is not.
    """
    published = space.name in list_class_spaces()
    if published and ClassSpaceEntry.of(load_class_space(space.name)) != space:
        raise MismatchError(f"{path}: class space {space.name} has changed since")


def parse_partial(
    document: Any, *, path: Path, class_space: ClassSpaceEntry, class_map: str | None
) -> PartialGraph:
    """Return the partial graph of a belief graph's document.

    Args:
        document: output of `encode_robot_graph`.
        path: its origin, for errors.
        class_space: of its classes.
        class_map: map for its categories, in version 1; None if it names classes.
    """
    if class_map is not None:
        return parse_robot_graph(document, path=path, class_map=class_map)
    return parse_classified_graph(document, path=path, class_space=class_space)
