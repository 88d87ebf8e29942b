"""Hydra's scene graphs (Spark-DSG JSON): partial graphs in, belief graphs out.

`spark_dsg` reads and writes the files. Labels of objects are those of a label space, ADE20K or
mpcat40 for example, whose names `mappings/labels-*.csv` translate into HM3D's categories. In what
we write, blind nodes are objects with `is_predicted` in a layer of their own, `BLIND`, and every
node has what it is in its metadata under `bsg`, so that the belief graph can be read back.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import ValidationError

from bsg_data.dataset.manifest import ClassSpaceEntry
from bsg_data.errors import RecipeError
from bsg_data.files import write_bytes
from bsg_data.geometry.floor_area import find_floor_area
from bsg_data.observation.hidden_share import VAGUE
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_data.observation.robot_json import BuildingKind, Id, RoomTypes, SquareMetres
from bsg_data.observation.said_share import SaidShare
from bsg_data.recipes import Record, name_fault
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap, load_class_map
from bsg_data.scene.scene_graph import Box, Point
from bsg_data.sources.label_space import read_labels
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.formats import FormatRow
from bsg_models.belief.header import encode_whole_header
from bsg_models.belief.nodes import Attributes, decode_nodes, encode_edges, encode_nodes
from bsg_models.errors import HydraError

Metadata = TypeVar("Metadata", bound=Record)
_BLIND_LAYER = 10
_COLOURS = {
    "building": (0, 24, 236),
    "room": (151, 2, 250),
    "object": (255, 128, 0),
    "blind": (0, 204, 0),
}
_SYMBOLS = {"building": "B", "room": "R", "object": "O", "blind": "b"}
_LAYERS = {"building": "BUILDINGS", "room": "ROOMS", "object": "OBJECTS"}


class _RoomMetadata(SaidShare):
    """What the metadata of a room may hold of it, under `bsg`."""

    floor_area: SquareMetres | None = None
    room_type: RoomTypes = None


class _BuildingMetadata(Record):
    """What the metadata of a graph may hold of its building, under `bsg`, in `partial`."""

    building_kind: BuildingKind = None
    source: Id | None = None


def _library() -> Any:
    try:
        import spark_dsg
    except ImportError as error:
        raise HydraError(
            "Spark-DSG files need spark-dsg: pip install 'belief-scene-graphs[hydra]'"
        ) from error
    return spark_dsg


def read_hydra(
    path: Path, *, labels: str | None = None, class_map: str | ClassMap = DEFAULT_CLASS_MAP
) -> PartialGraph:
    """Read a partial graph from Spark-DSG JSON.

    Rooms are those of the layer `ROOMS`, objects those of `OBJECTS` under a room, directly or over
    places; what is under none belongs to the building. A room has been passed through, and may hide
    anything, unless its metadata says `{"bsg": {"hidden_share": ...}}`, or how the robot looked at
    it (`floor_in_view`, `walls_in_view`, `seconds_inside`).

    Args:
        path: of the file.
        labels: the label space of its objects; None takes the file's own names as categories.
        class_map: whose classes the objects get.

    Raises:
        HydraError: if it cannot be read.
    """
    graph = _load(path)
    loaded = load_class_map(class_map)
    rooms = list(_nodes_of(graph, "ROOMS"))
    index = {node.id.value: number for number, node in enumerate(rooms, 1)}
    objects = [
        _seen_object(node, graph, index, labels, loaded) for node in _nodes_of(graph, "OBJECTS")
    ]
    known = tuple(_known_room(node, path) for node in rooms)
    pairs = {
        (min(a, b), max(a, b))
        for node in rooms
        for other in node.siblings()
        if (a := index[node.id.value]) != (b := index.get(other, 0)) and b
    }
    building = _read_metadata(_BuildingMetadata, _said_of(graph), f"{path}: metadata")
    return PartialGraph(
        scene_id=_scene_of(graph) or path.name.partition(".")[0],
        class_space=ClassSpaceEntry.of(loaded.space),
        hidden_share=float(np.mean([room.hidden_share for room in known])) if known else VAGUE.mean,
        rooms=known,
        objects=tuple(objects),
        adjacency=tuple(sorted(pairs)),
        building_kind=building.building_kind,
        source=building.source,
    )


def _load(path: Path) -> Any:
    """Return a graph of spark_dsg."""
    dsg = _library()
    if not path.is_file():
        raise HydraError(f"{path}: cannot be read (no such file)")
    try:
        return dsg.DynamicSceneGraph.load(str(path))
    except Exception as error:  # its reader raises what its parser does
        raise HydraError(
            f"{path}: expected a Spark-DSG file, found one that spark_dsg cannot load"
        ) from error


def _nodes_of(graph: Any, name: str) -> Iterator[Any]:
    layer = graph.get_layer(name) if graph.has_layer(name) else None
    nodes = [] if layer is None else list(layer.nodes)
    yield from sorted(nodes, key=lambda node: node.id.value)


def _scene_of(graph: Any) -> str | None:
    """Return the scene id that `write_hydra` left, if it did."""
    name = _said_of(graph).get("scene_id")
    return name if isinstance(name, str) and name else None


def _said_of(graph: Any) -> dict[str, Any]:
    """Return what the metadata of a graph say of the partial graph."""
    partial = _ours(graph.metadata.get()).get("partial")
    return dict(partial) if isinstance(partial, Mapping) else {}


def _ours(metadata: Any) -> dict[str, Any]:
    """Return what metadata hold under `bsg`."""
    ours = metadata.get("bsg") if isinstance(metadata, Mapping) else None
    return dict(ours) if isinstance(ours, Mapping) else {}


def _read_metadata(kind: type[Metadata], entries: Attributes, where: str) -> Metadata:
    """Return those of some entries that a record has."""
    try:
        return kind.model_validate(
            {key: value for key, value in entries.items() if key in kind.model_fields}
        )
    except ValidationError as error:
        raise HydraError(f"{where}: {name_fault(error)}") from error


def _known_room(node: Any, path: Path) -> KnownRoom:
    entries = _ours(node.attributes.metadata.get())
    where, box = f"{path}: metadata of room {node.id}", _box(node.attributes.bounding_box)
    metadata = _read_metadata(_RoomMetadata, entries, where)
    try:
        area = find_floor_area(metadata.floor_area, footprint=None, box=box)
        share = metadata.believe(floor_area=area)
    except RecipeError as error:
        raise HydraError(f"{where}: {error}") from error
    return KnownRoom(
        name=str(node.id),
        hidden_share=share.mean,
        visited=metadata.visited,
        label=node.attributes.name or None,
        position=_point(node.attributes.position),
        box=box,
        floor_area=metadata.floor_area,
        room_type=metadata.room_type,
        hidden_share_sd=share.sd,
    )


def _seen_object(
    node: Any, graph: Any, rooms: dict[int, int], labels: str | None, class_map: ClassMap
) -> SeenObject:
    """Return an object with its room: the first above it, by way of places."""
    above, room = node.get_parent(), 0
    while above is not None and not room:
        room = rooms.get(above, 0)
        above = graph.get_node(above).get_parent()
    name = _name_of(node, graph, labels)
    known = class_map.classify(name)
    position = _point(node.attributes.position)
    return SeenObject(str(node.id), room, name, known.category, known.class_index, position)


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
    graph = dsg.DynamicSceneGraph()
    graph.add_layer(_BLIND_LAYER, 0, "BLIND")
    graph.metadata.set({"bsg": encode_whole_header(belief)})
    nodes = list(encode_nodes(belief))
    symbols: list[Any] = []
    positions: list[Point] = []
    for number, node in enumerate(nodes):
        around = (0.0, 0.0, 0.0) if node.parent is None else positions[node.parent]
        positions.append(node.attributes.get("position") or around)
        attributes = _attributes(dsg, node.kind, node.attributes)
        attributes.position = np.array(positions[number], dtype=float)
        attributes.color = np.array(_COLOURS[node.kind], dtype=np.uint8)
        attributes.metadata.set({"bsg": node.attributes})
        symbols.append(dsg.NodeSymbol(_SYMBOLS[node.kind], number))
        graph.add_node(_LAYERS.get(node.kind, "BLIND"), symbols[number], attributes)
    for source, target, kind in sorted(encode_edges(belief, nodes)):
        edge = dsg.EdgeAttributes()
        edge.metadata.set({"bsg": {"kind": kind}})
        graph.insert_edge(symbols[source].value, symbols[target].value, edge)
    with tempfile.TemporaryDirectory() as folder:  # its writer chooses names, and fails in silence
        written = Path(folder, "graph.json")
        graph.save(str(written), include_mesh=False)
        write_bytes(path, written.read_bytes())


def _attributes(dsg: Any, kind: str, entries: Attributes) -> Any:
    if kind == "building":
        attributes = dsg.SemanticNodeAttributes()
        attributes.name = "building"
    elif kind == "room":
        attributes = dsg.RoomNodeAttributes()
        attributes.name = entries["label"] or entries["id"]
    else:
        attributes = dsg.ObjectNodeAttributes()
        attributes.name = entries["class"] or entries["category"]
        attributes.is_predicted = kind == "blind"
    return attributes


def read_hydra_belief(path: Path) -> BeliefGraph:
    """Read a belief graph that `write_hydra` wrote.

    Raises:
        HydraError: if it is none.
    """
    graph = _load(path)
    try:
        header = graph.metadata.get()["bsg"]
        numbers = {node.id.value: node.id.category_id for node in graph.nodes}
        nodes = sorted(graph.nodes, key=lambda node: node.id.category_id)
        edges = []
        for edge in graph.edges:
            # A parent has the lower number; spark_dsg may have turned an edge round.
            source, target = sorted((numbers[edge.source], numbers[edge.target]))
            edges.append((source, target, edge.info.metadata.get()["bsg"]["kind"]))
    except (LookupError, TypeError) as error:
        raise HydraError(
            f"{path}: expected a belief graph that `write_hydra` wrote, found a Spark-DSG file "
            "without its metadata; `read_hydra` reads what was seen"
        ) from error
    attributes = [_ours(node.attributes.metadata.get()) for node in nodes]
    return decode_nodes(header, attributes, edges, path=path)


SPARK_DSG = FormatRow("spark-dsg", (".dsg.json",), write=write_hydra, read=read_hydra_belief)
