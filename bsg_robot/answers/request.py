"""What every program may ask of a search: over HTTP, by MCP and on topics of ROS 2."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, field_validator, model_validator

from bsg_data.inputs.documents import parse_json
from bsg_data.records import Keyed, SaidRecord
from bsg_data.words.shown import SHOWN
from bsg_models.belief.partial_graph import LOOK_CHANCE, Id, Score, Text
from bsg_models.search.knowledge import Task
from bsg_robot.answers.ways import SaidCost, SaidCosts, SaidLook, SaidSpeed
from bsg_robot.graph.map_forms import drop_empty

MOST_ROBOTS = 10

WayCosts = Annotated[
    SaidCosts,
    Field(
        description="Costs of ways that the map does not say, as a list of [room, room, cost], in "
        'the unit of the ways; "closed" for a closed door, which no way leads through.',
        examples=[[["hall", "kitchen", 3.5], ["hall", "bath", "closed"]]],
    ),
]
Chance = Annotated[
    Score | None,
    Field(
        description="P(a look finds a thing that is there), of the robot's detector; null: "
        f"{LOOK_CHANCE}."
    ),
]


def read_text(value: Any) -> Any:
    """Return what a text says: models of agents write JSON as text."""
    if not isinstance(value, str):
        return value
    try:
        return parse_json(value)
    except ValueError as fault:
        raise ValueError(
            f"expected a value, or the text of its JSON, found {value[:SHOWN]!r} ({fault})"
        ) from None


class Request(SaidRecord):
    """Keys and values of a request; null and "" mean that a key is left out."""

    @model_validator(mode="before")
    @classmethod
    def _leave_out(cls, keys: Any) -> Any:
        return drop_empty(keys) if isinstance(keys, dict) else keys


class FindRequest(Request):
    """Where things are, and which room to go to first; the things are the door's own key."""

    here: Id | None = Field(
        None,
        description="The room where the robot is, by id or label; ways are measured from it.",
    )
    robots: Keyed[Id, Id] | None = Field(
        None,
        max_length=MOST_ROBOTS,
        description="Several robots that search together: name of each -> its room.",
    )
    costs: WayCosts = None
    look: SaidLook = Field(
        None,
        description="Cost of looking into a room, in the unit of the ways: of every room, or room "
        "-> cost; null: estimated from its size and what is left of it.",
    )
    chance: Chance = LOOK_CHANCE
    task: Task | None = Field(
        "single",
        description="`single`: one of each thing is enough (null); `all`: find all of them.",
    )
    budget: SaidCost | None = Field(
        None,
        description="What the search may cost, in the unit of the ways, or in seconds with a "
        "`speed`: the plan is the one that most likely ends within it. Needs `here` or `robots`.",
    )
    speed: SaidSpeed | None = Field(
        None, description="Of the robot, in metres a second; it makes a plan say `seconds`."
    )

    _read = field_validator("robots", "costs", "look", "chance", "budget", "speed", mode="before")(
        read_text
    )

    @property
    def options(self) -> dict[str, Any]:
        """The arguments of `describe_things`, without the robot's room."""
        return self.model_dump(include={*FindRequest.model_fields} - {"here"})


class NextPlaceRequest(Request):
    """Which piece of furniture to look at next, to find a thing."""

    thing: Text = Field(description="What to look for, in any words.")
    at: Id | None = Field(
        None,
        description="The piece of furniture where the robot is, by id; null: it is in the middle "
        "of the room.",
    )
    costs: WayCosts = None
    look: SaidCost | None = Field(
        None,
        description="Cost of a look at a piece of furniture, in the unit of the ways; null: 2.5 m.",
    )
    chance: Chance = LOOK_CHANCE

    _read = field_validator("costs", "look", "chance", mode="before")(read_text)

    @property
    def options(self) -> dict[str, Any]:
        """The arguments of `describe_place`, without the thing and the robot's room."""
        return self.model_dump(include={*NextPlaceRequest.model_fields} - {"thing"})
