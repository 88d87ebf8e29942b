"""What every format states once of a belief graph: its format version, model, mode and classes.

In networkx and Spark-DSG it is the attributes of the graph, in parquet the metadata of a table. A
JSON document begins with it; there the partial graph is a document of its own.
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
# Version 1 named a class map, by which the categories of its objects are read again; version 2 had
# no surroundings, version 3 was sure of every hidden share.
_MAPPED = 1
_READ = (_MAPPED, 2, 3, VERSION)


class PartialHeader(Record):
    """What is stated once of the partial graph."""

    format: Literal["bsg-partial-graph"] = "bsg-partial-graph"
    version: Literal[1, 2, 3] = 3
    scene_id: Id
    hidden_share: Share
    building_kind: BuildingKind = None
    source: Id | None = None


class Header(Record):
    """What is stated once of a belief graph.

    Attributes:
        format: `bsg-belief-graph`.
        version: of the format.
        model: the name of the model that believes this.
        mode: how the blind nodes were chosen.
        class_space: whose classes the histograms have.
        partial: the same of the partial graph.
        class_map: which the categories of objects are read with, in version 1 alone.
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
        MismatchError: if it is of a class space or map that has changed, or a map that is not here.
    """
    try:
        header = Header.model_validate(modernise(entries, path=path))
    except ValidationError as error:
        raise BeliefFileError(f"{path}: {name_fault(error)}") from error
    check_class_space(header.class_space, path=path)
    return header


def modernise(entries: Any, *, path: Path) -> Any:
    """Return the entries of a header, or of what begins with one, in the words of this version.

    Raises:
        BeliefFileError: if they are of another format or version.
        MismatchError: in version 1, if the class map has changed or is not here.
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
    """Check that a class space is what was published under its name.

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
        document: what `encode_robot_graph` returned.
        path: where it comes from, for errors.
        class_space: whose classes it names.
        class_map: which its categories are read with, in version 1; None where it names classes.
    """
    if class_map is not None:
        return parse_robot_graph(document, path=path, class_map=class_map)
    return parse_classified_graph(document, path=path, class_space=class_space)
