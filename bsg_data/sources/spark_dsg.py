"""Read scene graphs that Hydra recorded, as Spark-DSG JSON."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

from bsg_data.dataset.manifest import SkippedScene
from bsg_data.inputs.documents import require_json
from bsg_data.scene.class_map import ClassMap
from bsg_data.sources.annotation_files import find_files, read_scene_file
from bsg_data.sources.assembly import assemble
from bsg_data.sources.dsg_file import DSGNode, parse_dsg
from bsg_data.sources.label_space import LabelSpace, load_label_space, name_object
from bsg_data.sources.source import (
    AnnotatedRoom,
    Annotation,
    FoundScenes,
    Reading,
    SceneRef,
    SourceRow,
)

_WITH_MESH = "_with_mesh"  # Hydra writes dsg.json and, with the mesh, dsg_with_mesh.json


@dataclass(frozen=True)
class _RobotGraphs:
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
        found = find_files(self.path, ".json", expected=expected, is_path=True)
        names = {ref.scene_id for ref in found.scenes}
        seconds = {f"{name}{_WITH_MESH}" for name in names} & names
        reason = "the graph beside it, with its mesh"
        skips = (
            SkippedScene(ref.scene_id, ref.location, reason)
            for ref in found.scenes
            if ref.scene_id in seconds
        )
        scenes = tuple(ref for ref in found.scenes if ref.scene_id not in seconds)
        return replace(found, scenes=scenes, duplicates=(*found.duplicates, *skips))

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one graph; its mesh stays where it is. Objects under no room are the building's."""
        path, data = read_scene_file(self.path, ref)
        document = require_json(data, path, once=False)  # Hydra's own parser takes the last value
        file = parse_dsg(document, path=path)
        space = self._space()
        annotation = Annotation(
            [-1 if node.room is None else file.rooms[node.room].index for node in file.objects],
            [name_object(node, space) for node in file.objects],
            ids=[node.index for node in file.objects],
            centroids=[None if node.box else node.position for node in file.objects],
            boxes=[node.box for node in file.objects],
            rooms=map(_describe_room, file.rooms),
            doors=[(file.rooms[a].index, file.rooms[b].index) for a, b in file.adjacency],
            method="robot",
            sha256=hashlib.sha256(data).hexdigest(),
        )
        reason = f"{file.lost:,} edges to nodes that are not there: they are left out"
        lost = [SkippedScene(ref.scene_id, ref.location, reason)] if file.lost else []
        graph = assemble(annotation, ref=ref, kind=self.kind, class_map=class_map)
        return Reading(graph, left_out=tuple(lost))

    def _space(self) -> LabelSpace | None:
        return None if self.labels is None else load_label_space(self.labels)


def _describe_room(node: DSGNode) -> AnnotatedRoom:
    return AnnotatedRoom(
        region=node.index,
        source_label=node.label_name or node.name,
        centroid=None if node.box else node.position,
        box=node.box,
    )


ROW = SourceRow(
    summary="a folder of Spark-DSG graphs, as Hydra records them: what robots saw",
    open=_RobotGraphs,
    terms=None,  # a recording belongs to whoever made it
    class_map="hm3d45-v1",
    is_complete=False,
)
