"""Answer `bsg-belief --find`: which rooms hold things, and where to go first."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, TypeVar

import click

import bsg_robot
from bsg_cli.options import Function, choice_option
from bsg_cli.terminal import print_json, print_note, print_text
from bsg_data.tables import format_text, make_line
from bsg_models.belief.partial_graph import LOOK_CHANCE

OF_SEARCH = ("here", "robots", "costs", "looks", "chance", "task", "budget", "speed")
_Word = TypeVar("_Word", str, float)
_MOST_ROWS, _MOST_STEPS, _MOST_HABITS = 20, 5, 3
_SURE = 0.95  # a building that has one so surely: what the rooms have if there is one is no news


def search_options(function: Function) -> Function:
    """Add the options of a search: its things, its robots, its costs, and when it ends."""
    for option in (
        click.option(
            "--speed",
            type=float,
            metavar="NUMBER",
            help="With --find: speed of the robot in metres a second; a plan then has seconds.",
        ),
        click.option(
            "--budget",
            type=float,
            metavar="NUMBER",
            help="With --find: what the search may cost, in the unit of the ways, or in seconds "
            "with --speed. The plan is the one that most likely ends within it.",
        ),
        choice_option(
            "--task",
            ["single", "all"],
            "With --find: until one of each thing is found, or all that are there.",
            default="single",
        ),
        click.option(
            "--chance",
            type=click.FloatRange(0, 1, min_open=True),
            default=LOOK_CHANCE,
            show_default=True,
            help="With --find: chance that a look finds a thing that is there.",
        ),
        click.option(
            "--look",
            "looks",
            multiple=True,
            metavar="[ROOM=]COST",
            help="With --find: cost of a look, in the unit of the ways; without ROOM in any room.  "
            "[default: by the room's size]",
        ),
        click.option(
            "--cost",
            "costs",
            multiple=True,
            nargs=3,
            metavar="ROOM ROOM COST",
            help="With --find: cost of the way between two rooms, instead of the measured one; "
            "`closed` for a closed door.",
        ),
        click.option(
            "--robot",
            "robots",
            multiple=True,
            metavar="NAME=ROOM",
            help="With --find: one of several robots that search together, instead of --from.",
        ),
        click.option("--from", "here", metavar="ROOM", help="With --find: the room of the robot."),
        click.option(
            "--find",
            metavar="THING",
            multiple=True,
            help="Say where a thing is, and where to go first. THING is any word. Repeat it for "
            "several.",
        ),
    ):
        function = option(function)
    return function


def read_search(options: dict[str, Any]) -> dict[str, Any]:
    """Take the options of a search, and return them as `find_things` does."""
    search = {name: options.pop(name) for name in OF_SEARCH}
    return search | {
        "robots": _read_robots(search["robots"]),
        "look": _read_looks(search.pop("looks")),
        "costs": _read_costs(search["costs"]),
    }


def _read_looks(words: Sequence[str]) -> float | dict[str, float] | None:
    """Return the costs of `--look`: `5` for all rooms, `kitchen=5` for one."""
    costs = read_by_room("--look", words, "COST with a cost of 0 or more", most=math.inf)
    every = costs.pop("", None)
    if every is not None and costs:
        raise click.UsageError(
            f"--look says {every:g} of all rooms and {', '.join(costs)} apart; leave one out"
        )
    return costs or None if every is None else every


def _read_costs(rows: Sequence[tuple[str, str, str]]) -> Mapping[tuple[str, str], float] | None:
    """Return the costs of `--cost`: `hall kitchen 3.5`, `hall bath closed`."""
    if not rows:
        return None
    from bsg_robot.answers.ways import read_costs  # a help must not wait for NumPy

    return read_costs([(start, end, _read_number(cost, cost)) for start, end, cost in rows])


def read_by_room(
    option: str, words: Sequence[str], expected: str, *, most: float
) -> dict[str, float]:
    """Return the numbers of `[ROOM=]NUMBER`; the empty name stands for all other rooms."""
    numbers: dict[str, float] = {}
    for word in words:
        room, _, text = word.rpartition("=")
        number = _read_number(text, math.nan)
        if not 0 <= number <= most:
            raise click.UsageError(
                f"{option} {word}: expected [ROOM=]{expected}, such as 0.4 or kitchen=0.2"
            )
        _add(numbers, room, number, option=option)
    return numbers


def _add(table: dict[str, _Word], name: str, value: _Word, *, option: str) -> None:
    """Add what an option says of a room or a robot; it may say it twice."""
    if table.setdefault(name, value) != value:
        raise click.UsageError(
            f"{option} says {table[name]} and {value} of {name or 'all rooms'}; give one of them"
        )


def _read_number(text: str, otherwise: _Word) -> float | _Word:
    try:
        return float(text)
    except ValueError:
        return otherwise


def _read_robots(words: Sequence[str]) -> dict[str, str]:
    """Return the rooms of `--robot`, by the names of the robots."""
    robots: dict[str, str] = {}
    for word in words:
        name, _, room = word.partition("=")
        if not name or not room:
            raise click.UsageError(f"--robot {word}: expected NAME=ROOM, such as spot=hall")
        _add(robots, name, room, option="--robot")
    return robots


def find_things(
    seen: bsg_robot.SeenBuilding,
    things: Sequence[str],
    *,
    as_json: bool,
    here: str | None,
    note: Callable[[str], None],
    **search: Any,
) -> dict[str, Any]:
    """Print where things probably are in a partly seen building, and where to go first.

    JSON has room ids, and is returned; text has labels as well. See `describe_things`.
    """
    from bsg_robot.answers.description import describe_things  # as below

    things = tuple(dict.fromkeys(things))
    facts = describe_things(seen, things, here=here, **search)
    if as_json:
        print_json(facts)
        return facts
    unit = facts["cost_unit"]
    costs, budget, speed = (search.get(name) for name in ("costs", "budget", "speed"))
    for thing in things:
        meaning = seen.understand(thing)
        if meaning.how:
            note(meaning.how)
        places = seen.where(thing, here=here, costs=costs)
        _print_places(seen, meaning, places, unit, first=facts["go_first"])
        if habits := seen.habits(thing):
            print_text(_describe_habits(seen, habits))
        if len(things) > 1:
            print_text("")
    within = "" if budget is None else f"{budget:g} s" if speed else _cost(budget, unit, here="0")
    _print_plan(seen, facts, unit, within and f" within {within}")
    return facts


def _print_places(
    seen: bsg_robot.SeenBuilding,
    meaning: bsg_robot.Meaning,
    places: Sequence[bsg_robot.Place],
    unit: str | None,
    *,
    first: str | None,
) -> None:
    """Print the rooms of one thing as a table, then its furniture, and if the building has one."""
    from bsg_robot.answers.description import name_answerer  # a help must not wait for NumPy

    anywhere, is_counted = seen.anywhere(meaning.word), name_answerer(meaning) != "likeness"
    words = {obj.name: f"{obj.name} ({obj.raw_category})" for obj in seen.graph.objects}
    shown = places[:_MOST_ROWS]
    columns = {
        "room": [_name(place) for place in shown],
        f"P({meaning.name})": [_percent(place.probability) for place in shown],
        "if there is one": [_percent(place.if_there) for place in shown],
        "expected more": [f"{place.expected:.2f}" for place in shown],
        "seen": [", ".join(words[name] for name in place.seen) or "–" for place in shown],
        "cost": [_cost(place.cost, unit) for place in shown],
    }
    order = [*columns]
    if not is_counted:  # what annotators write down says little of how many homes have one
        order[1:3] = ["if there is one", "noted"]
        columns["noted"] = columns[f"P({meaning.name})"]
    elif anywhere >= _SURE:
        order.remove("if there is one")
    if unit is None:
        order.remove("cost")
    rows = [*zip(*(columns[name] for name in order), strict=True)]
    numbers = [name for name in order if name not in ("room", "seen")]
    print_text(format_text(rows, header=order, numeric=numbers))
    if len(places) > _MOST_ROWS:
        print_note(f"… and {len(places) - _MOST_ROWS:,} less likely rooms; --json prints all")
    named = [place for place in places if place.pieces and place.room in (first, places[0].room)]
    for place in named:
        print_text(_describe_pieces(place))
    model = seen.asked(meaning.word)
    if meaning.thing is not None:
        print_text(f"somewhere in the building: {_percent(anywhere)}, by the table {model}")
    elif is_counted:
        source = "" if meaning.noun is None else "the table of nouns and "
        print_text(f"somewhere in the building: {_percent(anywhere)}, by {source}the model {model}")
    else:
        print_text(
            f"noted: annotators write one down in {_percent(anywhere)} of such buildings, by the "
            f"table of nouns and the model {model}"
        )


def _describe_pieces(place: bsg_robot.Place) -> str:
    """Return the likeliest pieces of furniture of a room, if an unseen thing is there."""
    pieces = (
        f"{make_line(piece.name)} {'(seen there)' if piece.seen else _percent(piece.if_there)}"
        for piece in place.pieces
    )
    return f"{_name(place)}, if it is there: {', '.join(pieces)}"


def _describe_habits(seen: bsg_robot.SeenBuilding, habits: Sequence[bsg_robot.Habit]) -> str:
    """Return what this home has taught of a thing: from what, and the likeliest places."""
    from bsg_models.rendering.habits import Taught  # as above

    taught, places = Taught(seen.graph), []
    for habit in habits[:_MOST_HABITS]:
        place, share, times, ago, is_told = taught.row(asdict(habit))
        sightings = f"{times} seen{ago and f', the last {ago}'}" if times else ""
        why = ", ".join(filter(None, (is_told and "told", sightings)))
        places.append(f"{make_line(place)} {share}{why and f' ({why})'}")
    times_in_all = sum(habit.sightings for habit in habits)
    by = f", by {times_in_all} sighting{'s' * (times_in_all > 1)}" if times_in_all else ""
    return f"this home has taught{by}: {'; '.join(places)}"


def _print_plan(
    seen: bsg_robot.SeenBuilding, facts: Mapping[str, Any], unit: str | None, within: str
) -> None:
    """Print the room to go to first, and the order of the search if it has several steps."""
    labels = {room.name: room.label for room in seen.graph.rooms}
    for robot, first in (facts["robots"] or {"": facts["go_first"]}).items():
        sentence = f"no room is left to search{within}"
        if first == bsg_robot.EXPLORE:
            sentence = "explore first: find the rooms that are not found yet"
        elif first is not None:
            sentence = f"go first to {_call(first, labels.get(first))}"
        print_text(f"{robot}: {sentence}" if robot else sentence)
    steps, several = facts["plan"], len(facts["things"]) > 1
    if facts["found_within"]:
        print_text(f"{'all ' if several else ''}found{within}: {_percent(facts['found_within'])}")
    timed = bool(steps) and steps[0]["seconds"] is not None
    if len(steps) < (1 if timed else 2):
        return
    shown = steps[:_MOST_STEPS]
    columns = {
        "look into": [_call(step["room"], step["label"]) for step in shown],
        "P(any)" if several else "P": [_percent(step["probability"]) for step in shown],
        "way": [_cost(step["way"], unit) for step in shown],
        "look": [_cost(step["look"], unit, here="nothing") for step in shown],
    }
    if timed:
        columns["time"] = [f"{step['seconds']:.0f} s" for step in shown]
    ended = "all found by then" if several else "ended by then"
    columns[ended] = [_percent(step["found"]) for step in shown]
    if several:
        columns["any found by then"] = [_percent(step["any_found"]) for step in shown]
    rows, header = [*zip(*columns.values(), strict=True)], [*columns]
    print_text("\n" + format_text(rows, header=header, numeric=header[1:]))
    if len(steps) > _MOST_STEPS:
        print_note(f"… and {len(steps) - _MOST_STEPS:,} more; --json prints all")


def _name(place: bsg_robot.Place) -> str:
    if place.room is None:
        return "in no room"
    from bsg_data.scene.room_label import is_name  # as above: a help must not wait for NumPy

    kind = None if is_name(place.room) else place.kind
    return _call(place.room, place.label or kind)


def _call(room: str, label: str | None) -> str:
    """Return the id of a room, with its label if it has another one."""
    if room == bsg_robot.EXPLORE:
        return str(label)
    return make_line(room if label in (None, room) else f"{room} ({label})")


def _cost(cost: float | None, unit: str | None, *, here: str = "here") -> str:
    if cost is None:
        return "unknown"
    if cost == math.inf:
        return "closed"
    if cost == 0:
        return here
    if unit == "rooms":
        shown = f"{cost:.1f}".removesuffix(".0")
        return f"{shown} {'room' if shown == '1' else 'rooms'}"
    return f"{cost:.1f} m" if unit == "m" else f"{cost:.1f}"


def _percent(probability: float) -> str:
    return "<1 %" if 0 < probability < 0.005 else f"{probability:.0%}".replace("%", " %")
