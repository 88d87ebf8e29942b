"""Say what a look into each room of a robot's graph costs, in the unit of its ways."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import Field, PlainValidator, WithJsonSchema

from bsg_data.arrays import Floats
from bsg_data.observation.partial_graph import Number, PartialGraph
from bsg_data.recipes import read_number
from bsg_data.scene.surroundings import area_of
from bsg_data.spelling import SHOWN
from bsg_models.robot.unfound_rooms import EXPLORE
from bsg_models.robot.ways import Ways
from bsg_models.robot.words import find_room
from bsg_models.search.looks import metres_of_look

AnyLook: TypeAlias = float | Mapping[str, float]  # of every room, or of some
_MOST = 1e9


def check_look(said: Any) -> AnyLook | None:
    """Return what a robot says of the cost of its looks: a number, or room → number.

    Raises:
        RecipeError: for a cost that is no number of 0 or more.
    """
    if said is None:
        return None
    if not isinstance(said, Mapping):
        return read_number("look", said, most=_MOST)
    return {
        str(name): read_number(f"look: {str(name)[:SHOWN]!r}", cost, most=_MOST)
        for name, cost in said.items()
    }


SaidCost = Annotated[float, Number, Field(ge=0, le=_MOST)]  # of a look at a piece of furniture
SaidLook = Annotated[  # as a field of what people and programs ask
    AnyLook | None,
    PlainValidator(check_look),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "minimum": 0},
                {"type": "object", "additionalProperties": {"type": "number", "minimum": 0}},
                {"type": "null"},
            ]
        }
    ),
]


def cost_looks(graph: PartialGraph, ways: Ways, look: AnyLook | None = None) -> Floats:
    """Return the cost of a look in each room, and in one not found yet, `[1 + R + 1]`.

    The usual cost is that of `metres_of_look`, for the share of the room that was not seen. Where
    ways are not in metres, one between rooms that connect counts as long as in HM3D.

    Args:
        graph: what is known of the rooms.
        ways: between them.
        look: of every room; or by room id or label, and `explore` for rooms not found yet, where
            the others keep their usual cost; None for the usual costs.

    Raises:
        RecipeError: if a cost is not a number of 0 or more, or a name means no room.
    """
    look = check_look(look)
    if look is not None and not isinstance(look, Mapping):
        return np.full(2 + len(graph.rooms), look)
    metres = [metres_of_look(area_of(room), share=room.hidden_share) for room in graph.rooms]
    costs = np.array([0.0, *metres, metres_of_look(None)]) * ways.metre
    for name, cost in (look or {}).items():
        costs[-1 if name == EXPLORE else find_room(graph, name)] = cost
    return costs
