"""Read scene graphs that Hydra recorded, as Spark-DSG JSON."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

from bsg_data.errors import SourceError
from bsg_data.geometry.placement import find_storeys
from bsg_data.inputs.bounds import SPARK_DSG
from bsg_data.inputs.documents import parse_json
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.scene_graph import Room, SceneObject
from bsg_data.sources.annotation_files import find_files, read_listed
from bsg_data.sources.assembly import assemble, place_room
from bsg_data.sources.dsg_file import DSGFile, DSGNode, parse_dsg
from bsg_data.sources.label_space import LabelSpace, load_label_space
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, SkippedScene, SourceRow

_WITH_MESH = "_with_mesh"  # Hydra writes dsg.json and, with the mesh, dsg_with_mesh.json


@dataclass(frozen=True)
class RobotGraphs:
    """A folder of Spark-DSG graphs, packed or not, or one such file."""

    path: Path  # the folder or the file
    # the label space of the objects: `ade20k`, `mpcat40`, or the path of a YAML or CSV of your own;
    # None takes the names that the files have
    labels: str | None = None

    kind = "spark-dsg"

    @property
    def options(self) -> dict[str, int | str]:
        """The label space, by its name and its hash."""
        space = self._space()
        return {} if space is None else {"labels": f"{space.name} {space.sha256}"}

    def find(self) -> FoundScenes:
        """Find every graph; of one with and without its mesh, the one without."""
        self._space()  # a missing label space is no fault of a graph
        expected = (
            "no graph found; expected Spark-DSG files named *.json or *.json.gz, such as the "
            "dsg.json that Hydra leaves in its backend folder"
        )
        found = find_files(self.path, ".json", bound=SPARK_DSG, expected=expected, is_path=True)
        names = {ref.scene_id for ref in found.scenes}
        seconds = [ref for ref in found.scenes if _is_second(ref.scene_id, names)]
        reason = "the graph beside it, with its mesh"
        skips = [SkippedScene(ref.scene_id, ref.location, reason) for ref in seconds]
        return replace(
            found,
            scenes=tuple(ref for ref in found.scenes if ref not in seconds),
            duplicates=(*found.duplicates, *skips),
        )

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one graph; its mesh stays where it is. Objects under no room are the building's."""
        path = self.path if self.path.is_file() else self.path / ref.location
        data = read_listed(path, SPARK_DSG, expected=ref.fingerprint)
        try:
            document = parse_json(data, once=False)  # Hydra's own parser takes the last value
        except ValueError as error:
            message = f"{path}: expected a Spark-DSG graph, found no JSON ({str(error)[:200]})"
            raise SourceError(message, code="json-malformed", where=path) from error
        file = parse_dsg(document, path=path)
        graph = assemble(
            _list_objects(file, self._space()),
            ref=ref,
            kind=self.kind,
            sha256=hashlib.sha256(data).hexdigest(),
            class_map=class_map,
            rooms=find_storeys([_room(node) for node in file.rooms]),
            doors=[(file.rooms[a].index, file.rooms[b].index) for a, b in file.adjacency],
            method="robot",
        )
        return Reading(graph)

    def _space(self) -> LabelSpace | None:
        return None if self.labels is None else load_label_space(self.labels)


def _is_second(name: str, names: set[str]) -> bool:
    """Say whether a file is a graph with its mesh, and the same graph without is there, too."""
    return name.endswith(_WITH_MESH) and name.removesuffix(_WITH_MESH) in names


def _room(node: DSGNode) -> Room:
    room = Room(0, node.index, source_label=node.label_name or node.name, centroid=node.position)
    return room if node.box is None else place_room(room, node.box)


def _list_objects(file: DSGFile, space: LabelSpace | None) -> list[SceneObject]:
    return [
        SceneObject(
            object_index=0,
            instance_id=node.index,
            room_index=-1 if node.room is None else file.rooms[node.room].index,
            raw_category=name_object(node, space),
            centroid=node.position if node.box is None else node.box.centre,
            box=node.box,
        )
        for node in file.objects
    ]


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


ROW = SourceRow(
    summary="a folder of Spark-DSG graphs, as Hydra records them: what robots saw",
    open=RobotGraphs,
    terms=None,  # a recording belongs to whoever made it
    class_map="hm3d45-v2",
)
