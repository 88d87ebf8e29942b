"""What the service is asked, and what it answers. A question brings its map; nothing is kept."""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, ValidationError, WithJsonSchema, field_validator

from bsg_data.errors import BSGError, RecipeError
from bsg_data.files import AnyPath
from bsg_data.inputs.documents import parse_json
from bsg_data.records import Listed, Record, name_fault
from bsg_data.words.shown import SHOWN, show_value
from bsg_models.belief.clock import read_now
from bsg_models.belief.partial_graph import Id, Text
from bsg_models.runs.found_model import DEFAULT_MODEL
from bsg_models.runs.predictor import Predictor
from bsg_robot.answers.description import describe_place, describe_things
from bsg_robot.answers.place import ExpectedClass, Habit, Place, RoomKind, Step
from bsg_robot.answers.request import FindRequest, NextPlaceRequest, Request, read_text
from bsg_robot.answers.seen_building import SeenBuilding
from bsg_robot.graph.graph_file import parse_graph
from bsg_robot.graph.map_forms import FORM
from bsg_robot.graph.reports import reclassify

MOST_ROOMS = 500  # of a map
MOST_THINGS = 20  # of a question
MOST_CLASSES = 10  # of a room, if the question does not say
Notes = Annotated[tuple[str, ...], Field(description="How the map was read.")]
_THING = re.compile(r"(?:[^,(\[]|[(\[][^)\]]*[)\]]?)+")  # up to a comma: `mug (red, old)` is one


class MapRequest(Request):
    """A question about a map."""

    map: dict[str, Any] = Field(
        description="What was seen of the building. Simplest: room -> list of things seen there, "
        "[] for a room not entered; and `more_rooms`, true or a number, if there are rooms that "
        "are not found yet. Or a partial graph (docs/belief.md), or a Spark-DSG graph. A partial "
        "graph also has the times of what was seen (`time`), where things were before (`memory`) "
        "and where people keep them (`customs`).",
        examples=[{"living room": ["sofa", "tv"], "kitchen": ["sink"], "hall": []}],
    )
    now: Annotated[float | None, WithJsonSchema({"type": ["number", "string", "null"]})] = Field(
        None,
        description="What time it is: ISO 8601 with a zone, seconds of the clock of the map, or "
        "`now`; null: that of the map. What was seen counts less as it gets older.",
    )
    labels: Literal["mpcat40", "ade20k"] | None = Field(
        None, description="Label space of a Spark-DSG graph that does not name its labels."
    )

    _read_now = field_validator("now", mode="before")(read_now)

    @field_validator("map", mode="before")
    @classmethod
    def _read_map(cls, value: Any) -> Any:
        document = read_text(value)
        if not isinstance(document, dict):
            raise ValueError(f"expected a JSON object such as {FORM}, found {show_value(document)}")
        return document


class Find(FindRequest, MapRequest):
    """Say in which rooms things probably are, and which room to search first."""

    things: Listed[Text] = Field(
        min_length=1, max_length=MOST_THINGS, description="What to look for, in any words."
    )

    @field_validator("things", mode="before")
    @classmethod
    def _list_things(cls, value: Any) -> Any:
        """Return the things of a text: models of agents write `["cup"]` or `cup, towel`."""
        if not isinstance(value, str):
            return value
        if value.lstrip().startswith("[") and '"' in value:
            return read_text(value)
        parts = islice(_THING.finditer(value), MOST_THINGS + 1)
        return [*filter(None, (part.group().strip() for part in parts))] or [value]


class NextPlace(NextPlaceRequest, MapRequest):
    """Say which piece of furniture to look at next, to find one thing."""

    here: Id = Field(description="The room where the robot is, by id or label.")


class Expect(MapRequest):
    """Say what rooms probably hold that was not seen yet, of one room or of all."""

    room: Id | None = Field(None, description="One room, by id or label; null for all rooms.")
    most: Annotated[int, Field(ge=1, le=1000, strict=True)] | None = Field(
        MOST_CLASSES,
        description=f"Classes of a room, the likeliest first; null: {MOST_CLASSES}.",
    )

    _read = field_validator("most", mode="before")(read_text)


class Thing(Record):
    """Where one thing probably is."""

    thing: str
    class_name: str | None = Field(
        alias="class",
        description="The class that answers for it; null: no model counts it, and it is judged by "
        "what is like it.",
    )
    by: str = Field(
        description="What answers: counts of the `class`, the `table` of everyday things, or "
        "`likeness` to other things."
    )
    how: str = Field(description="Why this class; empty if the thing is its name.")
    model: str
    anywhere: float = Field(description="P(at least one is in the building).")
    places: tuple[Place, ...] = Field(
        description="Rooms, the likeliest first: `probability` of at least one, `if_there` the "
        "same if the building has one, `unseen` of at least one that was not seen, `expected` "
        "number of these, `seen` ids, `cost` of the way, null if it is unknown or closed. `room` "
        "is null for things that were seen in no room, and `explore` for rooms that are not found "
        "yet. `pieces` has the likeliest pieces of furniture, if some were seen there."
    )
    habits: tuple[Habit, ...] = Field(
        description="Where such things usually are in this home, the likeliest first: `room`, null "
        "for the rest; `piece` of furniture, `share` of those that were moved, number of "
        "`sightings`, time of the `last`, and whether people have `told` it. Empty if the map has "
        "no times and no customs of it."
    )


class Found(Record):
    """Where things probably are, and the room to go to first."""

    things: tuple[Thing, ...]
    go_first: str | None = Field(
        description="Room to look into first; `explore`: find new rooms; null: none is left, or "
        "none within the `budget`, or see `robots`."
    )
    plan: tuple[Step, ...] = Field(
        description="The search in its order: `probability` that the room has any of the things, "
        "cost of the `way` and of the `look`, probability that all (`found`) or any (`any_found`) "
        "of them are found by then, and `seconds` until then, by the `speed`. A room may come "
        "twice. Empty without `here`."
    )
    robots: dict[str, str | None] | None = Field(
        description="For each of several robots the room to look into first."
    )
    found_within: float | None = Field(
        description="Probability that the plan finds all within the `budget`; 0 if no room can be "
        "looked into within it; null without a budget, or of several robots."
    )
    here: str | None
    cost_unit: str | None = Field(
        description="Unit of `cost`: m, rooms, or given: that of `costs`."
    )
    notes: Notes


class Destination(Record):
    """The piece of furniture to look at next."""

    thing: str
    room: str | None = Field(
        description="Its room; `explore`: find new rooms; null: nothing is left to search."
    )
    piece: str | None = Field(
        description="Its id; null: enter the room, or look about in it for more furniture."
    )
    notes: Notes


class Content(Record):
    """What a room probably holds that was not seen."""

    room: str = Field(description="Its id; or the name that was asked for.")
    label: str | None
    kinds: tuple[RoomKind, ...] = Field(
        description="Kinds that the room may be of, the likeliest first."
    )
    expected: tuple[ExpectedClass, ...] = Field(
        description="`probability` of at least one that was not seen, `expected` number of these, "
        "number `seen`."
    )


class Contents(Record):
    """What rooms probably hold that was not seen."""

    rooms: tuple[Content, ...]
    model: str
    notes: Notes


class Question(NamedTuple):
    """What can be asked: over HTTP at the path of its name in `QUESTIONS`, over MCP by a tool."""

    tool: str
    asks: type[Request]
    answers: type[Record]


QUESTIONS = {
    "find": Question("find_things", Find, Found),
    "next_place": Question("next_place", NextPlace, Destination),
    "expect": Question("expect_things", Expect, Contents),
}


class Fault(Record):
    """Why there is no answer."""

    error: str
    code: str
    where: str = ""


class Answer(NamedTuple):
    """Status and JSON of an answer over HTTP."""

    status: int
    body: bytes


def refuse(status: int, error: str, *, code: str, where: str = "") -> Answer:
    """Return a fault as an answer."""
    return Answer(status, Fault(error=error, code=code, where=where).model_dump_json().encode())


class Service:
    """Answers each of `QUESTIONS` by one model."""

    def __init__(self, model: AnyPath = DEFAULT_MODEL) -> None:
        """Load the model.

        Raises:
            CheckpointError: if there is no such model.
        """
        self._predictor = Predictor(model)

    def answer(self, path: str, body: bytes) -> Answer:
        """Return the answer to one of `QUESTIONS`, or what is wrong with the question."""
        asks = QUESTIONS[path].asks
        try:
            document = parse_json(body)
        except ValueError as error:
            return refuse(400, f"no JSON ({str(error)[:SHOWN]})", code="json-malformed")
        try:
            found: Record = getattr(self, path)(asks.model_validate(document))
        except ValidationError as error:
            fault = f"{name_fault(error)}; keys are {', '.join(asks.model_fields)}"
            where = ".".join(str(key)[:SHOWN] for key in error.errors()[0]["loc"])
            return refuse(422, fault, code="question-malformed", where=where)
        except BSGError as error:
            return refuse(422, str(error), code=error.code, where=error.where)
        return Answer(200, found.model_dump_json(by_alias=True).encode())

    def find(self, asked: Find) -> Found:
        """Return where things probably are."""
        seen = self._open(asked)
        facts = describe_things(seen, asked.things, here=asked.here, **asked.options)
        return Found.model_validate({**facts, "notes": seen.notes})

    def next_place(self, asked: NextPlace) -> Destination:
        """Return the piece of furniture to look at next."""
        seen = self._open(asked)
        facts = describe_place(seen, asked.thing, here=asked.here, **asked.options)
        return Destination.model_validate({**facts, "notes": seen.notes})

    def expect(self, asked: Expect) -> Contents:
        """Return what rooms probably hold."""
        seen = self._open(asked)
        labels = {room.name: room.label for room in seen.graph.rooms}
        contents = [
            Content(
                room=room,
                label=labels.get(room),
                kinds=seen.kinds(room),
                expected=seen.expected(room)[: asked.most],
            )
            for room in (labels if asked.room is None else (asked.room,))
        ]
        return Contents(rooms=tuple(contents), model=seen.model, notes=seen.notes)

    def _open(self, asked: MapRequest) -> SeenBuilding:
        file = parse_graph(asked.map, path=Path("map"), labels=asked.labels)
        if (number := len(file.graph.rooms)) > MOST_ROOMS:
            raise RecipeError(
                f"map: expected at most {MOST_ROOMS} rooms, found {number:,}; ask about "
                "a part of the building",
                code="rooms-too-many",
                where="map",
            )
        graph = reclassify(file.graph, self._predictor.class_map)
        seen = SeenBuilding(graph, self._predictor, notes=file.notes)
        if asked.now is not None:
            seen.passes(until=asked.now)
        return seen
