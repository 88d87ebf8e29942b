"""Read scene graphs that Hydra recorded, as Spark-DSG JSON."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bsg_data.errors import SourceError
from bsg_data.geometry.adjacency import measure_distance
from bsg_data.geometry.placement import find_storeys
from bsg_data.inputs.bounded_file import PACKED
from bsg_data.inputs.bounds import SPARK_DSG
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import label_of
from bsg_data.scene.scene_graph import Box, Edge, Point, Room, SceneGraph, SceneObject
from bsg_data.sources.annotation_files import (
    decode,
    fingerprint,
    list_files,
    read_listed,
    refuse_unreadable,
)
from bsg_data.sources.dsg_file import DSGFile, DSGNode, parse_dsg
from bsg_data.sources.hm3d_names import keep_one_copy
from bsg_data.sources.label_space import LabelSpace, load_label_space
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, SkippedScene, SourceRow

_SUFFIXES = (".json", f".json{PACKED}")
_WITH_MESH = "_with_mesh"  # Hydra writes dsg.json and, with the mesh, dsg_with_mesh.json


@dataclass(frozen=True)
class RobotGraphs:
    """A folder of Spark-DSG graphs, packed or not, or one such file.

    Attributes:
        path: the folder or the file.
        labels: the label space of the objects: `ade20k`, `mpcat40`, or the path of a YAML or CSV
            of your own; None takes the names that the files have.
    """

    path: Path
    labels: str | None = None

    @property
    def kind(self) -> str:
        """`spark-dsg`."""
        return "spark-dsg"

    @property
    def options(self) -> dict[str, int | str]:
        """The label space, by its name and its hash."""
        space = self._space()
        return {} if space is None else {"labels": f"{space.name} {space.sha256}"}

    def find(self) -> FoundScenes:
        """Find every graph; of one with and without its mesh, the one without."""
        self._space()  # a missing label space is no fault of a graph
        unreadable: list[SkippedScene] = []
        files = list_files(self.path, _SUFFIXES, unreadable)
        if not files:
            refuse_unreadable(self.path, unreadable)
            raise SourceError(
                f"{self.path}: no graph found; expected Spark-DSG files named *.json or "
                "*.json.gz, such as the dsg.json that Hydra leaves in its backend folder"
            )
        names = {_stem(file) for file in files}
        kept = [file for file in files if not _is_second(file, names)]
        found = keep_one_copy(self._refer(file) for file in kept)
        seconds = tuple(self._duplicate(file) for file in files if _is_second(file, names))
        return replace(
            found, duplicates=(*found.duplicates, *seconds), unreadable=tuple(unreadable)
        )

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one graph; its mesh stays where it is."""
        path = self.path if self.path.is_file() else self.path / ref.location
        data = read_listed(path, SPARK_DSG, expected=ref.fingerprint)
        graph = parse_dsg(decode(data, path=path), path=path)
        digest = hashlib.sha256(data).hexdigest()
        return Reading(_assemble(graph, ref, digest, self._space(), class_map))

    def _space(self) -> LabelSpace | None:
        return None if self.labels is None else load_label_space(self.labels)

    def _where(self, path: Path) -> str:
        return path.name if path == self.path else path.relative_to(self.path).as_posix()

    def _refer(self, path: Path) -> SceneRef:
        where = self._where(path)
        return SceneRef(
            scene_id="-".join(_stem(Path(where)).parts),
            location=where,
            fingerprint=fingerprint(path, SPARK_DSG),
            source_split=None,
            source_version=None,
        )

    def _duplicate(self, path: Path) -> SkippedScene:
        ref = self._refer(path)
        return SkippedScene(ref.scene_id, ref.location, "the graph beside it, with its mesh")


def _stem(path: Path) -> Path:
    name = path.name.removesuffix(PACKED).removesuffix(".json")
    return path.with_name(name or path.name)


def _is_second(path: Path, stems: set[Path]) -> bool:
    """Say whether a file is a graph with its mesh, and the same graph without is there, too."""
    stem = _stem(path)
    bare = stem.name.removesuffix(_WITH_MESH)
    return bare not in ("", stem.name) and stem.with_name(bare) in stems


def _assemble(
    graph: DSGFile, ref: SceneRef, sha256: str, space: LabelSpace | None, class_map: ClassMap
) -> SceneGraph:
    """Make the scene graph; an object under no room belongs to the building."""
    rooms = find_storeys([_room(node, place) for place, node in enumerate(graph.rooms, start=1)])
    return SceneGraph(
        scene_id=ref.scene_id,
        source="spark-dsg",
        source_version=ref.source_version,
        source_split=ref.source_split,
        annotation_sha256=sha256,
        rooms=rooms,
        objects=tuple(
            _object(node, place, space, class_map)
            for place, node in enumerate(graph.objects, start=1)
        ),
        adjacency=_connect(rooms, graph.adjacency),
        class_map=class_map.version,
    )


def _room(node: DSGNode, index: int) -> Room:
    said = node.label_name or node.name
    room = Room(index, node.index, source_label=said, label=label_of("spark-dsg", said))
    if node.box is None:
        return replace(room, centroid=node.position)
    (a, b, floor), (c, d, _) = node.box.minimum, node.box.maximum
    return replace(
        room,
        box=node.box,
        centroid=_middle(node.box),
        floor_z=floor,
        footprint=((a, b), (c, b), (c, d), (a, d)),
        floor_area=(c - a) * (d - b) or None,
    )


def _object(
    node: DSGNode, index: int, space: LabelSpace | None, class_map: ClassMap
) -> SceneObject:
    name = name_object(node, space)
    known = class_map.classify(name)
    return SceneObject(
        object_index=index,
        instance_id=node.index,
        room_index=SceneObject.BUILDING if node.room is None else node.room + 1,
        raw_category=name,
        category=known.category,
        class_index=known.class_index,
        role=known.role,
        centroid=node.position if node.box is None else _middle(node.box),
        box=node.box,
    )


def name_object(node: DSGNode, space: LabelSpace | None) -> str:
    """Return the name of an object: of its label by the space, by the file, else its own.

    A published space names a label's number where neither the file nor the object has a name. An
    own name loses its number, `chair_3` for example. A label that nobody names is `label 5`, so
    that a build reports it; an object without either has no name.
    """
    own = (node.name or "").rstrip("0123456789").rstrip("_ #-")
    if node.label is None:
        name = own
    elif space is None:
        name = node.label_name or own or f"label {node.label}"
    else:
        given = space.names.get(node.label) or node.label_name or own
        name = given or space.usual.get(node.label) or f"label {node.label}"
    return name if space is None else space.translate(name)


def _connect(rooms: Sequence[Room], pairs: Sequence[tuple[int, int]]) -> tuple[Edge, ...]:
    return tuple(
        Edge(a + 1, b + 1, "adjacent", "robot", measure_distance(rooms[a], rooms[b]))
        for a, b in pairs
    )


def _middle(box: Box) -> Point:
    x, y, z = ((low + high) / 2 for low, high in zip(box.minimum, box.maximum, strict=True))
    return x, y, z


ROW = SourceRow(
    summary="a folder of Spark-DSG graphs, as Hydra records them: what robots saw",
    open=RobotGraphs,
    terms=None,  # a recording belongs to whoever made it
    class_map="hm3d45-v2",
)
