"""What the service is asked, and what it answers. A question brings its map; nothing is kept."""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BeforeValidator, Field, WithJsonSchema

from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath
from bsg_data.inputs.documents import parse_json
from bsg_data.records import Keyed, Listed, Record, SaidRecord
from bsg_data.words.shown import SHOWN, show_value
from bsg_models.belief.clock import read_now
from bsg_models.belief.partial_graph import LOOK_CHANCE, Id, Score, Text
from bsg_models.runs.found_model import DEFAULT_MODEL
from bsg_models.runs.predictor import Predictor
from bsg_models.search.knowledge import Task
from bsg_robot.answers.description import describe_place, describe_things
from bsg_robot.answers.place import ExpectedClass, Habit, Place, RoomKind, Step
from bsg_robot.answers.seen_building import SeenBuilding
from bsg_robot.answers.ways import SaidCost, SaidCosts, SaidLook, SaidSpeed
from bsg_robot.graph.graph_file import parse_graph
from bsg_robot.graph.map_forms import FORM
from bsg_robot.graph.reports import reclassify

MOST_ROOMS = 500  # of a map
MOST_THINGS = 20  # of a question
MOST_ROBOTS = 10
MOST_CLASSES = 10  # of a room, if the question does not say
_THING = re.compile(r"(?:[^,(\[]|[(\[][^)\]]*[)\]]?)+")  # up to a comma: `mug (red, old)` is one


def _read_text(said: Any) -> Any:
    """Return what a text says: models of agents write JSON as text, and "" for what is left out."""
    if not isinstance(said, str):
        return said
    try:
        return parse_json(said) if said.strip() else None
    except ValueError as fault:
        raise ValueError(
            f"expected a value, or the text of its JSON, found {said[:SHOWN]!r} ({fault})"
        ) from None


def _read_map(said: Any) -> Any:
    said = _read_text(said)
    if not isinstance(said, dict):
        raise ValueError(f"expected a JSON object such as {FORM}, found {show_value(said)}")
    return said


def _list_things(said: Any) -> Any:
    """Return the things of a text: models of agents write `["cup"]` or `cup, towel` for a list."""
    if not isinstance(said, str):
        return said
    if said.lstrip().startswith("[") and '"' in said:
        return _read_text(said)
    parts = islice(_THING.finditer(said), MOST_THINGS + 1)
    return [*filter(None, (part.group().strip() for part in parts))] or [said]


Map = Annotated[
    dict[str, Any],
    BeforeValidator(_read_map),
    Field(
        description="What was seen of the building. Simplest: room -> list of things seen there, "
        "[] for a room not entered; and `more_rooms`, true or a number, if there are rooms that "
        "are not found yet. Or a partial graph (docs/belief.md), or a Spark-DSG graph. A partial "
        "graph also has the times of what was seen (`time`), where things were before (`memory`) "
        "and where people keep them (`customs`).",
        examples=[{"living room": ["sofa", "tv"], "kitchen": ["sink"], "hall": []}],
    ),
]
Things = Annotated[
    Listed[Text],
    BeforeValidator(_list_things),
    Field(min_length=1, max_length=MOST_THINGS, description="What to look for, in any words."),
]
OneThing = Annotated[Text, Field(description="What to look for, in any words.")]
# Models of agents fill in every field: null and "" mean that it is left out.
_Blank = BeforeValidator(lambda said: None if said == "" else said)
Here = Annotated[
    Id | None,
    _Blank,
    Field(description="The room where the robot is, by id or label; ways are measured from it."),
]
HereSaid = Annotated[Id, Field(description="The room where the robot is, by id or label.")]
At = Annotated[
    Id | None,
    _Blank,
    Field(
        description="The piece of furniture where the robot is, by id; null: it is in the middle "
        "of the room."
    ),
]
Robots = Annotated[
    Annotated[Keyed[Id, Id], Field(max_length=MOST_ROBOTS)] | None,
    BeforeValidator(lambda said: _read_text(said) or None),
    Field(description="Several robots that search together: name of each -> its room."),
]
WayCosts = Annotated[
    SaidCosts,
    BeforeValidator(_read_text),
    Field(
        description="Costs of ways that the map does not say, as a list of [room, room, cost], in "
        'the unit of the ways; "closed" for a closed door, which no way leads through.',
        examples=[[["hall", "kitchen", 3.5], ["hall", "bath", "closed"]]],
    ),
]
Look = Annotated[
    SaidLook,
    BeforeValidator(_read_text),
    Field(
        description="Cost of looking into a room, in the unit of the ways: of every room, or room "
        "-> cost; null: estimated from its size and what is left of it."
    ),
]
LookAt = Annotated[
    SaidCost | None,
    BeforeValidator(_read_text),
    Field(
        description="Cost of a look at a piece of furniture, in the unit of the ways; null: 2.5 m."
    ),
]
Chance = Annotated[
    Score | None,
    BeforeValidator(_read_text),
    Field(
        description="P(a look finds a thing that is there), of the robot's detector; null: "
        f"{LOOK_CHANCE}."
    ),
]
Budget = Annotated[
    SaidCost | None,
    BeforeValidator(_read_text),
    Field(
        description="What the search may cost, in the unit of the ways, or in seconds with a "
        "`speed`: the plan is the one that most likely ends within it. Needs `here` or `robots`."
    ),
]
Speed = Annotated[
    SaidSpeed | None,
    BeforeValidator(_read_text),
    Field(description="Of the robot, in metres a second; it makes a plan say `seconds`."),
]
AnyTask = Annotated[
    Task | None,
    _Blank,
    Field(description="`single`: one of each thing is enough (null); `all`: find all of them."),
]
Room = Annotated[
    Id | None, _Blank, Field(description="One room, by id or label; null for all rooms.")
]
Most = Annotated[
    Annotated[int, Field(ge=1, le=1000, strict=True)] | None,
    BeforeValidator(_read_text),
    Field(description=f"Classes of a room, the likeliest first; null: {MOST_CLASSES}."),
]
Labels = Annotated[
    Literal["mpcat40", "ade20k"] | None,
    _Blank,
    Field(description="Label space of a Spark-DSG graph that does not name its labels."),
]

Now = Annotated[
    float | None,
    BeforeValidator(lambda said: None if said in (None, "") else read_now(said)),
    WithJsonSchema({"type": ["number", "string", "null"]}),
    Field(
        description="What time it is: ISO 8601 with a zone, seconds of the clock of the map, or "
        "`now`; null: that of the map. What was seen counts less as it gets older."
    ),
]


class Find(SaidRecord):
    """Where things probably are."""

    map: Map
    things: Things
    here: Here = None
    robots: Robots = None
    costs: WayCosts = None
    look: Look = None
    chance: Chance = None
    task: AnyTask = None
    budget: Budget = None
    speed: Speed = None
    now: Now = None
    labels: Labels = None


class NextPlace(SaidRecord):
    """Which piece of furniture to look at next."""

    map: Map
    thing: OneThing
    here: HereSaid
    at: At = None
    costs: WayCosts = None
    look: LookAt = None
    chance: Chance = None
    now: Now = None
    labels: Labels = None


class Expect(SaidRecord):
    """What rooms probably hold that was not seen."""

    map: Map
    room: Room = None
    most: Most = None
    now: Now = None
    labels: Labels = None


class Thing(Record):
    """Where one thing probably is."""

    thing: str
    class_name: Annotated[
        str | None,
        Field(
            alias="class",
            description="The class that answers for it; null: no model counts it, and it is judged "
            "by what is like it.",
        ),
    ]
    by: Annotated[
        str,
        Field(
            description="What answers: counts of the `class`, the `table` of everyday things, or "
            "`likeness` to other things."
        ),
    ]
    how: Annotated[str, Field(description="Why this class; empty if the thing is its name.")]
    model: str
    anywhere: Annotated[float, Field(description="P(at least one is in the building).")]
    places: Annotated[
        tuple[Place, ...],
        Field(
            description="Rooms, the likeliest first: `probability` of at least one, `if_there` the "
            "same if the building has one, `unseen` of at least one that was not seen, `expected` "
            "number of these, `seen` ids, `cost` of the way, null if it is unknown or closed. "
            "`room` is null for "
            "things that were seen in no room, and `explore` for rooms that are not found yet. "
            "`pieces` has the likeliest pieces of furniture, if some were seen there."
        ),
    ]
    habits: Annotated[
        tuple[Habit, ...],
        Field(
            description="Where such things usually are in this home, the likeliest first: `room`, "
            "null for the rest; `piece` of furniture, `share` of those that were moved, number of "
            "`sightings`, time of the `last`, and whether people have `told` it. Empty if the map "
            "has no times and no customs of it."
        ),
    ]


class Found(Record):
    """Where things probably are, and the room to go to first."""

    things: tuple[Thing, ...]
    go_first: Annotated[
        str | None,
        Field(
            description="Room to look into first; `explore`: find new rooms; null: none is left, "
            "or none within the `budget`, or see `robots`."
        ),
    ]
    plan: Annotated[
        tuple[Step, ...],
        Field(
            description="The search in its order: `probability` that the room has any of the "
            "things, cost of the `way` and of the `look`, probability that all (`found`) or any "
            "(`any_found`) of them are found by then, and `seconds` until then, by the `speed`. A "
            "room may come twice. Empty without `here`."
        ),
    ]
    robots: Annotated[
        dict[str, str | None] | None,
        Field(description="For each of several robots the room to look into first."),
    ]
    found_within: Annotated[
        float | None,
        Field(
            description="Probability that the plan finds all within the `budget`; 0 if no room can "
            "be looked into within it; null without a budget, or of several robots."
        ),
    ]
    here: str | None
    cost_unit: Annotated[
        str | None,
        Field(description="Unit of `cost`: m, rooms, or given: that of `costs`."),
    ]
    notes: Annotated[tuple[str, ...], Field(description="How the map was read.")]


class Destination(Record):
    """The piece of furniture to look at next."""

    thing: str
    room: Annotated[
        str | None,
        Field(description="Its room; `explore`: find new rooms; null: nothing is left to search."),
    ]
    piece: Annotated[
        str | None,
        Field(description="Its id; null: enter the room, or look about in it for more furniture."),
    ]
    notes: Annotated[tuple[str, ...], Field(description="How the map was read.")]


class Content(Record):
    """What a room probably holds that was not seen."""

    room: Annotated[str, Field(description="Its id; or the name that was asked for.")]
    label: str | None
    kinds: Annotated[
        tuple[RoomKind, ...],
        Field(description="Kinds that the room may be of, the likeliest first."),
    ]
    expected: Annotated[
        tuple[ExpectedClass, ...],
        Field(
            description="`probability` of at least one that was not seen, `expected` number of "
            "these, number `seen`."
        ),
    ]


class Contents(Record):
    """What rooms probably hold that was not seen."""

    rooms: tuple[Content, ...]
    model: str
    notes: Annotated[tuple[str, ...], Field(description="How the map was read.")]


class Question(NamedTuple):
    """What can be asked: over HTTP at the path of its name in `QUESTIONS`, over MCP by a tool."""

    tool: str
    asks: type[SaidRecord]
    answers: type[Record]
    what: str


QUESTIONS = {
    "find": Question(
        "find_things",
        Find,
        Found,
        "Say in which rooms things probably are, and which room to search first.",
    ),
    "next_place": Question(
        "next_place",
        NextPlace,
        Destination,
        "Say which piece of furniture to look at next, to find one thing.",
    ),
    "expect": Question(
        "expect_things",
        Expect,
        Contents,
        "Say what rooms probably hold that was not seen yet, of one room or of all.",
    ),
}


class Service:
    """Answers each of `QUESTIONS` by one model."""

    def __init__(self, model: AnyPath = DEFAULT_MODEL) -> None:
        """Load the model.

        Raises:
            CheckpointError: if there is no such model.
        """
        self._predictor = Predictor(model)

    def find(self, asked: Find) -> Found:
        """Return where things probably are.

        Raises:
            BSGError: if the map is malformed, or a name means nothing.
        """
        seen = self._open(asked)
        facts = describe_things(
            seen,
            asked.things,
            here=asked.here,
            robots=asked.robots,
            costs=asked.costs,
            look=asked.look,
            chance=LOOK_CHANCE if asked.chance is None else asked.chance,
            task=asked.task or "single",
            budget=asked.budget,
            speed=asked.speed,
        )
        return Found.model_validate({**facts, "notes": seen.notes})

    def next_place(self, asked: NextPlace) -> Destination:
        """Return the piece of furniture to look at next.

        Raises:
            BSGError: if the map is malformed, or a name means nothing.
        """
        seen = self._open(asked)
        facts = describe_place(
            seen,
            asked.thing,
            here=asked.here,
            at=asked.at,
            costs=asked.costs,
            look=asked.look,
            chance=LOOK_CHANCE if asked.chance is None else asked.chance,
        )
        return Destination.model_validate({**facts, "notes": seen.notes})

    def expect(self, asked: Expect) -> Contents:
        """Return what rooms probably hold.

        Raises:
            BSGError: if the map is malformed, or there is no such room.
        """
        seen = self._open(asked)
        known = {room.name: room.label for room in seen.graph.rooms}
        rooms = known if asked.room is None else (asked.room,)
        contents = [
            Content(
                room=room,
                label=known.get(room),
                kinds=seen.kinds(room),
                expected=seen.expected(room)[: asked.most or MOST_CLASSES],
            )
            for room in rooms
        ]
        return Contents(rooms=tuple(contents), model=seen.model, notes=seen.notes)

    def _open(self, asked: Find | NextPlace | Expect) -> SeenBuilding:
        file = parse_graph(asked.map, path=Path("map"), labels=asked.labels)
        if (found := len(file.graph.rooms)) > MOST_ROOMS:
            raise RecipeError(
                f"map: expected at most {MOST_ROOMS} rooms, found {found:,}; ask about "
                "a part of the building",
                code="rooms-too-many",
                where="map",
            )
        graph = reclassify(file.graph, self._predictor.class_map)
        seen = SeenBuilding(graph, self._predictor, notes=file.notes)
        if asked.now is not None:
            seen.passes(until=asked.now)
        return seen
