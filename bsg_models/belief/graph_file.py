"""Read a robot's graph, this project's JSON or Hydra's (Spark-DSG), from a file or standard input.

A robot states facts that Spark-DSG has no field for, such as the `hidden_share` of a room, in
metadata under `bsg`, with the keys of this project's JSON; facts of the graph go into `partial`.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bsg_data.errors import BSGError, RecipeError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import ROBOT, SPARK_DSG
from bsg_data.inputs.documents import parse_json
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import (
    GRAPH_WORDS,
    OBJECT_WORDS,
    ROOM_WORDS,
    RobotGraphError,
    parse_robot_graph,
)
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_data.sources.dsg_file import DSGFile, DSGNode, is_dsg, parse_dsg
from bsg_data.sources.spark_dsg import LabelSpace, load_label_space, name_object
from bsg_data.spelling import SHOWN, ask_if_meant
from bsg_models.belief.annotation import find_document
from bsg_models.belief.hydra_conversion import BINARY, convert

_LISTED = 10  # labels in a note
_OURS = ("belief", "partial")  # keys of `annotate_hydra`, and of facts of the graph
_ASKED = 1000  # foreign keys in metadata that are compared with ours; more are somebody's data
_TELLING = 5  # letters from which a similar key is no accident


_Asked = set[tuple[str, tuple[str, ...]]]  # keys in metadata, and the ones they are compared with


@dataclass(frozen=True, slots=True)
class GraphFile:
    """A robot's graph with its source."""

    path: Path
    graph: PartialGraph
    document: Any = None  # Hydra's JSON; None for this project's
    notes: tuple[str, ...] = ()  # what a person should know of how it was read, a sentence each


def read_graph(
    path: AnyPath,
    *,
    labels: AnyPath | None = None,
    class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP,
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
        class_map: map by which names become classes.

    Raises:
        BSGError: if the file cannot be read, or is not a graph.
        RecipeError: if labels are given for a graph that is not Hydra's.
    """
    return open_graph_file(Path(path), labels=labels, class_map=class_map).graph


def open_graph_file(
    path: Path, *, labels: AnyPath | None = None, class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP
) -> GraphFile:
    """Read a robot's graph as `read_graph` does, and keep its source."""
    named = Path("standard input") if path == Path("-") else path
    document = _read_document(path, named)
    return parse_graph(document, path=named, labels=labels, class_map=class_map)


def parse_graph(
    document: Any,
    *,
    path: Path,
    labels: AnyPath | None = None,
    class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP,
) -> GraphFile:
    """Read a robot's graph in a document of JSON; errors name the path."""
    if is_dsg(document):
        space = None if labels is None else load_label_space(labels)
        dsg = parse_dsg(document, path=path)
        said = {"scene_id": _name_scene(document, path), **_describe(dsg, space, path)}
        graph = parse_robot_graph(said, path=path, class_map=class_map)
        return GraphFile(path, graph, document, tuple(_note(dsg, space)))
    if labels is not None:
        raise RecipeError(
            f"labels are for Hydra's graphs, and {path} is not one",
            code="labels-unused",
            where=path,
        )
    return GraphFile(path, parse_robot_graph(document, path=path, class_map=class_map))


def _read_document(path: Path, named: Path) -> Any:
    """Return the JSON of a graph; a key may be there twice in Spark-DSG alone, as in its parser."""
    data = _read_standard_input() if path == Path("-") else read_bytes(path, SPARK_DSG)
    if path.suffix == BINARY:
        data = convert(path)
    try:
        if b'"nodes"' in data:
            document = parse_json(data, once=False)
            if is_dsg(document):
                return document
            del document  # one at a time: two of them would take twice the memory
        if len(data) > ROBOT:
            raise RobotGraphError(
                f"{named}: expected at most {ROBOT:,} bytes", code="file-too-large", where=named
            )
        return parse_json(data)
    except ValueError as error:
        raise RobotGraphError(
            f"{named}: no JSON ({str(error)[:200]})", code="json-malformed", where=named
        ) from error


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


def _name_scene(document: Any, path: Path) -> str:
    """Return the building's id from the belief in a document; else the file's name."""
    name = find_document(document)
    for key in ("partial", "scene_id"):
        name = name.get(key) if isinstance(name, dict) else None
    return str(name or path.name.partition(".")[0] or path.name)


def _describe(dsg: DSGFile, labels: LabelSpace | None, path: Path) -> dict[str, Any]:
    """Return Hydra's graph in the form of a robot's JSON; its metadata take precedence."""
    asked: _Asked = set()
    rooms = [_describe_room(room, path, asked) for room in dsg.rooms]
    names = [room["id"] for room in rooms]
    return {
        **_read_said(dsg.said.get("partial"), GRAPH_WORDS, asked, of=f"{path}: partial"),
        "rooms": rooms,
        "objects": [_describe_object(obj, names, labels, path, asked) for obj in dsg.objects],
        "adjacency": [[names[a], names[b]] for a, b in dsg.adjacency],
    }


def _describe_room(node: DSGNode, path: Path, asked: _Asked) -> dict[str, Any]:
    called = node.label_name or node.name
    return {
        "id": node.symbol,
        "label": called,
        "position": node.position,
        "box": None if node.box is None else (node.box.minimum, node.box.maximum),
        **_read_said(node.said, ROOM_WORDS, asked, of=f"{path}: room {node.symbol!r}"),
    }


def _describe_object(
    node: DSGNode, rooms: list[str], labels: LabelSpace | None, path: Path, asked: _Asked
) -> dict[str, Any]:
    return {
        "id": node.symbol,
        "room": None if node.room is None else rooms[node.room],
        "category": _name_object(node, labels),
        "position": node.position,
        **_read_said(node.said, OBJECT_WORDS, asked, of=f"{path}: object {node.symbol!r}"),
    }


def _name_object(node: DSGNode, labels: LabelSpace | None) -> str:
    """Return the name of an object; the one of our own annotation if nobody else names it."""
    name, belief = name_object(node, labels), node.said.get("belief")
    own = belief.get("category") if isinstance(belief, dict) else None
    return own if isinstance(own, str) and name in ("", f"label {node.label}") else name


def _read_said(said: Any, keys: tuple[str, ...], asked: _Asked, *, of: str) -> dict[str, Any]:
    """Return the keys of a robot's JSON in metadata; others are the user's, unless misspelt.

    A key of the user's is compared once in a graph, however many nodes have it.
    """
    said = said if isinstance(said, dict) else {}
    for key in said:
        if key in keys or key in _OURS or (key, keys) in asked or len(asked) >= _ASKED:
            continue
        asked.add((key, keys))
        if hint := ask_if_meant(key, [one for one in keys if len(one) >= _TELLING]):
            raise RobotGraphError(
                f"{of}: {key[:SHOWN]!r} is no key; {hint}", code="key-unknown", where=of
            )
    return {key: said[key] for key in keys if key in said}


def _note(dsg: DSGFile, labels: LabelSpace | None) -> Iterator[str]:
    """Yield what a person should know about how Hydra's graph is read, a sentence each."""
    if not dsg.rooms:
        yield "it has no rooms (layer ROOMS): beliefs are about the building only"
    elif astray := sum(obj.room is None for obj in dsg.objects):
        yield f"{astray} of {_count(len(dsg.objects))} under no room, counted for the building only"
    if dsg.links:
        edges = "1 edge" if dsg.links == 1 else f"{dsg.links:,} edges"
        yield (
            f"{edges} between objects not read: Spark-DSG does not say which of the two lies on "
            "the other; say `on` in the metadata of an object (docs/belief.md)"
        )
    bare = [
        obj for obj in dsg.objects if not (obj.label_name or obj.name or "category" in obj.said)
    ]
    labelled = [obj for obj in bare if obj.label is not None]
    named = Counter((obj.label, _name_object(obj, labels)) for obj in labelled)
    found = sorted(pair for pair in named if pair[1] != f"label {pair[0]}")
    if found and labels is not None:
        pairs = ", ".join(f"{label} is {name}" for label, name in found[:_LISTED])
        yield f"the file does not name its labels; by {labels.name}, {pairs}"
    if missing := sorted(set(named) - set(found)):
        numbers = ", ".join(str(label) for label, _ in missing[:_LISTED])
        yield (
            f"{_count(sum(named[pair] for pair in missing))} with labels that nobody names "
            f"({numbers}); name them by --labels: mpcat40, ade20k, or the file of the label "
            "space that Hydra ran with (config/label_spaces/NAME.yaml)"
        )
    if silent := len(bare) - len(labelled):
        yield f"{_count(silent)} with neither a label nor a name"


def _count(objects: int) -> str:
    return "1 object" if objects == 1 else f"{objects:,} objects"
