"""The forms in which people and programs write a map, and our document of each.

| form | read as |
|---|---|
| `{"kitchen": ["sink"], "hall": []}` | the simplest map: a room without things was not entered |
| `{"kitchen": {"objects": ["sink"], "position": [0, 0, 0]}}` | the same, with facts of the rooms |
| `{"rooms": {"kitchen": ["sink"]}}` | the same, beside keys of the document |
| `{"rooms": [{"name": "kitchen", "objects": [{"type": "sink"}]}]}` | a document, objects inside |
| `{"format": "bsg-belief-graph", "partial": …}` | the graph that was seen |

A thing is a word, or a record as in `objects`. NumPy's values are as Python's.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bsg_data.errors import RecipeError
from bsg_data.inputs.bounds import MAX_ROBOT_OBJECTS, MAX_ROBOT_ROOMS
from bsg_data.scene.room_label import label_of
from bsg_data.words.shown import SHOWN, show_value

FORM = '{"kitchen": ["sink"], "hall": []}'
_FACTS_OF_MAPS = ("more_rooms", "building_kind")
_LISTS = {"rooms", "objects", "looks", "adjacency"}  # of a document, which may be empty
_DEPTH = 6  # levels of a document that can hold a value of NumPy
# Kind of entry → key of others → the first of ours that is not said.
_SYNONYMS: dict[str, dict[str, tuple[str, ...]]] = {
    "": {"name": ("scene_id",), "kind": ("building_kind",)},
    "rooms": {
        "room_id": ("id",),
        "type": ("room_type",),
        "kind": ("room_type",),
        "things": ("objects",),
        "items": ("objects",),
        "name": ("id", "label"),
    },
    "objects": {
        "object_id": ("id",),
        "class_name": ("category",),
        "type": ("category",),
        "label": ("category",),
        "name": ("category", "id"),
        "parent": ("on",),
        "parentReceptacles": ("on",),
        "receptacle": ("on",),
        "in": ("on",),
        "at": ("on",),
    },
    "looks": {"object": ("thing",), "category": ("thing",), "on": ("at",)},
}
_PLAIN = (str, int, float, bool, type(None))


def spell_out(said: Any, path: Path, *, keys: frozenset[str]) -> dict[str, Any]:
    """Return a map of any form as our document, which has these keys.

    Raises:
        RecipeError: for what is no map; it shows one.
    """
    document = _find_rooms(open_belief(_make_plain(said)), keys)
    rooms, objects, looks = (
        document.get("rooms"),
        document.get("objects", []),
        document.get("looks"),
    )
    if isinstance(rooms, dict):
        rooms = _list_rooms(rooms)
    if isinstance(rooms, list):
        rooms = [_tidy(room, "rooms") for room in rooms]
        if lifted := _lift(rooms):
            objects = [*lifted, *objects] if isinstance(objects, list) else objects
        document["rooms"] = rooms
    if isinstance(objects, list):
        objects = _number([_tidy(obj, "objects") for obj in objects])
    if isinstance(looks, list):
        document["looks"] = [_tidy(look, "looks") for look in looks]
    return {"scene_id": path.name.partition(".")[0] or path.name} | document | {"objects": objects}


def _find_rooms(said: dict[str, Any], keys: frozenset[str]) -> dict[str, Any]:
    """Return a document as it is, or one of the rooms of the simplest map."""
    # Beside its rooms, the simplest map may state these; a list is a room of this name.
    facts = {k: said[k] for k in _FACTS_OF_MAPS if k in said and not isinstance(said[k], list)}
    rooms = {key: said[key] for key in said if key not in facts}
    is_map = not rooms.keys() <= _LISTS and all(
        _lists_words(value) and (value or key not in _LISTS) for key, value in rooms.items()
    )
    if rooms.keys() & keys and not is_map:
        return _rename(drop_empty(said), "")
    return drop_empty(facts) | {"rooms": rooms}


def open_belief(document: Any) -> dict[str, Any]:
    """Return a document, or that of what was seen in a belief graph."""
    if isinstance(document, dict) and document.get("format") == "bsg-belief-graph":
        beside = [
            key for key in ("now", "memory", "customs", "rooms", "objects") if key in document
        ]
        document = document.get("partial")
        if document is None:
            raise RecipeError(
                "a belief graph without `partial`, the graph that the robot has seen; expected it "
                "there (docs/belief.md)"
            )
        if beside:
            raise RecipeError(f"{beside[0]!r} beside `partial`; expected it there (docs/belief.md)")
    if not isinstance(document, dict):
        raise RecipeError(f"expected a JSON object such as {FORM}, found {show_value(document)}")
    return document


def drop_empty(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is said: null and "" say nothing, but a thing may have an empty name."""
    return {
        key: value
        for key, value in entry.items()
        if key == "category" or not (value is None or (isinstance(value, str) and not value))
    }


def _make_plain(value: Any, depth: int = _DEPTH) -> Any:
    """Return a document without NumPy's values, and with lists alone."""
    if type(value) in _PLAIN:  # most are; to ask for an abstract class takes long
        return value
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, set | frozenset):
        return sorted(value, key=str)
    if isinstance(value, Mapping):
        return {key: _make_plain(v, depth - 1) if depth else v for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_make_plain(v, depth - 1) if depth else v for v in value]
    return value


def _lists_words(value: Any) -> bool:
    """Say whether a value is a list as of the things in a room, of any name: `source`, `rooms`."""
    return isinstance(value, list) and all(isinstance(word, str) for word in value)


def _list_rooms(rooms: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the entries of a map of rooms; a name is also the kind, if it is a room label."""
    require_few(len(rooms), MAX_ROBOT_ROOMS, "rooms")
    entries = []
    for name, value in rooms.items():
        if not isinstance(value, list | dict):
            shown = f"{str(name)[:SHOWN]}: expected a JSON list of things"
            raise RecipeError(f"{shown}, such as {FORM}, found {show_value(value)}")
        facts = drop_empty(value) if isinstance(value, dict) else {"objects": value}
        called = {"label": name} if "id" in facts else {"id": name}
        kind = name if len(str(name)) <= SHOWN and label_of("any", str(name)) else None
        entry = _rename(called | facts, "rooms")
        entries.append({"objects": [], "room_type": kind} | entry)
    return entries


def _tidy(entry: Any, kind: str) -> Any:
    return _rename(drop_empty(entry), kind) if isinstance(entry, dict) else entry


def _rename(entry: dict[str, Any], kind: str) -> dict[str, Any]:
    for other, ours in _SYNONYMS[kind].items():
        if other in entry and (free := [key for key in ours if key not in entry]):
            entry[free[0]] = entry.pop(other)
    return entry


def _lift(rooms: list[Any]) -> list[Any]:
    """Take the objects out of the rooms; one without any was not entered, if it does not say."""
    lifted: list[Any] = []
    for room in rooms:
        if not isinstance(room, dict) or "objects" not in room:
            continue
        things, where = room.pop("objects"), str(room.get("id"))[:SHOWN]
        if not isinstance(things, list):
            raise RecipeError(f"room {where!r}: objects: expected a JSON list, such as {FORM}")
        require_few(len(lifted) + len(things), MAX_ROBOT_OBJECTS, "things")
        room.setdefault("visited", bool(things))
        for number, thing in enumerate(things):
            if not isinstance(thing, str | dict):
                form = 'expected a thing, such as "sink" or {"category": "sink"}'
                raise RecipeError(f"{where}.{number}: {form}, found {show_value(thing)}")
            entry = {"category": thing} if isinstance(thing, str) else thing
            lifted.append({"room": room.get("id")} | entry)
    return lifted


def _number(objects: list[Any]) -> list[Any]:
    """Return the objects with an id each: `sink 1`, `sink 2`."""
    taken = {str(obj.get("id")) for obj in objects if isinstance(obj, dict)}
    times, numbered = Counter[str](), []
    for obj in objects:
        if isinstance(obj, dict) and "id" not in obj and isinstance(obj.get("category"), str):
            word = obj["category"][:SHOWN] or "object"
            while (name := f"{word} {times[word] + 1}") in taken:
                times[word] += 1
            times[word] += 1
            obj = {"id": name} | obj
        numbered.append(obj)
    return numbered


def require_few(found: int, upper_bound: int, what: str) -> None:
    """Refuse more of something than a graph may have."""
    if found > upper_bound:
        raise RecipeError(
            f"expected at most {upper_bound:,} {what}, found {found:,}; leave some out"
        )
