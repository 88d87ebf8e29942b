"""Read a robot's graph, our JSON or Hydra's (Spark-DSG), from a file or standard input."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bsg_data.errors import BSGError, RecipeError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import ROBOT, SPARK_DSG
from bsg_data.inputs.documents import require_json
from bsg_data.sources.label_table import RoomWords, read_room_words
from bsg_models.belief.partial_graph import PartialGraph
from bsg_robot.graph.map_forms import FORM
from bsg_robot.graph.robot_json import OwnLabels, RobotGraphError, parse_robot_graph

_BINARY = ".sparkdsg"


@dataclass(frozen=True, slots=True)
class GraphFile:
    """A robot's graph with its source."""

    path: Path
    graph: PartialGraph
    document: Any = None  # Hydra's JSON; None for this project's
    notes: tuple[str, ...] = ()  # what a person should know of how it was read, a sentence each


def read_graph(
    path: AnyPath, *, labels: AnyPath | None = None, room_labels: RoomWords | None = None
) -> PartialGraph:
    """Read a robot's graph: this project's JSON or Spark-DSG's.

    Rooms of a Spark-DSG graph are the nodes of the layer `ROOMS`. Objects are those of `OBJECTS`
    below a room, directly or through places; other objects belong to the building. Ids are symbols
    such as `R(3)`. The label or the name of a room gives its type. A room counts as passed through,
    with an unknown hidden share, unless its metadata say `{"bsg": {"hidden_share": ...}}`, or how
    the robot looked at it (`floor_in_view`, `walls_in_view`, `seconds_inside`).

    Args:
        path: of the file: `.json`, `.json.gz`, or with spark_dsg `.sparkdsg`; `-` is standard
            input.
        labels: label space of a Hydra graph, as `load_label_space` takes it; None uses the names
            in the file.
        room_labels: your words for rooms, which count before ours: a table `source_label,label`,
            or word → label.

    Raises:
        BSGError: if the file cannot be read, or is not a graph.
        RecipeError: if labels are given for a graph that is not Hydra's.
    """
    return open_graph_file(Path(path), labels=labels, room_labels=room_labels).graph


def open_graph_file(
    path: Path, *, labels: AnyPath | None = None, room_labels: RoomWords | None = None
) -> GraphFile:
    """Read a robot's graph as `read_graph` does, and keep its source."""
    named = Path("standard input") if path == Path("-") else path
    document = _read_document(path, named)
    return parse_graph(document, path=named, labels=labels, room_labels=room_labels)


def parse_graph(
    document: Any,
    *,
    path: Path,
    labels: AnyPath | None = None,
    room_labels: RoomWords | None = None,
) -> GraphFile:
    """Read a robot's graph in a document of JSON; errors name the path."""
    own = () if room_labels is None else read_room_words(room_labels)
    if _is_dsg(document):
        return _parse_hydra(document, path, labels, own)
    if labels is not None:
        raise RecipeError(
            f"labels are for Hydra's graphs, and {path} is not one; leave them out",
            code="labels-unused",
            where=path,
        )
    return GraphFile(path, parse_robot_graph(document, path=path, room_labels=own))


def _is_dsg(document: Any) -> bool:
    """Say whether a JSON document is a Spark-DSG graph, of an old version or a new one."""
    return isinstance(document, dict) and "nodes" in document and "rooms" not in document


def _parse_hydra(
    document: Any, path: Path, labels: AnyPath | None, room_labels: OwnLabels
) -> GraphFile:
    # Imported here: other graphs need no reader of Spark-DSG's.
    from bsg_data.sources.dsg_file import parse_dsg
    from bsg_data.sources.label_space import load_label_space
    from bsg_robot.graph.hydra import describe_hydra, find_belief, note_hydra

    _refuse_other_nodes(document["nodes"], path)
    space = None if labels is None else load_label_space(labels)
    dsg = parse_dsg(document, path=path)
    name = _name_scene(find_belief(document), path)
    ours = {"scene_id": name, **describe_hydra(dsg, space, path)}
    graph = parse_robot_graph(ours, path=path, room_labels=room_labels)
    return GraphFile(path, graph, document, tuple(note_hydra(dsg, space)))


def _refuse_other_nodes(nodes: Any, path: Path) -> None:
    """Refuse a graph of nodes and links that is not Spark-DSG's, whose ids are numbers."""
    first = nodes[0] if isinstance(nodes, list) and nodes else None
    if isinstance(first, dict) and isinstance(first.get("id"), str):
        raise RobotGraphError(
            f"{path}: nodes of no Spark-DSG graph, as networkx writes them; write the rooms with "
            f"what was seen there: {FORM} (docs/belief.md)",
            code="graph-malformed",
            where=path,
        )


def _read_document(path: Path, named: Path) -> Any:
    """Return the JSON of a graph; a key may be there twice in Spark-DSG alone, as in its parser."""
    data = _read_standard_input() if path == Path("-") else read_bytes(path, SPARK_DSG)
    if path.suffix == _BINARY:
        from bsg_robot.graph.hydra import convert  # as above

        data = convert(path, named=path)
    if b"nodes" in data.replace(b"\0", b""):  # also in UTF-16
        document = require_json(data, named, once=False, is_bounded=True, error=RobotGraphError)
        if _is_dsg(document):
            return document
        del document  # one at a time: two of them would take twice the memory
    if len(data) > ROBOT:
        raise RobotGraphError(
            f"{named}: expected at most {ROBOT:,} bytes", code="file-too-large", where=named
        )
    return require_json(data, named, is_bounded=True, error=RobotGraphError)


def _read_standard_input() -> bytes:
    stream = getattr(sys.stdin, "buffer", None)  # None also for text that a notebook puts there
    if stream is None or stream.closed:
        raise BSGError(
            "standard input: expected a robot's graph, found it closed; send the graph to it, or "
            "name a file instead of -",
            code="standard-input-closed",
        )
    data = bytes(stream.read(SPARK_DSG + 1))
    if len(data) > SPARK_DSG:
        raise BSGError(
            f"standard input: expected at most {SPARK_DSG:,} bytes", code="file-too-large"
        )
    return data


def _name_scene(belief: Any, path: Path) -> str:
    """Return the building's id from the belief in a document, if any; else the file's name."""
    name = belief
    for key in ("document", "partial", "scene_id"):
        name = name.get(key) if isinstance(name, dict) else None
    return str(name or path.name.partition(".")[0] or path.name)
