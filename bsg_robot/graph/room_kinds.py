"""Read the kinds of rooms and of the building from what is said of them, and from their names."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from bsg_data.scene.room_label import (
    Origin,
    RoomReader,
    is_name,
    list_all_labels,
    normalise_room,
    owner_of,
    read_building_kind,
    read_room_type,
    say_again,
    tell_building,
)
from bsg_data.scene.surroundings import BUILDING_KINDS, SAID_KINDS
from bsg_data.words.nearest import nearest_names
from bsg_data.words.shown import SHOWN
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph

_OF_SOMEBODY = {"bedroom": 0.55, "child's bedroom": 0.4}  # a room that has somebody's name alone
_MOST_WORDS = 5  # named in a note
_TELLING = 2  # rooms that tell the kind of a building


def room_reader(graph: PartialGraph) -> RoomReader:
    """Return what reads the names of a graph's rooms."""
    return RoomReader(graph.room_labels, graph.building_kind)


def understand_rooms(graph: PartialGraph) -> PartialGraph:
    """Return a graph with what is said of its rooms and its kind in words that are known.

    The name of a room says its kind if nothing else does. Where nobody says the kind of the
    building, the rooms tell it: see `guess_building_kind`. A word that nobody can read says
    nothing; it stays in `unread`.
    """
    word = say_again(graph.building_kind, graph.origins.get("", ()))
    kind = read_building_kind(word) if isinstance(word, str) else None
    is_unread = isinstance(word, str) and kind is None and is_name(word)
    graph = _read_rooms(graph, kind)
    origin = Origin(kind, str(word)) if kind and kind != normalise_room(str(word)) else None
    names = (_list_names(room, graph.origins) for room in graph.rooms)
    if kind is None and (origin := guess_building_kind(names)):
        kind = origin.label
        graph = _read_rooms(graph, kind)
    return replace(
        graph,
        building_kind=kind,
        unread=(str(word),) if is_unread else graph.unread,
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
    telling: dict[str, list[str]] = {}  # kind → names of the rooms that tell it
    for names in rooms:
        kind, name = next(
            ((kind, name) for name in names if (kind := tell_building(name))), ("", "")
        )
        telling.setdefault(kind, []).append(name)
    telling.pop("", None)
    others = [names for kind, names in telling.items() if kind not in ("home", "office")]
    if any(len(names) >= _TELLING for names in others):
        telling.pop("office", None)
    kind = max(telling, key=lambda kind: len(telling[kind]), default="home")
    total = sum(map(len, telling.values()))
    if kind == "home" or not _TELLING <= len(telling[kind]) > total / 2:
        return None
    return Origin(kind, ", ".join(telling[kind][:_TELLING]), by_name=True)


def _read_rooms(graph: PartialGraph, kind: str | None) -> PartialGraph:
    read = RoomReader(graph.room_labels, kind)
    understood = [_understand(room, graph.origins.get(room.name, ()), read) for room in graph.rooms]
    origins = {room.name: origins for room, origins in understood if origins}
    return replace(graph, rooms=tuple([room for room, _ in understood]), origins=origins)


def _understand(
    room: KnownRoom, origins: tuple[Origin, ...], read: RoomReader
) -> tuple[KnownRoom, tuple[Origin, ...]]:
    """Return a room with the type that is said, and what that was read from."""
    meaning = read_room_type(say_again(room.room_type, origins), read=read)
    kind, origins = meaning.labels, meaning.origins
    for name in filter(None, (room.label, room.name) if kind is None else ()):
        known = read(name)
        if known.label:
            kind, origins = known.label, (Origin(known.label, name, known.rule, by_name=True),)
            break
    if kind is None and (owner_of(room.name) or owner_of(room.label or "")):
        kind = dict(_OF_SOMEBODY)
    return replace(room, room_type=kind, unread=meaning.unread or room.unread), origins


def _list_names(room: KnownRoom, origins: Mapping[str, Sequence[Origin]]) -> list[str]:
    """Return what may tell the kind of building: what was said of a room's type, and its names."""
    kind = room.room_type
    words = [origin.said for origin in origins.get(room.name, ())] if isinstance(kind, str) else []
    return [name for name in (*words, kind, room.label, room.name) if isinstance(name, str)]


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
    origins = [origin for room in rooms for origin in graph.origins.get(room.name, ())]
    if named := [o.said for o in origins if o.by_name and not o.rule]:
        yield f"{_list(named)}: read as the kinds that their names say"
    if ruled := {o.said: o for o in origins if o.rule}:
        made = [f"{w[:SHOWN]!r} is {o.label} ({o.rule})" for w, o in ruled.items()]
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
    for origin in graph.origins.get("", ()):
        how = "by" if origin.by_name else "for it is called"
        yield (
            f"building kind taken for `{kind}`, {how} {origin.said[:SHOWN]}; say `building_kind` "
            "to correct it"
        )
    if kind and kind not in BUILDING_KINDS:
        yield f"building kind `{kind}`: no model was taught it; they read it as unknown"


def _list(names: Sequence[str], show: Callable[[str], str] = str) -> str:
    """Return the first names as they are shown, and how many more there are."""
    more = f", and {len(names) - _MOST_WORDS:,} more" if len(names) > _MOST_WORDS else ""
    return ", ".join(map(show, names[:_MOST_WORDS])) + more
