"""What a robot says in a text: a word, or JSON. Each text gets one answer.

Texts come from other programs. They are bounded and checked here; a fault is an answer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError

from bsg_data.errors import BSGError, RecipeError
from bsg_data.inputs.documents import parse_json
from bsg_data.records import name_fault
from bsg_models.belief.clock import HOUR, Time, read_now, show_time
from bsg_models.belief.partial_graph import (
    LOOK_CHANCE,
    Hours,
    Metres,
    Number,
    PartialGraph,
    Position,
    Score,
    Stay,
    StrictFraction,
    spell_id,
)
from bsg_models.belief.partial_graph import MoreRooms as MoreRoomsNumber
from bsg_robot.answers.description import describe_place, describe_things
from bsg_robot.answers.request import FindRequest, NextPlaceRequest, Request, read_text
from bsg_robot.answers.seen_building import SeenBuilding
from bsg_robot.answers.words import find_room
from bsg_robot.graph.memory import LONGEST_STEP
from bsg_robot.graph.room_kinds import note_building, note_rooms

MOST_CHARACTERS = 65_536  # of a text
# That are kept: a broken detector may never stop. A file holds as many, whatever their names.
MOST_ROOMS, MOST_OBJECTS = 2_000, 10_000
_MOST_NAMES = 20  # in a list
_LONGEST = 100  # characters of a name

Answer = dict[str, Any]
Within = Annotated[float, Number, Field(ge=0)]  # metres, or ∞
Name = Annotated[str, Field(min_length=1, max_length=_LONGEST)]
Id = Annotated[Name, BeforeValidator(spell_id)]  # a number is one, too
_OneOrMore = BeforeValidator(lambda value: value if isinstance(value, list | tuple) else [value])
Names = Annotated[tuple[Name, ...], Field(min_length=1, max_length=_MOST_NAMES), _OneOrMore]
Ids = Annotated[tuple[Id, ...], Field(max_length=_MOST_NAMES), _OneOrMore]
Found = Annotated[tuple[Id, ...], Field(max_length=1000), _OneOrMore]


class _Request(Request):
    """What a robot may say on a topic; a text that is no object gives the first field."""

    id: Id | None = None  # comes back with the answer

    @property
    def arguments(self) -> dict[str, Any]:
        """The arguments of the method of `SeenBuilding`."""
        return self.model_dump(exclude={"id"})


class Saw(_Request):
    """One object; `object` is its id, and a known id moves it."""

    thing: Name
    room: Id | None = None  # None: where the robot is
    object: Id | None = None
    position: Position | None = None
    score: Score | None = None
    time: Time | None = None  # None: now, and so below
    age: Hours | None = None
    stays: Stay | None = None
    within: Within = 0.5
    besides: Annotated[tuple[Id, ...], Field(max_length=1000)] = ()
    on: Id | None = None


class Gone(_Request):
    """A known object is no longer there."""

    object: Id
    time: Time | None = None


class Looked(_Request):
    """A look for one thing in a room did not find it."""

    thing: Name
    room: Id | None = None  # None: where the robot is
    chance: Score = LOOK_CHANCE
    at: Id | None = None  # None: the whole room
    time: Time | None = None


class Entered(_Request):
    """The robot is in a room, or has seen more of it."""

    room: Id
    floor_in_view: StrictFraction | None = None
    walls_in_view: StrictFraction | None = None
    seconds_inside: Annotated[float, Field(ge=0, le=1e9, strict=True)] | None = None
    hidden_share: StrictFraction | None = None
    time: Time | None = None


class Searched(_Request):
    """All that is in a room was seen; known objects that are not `found`, if said, are gone."""

    room: Id
    found: Found | None = None
    time: Time | None = None


class Discovered(_Request):
    """There is one more room, which the robot has not entered."""

    room: Id
    beside: Ids = ()
    room_type: Name | dict[Name, StrictFraction] | None = None
    position: Position | None = None
    floor_area: Metres | None = None


class Describe(Discovered):
    """More is known of a room."""

    label: Name | None = None


class MoreRooms(_Request):
    """So many rooms are not found yet; `true`: as many as homes have."""

    number: Annotated[MoreRoomsNumber, BeforeValidator(read_text)]


class Passes(_Request):
    """So many hours have passed, or it is such a time."""

    hours: Annotated[Hours, BeforeValidator(read_text)] | None = None
    until: Annotated[Time, BeforeValidator(read_now)] | None = None


class Keeps(_Request):
    """People keep a thing, or a group of things, there; or never do."""

    thing: Name
    room: Id | None = None  # None: any
    at: Id | None = None  # None: anywhere in the room


class Forget(_Request):
    """What this home has taught of a thing, or of all, is forgotten."""

    thing: Name | None = None


class Where(_Request, FindRequest):
    """Where a thing is, or several; without `here`, from where the robot is."""

    thing: Names


class NextPlace(_Request, NextPlaceRequest):
    """Which piece of furniture to look at next, to find a thing."""

    here: Id | None = None  # None: where the robot is


class Expected(_Request):
    """Which unseen classes a room may hold."""

    room: Id


class Habits(_Request):
    """What this home has taught of a thing."""

    thing: Name


class Robot:
    """A robot's `SeenBuilding`, told and asked by texts."""

    def __init__(self, seen: SeenBuilding) -> None:
        self.seen = seen
        self.here: str | None = None  # the room that it entered last
        self._ahead = 0.0  # seconds, of the building's clock before the robot's

    def tell_time(self, clock: float) -> str:
        """Let the time of the robot's clock pass; return what a person should know of it, or "".

        A clock that jumps back, as of a simulation that begins again, or years ahead, goes on from
        the last time.
        """
        last = self.seen.graph.now
        if last is None:
            self.seen.passes(until=clock)
            return ""
        for ahead in (self._ahead, 0.0):
            if 0 <= clock + ahead - last <= LONGEST_STEP:
                self._ahead = ahead
                self.seen.passes(until=clock + ahead)
                return ""
        self._ahead = last - clock
        return (
            f"the clock says {show_time(clock)}, and the last report is of {show_time(last)}: its "
            "time goes on from there"
        )

    def date(self, stamp: float) -> float | None:
        """Return the time of what was seen at a stamp of the robot's clock; None for now.

        A stamp that is after now, or more than an hour before, is of another clock.
        """
        time, now = stamp + self._ahead, self.seen.graph.now
        return time if stamp and now is not None and 0 <= now - time <= HOUR else None

    def hear(self, topic: str, text: str) -> Answer:
        """Return the answer to a text of one of `TOPICS`: see `answer`."""
        try:
            return self.answer(topic, _read(text, TOPICS[topic][0]))
        except BSGError as error:
            return {"topic": topic, "error": str(error), "code": error.code}

    def answer(self, topic: str, request: Mapping[str, Any]) -> Answer:
        """Return the answer to keys and values that are not checked yet.

        It has the `topic`, and the `id` if there is one; an `error` and its `code`, or what was
        asked for.
        """
        kind, act = TOPICS[topic]
        answer: Answer = {"topic": topic}
        if isinstance(name := spell_id(request.get("id")), str):
            answer["id"] = name[:_LONGEST]
        try:
            return answer | act(self, kind.model_validate(request))
        except ValidationError as error:
            keys = ", ".join(kind.model_fields)
            fault = {"error": f"{name_fault(error)}; keys are {keys}", "code": "request-malformed"}
        except BSGError as error:
            fault = {"error": str(error), "code": error.code}
        return answer | fault

    def saw(self, request: Saw) -> Answer:
        """Note one object, in the robot's room unless it says another one."""
        known = self.seen.graph.objects
        if len(known) >= MOST_OBJECTS and all(obj.name != request.object for obj in known):
            raise _refuse_more(f"objects are at most {MOST_OBJECTS:,}", "objects-too-many")
        room = self._require_room(request.room)
        arguments = request.arguments | {"room": room}
        object_id = self.seen.saw(object_id=arguments.pop("object"), **arguments)
        is_known = self.seen.graph.objects[-1].category is not None
        note = f"no class map knows {request.thing!r}: it is kept, but tells the model nothing"
        return {"object": object_id} if is_known else {"object": object_id, "notes": [note]}

    def entered(self, request: Entered) -> Answer:
        """Note where the robot is, and how much of the room it has seen."""
        self.seen.entered(**request.arguments)
        self.here = request.room
        return {"room": request.room}

    def gone(self, request: Gone) -> Answer:
        """Note that an object is gone."""
        self.seen.gone(request.object, time=request.time)
        return {"object": request.object}

    def looked(self, request: Looked) -> Answer:
        """Note a look that did not find a thing, in the robot's room unless it says another one."""
        room = self._require_room(request.room)
        self.seen.looked(**request.arguments | {"room": room})
        return {"room": room, "thing": request.thing}

    def searched(self, request: Searched) -> Answer:
        """Note that all of a room was seen."""
        self.seen.searched(**request.arguments)
        return {"room": request.room}

    def describe(self, request: Describe) -> Answer:
        """Note more of a known room."""
        before = self.seen.graph
        index = find_room(before, request.room)
        self.seen.describe(**request.arguments)
        return self._answer_room(request.room, index, before)

    def _answer_room(self, room: str, index: int, before: PartialGraph) -> Answer:
        """Answer with a room, how it is read, and the building's kind if it is another one now."""
        graph = self.seen.graph
        notes = [*note_rooms(graph, [graph.rooms[index - 1]])]
        notes += [] if graph.building_kind == before.building_kind else note_building(graph)
        return {"room": room, "notes": notes} if notes else {"room": room}

    def more_rooms(self, request: MoreRooms) -> Answer:
        """Note how many rooms are not found yet."""
        self.seen.more_rooms(request.number or 0)
        return {"number": request.number}

    def passes(self, request: Passes) -> Answer:
        """Note that time has passed."""
        before = self.seen.graph.now
        self.seen.passes(request.hours, until=request.until)
        now = self.seen.graph.now or 0.0
        self._ahead += 0.0 if before is None else now - before
        return {"now": show_time(now)}

    def keeps(self, request: Keeps) -> Answer:
        """Note where people keep a thing."""
        self.seen.keeps(**request.arguments)
        return request.arguments

    def never(self, request: Keeps) -> Answer:
        """Note where a thing never is."""
        self.seen.never(**request.arguments)
        return request.arguments

    def forget(self, request: Forget) -> Answer:
        """Forget what this home has taught."""
        self.seen.forget(**request.arguments)
        return request.arguments

    def _require_room(self, room: str | None) -> str:
        """Return a room, or that of the robot."""
        if room is None and self.here is None:
            raise RecipeError(
                "it is not known where the robot is; say the room, or first that it entered one",
                code="room-unsaid",
            )
        return str(room or self.here)

    def discovered(self, request: Discovered) -> Answer:
        """Note a new room."""
        if len(self.seen.rooms) >= MOST_ROOMS:
            raise _refuse_more(f"rooms are at most {MOST_ROOMS:,}", "rooms-too-many")
        before = self.seen.graph
        self.seen.discovered(**request.arguments)
        return self._answer_room(request.room, len(self.seen.rooms), before)

    def where(self, request: Where) -> Answer:
        """Answer what `bsg-belief --find --json` prints."""
        here = request.here or (None if request.robots else self.here)
        return describe_things(self.seen, request.thing, here=here, **request.options)

    def next_place(self, request: NextPlace) -> Answer:
        """Answer which piece of furniture to look at next."""
        here = self._require_room(request.here)
        return describe_place(self.seen, request.thing, here=here, **request.options)

    def expected(self, request: Expected) -> Answer:
        """Answer what a room may hold, and of which kind it may be, the likeliest first."""
        expected, kinds = self.seen.expected(request.room), self.seen.kinds(request.room)
        return {
            "room": request.room,
            "kinds": [*map(asdict, kinds)],
            "expected": [*map(asdict, expected)],
        }

    def habits(self, request: Habits) -> Answer:
        """Answer where a thing usually is in this home."""
        return {"thing": request.thing, "habits": [*map(asdict, self.seen.habits(request.thing))]}


def read_detections(message: Any, *, frame: str, min_score: float) -> Iterator[dict[str, Any]]:
    """Yield the objects of a `vision_msgs/Detection3DArray` that have a high score.

    Positions count only in the frame of the map. A detection without an id is an object of its
    class that is known nearby; without a position, any of its class in the room.
    """
    placed = message.header.frame_id == frame
    for detection in message.detections:
        best = max(
            (each.hypothesis for each in detection.results), key=lambda h: h.score, default=None
        )
        if best is not None and best.score >= min_score:
            at = detection.bbox.center.position
            sighting = {"thing": best.class_id, "object": detection.id or None, "score": best.score}
            yield sighting | ({"position": (at.x, at.y, at.z)} if placed else {})


def _read(text: str, kind: type[_Request]) -> dict[str, Any]:
    """Return what a text says, as keys and values that are not checked yet."""
    if len(text) > MOST_CHARACTERS:
        raise RecipeError(
            f"expected at most {MOST_CHARACTERS:,} characters, found {len(text):,}",
            code="request-too-large",
        )
    keys: Any = text
    if text.lstrip().startswith(("{", "[", '"')):
        try:
            keys = parse_json(text)
        except ValueError as error:
            raise RecipeError(f"no JSON ({error})", code="json-malformed") from error
    needed = [name for name, key in kind.model_fields.items() if key.is_required()]
    plain, *_ = needed or [name for name in kind.model_fields if name != "id"]
    return keys if isinstance(keys, dict) else {plain: keys}


def _refuse_more(what: str, code: str) -> RecipeError:
    return RecipeError(f"{what}; call ~/reset to begin a new building", code=code)


# topic → what a text says, and what is done with it; in the order of a robot's day
TOPICS: dict[str, tuple[type[_Request], Callable[[Robot, Any], Answer]]] = {
    "discovered": (Discovered, Robot.discovered),
    "entered": (Entered, Robot.entered),
    "saw": (Saw, Robot.saw),
    "searched": (Searched, Robot.searched),
    "looked": (Looked, Robot.looked),
    "gone": (Gone, Robot.gone),
    "describe": (Describe, Robot.describe),
    "more_rooms": (MoreRooms, Robot.more_rooms),
    "passes": (Passes, Robot.passes),
    "keeps": (Keeps, Robot.keeps),
    "never": (Keeps, Robot.never),
    "forget": (Forget, Robot.forget),
    "where": (Where, Robot.where),
    "next_place": (NextPlace, Robot.next_place),
    "expected": (Expected, Robot.expected),
    "habits": (Habits, Robot.habits),
}
