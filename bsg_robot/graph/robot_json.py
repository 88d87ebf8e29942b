"""Read and write a robot's partial graph as plain JSON: docs/belief.md describes the format.

`id`s are text, unique among the rooms and among the objects. A category is any name; the class map
gives its class. A room's fields are those of `KnownRoom`. `bsg_robot.graph.map_forms` has the other
forms that are read, as room → the things seen there.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationError

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
from bsg_data.scene.room_label import check_own_label
from bsg_data.scene.surroundings import find_floor_area
from bsg_data.scene.synonyms import vocabulary_words
from bsg_data.words.nearest import ask_if_meant
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
from bsg_robot.graph.room_kinds import understand_rooms
from bsg_robot.things.things import classify_seen

OwnLabels = Sequence[tuple[str, str | None]]  # the user's words for rooms, each with its label
_UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")
_SHOULD = re.compile(r"^\w+ should (?:be |have )?")
_WORDS = {  # of JSON, where pydantic's are of Python's types
    "model_type": "expected a JSON object (docs/belief.md)",
    "dataclass_type": 'expected a JSON object, such as {"id": "kitchen"} (docs/belief.md)',
    "tuple_type": "expected a JSON list",
    "dict_type": "expected a JSON list of words",
    "too_short": "expected one or more, found none",
    "missing": f"is missing (docs/belief.md); the simplest map is {FORM}",
}
_ROOM_FIELDS = tuple(field.name for field in fields(KnownRoom))
_SHARE_WORDS = ("visited", "hidden_share", "hidden_share_sd")
_FACTS = tuple(name for name in _ROOM_FIELDS if name not in ("name", *_SHARE_WORDS))
_LOOKS = ("seconds_inside", "floor_in_view", "walls_in_view")
# What a robot may say of its rooms, its objects and the building, in any file format.
ROOM_WORDS = (*_SHARE_WORDS, *_LOOKS, "id", *_FACTS)
OBJECT_WORDS = ("id", "category", "position", "score", "time", "age", "stays", "on")
_GRAPH_FACTS = ("scene_id", "hidden_share", "building_kind", "source", "more_rooms", "stays")
_PLAIN_FACTS = ("scene_id", "rooms", "building_kind", "source", "more_rooms", "stays", "unread")
GRAPH_WORDS = (*_GRAPH_FACTS, "detector", "looks", "now", "memory", "customs")


_KEY_OF = {  # field of a part of a graph → its key in a document, if it has another name
    "name": "id",
    "room_index": "room",
    "raw_category": "category",
    "category": "corrected",
    "class_index": "class",
}


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


def _list_words(detector: Any) -> Any:
    """Return the words of a detector: a list of them, or those of a published vocabulary."""
    words = [*vocabulary_words(detector)] if isinstance(detector, str) and detector else detector
    are_words = isinstance(words, list) and all(isinstance(word, str) for word in words)
    return dict.fromkeys(words) if are_words else words


def _require_bounds(document: Mapping[str, Any]) -> None:
    """Refuse a document that has too much in all, before any of it is read."""
    types = [*_values(document, "rooms", "room_type"), *_values(document, "rooms", "unread")]
    kinds = [word for said in types for word in ([said] if isinstance(said, str) else _parts(said))]
    corners = _count_parts(_values(document, "rooms", "footprint"))
    sightings = _count_parts(_values(document, "memory", "sightings"))
    letters = sum(map(len, _words(_values(document, "objects", "category"))))
    sought = len(_words(_values(document, "looks", "thing")))
    require_few(corners, MAX_ALL_CORNERS, "corners of all footprints together")
    require_few(_count_parts(types), MAX_ROBOT_TYPES, "labels of all room types together")
    require_few(len(_words(kinds)), MAX_ROBOT_KINDS, "different labels of room types")
    require_few(letters, MAX_ROBOT_LETTERS, "letters of different words for objects")
    require_few(sought, MAX_ROBOT_SOUGHT, "different things to look for")
    require_few(sightings, MOST_IN_ALL, "sightings of all things together")
    for key in ("detector", "room_labels"):
        require_few(len(_parts(document.get(key))), MAX_ROBOT_WORDS, f"words in `{key}`")


def _values(document: Mapping[str, Any], entries: str, key: str) -> list[Any]:
    """Return what the entries of a list have under a key, whatever it is."""
    listed = _parts(document.get(entries))
    return [entry[key] for entry in listed if isinstance(entry, dict) and key in entry]


def _parts(value: Any) -> Collection[Any]:
    return value if isinstance(value, list | tuple | dict) else ()


def _count_parts(values: Iterable[Any]) -> int:
    return sum(len(_parts(value)) for value in values)


def _words(values: Iterable[Any]) -> set[str]:
    return {value for value in values if isinstance(value, str)}


def _check_own(labels: Mapping[str, str | None]) -> Mapping[str, str | None]:
    return {word: check_own_label(word, label) for word, label in labels.items()}


class _Graph(SaidRecord):
    format: Literal["bsg-partial-graph"] = "bsg-partial-graph"
    version: Annotated[Literal[1], Number] = 1
    scene_id: Id
    hidden_share: StrictFraction | None = None
    building_kind: Text | None = None
    source: Id | None = None
    rooms: Annotated[Listed[_SaidRoom], Field(max_length=MAX_ROBOT_ROOMS)]
    objects: Annotated[Listed[_Object], Field(max_length=MAX_ROBOT_OBJECTS)] = ()
    adjacency: Annotated[Listed[tuple[Id, Id]], Field(max_length=MAX_ROBOT_PAIRS)] = ()
    # A list of words, or the name of a vocabulary; or word → class, as `encode_robot_graph` writes.
    detector: Annotated[Keyed[Text, Text | None] | None, BeforeValidator(_list_words)] = None
    looks: Annotated[Listed[_Look], Field(max_length=MAX_ROBOT_LOOKS)] = ()
    more_rooms: MoreRooms = None
    stays: Stay | None = None
    now: Time | None = None
    memory: Annotated[Listed[_Remembered], Field(max_length=MOST_THINGS)] = ()
    customs: Annotated[Listed[_Custom], Field(max_length=MAX_ROBOT_CUSTOMS)] = ()
    room_labels: Annotated[
        Keyed[Annotated[Text, Field(min_length=1)], Text | None],
        AfterValidator(_check_own),
    ] = Field(default_factory=dict)
    unread: Unread = ()


_KEYS = tuple(_Graph.model_fields)
_ENTRIES: dict[
    str, tuple[str, tuple[str, ...]]
] = {  # key of a list → what an entry is called, and its keys
    "rooms": ("room", ROOM_WORDS),
    "objects": ("object", tuple(f.alias or name for name, f in _Object.model_fields.items())),
    "adjacency": ("pair of adjacency", ()),
    "looks": ("look", tuple(_Look.model_fields)),
    "memory": ("remembered thing", tuple(_Remembered.model_fields)),
    "customs": ("custom", tuple(_Custom.model_fields)),
}


def read_robot_graph(
    path: AnyPath,
    *,
    class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP,
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
    document = read_json(path, ROBOT, error=RobotGraphError)
    return parse_robot_graph(document, path=path, class_map=class_map)


def parse_robot_graph(
    document: Any,
    *,
    path: Path,
    class_map: AnyPath | ClassMap | ClassSpace = DEFAULT_CLASS_MAP,
    room_labels: OwnLabels = (),
) -> PartialGraph:
    """Return the partial graph in a robot's JSON document; see `read_robot_graph`.

    With a class space, the document itself has the class of every object: one that
    `encode_robot_graph` made. `room_labels` are a user's words for rooms, which count before those
    of the document.
    """
    by = class_map if isinstance(class_map, ClassSpace) else load_class_map(class_map)
    ours: Any = {}
    try:
        if isinstance(by, ClassSpace):  # as it was understood before
            ours = open_belief(document)
            return _assemble(ours, by)
        ours = spell_out(document, path, keys=frozenset(_KEYS))
        own = ours.get("room_labels", {})
        if room_labels and isinstance(own, dict):  # as if the document said them
            ours["room_labels"] = own | dict(room_labels)
        return understand_rooms(_assemble(ours, by))
    except ValidationError as error:
        why = _explain(error, ours)
        raise RobotGraphError(f"{path}: {why}", code="graph-malformed", where=path) from error
    except RecipeError as error:
        raise RobotGraphError(f"{path}: {error}", code="graph-malformed", where=path) from error


def _assemble(document: Mapping[str, Any], by: ClassMap | ClassSpace) -> PartialGraph:
    _require_bounds(document)
    record = _Graph.model_validate(document)
    rooms: tuple[KnownRoom, ...] = record.rooms
    index = _number([room.name for room in rooms], "room")
    _number([obj.id for obj in record.objects], "object")
    _number([thing.id for thing in record.memory], "remembered thing's")
    room_of = {obj.id: obj.room for obj in record.objects}
    _require_support({obj.id: obj.on for obj in record.objects if obj.on is not None}, room_of)
    graph = PartialGraph(
        class_space=by.space if isinstance(by, ClassMap) else by,
        hidden_share=VAGUE.mean if record.hidden_share is None else record.hidden_share,
        objects=tuple([_read_object(obj, index, by, record.now) for obj in record.objects]),
        looks=tuple(_read_look(look, index, room_of) for look in record.looks),
        adjacency=tuple(sorted({_connect(ends, index) for ends in record.adjacency})),
        memory=tuple(_read_memory(thing, index) for thing in record.memory),
        customs=tuple(dict.fromkeys(_read_custom(custom, index) for custom in record.customs)),
        room_labels=tuple(record.room_labels.items()),
        detector=_read_detector(record.detector, by),
        **{name: getattr(record, name) for name in _PLAIN_FACTS},
    )
    graph = start_clock(graph, record.now)
    if record.hidden_share is None and rooms:
        mean = float(np.mean([room.hidden_share for room in graph.rooms]))
        graph = replace(graph, hidden_share=mean)
    return graph


def _read_object(
    obj: _Object, index: Mapping[str, int], by: ClassMap | ClassSpace, now: float | None
) -> SeenObject:
    where = f"object {obj.id[:SHOWN]!r} ({obj.category[:SHOWN]})"
    room = _find(obj.room, index, where) if obj.room is not None else 0
    meaning = _classify(obj.category, obj.corrected, obj.class_name, by)
    time = say_time(where, obj.time, age=obj.age, now=now)
    facts = (obj.id, room, obj.category, *meaning, obj.position, obj.score)
    return SeenObject(*facts, on=obj.on, time=time, stays=obj.stays)


def _read_detector(
    words: Mapping[str, str | None] | None, by: ClassMap | ClassSpace
) -> tuple[tuple[str, int | None], ...] | None:
    if words is None:
        return None
    return tuple((word, _classify(word, None, stated, by)[1]) for word, stated in words.items())


def _read_look(look: _Look, index: Mapping[str, int], room_of: Mapping[str, str | None]) -> Look:
    where = f"look for {look.thing[:SHOWN]!r}"
    if look.at is not None:
        _require_beside(where, "at", look.at, look.room, room_of)
    return Look(_find(look.room, index, where), look.thing, look.chance, look.at, look.time)


def _read_memory(thing: _Remembered, index: Mapping[str, int]) -> Remembered:
    where = f"remembered thing {thing.id[:SHOWN]!r}"
    sightings = (
        Sighting(time, 0 if room is None else _find(room, index, where), on)
        for time, room, on in thing.sightings
    )
    in_order = tuple(sorted(sightings, key=lambda seen: seen.time))
    return Remembered(thing.id, thing.category, in_order, thing.score)


def _read_custom(custom: _Custom, index: Mapping[str, int]) -> Custom:
    where = f"custom of {custom.thing[:SHOWN]!r}"
    if custom.room is None and custom.at is None:
        raise RecipeError(f"{where}: expected a room, or a piece of furniture (`at`), or both")
    room = None if custom.room is None else _find(custom.room, index, where)
    return Custom(custom.thing, room, custom.at, custom.never)


def _require_support(on: Mapping[str, str], room_of: Mapping[str, str | None]) -> None:
    """Refuse an object on one that is not in its room, or on itself by any way."""
    for name, piece in on.items():
        _require_beside(f"object {name[:SHOWN]!r}", "on", piece, room_of[name], room_of)
    try:
        TopologicalSorter({name: (piece,) for name, piece in on.items()}).prepare()
    except CycleError as error:
        piece, name = error.args[1][:2]
        raise RecipeError(
            f"object {name[:SHOWN]!r}: on: lies on itself, by {piece[:SHOWN]!r}; say what is below"
        ) from None


def _require_beside(
    where: str, key: str, piece: str, room: str | None, room_of: Mapping[str, str | None]
) -> None:
    if piece not in room_of:
        hint = ask_if_meant(piece, room_of) or "add it to `objects`"
        raise RecipeError(f"{where}: {key}: there is no object {piece[:SHOWN]!r}; {hint}")
    if room_of[piece] != room:
        found, expected = (
            "no room" if name is None else f"room {name[:SHOWN]!r}"
            for name in (room_of[piece], room)
        )
        raise RecipeError(
            f"{where}: {key}: {piece[:SHOWN]!r} is in {found}; expected an object of {expected}"
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
        raise RecipeError(f"adjacency: {ends[0]!r} with itself; name two rooms")
    return a, b


def _number(ids: list[str], what: str) -> dict[str, int]:
    twice = [name for name, times in Counter(ids).items() if times > 1]
    if twice:
        raise RecipeError(f"{what} id {twice[0]!r} is there twice; give each its own")
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
    fault = next((fault for fault in faults if fault["type"] in _UNKNOWN_KEY), faults[0])
    path, entry, known = [*fault["loc"]], "", _KEYS
    if path[0] in _ENTRIES and len(path) > 1:
        what, known = _ENTRIES[str(path[0])]
        entry = _name_entry(what, document[str(path[0])], int(path[1]))
        path = path[2:]
    if fault["type"] in _UNKNOWN_KEY:
        reason = _explain_key(str(path.pop()), known, {} if entry else document)
    elif fault["type"] == "too_long":
        reason = f"expected at most {fault['ctx']['max_length']:,} entries, found more"
    else:
        reason = _WORDS.get(fault["type"]) or _SHOULD.sub("expected ", fault["msg"]).removeprefix(
            "Value error, "
        )
    keys = ".".join(str(key)[:SHOWN] for key in path)
    return ": ".join(filter(None, (entry, keys, reason)))


def _explain_key(key: str, known: Sequence[str], document: Mapping[str, Any]) -> str:
    hint = ask_if_meant(key, known) or f"known are {', '.join(known)}"
    if known is ROOM_WORDS:
        hint += f"; things of a room are a list: {FORM}"
    if isinstance(document.get(key), list):
        hint += f'; beside other keys, list the rooms under `rooms`: {{"rooms": {FORM}}}'
    return f"{key[:SHOWN]!r} is no key; {hint}"


def _name_entry(what: str, entries: Any, number: int) -> str:
    """Return an entry of a list by its id, or by its number."""
    name = entries[number].get("id") if isinstance(entries[number], Mapping) else None
    return (
        f"{what} {name[:SHOWN]!r}"
        if name and isinstance(name, str)
        else f"{what} number {number + 1}"
    )


def encode_robot_graph(graph: PartialGraph) -> dict[str, Any]:
    """Return the JSON document of a partial graph.

    `parse_robot_graph` reads it back, with the same class map or with the graph's class space.
    """
    rooms = [None, *(room.name for room in graph.rooms)]
    classes = graph.class_space.classes
    parts = {
        name: [_encode(part, rooms, classes) for part in getattr(graph, name)]
        for name in ("rooms", "objects", "looks", "memory", "customs")
    }
    document = {
        "format": "bsg-partial-graph",
        "version": 1,
        **{name: getattr(graph, name) for name in _GRAPH_FACTS},
        "rooms": parts.pop("rooms"),
        "objects": parts.pop("objects"),
        "adjacency": [[rooms[a], rooms[b]] for a, b in graph.adjacency],
        "room_labels": dict(graph.room_labels) or None,
        "unread": graph.unread or None,
        "now": show_time(graph.now),
        **{name: entries or None for name, entries in parts.items()},
    }
    if graph.detector is not None:
        document["detector"] = {w: None if c is None else classes[c] for w, c in graph.detector}
    return {key: value for key, value in document.items() if value is not None}


def _encode(
    part: KnownRoom | SeenObject | Look | Remembered | Custom,
    rooms: Sequence[str | None],
    classes: Sequence[str],
) -> dict[str, Any]:
    """Return a part of a graph as a document has it: what is known, by names."""
    entry: dict[str, Any] = {}
    for field in fields(part):
        key, value = _KEY_OF.get(field.name, field.name), getattr(part, field.name)
        if value is None or value == ():
            continue
        if key == "room":
            value = rooms[value]
        elif key == "class":
            value = classes[value]
        elif key == "time":
            value = show_time(value)
        elif key == "box":
            value = [value.minimum, value.maximum]
        elif key == "sightings":
            value = [[show_time(seen.time), rooms[seen.room_index], seen.on] for seen in value]
        entry[key] = value
    return entry


def list_unmapped(graph: PartialGraph) -> dict[str, int]:
    """Return category → number of objects, for categories that are not in the class map."""
    return dict(Counter(obj.raw_category for obj in graph.objects if obj.category is None))
