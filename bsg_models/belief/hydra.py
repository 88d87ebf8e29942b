"""Hydra's scene graphs (Spark-DSG JSON): partial graphs in, belief graphs out.

`spark_dsg` reads and writes the files. Labels of objects are those of a label space, ADE20K or
mpcat40 for example, whose names `mappings/labels-*.csv` translate into HM3D's categories. In what
we write, blind nodes are objects with `is_predicted` in a layer of their own, `BLIND`, and every
node has what it is in its metadata under `bsg`, so that the belief graph can be read back.
"""

from __future__ import annotations

import csv
import io
import math
import tempfile
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
from pydantic import StrictBool, ValidationError

from bsg_data.dataset.manifest import ClassMapEntry
from bsg_data.errors import BSGError, ClassMapError
from bsg_data.files import write_bytes
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject, classify
from bsg_data.observation.robot_json import SEEN_SHARE, Share
from bsg_data.recipes import Record, name_fault
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap, load_class_map
from bsg_data.scene.scene_graph import Box, Point
from bsg_models.belief.belief_files import from_networkx, to_networkx
from bsg_models.belief.belief_graph import BeliefGraph

_BLIND_LAYER = 10
_COLOURS = {
    "building": (0, 24, 236),
    "room": (151, 2, 250),
    "object": (255, 128, 0),
    "blind": (0, 204, 0),
}
_SYMBOLS = {"building": "B", "room": "R", "object": "O", "blind": "b"}
_LAYERS = {"building": "BUILDINGS", "room": "ROOMS", "object": "OBJECTS"}


class _Said(Record):
    """What the metadata of a room may say of it, under `bsg`."""

    visited: StrictBool = True
    hidden_share: Share | None = None


class HydraError(BSGError):
    """Report a Spark-DSG file that cannot be read or written."""


def _library() -> Any:
    try:
        import spark_dsg
    except ImportError as error:
        raise HydraError(
            "Spark-DSG files need spark-dsg: pip install 'belief-scene-graphs[hydra]'"
        ) from error
    return spark_dsg


@cache
def read_labels(space: str) -> dict[str, str]:
    """Return the categories of the labels of a label space, `ade20k` or `mpcat40`.

    Raises:
        ClassMapError: for another space.
    """
    known = sorted(
        item.name.removeprefix("labels-").removesuffix(".csv")
        for item in files("bsg_mappings").iterdir()
        if item.name.startswith("labels-")
    )
    if space not in known:
        raise ClassMapError(f"no label space {space!r}: there are {', '.join(known)}")
    text = files("bsg_mappings").joinpath(f"labels-{space}.csv").read_text("utf-8")
    return {row["label"]: row["category"] for row in csv.DictReader(io.StringIO(text))}


def read_hydra(
    path: Path, *, labels: str | None = None, class_map: str = DEFAULT_CLASS_MAP
) -> PartialGraph:
    """Read a partial graph from Spark-DSG JSON.

    Rooms are those of the layer `ROOMS`, objects those of `OBJECTS` under a room, directly or over
    places; what is under none belongs to the building. A room has been passed through, and half of
    its objects were not seen, unless its metadata says `{"bsg": {"hidden_share": ...}}`.

    Args:
        path: of the file.
        labels: the label space of its objects; None takes the file's own names as categories.
        class_map: whose classes the objects get.

    Raises:
        HydraError: if it cannot be read.
    """
    dsg = _library()
    try:
        found = dsg.DynamicSceneGraph.load(str(path))
    except Exception as error:  # its reader raises what its parser does
        raise HydraError(f"{path}: no Spark-DSG file ({str(error)[:200]})") from error
    loaded = load_class_map(class_map)
    rooms = list(_layer(found, "ROOMS"))
    index = {node.id.value: number for number, node in enumerate(rooms, 1)}
    objects = [_see(node, found, index, labels, loaded) for node in _layer(found, "OBJECTS")]
    known = tuple(_know(node, path) for node in rooms)
    pairs = {
        (min(a, b), max(a, b))
        for node in rooms
        for other in node.siblings()
        if (a := index[node.id.value]) != (b := index.get(other, 0)) and b
    }
    return PartialGraph(
        scene_id=_scene_of(found) or path.name.partition(".")[0],
        class_map=ClassMapEntry.of(loaded),
        hidden_share=float(np.mean([room.hidden_share for room in known])) if known else SEEN_SHARE,
        rooms=known,
        objects=tuple(objects),
        adjacency=tuple(sorted(pairs)),
    )


def _layer(graph: Any, name: str) -> Iterator[Any]:
    layer = graph.get_layer(name) if graph.has_layer(name) else None
    nodes = [] if layer is None else list(layer.nodes)
    yield from sorted(nodes, key=lambda node: node.id.value)


def _scene_of(graph: Any) -> str | None:
    """Return the scene id that `write_hydra` left, if it did."""
    said = graph.metadata.get()
    ours = said.get("bsg", {}) if isinstance(said, Mapping) else {}
    partial = ours.get("partial", {}) if isinstance(ours, Mapping) else {}
    name = partial.get("scene_id") if isinstance(partial, Mapping) else None
    return name if isinstance(name, str) and name else None


def _metadata(node: Any) -> dict[str, Any]:
    said = node.attributes.metadata.get()
    found = said.get("bsg") if isinstance(said, Mapping) else None
    return dict(found) if isinstance(found, Mapping) else {}


def _know(node: Any, path: Path) -> KnownRoom:
    words = {key: value for key, value in _metadata(node).items() if key in _Said.model_fields}
    try:
        said = _Said.model_validate(words)
    except ValidationError as error:
        raise HydraError(f"{path}: metadata of room {node.id}: {name_fault(error)}") from error
    usual = SEEN_SHARE if said.visited else 1.0
    return KnownRoom(
        name=str(node.id),
        hidden_share=usual if said.hidden_share is None else said.hidden_share,
        visited=said.visited,
        label=node.attributes.name or None,
        position=_point(node.attributes.position),
        box=_box(node.attributes.bounding_box),
    )


def _see(
    node: Any, graph: Any, rooms: dict[int, int], labels: str | None, class_map: ClassMap
) -> SeenObject:
    """Return an object with its room: the first above it, by way of places."""
    above, room = node.get_parent(), 0
    while above is not None and not room:
        room = rooms.get(above, 0)
        above = graph.get_node(above).get_parent()
    name = _name_of(node, graph, labels)
    category, class_index = classify(name, class_map)
    position = _point(node.attributes.position)
    return SeenObject(str(node.id), room, name, category, class_index, position)


def _name_of(node: Any, graph: Any, labels: str | None) -> str:
    """Return the category of an object: its label's name, else its own without a number."""
    label = node.attributes.semantic_label
    space = graph.get_labelspace(node.layer.layer, node.layer.partition)
    known = space.labels_to_names if space else {}
    name = str(known.get(label) or "") or node.attributes.name.rstrip("0123456789").rstrip("_ #-")
    return str(name if labels is None else read_labels(labels).get(name, name))


def _point(position: Any) -> Point | None:
    x, y, z = (float(value) for value in position)
    return (x, y, z) if math.isfinite(x + y + z) else None


def _box(box: Any) -> Box | None:
    if not box.is_valid():
        return None
    corners = np.array(box.corners())
    low, high = _point(corners.min(axis=0)), _point(corners.max(axis=0))
    return None if low is None or high is None else Box(low, high)


def write_hydra(belief: BeliefGraph, path: Path) -> None:
    """Write a belief graph as Spark-DSG JSON; `read_hydra_belief` reads it back exactly.

    Positions that are unknown are the centre of the room, or the origin.

    Raises:
        HydraError: if the name does not end in .json.
        DatasetError: if it cannot be written.
    """
    if path.suffix != ".json":
        raise HydraError(f"{path}: expected a name that ends in .json, by which readers know it")
    dsg = _library()
    source = to_networkx(belief)
    graph = dsg.DynamicSceneGraph()
    graph.add_layer(_BLIND_LAYER, 0, "BLIND")
    graph.metadata.set({"bsg": source.graph})
    symbols: dict[int, Any] = {}
    places: dict[int, Any] = {}
    for number, data in sorted(source.nodes(data=True)):
        kind = data["kind"]
        parents = [a for a, _, edge in source.in_edges(number, data="kind") if edge != "adjacent"]
        spot = data.get("position") or places.get(parents[0] if parents else -1)
        places[number] = spot if spot is not None else (0.0, 0.0, 0.0)
        attributes = _attributes(dsg, kind, data)
        attributes.position = np.array(places[number], dtype=float)
        attributes.color = np.array(_COLOURS[kind], dtype=np.uint8)
        attributes.metadata.set({"bsg": data})
        symbols[number] = dsg.NodeSymbol(_SYMBOLS[kind], number)
        graph.add_node(_LAYERS.get(kind, "BLIND"), symbols[number], attributes)
    for a, b, kind in sorted(source.edges(data="kind")):
        if kind == "adjacent" and a > b:
            continue
        edge = dsg.EdgeAttributes()
        edge.metadata.set({"bsg": {"kind": kind}})
        graph.insert_edge(symbols[a].value, symbols[b].value, edge)
    with tempfile.TemporaryDirectory() as folder:  # its writer chooses names, and fails in silence
        written = Path(folder, "graph.json")
        graph.save(str(written), include_mesh=False)
        write_bytes(path, written.read_bytes())


def _attributes(dsg: Any, kind: str, data: dict[str, Any]) -> Any:
    if kind == "building":
        attributes = dsg.SemanticNodeAttributes()
        attributes.name = "building"
    elif kind == "room":
        attributes = dsg.RoomNodeAttributes()
        attributes.name = data["label"] or data["id"]
    else:
        attributes = dsg.ObjectNodeAttributes()
        attributes.name = data["class"] or data["category"]
        attributes.is_predicted = kind == "blind"
    return attributes


def read_hydra_belief(path: Path) -> BeliefGraph:
    """Read a belief graph that `write_hydra` wrote.

    Raises:
        HydraError: if it is none.
    """
    dsg = _library()
    try:
        found = dsg.DynamicSceneGraph.load(str(path))
        graph = nx.DiGraph(**found.metadata.get()["bsg"])
        numbers = {}
        for node in found.nodes:
            numbers[node.id.value] = node.id.category_id
            graph.add_node(node.id.category_id, **_metadata(node))
        for edge in found.edges:
            a, b = sorted((numbers[edge.source], numbers[edge.target]))  # a parent comes first
            kind = edge.info.metadata.get()["bsg"]["kind"]
            graph.add_edge(a, b, kind=kind)
            if kind == "adjacent":
                graph.add_edge(b, a, kind=kind)
    except BSGError:
        raise
    except Exception as error:  # its reader raises what its parser does
        raise HydraError(f"{path}: no belief graph of ours ({str(error)[:200]})") from error
    return from_networkx(graph)
