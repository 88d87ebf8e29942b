"""Read and write a robot's partial graph as plain JSON.

    {
      "format": "bsg-partial-graph", "version": 1,
      "scene_id": "office", "building_kind": "office", "source": null,
      "rooms": [
        {"id": "kitchen", "visited": true, "hidden_share": 0.5, "hidden_share_sd": 0.2,
         "label": null, "position": [2.0, 1.5, 0.0], "floor_area": 9.5,
         "room_type": {"kitchen": 0.7, "dining room": 0.3}},
        {"id": "hall", "visited": false, "room_type": "corridor"}
      ],
      "objects": [{"id": "7", "room": "kitchen", "category": "fridge", "position": null}],
      "adjacency": [["kitchen", "hall"]]
    }

`id`s are text, unique among the rooms and among the objects. A category is any name; the class map
gives its class. By default the hidden share is 1 for a room that was not visited, and vague
(`VAGUE`) for a visited one. Units are metres and square metres, Z up. `seconds_inside`,
`floor_in_view` and `walls_in_view` can replace a hidden share, which is then estimated.
docs/belief.md describes the format.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, ValidationError

from bsg_data.errors import RecipeError, SourceError
from bsg_data.files import AnyPath
from bsg_data.geometry.floor_area import find_floor_area
from bsg_data.inputs.bounds import MAX_ROBOT_ROOMS, ROBOT
from bsg_data.inputs.documents import read_json
from bsg_data.observation.hidden_share import VAGUE
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_data.observation.robot_faults import explain_fault, show_json
from bsg_data.observation.said_share import SaidShare, Share
from bsg_data.recipes import Record, name_fault
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap, load_class_map
from bsg_data.scene.class_space import ClassSpace
from bsg_data.scene.scene_graph import Box
from bsg_data.scene.surroundings import (
    MAX_FLOOR_AREA,
    RoomType,
    check_building_kind,
    check_room_type,
)
from bsg_data.spelling import SHOWN, show_value

_MOST_ROOMS = 5  # named in an error
AnyRecord = TypeVar("AnyRecord", bound=Record)
Id = Annotated[str, Field(min_length=1, max_length=500)]
Text = Annotated[str, Field(max_length=500)]


def _refuse_other_than_number(said: object) -> object:
    """Refuse what pydantic would take for a number: true, false and text."""
    if isinstance(said, bool) or not isinstance(said, Real):
        raise ValueError(f"expected a number, found {show_json(said)}")
    return said


Number = BeforeValidator(_refuse_other_than_number)
Metres = Annotated[float, Number, Field(ge=-1e6, le=1e6)]
Triple = tuple[Metres, Metres, Metres]
SquareMetres = Annotated[float, Field(gt=0, le=MAX_FLOOR_AREA, strict=True)]
BuildingKind = Annotated[Text | None, AfterValidator(check_building_kind)]


def _read_room_type(said: object) -> RoomType | None:
    """Return a room type from JSON in the common labels.

    Raises:
        RecipeError: if it is no room type.
    """
    if said is None or isinstance(said, str):
        return check_room_type(said)
    if isinstance(said, dict) and all(type(share) in (int, float) for share in said.values()):
        return check_room_type(said)
    raise RecipeError(
        f"expected a room label, or labels with their probabilities, found {show_json(said)}"
    )


RoomTypes = Annotated[RoomType | None, PlainValidator(_read_room_type)]


class RobotGraphError(SourceError):
    """Report a malformed graph of a robot."""


class _Room(SaidShare):
    id: Id
    label: Text | None = None
    position: Triple | None = None
    box: tuple[Triple, Triple] | None = None
    footprint: Annotated[tuple[tuple[Metres, Metres], ...], Field(min_length=3)] | None = None
    floor_index: Annotated[int, Number, Field(ge=-1000, le=1000)] | None = None
    floor_area: SquareMetres | None = None
    room_type: RoomTypes = None


class _Object(Record):
    id: Id
    room: Id | None = None
    category: Text
    corrected: Text | None = None
    class_name: Annotated[Text | None, Field(alias="class")] = None
    position: Triple | None = None


class _Graph(Record):
    format: Literal["bsg-partial-graph"] = "bsg-partial-graph"
    version: Annotated[Literal[1], Number] = 1
    scene_id: Id
    hidden_share: Share | None = None
    building_kind: BuildingKind = None
    source: Id | None = None
    rooms: Annotated[tuple[_Room, ...], Field(max_length=MAX_ROBOT_ROOMS)]
    objects: tuple[_Object, ...] = ()
    adjacency: tuple[tuple[Id, Id], ...] = ()


_KEYS = {
    "": tuple(_Graph.model_fields),
    "rooms": tuple(_Room.model_fields),
    "objects": tuple(field.alias or name for name, field in _Object.model_fields.items()),
}

# What a robot may say of its rooms, its objects and the building, in any file format.
ROOM_WORDS = tuple(_Room.model_fields)
OBJECT_WORDS = ("id", "category", "position")
GRAPH_WORDS = tuple(
    word
    for word in _Graph.model_fields
    if word not in ("format", "version", "rooms", "objects", "adjacency")
)


def read_robot_graph(
    path: AnyPath, *, class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP
) -> PartialGraph:
    """Read a partial graph from a JSON file.

    The class map gives each category its class. Objects with an unknown category stay in the graph
    without a class; `list_unmapped` names them.

    Args:
        path: the file.
        class_map: a published version, the path of your own NAME.csv, or a loaded map.

    Raises:
        RobotGraphError: naming the file, the entry, and what was expected there.
    """
    path = Path(path)
    said = read_json(path, ROBOT, error=RobotGraphError)
    return parse_robot_graph(said, path=path, class_map=class_map)


def parse_robot_graph(
    said: Any, *, path: Path, class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP
) -> PartialGraph:
    """Return the partial graph in a robot's JSON document.

    Raises:
        RobotGraphError: as `read_robot_graph`.
    """
    loaded = load_class_map(class_map)

    def classify(obj: _Object, _: str) -> tuple[str | None, int | None]:
        known = loaded.classify(obj.category)
        return known.category, known.class_index

    space = loaded.space
    return _assemble(said, path=path, class_space=space, classify=classify)


def parse_classified_graph(said: Any, *, path: Path, class_space: ClassSpace) -> PartialGraph:
    """Return the partial graph of a document that has the class of every object.

    Raises:
        RobotGraphError: as `read_robot_graph`, and for a class that is not in the space.
    """
    index = {name: number for number, name in enumerate(class_space.classes)}

    def classify(obj: _Object, where: str) -> tuple[str | None, int | None]:
        if obj.class_name is not None and obj.class_name not in index:
            raise RobotGraphError(
                f"{path}: {where}: {obj.class_name!r} is no class of {class_space.name}"
            )
        return obj.corrected, None if obj.class_name is None else index[obj.class_name]

    return _assemble(said, path=path, class_space=class_space, classify=classify)


def _assemble(
    said: Any,
    *,
    path: Path,
    class_space: ClassSpace,
    classify: Callable[[_Object, str], tuple[str | None, int | None]],
) -> PartialGraph:
    if isinstance(said, dict) and said.get("format") == "bsg-belief-graph":
        said = said.get("partial")  # a belief graph holds the partial graph
        if said is None:
            raise RobotGraphError(
                f"{path}: a belief graph without `partial`, the graph that the robot has seen; "
                "expected it there (docs/belief.md)"
            )
    if not isinstance(said, dict):
        raise RobotGraphError(
            f"{path}: expected a JSON object with `scene_id`, `rooms` and `objects` "
            f"(docs/belief.md), found {show_json(said)}"
        )
    try:
        document = _Graph.model_validate(said)
    except ValidationError as error:
        raise RobotGraphError(f"{path}: {explain_fault(error, said, keys=_KEYS)}") from error
    index = _number([room.id for room in document.rooms], "room", path)
    _number([obj.id for obj in document.objects], "object", path)
    rooms = tuple(_know(room, path) for room in document.rooms)
    objects = []
    for obj in document.objects:
        called = f"object {obj.id[:SHOWN]!r} ({obj.category[:SHOWN]})"
        room = _find(obj.room, index, called, path) if obj.room is not None else 0
        category, class_index = classify(obj, f"objects: {obj.id}")
        objects.append(SeenObject(obj.id, room, obj.category, category, class_index, obj.position))
    adjacency = set()
    for ends in document.adjacency:
        a, b = (
            _find(end, index, f"adjacency of {ends[0][:SHOWN]!r} and {ends[1][:SHOWN]!r}", path)
            for end in ends
        )
        if a == b:
            raise RobotGraphError(f"{path}: adjacency: {ends[0]!r} with itself")
        adjacency.add((min(a, b), max(a, b)))
    share = document.hidden_share
    if share is None:
        share = float(np.mean([room.hidden_share for room in rooms])) if rooms else VAGUE.mean
    return PartialGraph(
        scene_id=document.scene_id,
        class_space=class_space,
        hidden_share=share,
        rooms=rooms,
        objects=tuple(objects),
        adjacency=tuple(sorted(adjacency)),
        building_kind=document.building_kind,
        source=document.source,
    )


def _number(ids: list[str], what: str, path: Path) -> dict[str, int]:
    twice = [name for name, times in Counter(ids).items() if times > 1]
    if twice:
        raise RobotGraphError(f"{path}: {what} id {twice[0]!r} is there twice")
    return {name: number for number, name in enumerate(ids, 1)}


def _find(name: str, index: Mapping[str, int], where: str, path: Path) -> int:
    if name not in index:
        known = ", ".join(room[:SHOWN] for room in list(index)[:_MOST_ROOMS]) or "none"
        more = f" and {len(index) - _MOST_ROOMS:,} more" if len(index) > _MOST_ROOMS else ""
        raise RobotGraphError(
            f"{path}: {where}: expected the id of a room, found no room {name[:SHOWN]!r}; rooms "
            f"are {known}{more}: name one of these, or add the room to `rooms`"
        )
    return index[name]


def _know(room: _Room, path: Path) -> KnownRoom:
    box = None if room.box is None else Box(*room.box)
    try:
        area = find_floor_area(room.floor_area, footprint=room.footprint, box=box)
        share = room.believe(floor_area=area)
    except RecipeError as error:
        raise RobotGraphError(f"{path}: room {room.id!r}: {error}") from error
    return KnownRoom(
        name=room.id,
        hidden_share=share.mean,
        visited=room.visited,
        label=room.label,
        position=room.position,
        box=box,
        footprint=room.footprint,
        floor_index=room.floor_index,
        floor_area=room.floor_area,
        room_type=room.room_type,
        hidden_share_sd=share.sd,
    )


def encode_robot_graph(graph: PartialGraph) -> dict[str, Any]:
    """Return the JSON document of a partial graph.

    `parse_classified_graph` reads it back; so does `parse_robot_graph` with the same class map.
    """
    names = [room.name for room in graph.rooms]
    return {
        "format": "bsg-partial-graph",
        "version": 1,
        "scene_id": graph.scene_id,
        "hidden_share": graph.hidden_share,
        "building_kind": graph.building_kind,
        "source": graph.source,
        "rooms": [
            {
                "id": room.name,
                "visited": room.visited,
                "hidden_share": room.hidden_share,
                "hidden_share_sd": room.hidden_share_sd,
                "label": room.label,
                "position": room.position,
                "box": None if room.box is None else [room.box.minimum, room.box.maximum],
                "footprint": room.footprint,
                "floor_index": room.floor_index,
                "floor_area": room.floor_area,
                "room_type": room.room_type,
            }
            for room in graph.rooms
        ],
        "objects": [
            {
                "id": obj.name,
                "room": names[obj.room_index - 1] if obj.room_index else None,
                "category": obj.raw_category,
                "corrected": obj.category,
                "class": _name_class(graph, obj),
                "position": obj.position,
            }
            for obj in graph.objects
        ],
        "adjacency": [[names[a - 1], names[b - 1]] for a, b in graph.adjacency],
    }


def _name_class(graph: PartialGraph, obj: SeenObject) -> str | None:
    return None if obj.class_index is None else graph.class_space.classes[obj.class_index]


def check_object(seen: SeenObject) -> SeenObject:
    """Return an object with plain Python numbers, and refuse values that no file could hold.

    Raises:
        RecipeError: naming what is wrong with it.
    """
    said = {"id": seen.name, "category": seen.raw_category, "position": seen.position}
    found = _check(_Object, said, f"object {show_value(seen.name)}")
    return replace(seen, name=found.id, raw_category=found.category, position=found.position)


def check_room(room: KnownRoom) -> KnownRoom:
    """Return a room with plain Python numbers, and refuse values that no file could hold.

    Raises:
        RecipeError: naming what is wrong with it.
    """
    said = {"id": room.name, "position": room.position, "floor_area": room.floor_area}
    found = _check(_Room, said, f"room {show_value(room.name)}")
    area = None if found.floor_area is None else float(found.floor_area)
    return replace(room, name=found.id, position=found.position, floor_area=area)


def _check(kind: type[AnyRecord], said: dict[str, Any], what: str) -> AnyRecord:
    try:
        return kind.model_validate(said)
    except ValidationError as error:
        raise RecipeError(f"{what}: {name_fault(error)}") from error


def list_unmapped(graph: PartialGraph) -> dict[str, int]:
    """Return category → number of objects, for categories that are not in the class map."""
    return dict(Counter(obj.raw_category for obj in graph.objects if obj.category is None))
