"""What a robot says in a text: a word, or JSON. Each text gets one answer.

Texts come from other programs. They are bounded and checked here; a fault is an answer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError

import bsg_data
import bsg_models
from bsg_cli.find import describe_things
from bsg_data.inputs.documents import parse_json
from bsg_data.observation.partial_graph import Metres, Position, Share
from bsg_data.recipes import Record, name_fault
from bsg_data.scene.room_label import explain_room_type, label_of

MOST_CHARACTERS = 65_536  # of a text
MOST_ROOMS, MOST_OBJECTS = 2_000, 20_000  # that are kept; a broken detector may never stop
_MOST_NAMES = 20  # in a list
_LONGEST = 100  # characters of a name

Answer = dict[str, Any]
Name = Annotated[str, Field(min_length=1, max_length=_LONGEST)]
Names = Annotated[  # or one name
    tuple[Name, ...],
    Field(max_length=_MOST_NAMES),
    BeforeValidator(lambda said: [said] if isinstance(said, str) else said),
]


class _Request(Record):
    """What a robot may say on a topic; a text that is no object gives the first field."""

    id: Name | None = None  # comes back with the answer


class Saw(_Request):
    """One object; `object` is its id, and a known id moves it."""

    thing: Name
    room: Name | None = None  # None: where the robot is
    object: Name | None = None
    position: Position | None = None


class Entered(_Request):
    """The robot is in a room, or has seen more of it."""

    room: Name
    floor_in_view: Share | None = None
    walls_in_view: Share | None = None
    seconds_inside: Annotated[float, Field(ge=0, le=1e9, strict=True)] | None = None
    hidden_share: Share | None = None


class Searched(_Request):
    """All that is in a room was seen."""

    room: Name


class Discovered(_Request):
    """There is one more room, which the robot has not entered."""

    room: Name
    beside: Names = ()
    room_type: Name | dict[Name, Share] | None = None
    position: Position | None = None
    floor_area: Metres | None = None


class Where(_Request):
    """Where a thing is, or several, and which room to go to first."""

    thing: Annotated[Names, Field(min_length=1)]
    here: Name | None = None  # None: where the robot is


class Expected(_Request):
    """Which unseen classes a room may hold."""

    room: Name


class Robot:
    """A robot's `SeenBuilding`, told and asked by texts."""

    def __init__(self, seen: bsg_models.SeenBuilding) -> None:
        self.seen = seen
        self.here: str | None = None  # the room that it entered last

    def hear(self, topic: str, text: str) -> Answer:
        """Return the answer to a text of one of `TOPICS`: see `answer`."""
        try:
            return self.answer(topic, _read(text, TOPICS[topic][0]))
        except bsg_data.BSGError as error:
            return {"topic": topic, "error": str(error), "code": error.code}

    def answer(self, topic: str, said: Mapping[str, Any]) -> Answer:
        """Return the answer to keys and values that are not checked yet.

        It has the `topic`, and the `id` if there is one; an `error` and its `code`, or what was
        asked for.
        """
        kind, act = TOPICS[topic]
        answer: Answer = {"topic": topic}
        if isinstance(said.get("id"), str):
            answer["id"] = said["id"][:_LONGEST]
        try:
            return answer | act(self, kind.model_validate(said))
        except ValidationError as error:
            keys = ", ".join(kind.model_fields)
            fault = {"error": f"{name_fault(error)}; keys are {keys}", "code": "request-malformed"}
        except bsg_data.BSGError as error:
            fault = {"error": str(error), "code": error.code}
        return answer | fault

    def saw(self, said: Saw) -> Answer:
        """Note one object, in the robot's room unless it says another one."""
        known = self.seen.graph.objects
        if len(known) >= MOST_OBJECTS and all(obj.name != said.object for obj in known):
            raise _refuse_more(f"objects are at most {MOST_OBJECTS:,}", "objects-too-many")
        room = said.room or self.here
        if room is None:
            raise bsg_data.RecipeError(
                "it is not known where the robot is; say the room, or first that it entered one",
                code="room-unsaid",
            )
        object_id = self.seen.saw(room, said.thing, object_id=said.object, position=said.position)
        is_known = self.seen.graph.objects[-1].category is not None
        note = f"no class map knows {said.thing!r}: it is kept, but tells the model nothing"
        return {"object": object_id} if is_known else {"object": object_id, "notes": [note]}

    def entered(self, said: Entered) -> Answer:
        """Note where the robot is, and how much of the room it has seen."""
        self.seen.entered(**said.model_dump(exclude={"id"}))
        self.here = said.room
        return {"room": said.room}

    def searched(self, said: Searched) -> Answer:
        """Note that all of a room was seen."""
        self.seen.searched(said.room)
        return {"room": said.room}

    def discovered(self, said: Discovered) -> Answer:
        """Note a new room."""
        if len(self.seen.rooms) >= MOST_ROOMS:
            raise _refuse_more(f"rooms are at most {MOST_ROOMS:,}", "rooms-too-many")
        kind = said.room_type or label_of("any", said.room)  # a name may be a kind, as in a map
        self.seen.discovered(**said.model_dump(exclude={"id"}) | {"room_type": kind})
        types = explain_room_type(said.room_type).items()
        notes = [f"room type {word!r} is read as {read}" for word, read in types]
        return {"room": said.room, "notes": notes} if notes else {"room": said.room}

    def where(self, said: Where) -> Answer:
        """Answer what `bsg-belief --find --json` prints."""
        things = said.thing[0] if len(said.thing) == 1 else said.thing
        return describe_things(self.seen, things, here=said.here or self.here)

    def expected(self, said: Expected) -> Answer:
        """Answer what a room may hold, the likeliest first."""
        return {"room": said.room, "expected": [*map(asdict, self.seen.expected(said.room))]}


def read_detections(message: Any, *, frame: str, min_score: float) -> Iterator[dict[str, Any]]:
    """Yield the objects of a `vision_msgs/Detection3DArray` that have an id and a high score.

    Positions count only in the frame of the map.
    """
    placed = message.header.frame_id == frame
    for one in message.detections:
        best = max((each.hypothesis for each in one.results), key=lambda h: h.score, default=None)
        if best is not None and best.score >= min_score and one.id:
            at = one.bbox.center.position
            position = (at.x, at.y, at.z) if placed else None
            yield {"thing": best.class_id, "object": one.id, "position": position}


def _read(text: str, kind: type[_Request]) -> dict[str, Any]:
    """Return what a text says, as keys and values that are not checked yet."""
    if len(text) > MOST_CHARACTERS:
        raise bsg_data.RecipeError(
            f"expected at most {MOST_CHARACTERS:,} characters, found {len(text):,}",
            code="request-too-large",
        )
    said: Any = text
    if text.lstrip().startswith(("{", "[", '"')):
        try:
            said = parse_json(text)
        except ValueError as error:
            raise bsg_data.RecipeError(f"no JSON ({error})", code="json-malformed") from error
    plain = next(name for name in kind.model_fields if name != "id")
    return said if isinstance(said, dict) else {plain: said}


def _refuse_more(what: str, code: str) -> bsg_data.RecipeError:
    return bsg_data.RecipeError(f"{what}; call ~/reset to begin a new building", code=code)


# topic → what a text says, and what is done with it; in the order of a robot's day
TOPICS: Mapping[str, tuple[type[_Request], Callable[[Robot, Any], Answer]]] = MappingProxyType(
    {
        "discovered": (Discovered, Robot.discovered),
        "entered": (Entered, Robot.entered),
        "saw": (Saw, Robot.saw),
        "searched": (Searched, Robot.searched),
        "where": (Where, Robot.where),
        "expected": (Expected, Robot.expected),
    }
)
