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
      "objects": [{"id": "7", "room": "kitchen", "category": "fridge", "position": null},
                  {"id": "8", "room": "kitchen", "category": "milk", "on": "7"}],
      "adjacency": [["kitchen", "hall"]],
      "detector": ["fridge", "chair", "cup"],
      "looks": [{"room": "kitchen", "thing": "cup", "chance": 0.8}], "more_rooms": 3,
      "customs": [{"thing": "drinks", "room": "kitchen", "at": "7"}],
      "now": "2026-11-28T08:30:00Z"
    }

With a clock (`now`), rooms, objects and looks have a `time`, and `memory` has where things were.

`id`s are text, unique among the rooms and among the objects. A category is any name; the class map
gives its class. By default the hidden share is 1 for a room that was not visited, and vague
(`VAGUE`) for a visited one. Units are metres and square metres, Z up. `seconds_inside`,
`floor_in_view` and `walls_in_view` can replace a hidden share, which is then estimated.
docs/belief.md describes the format. A room's fields are those of `KnownRoom`.

`bsg_robot.graph.map_forms` has the other forms that are read, as room → the things seen there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeGuard

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationError,
)

from bsg_data.errors import RecipeError, SourceError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounds import (
    MAX_ALL_CORNERS,
    MAX_ROBOT_CUSTOMS,
    MAX_ROBOT_KINDS,
    MAX_ROBOT_LETTERS,
    MAX_ROBOT_LOOKS,
    MAX_ROBOT_OBJECTS,
    MAX_ROBOT_PAIRS,
    MAX_ROBOT_ROOMS,
    MAX_ROBOT_SOUGHT,
    MAX_ROBOT_TYPES,
    MAX_ROBOT_WORDS,
    ROBOT,
)
from bsg_data.inputs.documents import read_json
from bsg_data.records import Keyed, Listed, SaidRecord, keep_one_unknown
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap, load_class_map
from bsg_data.scene.class_space import ClassSpace
from bsg_data.scene.room_label import (
    Origin,
    RoomReader,
    check_own_label,
    is_name,
    list_all_labels,
    normalise_room,
    owner_of,
    read_building_kind,
    read_room_type,
    say_again,
    tell_building,
)
from bsg_data.scene.surroundings import (
    BUILDING_KINDS,
    SAID_KINDS,
    find_floor_area,
)
from bsg_data.scene.synonyms import vocabulary_words
from bsg_data.words.nearest import ask_if_meant, nearest_names
from bsg_data.words.shown import SHOWN
from bsg_models.belief.clock import Time, show_time
from bsg_models.belief.hidden_share import VAGUE, ShareBelief, estimate_hidden_share
from bsg_models.belief.partial_graph import (
    LOOK_CHANCE,
    Custom,
    Hours,
    Id,
    KnownRoom,
    Look,
    MoreRooms,
    Number,
    PartialGraph,
    Position,
    Remembered,
    Score,
    SeenObject,
    Sighting,
    Stay,
    StrictFraction,
    Text,
    Unread,
)
from bsg_robot.graph.map_forms import FORM, open_belief, require_few, spell_out
from bsg_robot.graph.memory import MOST_IN_ALL, MOST_SIGHTINGS, MOST_THINGS, say_time, start_clock
from bsg_robot.things.things import classify_seen

OwnLabels = Sequence[tuple[str, str | None]]  # the user's words for rooms, each with its label
_OF_SOMEBODY = {"bedroom": 0.55, "child's bedroom": 0.4}  # a room that has somebody's name alone
_MOST_WORDS = 5  # named in a note
_TELLING = 2  # rooms that tell the kind of a building
_ENTRIES = {
    "rooms": "room",
    "objects": "object",
    "adjacency": "pair of adjacency",
    "looks": "look",
    "memory": "remembered thing",
    "customs": "custom",
}
_UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")
_WORDS = {  # of JSON, where pydantic's are of Python's types
    "model_type": "expected a JSON object (docs/belief.md)",
    "dataclass_type": 'expected a JSON object, such as {"id": "kitchen"} (docs/belief.md)',
    "tuple_type": "expected a JSON list",
    "dict_type": "expected a JSON list of words",
    "missing": f"is missing (docs/belief.md); the simplest map is {FORM}",
}
_ROOM_FIELDS = tuple(one.name for one in fields(KnownRoom))
_SHARE_WORDS = ("visited", "hidden_share", "hidden_share_sd")
_FACTS = tuple(name for name in _ROOM_FIELDS if name not in ("name", *_SHARE_WORDS))
_LOOKS = ("seconds_inside", "floor_in_view", "walls_in_view")
# What a robot may say of its rooms, its objects and the building, in any file format.
ROOM_WORDS = (*_SHARE_WORDS, *_LOOKS, "id", *_FACTS)
OBJECT_WORDS = ("id", "category", "position", "score", "time", "age", "stays", "on")
_GRAPH_FACTS = ("scene_id", "hidden_share", "building_kind", "source", "more_rooms", "stays")
GRAPH_WORDS = (*_GRAPH_FACTS, "detector", "looks", "now", "memory", "customs")


class RobotGraphError(SourceError):
    """Report a malformed graph of a robot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Room(KnownRoom):
    """A room as a robot says it: its hidden share, or how it looked at the room."""

    hidden_share: StrictFraction | None = None  # type: ignore[assignment]
    seconds_inside: Annotated[float, Number, Field(ge=0, le=1e9)] | None = None
    floor_in_view: StrictFraction | None = None
    walls_in_view: StrictFraction | None = None


def _know(room: _Room) -> KnownRoom:
    """Return a room with its hidden share, stated or estimated."""
    looks = {name: getattr(room, name) for name in _LOOKS}
    twice = [name for name, look in looks.items() if look is not None]
    if room.hidden_share is None and room.hidden_share_sd:
        raise RecipeError("has hidden_share_sd without hidden_share; give both or neither")
    if room.hidden_share is not None and twice:
        raise RecipeError(
            f"has hidden_share and {twice[0]}, which serves to estimate it; leave out one of them"
        )
    if room.hidden_share is None:
        area = find_floor_area(room.floor_area, footprint=room.footprint, box=room.box)
        share = estimate_hidden_share(visited=room.visited, floor_area=area, **looks)
    else:
        share = ShareBelief(room.hidden_share, room.hidden_share_sd)
    facts = {name: getattr(room, name) for name in _ROOM_FIELDS}
    return KnownRoom(**facts | {"hidden_share": share.mean, "hidden_share_sd": share.sd})


_SaidRoom = Annotated[
    _Room,
    BeforeValidator(lambda said: keep_one_unknown(said, ROOM_WORDS)),
    AfterValidator(_know),
]


class _Object(SaidRecord):
    id: Id
    room: Id | None = None
    category: Text
    corrected: Text | None = None
    class_name: Annotated[Text | None, Field(alias="class")] = None
    position: Position | None = None
    score: Score | None = None
    time: Time | None = None
    age: Hours | None = None
    stays: Stay | None = None
    on: Id | None = None


class _Look(SaidRecord):
    room: Id
    thing: Annotated[Text, Field(min_length=1)]
    chance: Score = LOOK_CHANCE
    at: Id | None = None
    time: Time | None = None


class _Remembered(SaidRecord):
    id: Id
    category: Text
    score: Score | None = None
    # Each with the time, the room (null: none) and the piece of furniture (null: unknown).
    sightings: Annotated[
        Listed[tuple[Time, Id | None, Id | None]], Field(min_length=1, max_length=MOST_SIGHTINGS)
    ]


class _Custom(SaidRecord):
    thing: Annotated[Text, Field(min_length=1)]
    room: Id | None = None
    at: Id | None = None
    never: bool = False


def _list_words(said: Any) -> Any:
    """Return the words of a detector: a list of them, or those of a published vocabulary."""
    if isinstance(said, str) and said:
        said = [*vocabulary_words(said)]
    if isinstance(said, list | dict) and len(said) > MAX_ROBOT_WORDS:
        raise ValueError(f"expected at most {MAX_ROBOT_WORDS:,} words, found {len(said):,}")
    are_words = isinstance(said, list) and all(isinstance(word, str) for word in said)
    return dict.fromkeys(said) if are_words else said


def _count_parts(rooms: Any) -> Any:
    """Refuse rooms that have too much in all, before any of it is read."""
    listed = [room for room in rooms if isinstance(room, dict)] if _is_list(rooms) else []
    corners = sum(len(one) for room in listed if _is_list(one := room.get("footprint")))
    require_few(corners, MAX_ALL_CORNERS, "corners of all footprints together")
    types = [room.get(key) for room in listed for key in ("room_type", "unread")]
    labels = sum(len(one) for one in types if isinstance(one, dict | list))
    require_few(labels, MAX_ROBOT_TYPES, "labels of all room types together")
    kinds: set[str] = set()
    for one in types:
        words = [one] if isinstance(one, str) else one if isinstance(one, dict | list) else ()
        kinds.update(word for word in words if isinstance(word, str))
    require_few(len(kinds), MAX_ROBOT_KINDS, "different labels of room types")
    return rooms


def _count_letters(objects: Any) -> Any:
    """Refuse objects with too many long and different words."""
    listed = objects if _is_list(objects) and len(objects) <= MAX_ROBOT_OBJECTS else ()
    words = {
        one["category"]
        for one in listed
        if isinstance(one, dict) and isinstance(one.get("category"), str)
    }
    what = "letters of different words for objects"
    require_few(sum(map(len, words)), MAX_ROBOT_LETTERS, what)
    return objects


def _count_things(looks: Any) -> Any:
    """Refuse looks for too many different things."""
    listed = looks if _is_list(looks) and len(looks) <= MAX_ROBOT_LOOKS else ()
    things = {
        one["thing"]
        for one in listed
        if isinstance(one, dict) and isinstance(one.get("thing"), str)
    }
    what = "different things to look for"
    require_few(len(things), MAX_ROBOT_SOUGHT, what, "; leave out old looks")
    return looks


def _count_sightings(memory: Any) -> Any:
    """Refuse more sightings than a memory keeps."""
    listed = [one for one in memory if isinstance(one, dict)] if _is_list(memory) else []
    sightings = sum(len(one) for o in listed if _is_list(one := o.get("sightings")))
    require_few(sightings, MOST_IN_ALL, "sightings of all things together")
    return memory


def _count_own(said: Any) -> Any:
    """Refuse a table of too many words for rooms."""
    if isinstance(said, dict):
        require_few(len(said), MAX_ROBOT_WORDS, "words for rooms")
    return said


def _check_own(said: Mapping[str, str | None]) -> Mapping[str, str | None]:
    return {word: check_own_label(word, label) for word, label in said.items()}


def _is_list(said: Any) -> TypeGuard[list[Any] | tuple[Any, ...]]:
    return isinstance(said, list | tuple)


class _Graph(SaidRecord):
    format: Literal["bsg-partial-graph"] = "bsg-partial-graph"
    version: Annotated[Literal[1], Number] = 1
    scene_id: Id
    hidden_share: StrictFraction | None = None
    building_kind: Text | None = None
    source: Id | None = None
    rooms: Annotated[
        Listed[_SaidRoom], Field(max_length=MAX_ROBOT_ROOMS), BeforeValidator(_count_parts)
    ]
    objects: Annotated[
        Listed[_Object], Field(max_length=MAX_ROBOT_OBJECTS), BeforeValidator(_count_letters)
    ] = ()
    adjacency: Annotated[Listed[tuple[Id, Id]], Field(max_length=MAX_ROBOT_PAIRS)] = ()
    # A list of words, or the name of a vocabulary; or word → class, as `encode_robot_graph` writes.
    detector: Annotated[Keyed[Text, Text | None] | None, BeforeValidator(_list_words)] = None
    looks: Annotated[
        Listed[_Look], Field(max_length=MAX_ROBOT_LOOKS), BeforeValidator(_count_things)
    ] = ()
    more_rooms: MoreRooms = None
    stays: Stay | None = None
    now: Time | None = None
    memory: Annotated[
        Listed[_Remembered], Field(max_length=MOST_THINGS), BeforeValidator(_count_sightings)
    ] = ()
    customs: Annotated[Listed[_Custom], Field(max_length=MAX_ROBOT_CUSTOMS)] = ()
    room_labels: Annotated[
        Keyed[Annotated[Text, Field(min_length=1)], Text | None],
        BeforeValidator(_count_own),
        AfterValidator(_check_own),
    ] = Field(default_factory=dict)
    unread: Unread = ()


_KEYS = {
    "": tuple(_Graph.model_fields),
    "rooms": ROOM_WORDS,
    "objects": tuple(one.alias or name for name, one in _Object.model_fields.items()),
    "looks": tuple(_Look.model_fields),
    "memory": tuple(_Remembered.model_fields),
    "customs": tuple(_Custom.model_fields),
}


def read_robot_graph(
    path: AnyPath,
    *,
    class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP,
    room_labels: OwnLabels = (),
) -> PartialGraph:
    """Read a partial graph from a JSON file.

    The class map gives each category its class. Objects with an unknown category stay in the graph
    without a class; `list_unmapped` names them.

    Args:
        path: the file.
        class_map: a published version, the path of your own NAME.csv, or a loaded map.
        room_labels: your words for rooms, each with its label, as `read_room_words` reads them;
            they count before those of the file.

    Raises:
        RobotGraphError: naming the file, the entry, and what was expected there.
    """
    path = Path(path)
    said = read_json(path, ROBOT, error=RobotGraphError)
    return parse_robot_graph(said, path=path, class_map=class_map, room_labels=room_labels)


def parse_robot_graph(
    said: Any,
    *,
    path: Path,
    class_map: AnyPath | ClassMap | ClassSpace = DEFAULT_CLASS_MAP,
    room_labels: OwnLabels = (),
) -> PartialGraph:
    """Return the partial graph in a robot's JSON document; see `read_robot_graph`.

    With a class space, the document itself has the class of every object: one that
    `encode_robot_graph` made.
    """
    by = class_map if isinstance(class_map, ClassSpace) else load_class_map(class_map)
    document: Any = {}
    try:
        if isinstance(by, ClassSpace):  # as it was understood before
            document = open_belief(said)
            return _assemble(_Graph.model_validate(document), by)
        document = spell_out(said, path, keys=frozenset(_KEYS[""]))
        own = document.get("room_labels", {})
        if room_labels and isinstance(own, dict):  # as if the document said them
            document["room_labels"] = own | dict(room_labels)
        return understand_rooms(_assemble(_Graph.model_validate(document), by))
    except ValidationError as error:
        why = _explain(error, document)
        raise RobotGraphError(f"{path}: {why}", code="graph-malformed", where=path) from error
    except RecipeError as error:
        raise RobotGraphError(f"{path}: {error}", code="graph-malformed", where=path) from error


def _assemble(document: _Graph, by: ClassMap | ClassSpace) -> PartialGraph:
    rooms: tuple[KnownRoom, ...] = document.rooms
    index = _number([room.name for room in rooms], "room")
    _number([obj.id for obj in document.objects], "object")
    _number([one.id for one in document.memory], "remembered thing's")
    room_of = {obj.id: obj.room for obj in document.objects}
    _require_support({obj.id: obj.on for obj in document.objects if obj.on is not None}, room_of)
    objects = []
    for obj in document.objects:
        called = f"object {obj.id[:SHOWN]!r} ({obj.category[:SHOWN]})"
        room = _find(obj.room, index, called) if obj.room is not None else 0
        found = _classify(obj.category, obj.corrected, obj.class_name, by)
        time = say_time(called, obj.time, age=obj.age, now=document.now)
        facts = (obj.id, room, obj.category, *found, obj.position, obj.score)
        objects.append(SeenObject(*facts, on=obj.on, time=time, stays=obj.stays))
    looks = tuple(_read_look(one, index, room_of) for one in document.looks)
    share = document.hidden_share
    graph = PartialGraph(
        scene_id=document.scene_id,
        class_space=by.space if isinstance(by, ClassMap) else by,
        hidden_share=VAGUE.mean if share is None else share,
        rooms=rooms,
        objects=tuple(objects),
        adjacency=tuple(sorted({_connect(ends, index) for ends in document.adjacency})),
        building_kind=document.building_kind,
        source=document.source,
        looks=looks,
        more_rooms=document.more_rooms,
        stays=document.stays,
        memory=tuple(_read_memory(one, index) for one in document.memory),
        customs=tuple(dict.fromkeys(_read_custom(one, index) for one in document.customs)),
        room_labels=tuple(document.room_labels.items()),
        unread=document.unread,
        detector=None
        if document.detector is None
        else tuple(
            (word, _classify(word, None, stated, by)[1])
            for word, stated in document.detector.items()
        ),
    )
    graph = start_clock(graph, document.now)
    if share is None and rooms:
        mean = float(np.mean([room.hidden_share for room in graph.rooms]))
        graph = replace(graph, hidden_share=mean)
    return graph


def _read_look(said: _Look, index: Mapping[str, int], room_of: Mapping[str, str | None]) -> Look:
    where = f"look for {said.thing[:SHOWN]!r}"
    if said.at is not None:
        _require_beside(where, "at", said.at, said.room, room_of)
    return Look(_find(said.room, index, where), said.thing, said.chance, said.at, said.time)


def _read_memory(said: _Remembered, index: Mapping[str, int]) -> Remembered:
    where = f"remembered thing {said.id[:SHOWN]!r}"
    sightings = (
        Sighting(time, 0 if room is None else _find(room, index, where), on)
        for time, room, on in said.sightings
    )
    inorder = tuple(sorted(sightings, key=lambda one: one.time))
    return Remembered(said.id, said.category, inorder, said.score)


def _read_custom(said: _Custom, index: Mapping[str, int]) -> Custom:
    where = f"custom of {said.thing[:SHOWN]!r}"
    if said.room is None and said.at is None:
        raise RecipeError(f"{where}: expected a room, or a piece of furniture (`at`), or both")
    room = None if said.room is None else _find(said.room, index, where)
    return Custom(said.thing, room, said.at, said.never)


def _require_support(on: Mapping[str, str], room_of: Mapping[str, str | None]) -> None:
    """Refuse an object on one that is not in its room, or on itself by any way."""
    for name, piece in on.items():
        _require_beside(f"object {name[:SHOWN]!r}", "on", piece, room_of[name], room_of)
    sound: set[str] = set()
    for name in on:
        path: dict[str, None] = {}
        while name in on and name not in sound:
            if name in path:
                raise RecipeError(
                    f"object {name[:SHOWN]!r}: on: lies on itself, by {on[name][:SHOWN]!r}; say "
                    "what is below"
                )
            path[name] = None
            name = on[name]
        sound.update(path)


def _require_beside(
    where: str, key: str, piece: str, room: str | None, room_of: Mapping[str, str | None]
) -> None:
    if piece not in room_of:
        hint = ask_if_meant(piece, room_of) or "add it to `objects`"
        raise RecipeError(f"{where}: {key}: there is no object {piece[:SHOWN]!r}; {hint}")
    if room_of[piece] != room:
        there, here = (
            "no room" if one is None else f"room {one[:SHOWN]!r}" for one in (room_of[piece], room)
        )
        raise RecipeError(
            f"{where}: {key}: {piece[:SHOWN]!r} is in {there}; expected an object of {here}"
        )


def _classify(
    word: str, corrected: str | None, stated: str | None, by: ClassMap | ClassSpace
) -> tuple[str | None, int | None]:
    """Return the corrected name and the class of a word, which a document may state."""
    if isinstance(by, ClassMap):
        known = classify_seen(word, by)
        return known.category, known.class_index
    if stated is None:
        return corrected, None
    if stated not in by.classes:
        raise RecipeError(f"{word[:SHOWN]!r}: {stated!r} is no class of {by.name}")
    return corrected, by.classes.index(stated)


def _connect(ends: tuple[str, str], index: Mapping[str, int]) -> tuple[int, int]:
    where = f"adjacency of {ends[0][:SHOWN]!r} and {ends[1][:SHOWN]!r}"
    a, b = sorted(_find(end, index, where) for end in ends)
    if a == b:
        raise RecipeError(f"adjacency: {ends[0]!r} with itself")
    return a, b


def _number(ids: list[str], what: str) -> dict[str, int]:
    twice = [name for name, times in Counter(ids).items() if times > 1]
    if twice:
        raise RecipeError(f"{what} id {twice[0]!r} is there twice")
    return {name: number for number, name in enumerate(ids, 1)}


def _find(name: str, index: Mapping[str, int], where: str) -> int:
    if name not in index:
        hint = ask_if_meant(name, index) or "add it to `rooms`"
        raise RecipeError(f"{where}: there is no room {name[:SHOWN]!r}; {hint}")
    return index[name]


def _explain(error: ValidationError, document: Mapping[str, Any]) -> str:
    """Return key and kind of a fault: `room 'kitchen': hidden_share: Input should be …`.

    A key that is unknown comes first, for what is missing may stand under it.
    """
    faults = error.errors(include_url=False, include_input=False)
    fault = next((one for one in faults if one["type"] in _UNKNOWN_KEY), faults[0])
    what = _WORDS.get(fault["type"]) or str(fault["msg"]).removeprefix("Value error, ")
    if fault["type"] == "too_long":
        what = f"expected at most {fault['ctx']['max_length']:,} entries, found more"
    first, *path = fault["loc"]
    entry = ""
    if first in _ENTRIES and path:
        entry = _name_entry(document[first], str(first), int(path.pop(0)))
    else:
        path = [first, *path]
    if fault["type"] in _UNKNOWN_KEY:
        wrong, known = str(path.pop()), _KEYS[str(first) if entry else ""]
        hint = ask_if_meant(wrong, known) or f"known are {', '.join(known)}"
        if entry and first == "rooms":
            hint += f"; things of a room are a list: {FORM}"
        what = f"{wrong[:SHOWN]!r} is no key; {hint}"
        if not entry and isinstance(document.get(wrong), list):
            what += f'; beside other keys, list the rooms under `rooms`: {{"rooms": {FORM}}}'
    keys = ".".join(str(one)[:SHOWN] for one in path)
    return ": ".join(filter(None, (entry, keys, what)))


def _name_entry(entries: Any, kind: str, number: int) -> str:
    """Return an entry of a list by its id, or by its number."""
    entry = entries[number]
    name = entry.get("id") if isinstance(entry, Mapping) else None
    if isinstance(name, str) and name:
        return f"{_ENTRIES[kind]} {name[:SHOWN]!r}"
    return f"{_ENTRIES[kind]} number {number + 1}"


def encode_robot_graph(graph: PartialGraph) -> dict[str, Any]:
    """Return the JSON document of a partial graph.

    `parse_robot_graph` reads it back, with the same class map or with the graph's class space.
    """
    names, classes = [room.name for room in graph.rooms], graph.class_space.classes
    said: dict[str, Any] = {
        "format": "bsg-partial-graph",
        "version": 1,
        **{name: getattr(graph, name) for name in _GRAPH_FACTS},
        "rooms": [_encode_room(room) for room in graph.rooms],
        "objects": [
            {
                "id": obj.name,
                "room": names[obj.room_index - 1] if obj.room_index else None,
                "category": obj.raw_category,
                "corrected": obj.category,
                "class": None if obj.class_index is None else classes[obj.class_index],
                "position": obj.position,
                "score": obj.score,
                **({} if obj.on is None else {"on": obj.on}),
                **_encode_time(obj.time),
                **({} if obj.stays is None else {"stays": obj.stays}),
            }
            for obj in graph.objects
        ],
        "adjacency": [[names[a - 1], names[b - 1]] for a, b in graph.adjacency],
    }
    if graph.room_labels:
        said["room_labels"] = dict(graph.room_labels)
    if graph.unread:
        said["unread"] = [*graph.unread]
    if graph.looks:
        said["looks"] = [
            {"room": names[one.room_index - 1], "thing": one.thing, "chance": one.chance}
            | ({} if one.at is None else {"at": one.at})
            | _encode_time(one.time)
            for one in graph.looks
        ]
    if graph.now is not None:
        said["now"] = show_time(graph.now)
    rooms = [None, *names]
    if graph.memory:
        said["memory"] = [
            {
                "id": one.name,
                "category": one.raw_category,
                **({} if one.score is None else {"score": one.score}),
                "sightings": [
                    [show_time(seen.time), rooms[seen.room_index], seen.on]
                    for seen in one.sightings
                ],
            }
            for one in graph.memory
        ]
    if graph.customs:
        said["customs"] = [
            {"thing": one.thing, "room": rooms[one.room_index or 0], "at": one.at}
            | ({"never": True} if one.never else {})
            for one in graph.customs
        ]
    if graph.detector is not None:
        said["detector"] = {w: None if c is None else classes[c] for w, c in graph.detector}
    return said


def _encode_room(room: KnownRoom) -> dict[str, Any]:
    facts = (name for name in (*_SHARE_WORDS, *_FACTS) if name not in ("unread", "time"))
    said = {name: getattr(room, name) for name in facts}
    said["box"] = None if room.box is None else [room.box.minimum, room.box.maximum]
    said |= {"unread": [*room.unread]} if room.unread else {}
    return {"id": room.name, **said, **_encode_time(room.time)}


def _encode_time(time: float | None) -> dict[str, Any]:
    return {} if time is None else {"time": show_time(time)}


def list_unmapped(graph: PartialGraph) -> dict[str, int]:
    """Return category → number of objects, for categories that are not in the class map."""
    return dict(Counter(obj.raw_category for obj in graph.objects if obj.category is None))


def room_reader(graph: PartialGraph) -> RoomReader:
    """Return what reads the names of a graph's rooms."""
    return RoomReader(graph.room_labels, graph.building_kind)


def understand_rooms(graph: PartialGraph) -> PartialGraph:
    """Return a graph with what is said of its rooms and its kind in words that are known.

    The name of a room says its kind if nothing else does. Where nobody says the kind of the
    building, the rooms tell it: see `guess_building_kind`. A word that nobody can read says
    nothing; it stays in `unread`.
    """
    said = say_again(graph.building_kind, graph.origins.get("", ()))
    kind = read_building_kind(said) if isinstance(said, str) else None
    is_unread = isinstance(said, str) and kind is None and is_name(said)
    graph = _read_rooms(graph, kind)
    origin = Origin(kind, str(said)) if kind and kind != normalise_room(str(said)) else None
    names = (_list_names(room, graph.origins) for room in graph.rooms)
    if kind is None and (origin := guess_building_kind(names)):
        kind = origin.label
        graph = _read_rooms(graph, kind)
    return replace(
        graph,
        building_kind=kind,
        unread=(str(said),) if is_unread else graph.unread,
        origins={**graph.origins, "": (origin,) if origin else ()},
    )


def guess_building_kind(rooms: Iterable[Sequence[str]]) -> Origin | None:
    """Return the kind of building that its rooms tell, by the names of each; None if unclear.

    Two rooms or more tell it, and more than half of all that tell one. Offices, which other
    buildings have too, are heard last. A home is never guessed: an unknown kind is read as one.

    >>> guess_building_kind([["ward 1"], ["nurse station"], ["office"]]).label
    'hospital'
    >>> guess_building_kind([["office"], ["printer room"], ["bedroom"], ["kitchen"]])
    """
    told: dict[str, list[str]] = {}
    for names in rooms:
        kind, name = next(
            ((kind, name) for name in names if (kind := tell_building(name))), ("", "")
        )
        told.setdefault(kind, []).append(name)
    told.pop("", None)
    others = [names for kind, names in told.items() if kind not in ("home", "office")]
    if any(len(names) >= _TELLING for names in others):
        told.pop("office", None)
    kind = max(told, key=lambda one: len(told[one]), default="home")
    total = sum(map(len, told.values()))
    if kind == "home" or not _TELLING <= len(told[kind]) > total / 2:
        return None
    return Origin(kind, ", ".join(told[kind][:_TELLING]), by_name=True)


def _read_rooms(graph: PartialGraph, kind: str | None) -> PartialGraph:
    read = RoomReader(graph.room_labels, kind)
    found = [_understand(room, graph.origins.get(room.name, ()), read) for room in graph.rooms]
    origins = {room.name: said for room, said in found if said}
    return replace(graph, rooms=tuple([room for room, _ in found]), origins=origins)


def _understand(
    room: KnownRoom, origins: tuple[Origin, ...], read: RoomReader
) -> tuple[KnownRoom, tuple[Origin, ...]]:
    """Return a room with the type that is said, and what that was read from."""
    found = read_room_type(say_again(room.room_type, origins), read=read)
    kind, origins = found.labels, found.origins
    for name in filter(None, (room.label, room.name) if kind is None else ()):
        known = read(name)
        if known.label:
            kind, origins = known.label, (Origin(known.label, name, known.rule, by_name=True),)
            break
    if kind is None and (owner_of(room.name) or owner_of(room.label or "")):
        kind = dict(_OF_SOMEBODY)
    return replace(room, room_type=kind, unread=found.unread or room.unread), origins


def _list_names(room: KnownRoom, origins: Mapping[str, Sequence[Origin]]) -> list[str]:
    """Return what may tell the kind of building: what was said of a room's type, and its names."""
    kind = room.room_type
    said = [one.said for one in origins.get(room.name, ())] if isinstance(kind, str) else []
    return [name for name in (*said, kind, room.label, room.name) if isinstance(name, str)]


def note_room_types(graph: PartialGraph) -> tuple[str, ...]:
    """Return what a person should know of the kinds of rooms and of the building."""
    own = frozenset(word for word, _ in graph.room_labels)
    return (*note_rooms(graph, graph.rooms, own=own), *note_building(graph))


def note_rooms(
    graph: PartialGraph, rooms: Sequence[KnownRoom], *, own: frozenset[str] = frozenset()
) -> Iterator[str]:
    """Yield how the names and types of rooms are read, where that is not plain.

    `own` has words of the user, who knows what they mean.
    """
    origins = [one for room in rooms for one in graph.origins.get(room.name, ())]
    if named := [one.said for one in origins if one.by_name and not one.rule]:
        yield f"{_list(named)}: read as the kinds that their names say"
    if ruled := {one.said: one for one in origins if one.rule}:
        made = [f"{w[:SHOWN]!r} is {one.label} ({one.rule})" for w, one in ruled.items()]
        yield f"kinds of rooms read by a rule: {_list(made)}"
    silent = (room.label or room.name for room in rooms if room.room_type is None)
    silent = (name for name in silent if name not in own)
    unread = dict.fromkeys(word for room in rooms for word in room.unread)
    if dark := [*(unread | dict.fromkeys(filter(is_name, silent)))]:
        yield f"{_list(dark, _show_nearest)}: kind of room unknown; say `room_type`"


def _show_nearest(name: str) -> str:
    near = nearest_names(name, list_all_labels())
    return repr(name[:SHOWN]) + (f" (nearest: {', '.join(near)})" if near else "")


def note_building(graph: PartialGraph) -> Iterator[str]:
    """Yield how the kind of a building was guessed, and whether models know it."""
    kind = graph.building_kind
    if graph.unread:
        words = _list(graph.unread, lambda word: repr(word[:SHOWN]))
        yield f"{words}: kind of building unknown; known are {', '.join(SAID_KINDS)}"
    for one in graph.origins.get("", ()):
        how = "by" if one.by_name else "for it is called"
        yield (
            f"building kind taken for `{kind}`, {how} {one.said[:SHOWN]}; say `building_kind` to "
            "correct it"
        )
    if kind and kind not in BUILDING_KINDS:
        yield f"building kind `{kind}`: no model was taught it; they read it as unknown"


def _list(names: Sequence[str], show: Callable[[str], str] = str) -> str:
    """Return the first names as they are shown, and how many more there are."""
    more = f", and {len(names) - _MOST_WORDS:,} more" if len(names) > _MOST_WORDS else ""
    return ", ".join(map(show, names[:_MOST_WORDS])) + more
