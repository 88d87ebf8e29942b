"""Hold a Spark-DSG file that was read: its text, and its description of the building.

A robot states facts that Spark-DSG has no field for, such as the `hidden_share` of a room, in
metadata under `bsg`, with the keys of this project's JSON; facts of the graph go into `partial`.
"""

from __future__ import annotations

import codecs
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bsg_data.errors import SourceError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import SPARK_DSG
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import (
    GRAPH_WORDS,
    OBJECT_WORDS,
    ROOM_WORDS,
    RobotGraphError,
    parse_robot_graph,
)
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_data.scene.room_label import label_of
from bsg_data.sources.annotation_files import decode
from bsg_data.sources.dsg_file import DSGFile, DSGNode, parse_dsg
from bsg_data.sources.label_space import LabelSpace
from bsg_data.sources.spark_dsg import name_object
from bsg_data.spelling import SHOWN, ask_if_meant
from bsg_models.belief.annotation import annotate, find_document
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.hydra_conversion import convert
from bsg_models.errors import HydraError

BINARY = ".sparkdsg"
BOM = "\ufeff"
_SHOWN = 10  # labels in a note
_OURS = ("belief", "partial")  # keys of `annotate`, and of facts of the graph
_TELLING = 5  # letters from which a similar key is no accident


@dataclass(frozen=True, slots=True)
class HydraFile:
    """A Spark-DSG file that was read.

    Attributes:
        path: of the file.
        text: its JSON, byte for byte; for a binary file, the JSON that spark_dsg makes.
        graph: the parsed graph.
    """

    path: Path
    text: str
    graph: DSGFile

    def partial(
        self, *, labels: LabelSpace | None = None, class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP
    ) -> PartialGraph:
        """Return what the robot has seen; see `read_hydra`."""
        try:
            document = self._describe(labels)
        except RobotGraphError as error:
            raise HydraError(f"{self.path}: {error} (in metadata, under `bsg`)") from error
        try:
            return parse_robot_graph(document, path=self.path, class_map=class_map)
        except RobotGraphError as error:
            raise HydraError(f"{error} (in metadata, under `bsg`)") from error

    def _describe(self, labels: LabelSpace | None) -> dict[str, Any]:
        """Return an equal document in the form of a robot's JSON."""
        rooms = [_describe_room(room) for room in self.graph.rooms]
        names = [room["id"] for room in rooms]
        return {
            "scene_id": self._scene_id(),
            **_read_said(self.graph.said.get("partial"), GRAPH_WORDS, of="partial"),
            "rooms": rooms,
            "objects": [_describe_object(obj, names, labels) for obj in self.graph.objects],
            "adjacency": [[names[a], names[b]] for a, b in self.graph.adjacency],
        }

    @property
    def is_numbered(self) -> bool:
        """Whether an early version of `write_hydra` wrote it, with numbered nodes."""
        return "format" in self.graph.said

    @property
    def document(self) -> Any:
        """The document of the belief graph in the file; None without one."""
        return find_document({"metadata": {"bsg": self.graph.said}})

    def notes(self, labels: LabelSpace | None = None) -> tuple[str, ...]:
        """Return what a person should know about how the file is read, a sentence each."""
        return (*self._note_rooms(), *_note_labels(self.graph.objects, labels))

    def annotated(self, belief: BeliefGraph) -> str:
        """Return the text with a belief graph in it; see `annotate_hydra`."""
        rooms = {_name_node(room): room.id for room in self.graph.rooms}
        objects = {_name_node(obj): obj.id for obj in self.graph.objects}
        strange = [room.name for room in belief.partial.rooms if room.name not in rooms]
        if strange:
            raise HydraError(
                f"{self.path}: has no room {strange[0]!r}, of which something is believed; "
                "use `write_hydra` for a new graph"
            )
        try:
            return annotate(
                self.text,
                belief,
                rooms=[rooms[room.name] for room in belief.partial.rooms],
                objects=[objects.get(obj.name) for obj in belief.partial.objects],
            )
        except HydraError as error:
            raise HydraError(f"{self.path}: {error}") from error

    def _scene_id(self) -> str:
        """Return the building's id from the belief in the file; else the file's name."""
        partial = self.document.get("partial") if isinstance(self.document, Mapping) else None
        name = partial.get("scene_id") if isinstance(partial, Mapping) else None
        return str(name or self.path.name.partition(".")[0] or self.path.name)

    def _note_rooms(self) -> Iterator[str]:
        rooms, objects = self.graph.rooms, self.graph.objects
        if not rooms:
            yield "it has no rooms (layer ROOMS): beliefs are about the building only"
        elif astray := sum(obj.room is None for obj in objects):
            yield f"{astray} of {_count(len(objects))} under no room, counted for the building only"


def open_hydra(path: Path) -> HydraFile:
    """Read a Spark-DSG file: `.json`, packed `.json.gz`, or binary `.sparkdsg`.

    Raises:
        HydraError: if it is not one, or if it is binary and spark_dsg is not installed.
    """
    try:
        text = read_text(path)
        return HydraFile(path, text, parse_dsg(text.removeprefix(BOM), path=path))
    except SourceError as error:
        raise HydraError(str(error)) from error


def select_words(said: Any, words: Collection[str]) -> dict[str, Any]:
    """Return the entries of metadata whose keys are those of a robot's JSON."""
    return {word: said[word] for word in words if word in said} if isinstance(said, dict) else {}


def read_text(path: Path) -> str:
    """Return the JSON of a file with its byte order mark; for a binary file, what spark_dsg makes.

    Raises:
        SourceError: if it cannot be read, or is larger than the limit.
        HydraError: if spark_dsg is missing, or cannot load it.
    """
    if path.suffix == BINARY:
        return convert(path)
    data = read_bytes(path, SPARK_DSG)
    return (BOM if data.startswith(codecs.BOM_UTF8) else "") + decode(data, path=path)


def _name_node(node: DSGNode) -> str:
    """Return the id of a room or object: from its metadata, else its symbol."""
    return str(node.said.get("id", node.symbol))


def _describe_room(node: DSGNode) -> dict[str, Any]:
    """Return a room in the form of a robot's JSON; its metadata take precedence."""
    called = node.label_name or node.name
    return {
        "id": node.symbol,
        "label": called,
        "room_type": label_of("spark-dsg", called),
        "position": node.position,
        "box": None if node.box is None else (node.box.minimum, node.box.maximum),
        **_read_said(node.said, ROOM_WORDS, of=f"room {node.symbol!r}"),
    }


def _describe_object(
    node: DSGNode, rooms: Sequence[str], labels: LabelSpace | None
) -> dict[str, Any]:
    return {
        "id": node.symbol,
        "room": None if node.room is None else rooms[node.room],
        "category": name_object(node, labels),
        "position": node.position,
        **_read_said(node.said, OBJECT_WORDS, of=f"object {node.symbol!r}"),
    }


def _read_said(said: Any, words: Collection[str], *, of: str) -> dict[str, Any]:
    """Return the keys of a robot's JSON in metadata; other keys belong to the user.

    Raises:
        RobotGraphError: for a key that looks misspelt.
    """
    for key in said if isinstance(said, dict) else ():
        if key in words or key in _OURS:
            continue
        if hint := ask_if_meant(key, [word for word in words if len(word) >= _TELLING]):
            raise RobotGraphError(f"{of}: {key[:SHOWN]!r} is no key; {hint}")
    return select_words(said, words)


def _note_labels(objects: Sequence[DSGNode], labels: LabelSpace | None) -> Iterator[str]:
    """Yield notes on labels that the file does not name, and on objects without label or name."""
    bare = [obj for obj in objects if not (obj.label_name or obj.name or "category" in obj.said)]
    named = Counter((obj.label, name_object(obj, labels)) for obj in bare if obj.label is not None)
    found = sorted(pair for pair in named if pair[1] != f"label {pair[0]}")
    if found and labels is not None:
        pairs = ", ".join(f"{label} is {name}" for label, name in found[:_SHOWN])
        yield f"the file does not name its labels; by {labels.name}, {pairs}"
    missing = sorted(set(named) - set(found))
    if missing:
        numbers = ", ".join(str(label) for label, _ in missing[:_SHOWN])
        yield (
            f"{_count(sum(named[pair] for pair in missing))} with labels that nobody names "
            f"({numbers}); name them by --labels: mpcat40, ade20k, or the file of the label space "
            "that Hydra ran with (config/label_spaces/NAME.yaml)"
        )
    silent = len(bare) - sum(named.values())
    if silent:
        yield f"{_count(silent)} with neither a label nor a name"


def _count(objects: int) -> str:
    return "1 object" if objects == 1 else f"{objects:,} objects"
