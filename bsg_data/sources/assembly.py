"""Scene graphs from lists of annotated instances."""

from __future__ import annotations

from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.scene_graph import Room, SceneGraph, SceneObject
from bsg_data.sources.annotations import Annotation, Instance
from bsg_data.sources.source import SceneRef


def assemble(
    annotation: Annotation, *, ref: SceneRef, kind: str, class_map: ClassMap
) -> SceneGraph:
    """Make the scene graph of one annotation.

    A region with an id of 0 or more is a room if it holds an instance. Objects of the null region
    belong to the building. A nameless object and one outside the classes stay, without a class.
    """
    regions = sorted({i.region_id for i in annotation.instances if i.region_id >= 0})
    room_of = {region: index for index, region in enumerate(regions, start=1)}
    return SceneGraph(
        scene_id=ref.scene_id,
        source=kind,
        source_version=ref.source_version,
        source_split=ref.source_split,
        annotation_sha256=annotation.sha256,
        rooms=tuple(Room(index, region) for region, index in room_of.items()),
        objects=tuple(
            _classify(instance, index, room_of.get(instance.region_id, 0), class_map)
            for index, instance in enumerate(annotation.instances, start=1)
        ),
        class_map=class_map.version,
    )


def _classify(instance: Instance, index: int, room: int, class_map: ClassMap) -> SceneObject:
    known = class_map.classify(instance.name)
    return SceneObject(
        object_index=index,
        instance_id=instance.instance_id,
        room_index=room,
        raw_category=instance.name,
        category=known.category,
        class_index=known.class_index,
        role=known.role,
        colour=instance.colour,
    )
