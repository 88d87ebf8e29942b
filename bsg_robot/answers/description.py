"""Describe answers as plain values: what the command, ROS, HTTP and MCP say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from bsg_robot.answers.place import Step
from bsg_robot.answers.seen_building import SeenBuilding
from bsg_robot.answers.ways import Costs, check_costs
from bsg_robot.answers.words import Meaning, find_room


def describe_things(
    seen: SeenBuilding,
    things: Sequence[str],
    *,
    here: str | None,
    robots: Mapping[str, str] | None = None,
    costs: Costs | None = None,
    budget: float | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Return where things probably are, and where to go first: what every door answers.

    Args:
        seen: the building.
        things: in any words.
        here: the robot's room.
        robots: name of each of several robots → its room, instead of `here`.
        costs: of ways, as for `next_room`.
        budget: as for `next_room`.
        options: `look`, `chance`, `task` and `speed` of `next_room`.
    """
    if here is not None:
        here = seen.rooms[find_room(seen.graph, here) - 1]  # which may be said by its label
    given = check_costs(seen.graph, costs)
    # By ids, which are found at once; each answer looks them up again.
    costs = {(seen.rooms[a - 1], seen.rooms[b - 1]): cost for (a, b), cost in given.items()} or None
    facts: dict[str, Any] = {"things": [_describe(seen, word, here, costs) for word in things]}
    options |= {"costs": costs, "budget": budget}
    steps: Sequence[Step] = ()
    first = firsts = None
    if robots:
        firsts = seen.next_rooms(robots, things, **options)
    elif here is None:
        first = seen.next_room(things, **options)
    else:
        steps = seen.explain(things, here=here, **options)
        first = steps[0].room if steps else None
    within = None if budget is None or robots else steps[-1].found if steps else 0.0
    facts |= {"go_first": first, "plan": list(map(asdict, steps)), "robots": firsts}
    unit = None if here is None else seen.ways(costs).unit
    return {**facts, "found_within": within, "cost_unit": unit, "here": here}


def describe_place(seen: SeenBuilding, thing: str, *, here: str, **options: Any) -> dict[str, Any]:
    """Return the piece of furniture to look at next: what every door answers.

    Args:
        seen: the building.
        thing: any word.
        here: the robot's room.
        options: `at`, `costs`, `look` and `chance` of `next_place`.
    """
    go = seen.next_place(thing, here=here, **options)
    return {"thing": thing, "room": go and go.room, "piece": go and go.piece}


def _describe(
    seen: SeenBuilding, thing: str, here: str | None, costs: Costs | None
) -> dict[str, Any]:
    meaning = seen.understand(thing)
    return {
        "thing": meaning.word,
        "class": None if meaning.thing else meaning.class_name,
        "how": meaning.how,
        "by": name_answerer(meaning),
        "model": seen.asked(meaning.word),
        "anywhere": seen.anywhere(meaning.word),
        "habits": list(map(asdict, seen.habits(meaning.word))),
        "places": [
            asdict(replace(place, cost=None) if place.cost == math.inf else place)  # no JSON has ∞
            for place in seen.where(meaning.word, here=here, costs=costs)
        ],
    }


def name_answerer(meaning: Meaning) -> str:
    """Return what answers for a word: counts of a class, the table of things, or likeness."""
    if meaning.thing is not None:
        return "table"
    return "likeness" if meaning.class_name is None else "class"
