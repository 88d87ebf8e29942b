"""Update a partial graph by what a robot reports. Each update returns a new graph."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

from bsg_data.errors import RecipeError
from bsg_data.inputs.bounds import MAX_ROBOT_LOOKS, MAX_ROBOT_SOUGHT
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.class_space import ClassSpace
from bsg_data.words.normal import normalise_name
from bsg_models.belief.clock import has_stayed
from bsg_models.belief.hidden_share import VAGUE, ShareBelief
from bsg_models.belief.partial_graph import (
    EVIDENCE_SCORE,
    KnownRoom,
    Look,
    PartialGraph,
    Remembered,
    SeenObject,
)
from bsg_models.search.looks import miss_all, overlooked_at
from bsg_robot.graph.memory import remember
from bsg_robot.things.things import classify_seen

_ALMOST = 1 - 1e-12  # the chance of any number of looks that may miss
_FADED = 0.01  # least chance of a look, as time has left it


def hide_of_room(
    graph: PartialGraph,
    room_index: int,
    share: ShareBelief,
    *,
    visited: bool | None = None,
    time: float | None = None,
) -> PartialGraph:
    """Return the graph with another hidden share of a room, 1..R, and whether it was visited."""
    rooms = list(graph.rooms)
    room = rooms[room_index - 1]
    rooms[room_index - 1] = replace(
        room,
        hidden_share=share.mean,
        hidden_share_sd=share.sd,
        visited=room.visited if visited is None else visited,
        time=time,
    )
    return follow_rooms(graph, replace(graph, rooms=tuple(rooms)))


def follow_rooms(before: PartialGraph, after: PartialGraph) -> PartialGraph:
    """Return a later graph whose building hides more or less as its rooms do."""
    if before.rooms == after.rooms:
        return after
    return replace(
        after, hidden_share=before.share_with([room.hidden_share for room in after.rooms])
    )


def see_object(graph: PartialGraph, seen: SeenObject) -> PartialGraph:
    """Return the partial graph after the robot has seen one object.

    A known object of this name moves to the new place, and where it was is remembered; a report
    that comes late is remembered alone. The hidden share of its room stays the same, because one
    object does not say how much more the robot looked at; but a room that shows something does not
    hide all.
    """
    known = next((obj for obj in graph.objects if obj.name == seen.name), None)
    before = next((thing for thing in graph.memory if thing.name == seen.name), None)
    if _is_other(seen, known, before, graph.class_space):  # another thing has the id now
        objects = tuple(obj for obj in graph.objects if obj is not known)
        memory = tuple(thing for thing in graph.memory if thing is not before)
        graph, known, before = replace(graph, objects=objects, memory=memory), None, None
    others = tuple(obj for obj in graph.objects if obj.name != seen.name)
    last = known.time if known else before.sightings[-1].time if before else None
    if is_before(seen.time, last):
        return replace(graph, memory=remember(graph.memory, [seen]))
    memory = graph.memory if known is None else remember(graph.memory, [known])
    # What is on an object shows that it is still there, too.
    others = tuple(
        replace(obj, time=seen.time)
        if obj.name == seen.on and is_before(obj.time, seen.time)
        else obj
        for obj in others
    )
    return follow_rooms(graph, replace(graph, objects=(*others, seen), memory=memory))


def _is_other(
    seen: SeenObject, known: SeenObject | None, before: Remembered | None, space: ClassSpace
) -> bool:
    """Return whether a sighting is of another thing than the known one of its id."""
    if known is not None:
        return not _is_alike(known, seen, space)
    return before is not None and normalise_name(before.raw_category) != normalise_name(
        seen.raw_category
    )


def is_before(time: float | None, other: float | None) -> bool:
    """Return whether a time is before another, if both are said."""
    return time is not None and other is not None and time < other


def enter(
    graph: PartialGraph,
    room_index: int,
    *,
    hidden_share: ShareBelief | None = None,
    time: float | None = None,
) -> PartialGraph:
    """Return the partial graph after the robot has entered a room, 1..R, or seen more of it.

    Without a new hidden share, the known one stays, but a room not yet visited with a share above
    0.5 gets `VAGUE`.
    """
    known = graph.rooms[room_index - 1]
    if is_before(time, known.time):
        return graph  # a report that comes late
    if hidden_share is None:
        was_inside = known.visited and known.hidden_share < 1
        stays = was_inside or known.hidden_share <= VAGUE.mean
        hidden_share, time = (known.share, known.time) if stays else (VAGUE, time)
    return hide_of_room(graph, room_index, hidden_share, visited=True, time=time)


def discover(graph: PartialGraph, room: KnownRoom, *, beside: Collection[int] = ()) -> PartialGraph:
    """Return the partial graph with one more room, the last, `beside` known ones.

    Raises:
        RecipeError: if the name is known already.
    """
    number = len(graph.rooms) + 1
    if room.name in {known.name for known in graph.rooms}:
        raise RecipeError(
            f"{graph.scene_id}: room {room.name!r} is known already; `describe` says more of it",
            code="room-known",
            where=room.name,
        )
    pairs = {*graph.adjacency, *((other, number) for other in beside)}
    more = graph.more_rooms
    return replace(
        graph,
        rooms=(*graph.rooms, room),
        adjacency=tuple(sorted(pairs)),
        hidden_share=(graph.hidden_share * (number - 1) + room.hidden_share) / number,
        more_rooms=more if more is True or not more else more - 1,
    )


def describe(
    graph: PartialGraph, room_index: int, room: KnownRoom, *, beside: Collection[int] = ()
) -> PartialGraph:
    """Return the partial graph with other facts of a room, 1..R, and more connections of it.

    Raises:
        RecipeError: if a room connects with itself.
    """
    if room_index in beside:
        raise RecipeError(
            f"room {room.name!r}: beside: expected other rooms, found itself",
            code="room-beside-itself",
            where=room.name,
        )
    rooms = [*graph.rooms]
    rooms[room_index - 1] = room
    pairs = {*graph.adjacency, *((min(n, room_index), max(n, room_index)) for n in beside)}
    return replace(graph, rooms=tuple(rooms), adjacency=tuple(sorted(pairs)))


def look(graph: PartialGraph, seen: Look, *, stays: Callable[[str], float]) -> PartialGraph:
    """Return the partial graph after a look that did not find a thing.

    Looks for the same thing at the same place become one, whose chance is that of all
    (`bsg_models.search.looks`: as good as keeping them). Only a look that misses nothing leaves
    nothing possible. With a clock, looks that have faded are left out, and of too many the
    faintest.

    Args:
        graph: before.
        seen: the look.
        stays: thing → hours after which half of such things are elsewhere: looks fade by it.

    Raises:
        RecipeError: without a clock, if there are too many.
    """
    same = [seen, *(old for old in graph.looks if _is_same(old, seen))]
    latest = max((old.time for old in same if old.time is not None), default=None)
    chances = [old.chance * has_stayed(old.time, latest, stays(old.thing)) for old in same]
    found = 1 - miss_all(chances, overlooked=overlooked_at(seen.at))
    joined = replace(seen, chance=1.0 if 1.0 in chances else min(found, _ALMOST), time=latest)
    looks = [old for old in graph.looks if not _is_same(old, seen)]
    if graph.now is not None:
        left = {old: has_stayed(old.time, graph.now, stays(old.thing)) for old in looks}
        looks = _leave_faint({old: old.chance * left[old] for old in looks}, seen.thing)
    things = {seen.thing, *(old.thing for old in looks)}
    if len(looks) >= MAX_ROBOT_LOOKS or len(things) > MAX_ROBOT_SOUGHT:
        raise RecipeError(
            f"{graph.scene_id}: expected at most {MAX_ROBOT_LOOKS:,} looks for at most "
            f"{MAX_ROBOT_SOUGHT} different things; `searched` says that a room has nothing more",
            code="looks-too-many",
            where=graph.scene_id,
        )
    return replace(graph, looks=(*looks, joined))


def _leave_faint(chances: Mapping[Look, float], thing: str) -> list[Look]:
    """Return looks without those of which little is left; beside them, one more has room."""
    things, strong = {thing}, set[Look]()
    for look in sorted(chances, key=lambda look: -chances[look]):
        is_new = look.thing not in things
        if chances[look] < _FADED or len(things) + is_new > MAX_ROBOT_SOUGHT:
            continue
        things.add(look.thing)
        strong.add(look)
        if len(strong) + 1 >= MAX_ROBOT_LOOKS:
            break
    return [look for look in chances if look in strong]


def _is_same(look: Look, other: Look) -> bool:
    """Return whether two looks are for the same thing at the same place."""
    places = [(one.room_index, one.at, normalise_name(one.thing)) for one in (look, other)]
    return places[0] == places[1]


def find_all(
    graph: PartialGraph, room_index: int, names: Collection[str], *, time: float | None = None
) -> PartialGraph:
    """Return the partial graph after all of a room was seen, and only these of its objects.

    Nobody doubts them any more, and no look has missed anything there. What was reported of a later
    time stays.
    """
    here = [
        obj
        for obj in graph.objects
        if obj.room_index == room_index and not is_before(time, obj.time)
    ]
    graph = lose(graph, {obj.name for obj in here}.difference(names))
    for obj in here:
        if obj.name in names:
            graph = see_object(graph, replace(obj, score=None, time=time))
    later = (
        look for look in graph.looks if look.room_index != room_index or is_before(time, look.time)
    )
    graph = replace(graph, looks=tuple(later))
    return enter(graph, room_index, hidden_share=ShareBelief(0.0), time=time)


def is_on_itself(graph: PartialGraph, seen: SeenObject) -> bool:
    """Return whether what an object lies on lies on it, by any way."""
    below, on = {obj.name: obj.on for obj in graph.objects}, seen.on
    while on is not None and on != seen.name:
        on = below.get(on)
    return on is not None


def let_go(graph: PartialGraph) -> PartialGraph:
    """Return the graph without what names an object that is no longer in its room.

    What lay on a piece of furniture that is gone lies somewhere in the room; a look at it says
    nothing any more.
    """
    room_of = {obj.name: obj.room_index for obj in graph.objects}
    loose = [obj for obj in graph.objects if obj.on and room_of.get(obj.on) != obj.room_index]
    looks = tuple(
        look for look in graph.looks if look.at is None or room_of.get(look.at) == look.room_index
    )
    if not loose and len(looks) == len(graph.looks):
        return graph
    freed = {obj.name for obj in loose}
    objects = tuple(replace(obj, on=None) if obj.name in freed else obj for obj in graph.objects)
    return replace(graph, objects=objects, looks=looks)


def lose(graph: PartialGraph, names: Collection[str]) -> PartialGraph:
    """Return the partial graph without some objects; it remembers where they were."""
    others = tuple(obj for obj in graph.objects if obj.name not in names)
    lost = [obj for obj in graph.objects if obj.name in names]
    return replace(graph, objects=others, memory=remember(graph.memory, lost))


def find_near(
    graph: PartialGraph, seen: SeenObject, *, within: float, besides: Collection[str] = ()
) -> SeenObject | None:
    """Return the known object that a sighting is: the nearest in its room of the same class.

    Their categories are the same, or one of them is the class itself: a sofa is a couch.

    Args:
        graph: the partial graph before.
        seen: the sighting.
        within: metres, between two that have a position; 0 keeps all apart.
        besides: ids of objects that it is not.
    """

    def measure(obj: SeenObject) -> float:
        places = (obj.position, seen.position)
        return within if None in places else math.dist(*places)  # type: ignore[arg-type]

    others = (
        obj
        for obj in graph.objects
        if obj.room_index == seen.room_index
        and obj.name not in besides
        and _is_alike(obj, seen, graph.class_space)
    )
    nearest = min(others, key=measure, default=None)
    return nearest if nearest and within and measure(nearest) <= within else None


def find_moved(
    graph: PartialGraph,
    seen: SeenObject,
    *,
    at: Callable[[Collection[SeenObject]], Mapping[str, float]],
    besides: Collection[str] = (),
) -> str | None:
    """Return the id of the thing that a sighting elsewhere is: one of the class that has moved.

    It is the last one that is gone; else the one that is the least likely where it was, if that is
    improbable (`EVIDENCE_SCORE`).

    Args:
        graph: the partial graph before.
        seen: the sighting.
        at: objects → id → P(it is where it was).
        besides: ids of objects that it is not.
    """
    if gone := _find_gone(graph, seen, besides):
        return gone.name
    others = (obj for obj in graph.objects if obj.name not in besides)
    still = at([obj for obj in others if _is_alike(obj, seen, graph.class_space)])
    moved = min(still, key=lambda name: still[name], default=None)
    return moved if moved is not None and still[moved] < EVIDENCE_SCORE else None


def take_over(graph: PartialGraph, seen: SeenObject) -> PartialGraph:
    """Return the graph in which a thing with a new id is the one of its class that is gone, if any.

    Trackers give new ids, and what was used up is bought again.
    """
    known = {obj.name for obj in graph.objects} | {thing.name for thing in graph.memory}
    gone = None if seen.name in known else _find_gone(graph, seen, ())
    memory = (replace(t, name=seen.name) if t is gone else t for t in graph.memory)
    return graph if gone is None else replace(graph, memory=tuple(memory))


def _find_gone(
    graph: PartialGraph, seen: SeenObject, besides: Collection[str]
) -> Remembered | None:
    """Return the last thing of the word of a sighting that is gone, and nobody knows where."""
    here = {obj.name for obj in graph.objects}.union(besides)
    word = normalise_name(seen.raw_category)
    gone = (
        thing
        for thing in graph.memory
        if thing.name not in here and normalise_name(thing.raw_category) == word
    )
    return max(gone, key=lambda thing: thing.sightings[-1].time, default=None)


def _is_alike(obj: SeenObject, other: SeenObject, space: ClassSpace) -> bool:
    """Return whether two are of one class; a plate is no fork, if both are tableware."""
    if obj.class_index != other.class_index:
        return False
    names = {normalise_name(thing.category or thing.raw_category) for thing in (obj, other)}
    is_class = obj.class_index is not None and (
        normalise_name(space.classes[obj.class_index]) in names
    )
    return len(names) == 1 or is_class


def reclassify(graph: PartialGraph, class_map: ClassMap) -> PartialGraph:
    """Return the graph with the classes that another class map gives its objects."""
    meanings = [classify_seen(obj.raw_category, class_map) for obj in graph.objects]
    words = graph.detector
    known = tuple([(word, classify_seen(word, class_map).class_index) for word, _ in words or ()])
    return replace(
        graph,
        class_space=class_map.space,
        detector=words and known,
        objects=tuple(
            replace(obj, category=meaning.category, class_index=meaning.class_index)
            for obj, meaning in zip(graph.objects, meanings, strict=True)
        ),
    )
