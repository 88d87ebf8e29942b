"""Read Hydra's scene graphs (Spark-DSG) as partial graphs, and write beliefs into them.

`annotate_hydra` writes Hydra's graph with the beliefs added: every value, key and order stays.
`write_hydra` writes a belief graph of another origin as a new file. `read_hydra_belief` reads both
back exactly, and `strip_hydra` removes what was added.

A robot states facts that Spark-DSG has no field for, such as the `hidden_share` of a room, in
metadata under `bsg`, with the keys of this project's JSON; facts of the graph go into `partial`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bsg_data.errors import SourceError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import SPARK_DSG as BOUND
from bsg_data.inputs.documents import parse_json
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import (
    GRAPH_WORDS,
    OBJECT_WORDS,
    ROOM_WORDS,
    RobotGraphError,
    encode_robot_graph,
    parse_robot_graph,
)
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_data.scene.room_label import label_of
from bsg_data.sources.dsg_file import DSGFile, DSGNode, parse_dsg
from bsg_data.sources.label_space import LabelSpace, load_label_space
from bsg_data.sources.spark_dsg import name_object
from bsg_data.spelling import SHOWN, ask_if_meant
from bsg_models.belief.annotation import (
    BARE_NODE,
    BARE_OBJECT,
    Document,
    annotate,
    find_document,
    strip_annotation,
)
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.document import decode_belief, write_json
from bsg_models.belief.formats import FormatRow
from bsg_models.belief.hydra_conversion import BINARY, convert
from bsg_models.errors import HydraError

_LISTED = 10  # labels in a note
_OURS = ("belief", "partial")  # keys of `annotate`, and of facts of the graph
_TELLING = 5  # letters from which a similar key is no accident
_LAYERS = {"OBJECTS": 2, "PLACES": 3, "ROOMS": 4, "BUILDINGS": 5}
_OF_LAYER: dict[str, Document] = {
    "BUILDINGS": {"type": "SemanticNodeAttributes"},
    "ROOMS": {"type": "RoomNodeAttributes", "semantic_class_probabilities": {}},
    "OBJECTS": BARE_OBJECT,
}
_COLOURS = {"BUILDINGS": (0, 24, 236), "ROOMS": (151, 2, 250), "OBJECTS": (255, 128, 0)}


@dataclass(frozen=True, slots=True)
class HydraFile:
    """A Spark-DSG file that was read."""

    path: Path
    document: Document  # its JSON; of a binary file, the JSON that spark_dsg makes
    graph: DSGFile

    @classmethod
    def of(cls, document: Any, *, path: Path) -> HydraFile:
        """Return the file with a document; one that is no Spark-DSG graph is refused."""
        with _as_hydra_error():
            return cls(path, document, parse_dsg(document, path=path))

    def partial(
        self, *, labels: LabelSpace | None = None, class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP
    ) -> PartialGraph:
        """Return what the robot has seen; see `read_hydra`."""
        graph, path = self.graph, self.path
        with _as_hydra_error(" (in metadata, under `bsg`)"):
            rooms = [_describe_room(room, path) for room in graph.rooms]
            names = [room["id"] for room in rooms]
            said = {
                "scene_id": _name_scene(self.document, path),
                **_read_said(graph.said.get("partial"), GRAPH_WORDS, of=f"{path}: partial"),
                "rooms": rooms,
                "objects": [_describe_object(obj, names, labels, path) for obj in graph.objects],
                "adjacency": [[names[a], names[b]] for a, b in graph.adjacency],
            }
            return parse_robot_graph(said, path=path, class_map=class_map)

    def notes(self, labels: LabelSpace | None = None) -> Iterator[str]:
        """Yield what a person should know about how the file is read, a sentence each."""
        rooms, objects = self.graph.rooms, self.graph.objects
        if not rooms:
            yield "it has no rooms (layer ROOMS): beliefs are about the building only"
        elif astray := sum(obj.room is None for obj in objects):
            yield f"{astray} of {_count(len(objects))} under no room, counted for the building only"
        bare = [
            obj for obj in objects if not (obj.label_name or obj.name or "category" in obj.said)
        ]
        labelled = [obj for obj in bare if obj.label is not None]
        named = Counter((obj.label, name_object(obj, labels)) for obj in labelled)
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

    def annotated(self, belief: BeliefGraph) -> Document:
        """Return the document with a belief graph in it; see `annotate_hydra`."""
        rooms, objects = (
            {str(node.said.get("id", node.symbol)): node.id for node in nodes}
            for nodes in (self.graph.rooms, self.graph.objects)
        )
        strange = [room.name for room in belief.partial.rooms if room.name not in rooms]
        if strange:
            raise HydraError(
                f"{self.path}: has no room {strange[0]!r}, of which something is believed; "
                "use `write_hydra` for a new graph",
                code="room-unknown",
                where=self.path,
            )
        return annotate(
            self.document,
            belief,
            rooms=[rooms[room.name] for room in belief.partial.rooms],
            objects=[objects.get(obj.name) for obj in belief.partial.objects],
        )


def read_json_text(path: Path) -> bytes | str:
    """Return the JSON of a file; for a binary one, what spark_dsg makes of it."""
    return convert(path) if path.suffix == BINARY else read_bytes(path, BOUND)


def _open(path: Path) -> HydraFile:
    with _as_hydra_error():
        text = read_json_text(path)
    try:
        document = parse_json(text, once=False)  # as Hydra's own parser
    except ValueError as error:
        raise HydraError(
            f"{path}: expected a Spark-DSG graph, found no JSON ({str(error)[:200]})",
            code="json-malformed",
            where=path,
        ) from error
    return HydraFile.of(document, path=path)


@contextmanager
def _as_hydra_error(where: str = "") -> Iterator[None]:
    try:
        yield
    except SourceError as error:
        raise HydraError(f"{error}{where}", code=error.code, where=error.where) from error


def read_hydra(
    path: AnyPath,
    *,
    labels: AnyPath | None = None,
    class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP,
) -> PartialGraph:
    """Read a partial graph from a Spark-DSG file.

    Rooms are the nodes of the layer `ROOMS`. Objects are those of `OBJECTS` below a room, directly
    or through places; other objects belong to the building. Ids are symbols such as `R(3)`. The
    label or the name of a room gives its type. A room counts as passed through, with an unknown
    hidden share, unless its metadata say `{"bsg": {"hidden_share": ...}}`, or how the robot looked
    at it (`floor_in_view`, `walls_in_view`, `seconds_inside`).

    Args:
        path: of the file: `.json`, `.json.gz`, or with spark_dsg `.sparkdsg`.
        labels: label space of its objects, as `load_label_space` takes it; None uses the names in
            the file.
        class_map: map that gives the objects their classes.

    Raises:
        HydraError: if it cannot be read.
        ClassMapError: if there is no such label space.
    """
    space = None if labels is None else load_label_space(labels)
    return _open(Path(path)).partial(labels=space, class_map=class_map)


def annotate_hydra(belief: BeliefGraph, original: AnyPath | HydraFile, path: AnyPath) -> None:
    """Write a Spark-DSG graph with the beliefs about it added; its own values and order stay.

    Blind nodes get a layer of their own, `BLIND`; everything else goes into metadata, under
    `bsg.belief`. A belief that the original already holds is replaced. A packed original is written
    unpacked, and a binary one as the JSON that spark_dsg makes of it.

    Args:
        belief: about the original.
        original: the graph that was read.
        path: of the file to write.

    Raises:
        HydraError: if the original lacks a room of the belief, or the name does not end in .json.
        DatasetError: if it cannot be written.
    """
    file = original if isinstance(original, HydraFile) else _open(Path(original))
    _write(file.annotated(belief), Path(path))


def strip_hydra(original: AnyPath, path: AnyPath) -> None:
    """Write a Spark-DSG graph without what `annotate_hydra` added.

    Raises:
        HydraError: if it is not a Spark-DSG graph, or the name does not end in .json.
        DatasetError: if it cannot be written.
    """
    _write(strip_annotation(_open(Path(original)).document), Path(path))


def write_hydra(belief: BeliefGraph, path: AnyPath) -> None:
    """Write a belief graph as a new Spark-DSG graph; `read_hydra_belief` reads it back exactly.

    Raises:
        HydraError: if the name does not end in .json.
        DatasetError: if it cannot be written.
    """
    path = Path(path)
    annotate_hydra(belief, HydraFile.of(_encode_graph(belief.partial), path=path), path)


def read_hydra_belief(path: AnyPath) -> BeliefGraph:
    """Read the belief graph that `annotate_hydra` or `write_hydra` wrote into a Spark-DSG graph.

    Raises:
        HydraError: if there is none.
        BeliefFileError: if it is damaged.
    """
    path = Path(path)
    document = find_document(_open(path).document)
    if document is None:
        raise HydraError(
            f"{path}: expected a belief graph that `annotate_hydra` or `write_hydra` wrote, found "
            "a Spark-DSG file without one; `read_hydra` reads what was seen",
            code="belief-missing",
            where=path,
        )
    return decode_belief(document, path=path)


def _write(document: Document, path: Path) -> None:
    if path.suffix != ".json":
        raise HydraError(
            f"{path}: expected a name that ends in .json, by which readers recognise it",
            code="suffix-unknown",
            where=path,
        )
    write_json(document, path)


def _name_scene(document: Document, path: Path) -> str:
    """Return the building's id from the belief in a document; else the file's name."""
    name = find_document(document)
    for key in ("partial", "scene_id"):
        name = name.get(key) if isinstance(name, dict) else None
    return str(name or path.name.partition(".")[0] or path.name)


def _describe_room(node: DSGNode, path: Path) -> dict[str, Any]:
    """Return a room in the form of a robot's JSON; its metadata take precedence."""
    called = node.label_name or node.name
    return {
        "id": node.symbol,
        "label": called,
        "room_type": label_of("spark-dsg", called),
        "position": node.position,
        "box": None if node.box is None else (node.box.minimum, node.box.maximum),
        **_read_said(node.said, ROOM_WORDS, of=f"{path}: room {node.symbol!r}"),
    }


def _describe_object(
    node: DSGNode, rooms: list[str], labels: LabelSpace | None, path: Path
) -> dict[str, Any]:
    return {
        "id": node.symbol,
        "room": None if node.room is None else rooms[node.room],
        "category": name_object(node, labels),
        "position": node.position,
        **_read_said(node.said, OBJECT_WORDS, of=f"{path}: object {node.symbol!r}"),
    }


def _read_said(said: Any, keys: Collection[str], *, of: str) -> dict[str, Any]:
    """Return the keys of a robot's JSON in metadata; others are the user's, unless misspelt."""
    said = said if isinstance(said, dict) else {}
    for key in said:
        telling = [one for one in keys if len(one) >= _TELLING]
        if key not in keys and key not in _OURS and (hint := ask_if_meant(key, telling)):
            raise RobotGraphError(
                f"{of}: {key[:SHOWN]!r} is no key; {hint}", code="key-unknown", where=of
            )
    return _select(said, keys)


def _select(said: dict[str, Any], keys: Collection[str]) -> dict[str, Any]:
    return {key: said[key] for key in keys if key in said}


def _count(objects: int) -> str:
    return "1 object" if objects == 1 else f"{objects:,} objects"


def _encode_graph(partial: PartialGraph) -> Document:
    """Return a partial graph that no Hydra wrote as the document of a Spark-DSG graph.

    Facts without a field go into metadata. An unknown position becomes the centre of the room, or
    the origin.
    """
    said, origin = encode_robot_graph(partial), (0.0, 0.0, 0.0)
    building = {"name": "building", "position": origin}
    nodes, edges = [_encode_node("BUILDINGS", 0, building, {})], []
    for number, (room, facts) in enumerate(zip(partial.rooms, said["rooms"], strict=True)):
        shown = {"name": room.label or room.name, "position": room.position or origin}
        nodes.append(_encode_node("ROOMS", number, shown, _select(facts, ROOM_WORDS)))
        edges.append(("BUILDINGS", 0, "ROOMS", number))
    for number, (obj, facts) in enumerate(zip(partial.objects, said["objects"], strict=True)):
        around = partial.rooms[obj.room_index - 1].position if obj.room_index else None
        shown = {"name": obj.raw_category, "position": obj.position or around or origin}
        nodes.append(_encode_node("OBJECTS", number, shown, _select(facts, OBJECT_WORDS)))
        above = ("ROOMS", obj.room_index - 1) if obj.room_index else ("BUILDINGS", 0)
        edges.append((*above, "OBJECTS", number))
    edges += [("ROOMS", a - 1, "ROOMS", b - 1) for a, b in partial.adjacency]
    info = {"type": "EdgeAttributes", "weight": 1.0, "weighted": False, "metadata": {}}
    keys = {name: {"layer": layer, "partition": 0} for name, layer in _LAYERS.items()}
    return {
        "SPARK_DSG_header": {
            "project_name": "main",
            "version": {"major": 1, "minor": 1, "patch": 3},
        },
        "directed": False,
        "multigraph": False,
        "layer_ids": list(_LAYERS.values()),
        "layer_keys": list(keys.values()),
        "layer_names": keys,
        "metadata": {"bsg": {"partial": _select(said, GRAPH_WORDS)}},
        "nodes": nodes,
        "edges": [
            {"source": _symbol(layer, a), "target": _symbol(other, b), "info": info}
            for layer, a, other, b in edges
        ],
    }


def _encode_node(layer: str, number: int, shown: Document, said: Document) -> Document:
    red, green, blue = _COLOURS[layer]
    attributes = {
        **_OF_LAYER[layer],
        **BARE_NODE,
        **shown,
        "color": {"r": red, "g": green, "b": blue, "a": 255},
        "semantic_feature": {"rows": 0, "cols": 0, "data": None},
        "metadata": {"bsg": said} if said else {},
    }
    place = {"layer": _LAYERS[layer], "partition": 0}
    return {"attributes": attributes, "id": _symbol(layer, number), **place}


def _symbol(layer: str, number: int) -> int:
    return ord(layer[0]) << 56 | number


SPARK_DSG = FormatRow("spark-dsg", (".dsg.json",), write=write_hydra, read=read_hydra_belief)
