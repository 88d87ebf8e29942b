"""Measure what a robot learns of one home, in simulated households whose people move things.

    python scripts/measure/habits.py --homer PATH --out docs/results/figures.json

The folder has one for each household, with `nodes.csv` and `moves.csv` (HOMER, arXiv 2211.15501).
On training days a robot tours twice, and sees each thing with one half. It is asked on test days,
half of the times after a tour of that morning, where a thing is that moves, and whose word is no
word for another thing there. What lies on no furniture is reported on the floor.
"""

from __future__ import annotations

import argparse
import csv
import random
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from results import ResultsTable, write_figures

from bsg_data.arrays import Floats
from bsg_data.tables import format_text
from bsg_models.evaluation.bootstrap import weigh_buildings
from bsg_robot import SeenBuilding, open_graph

MINUTE, DAY = 60.0, 1440
START = 100  # days of the clock before day 0
TOURS = ((480, 840), (900, 1320))  # minutes of a day
SPELT = {"tvstand": "tv stand", "trashcan": "trash can", "coffe": "coffee", "cookingpot": "pot"}
HIDDEN = ("food ", "clothes ")  # what HOMER says before a word
ANYWHERE = 0.003  # of every answer of ours, on all places alike, as rivals have it
Seen = tuple[int, str, str]  # minute, thing, place


def spell(name: str) -> str:
    """Return a class as a person says it."""
    words = " ".join(SPELT.get(word, word) for word in name.split("_"))
    for prefix in HIDDEN:
        words = words.removeprefix(prefix)
    return words


@dataclass(frozen=True, eq=False)
class Household:
    """A household: its rooms and furniture, which are its places, and where things are."""

    rooms: dict[str, str]  # id → word
    room_of: dict[str, str]  # place → room
    words: dict[str, str]  # id → word
    days: dict[tuple[str, int], list[Seen]]

    @property
    def places(self) -> list[str]:
        """Ids of furniture, and of rooms: for the rest of them."""
        return [*self.room_of]

    def at(self, part: str, day: int, minute: int) -> dict[str, str]:
        """Return thing → place."""
        on = {thing: place for time, thing, place in self.days[part, day] if time <= minute}
        found = {}
        for thing in on:
            place = on[thing]
            for _ in range(5):  # a cup on a tray on a table
                place = place if place in self.room_of else on.get(place, place)
            found[thing] = place
        return {thing: place for thing, place in found.items() if place in self.room_of}


def read(folder: Path) -> Household:
    """Return a household."""
    nodes = {row["id"]: row for row in _read(folder / "nodes.csv")}
    rooms = {one: spell(row["class"]) for one, row in nodes.items() if row["category"] == "Rooms"}
    fixed = [one for one, row in nodes.items() if row["category"] != "placable_objects"]
    room_of = {}
    for place in fixed:
        above = place
        while above not in rooms:
            above = nodes[above]["parent"]
        room_of[place] = above
    days = defaultdict(list)
    for row in _read(folder / "moves.csv"):
        seen = int(row["minute"]), row["object"], row["place"]
        days[row["part"], int(row["day"])].append(seen)
    words = {one: spell(row["class"]) for one, row in nodes.items()}
    return Household(rooms, room_of, words, dict(days))


def _read(path: Path) -> Iterator[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        yield from csv.DictReader(file)


def tour(home: Household, part: str, day: int, minute: int, rng: random.Random) -> list[Seen]:
    """Return what a robot sees that notices half of all things."""
    there = home.at(part, day, minute)
    return [(minute, thing, place) for thing, place in there.items() if rng.random() < 0.5]


def train(home: Household, days: int, rng: random.Random) -> list[Seen]:
    """Return what a robot has seen in a number of days, by minutes before day 0."""
    known = sorted(day for part, day in home.days if part == "train")[:days]
    seen = []
    for number, day in enumerate(known):
        for start, end in TOURS:
            some = tour(home, "train", day, rng.randrange(start, end, 10), rng)
            seen += [((number - days) * DAY + time, *rest) for time, *rest in some]
    return seen


@dataclass(frozen=True)
class Question:
    """Where a thing is at a minute of day 0, and what was seen that morning."""

    minute: int
    thing: str
    place: str
    morning: tuple[Seen, ...]


def choose(home: Household) -> set[str]:
    """Return the things that move, and whose word is no word for another thing."""
    ever, seen = defaultdict(set), begin(home, 0)
    for moves in home.days.values():
        for _, thing, place in moves:
            ever[thing].add(place)
    report(seen, home, [(0, thing, min(home.rooms)) for thing in ever])
    known = {one: [*seen.where(home.words[one])] for one in ever if len(ever[one]) > 1}
    return {one for one, rooms in known.items() if sum(len(room.seen) for room in rooms) == 1}


def ask(home: Household, number: int, rng: random.Random) -> list[Question]:
    """Return questions about things that move."""
    asked = choose(home)
    test, questions = sorted(day for part, day in home.days if part == "test"), []
    for _ in range(number):
        day, minute = rng.choice(test), rng.randrange(480, DAY, 10)
        there = home.at("test", day, minute)
        thing = rng.choice(sorted(asked & {*there}))
        time = rng.randrange(400, min(minute, 720), 10)
        morning = tour(home, "test", day, time, rng) if rng.random() < 0.5 else []
        questions.append(Question(minute, thing, there[thing], tuple(morning)))
    return questions


def begin(home: Household, days: int) -> SeenBuilding:
    """Return a robot's graph of the furniture."""
    objects = [
        {"id": place, "category": home.words[place], "room": room}
        for place, room in home.room_of.items()
        if place != room
    ]
    objects += [{"id": f"{room} floor", "category": "floor", "room": room} for room in home.rooms]
    corners = ((0, 0), (5, 0), (0, 5), (5, 5), (10, 0))  # metres
    rooms = [
        {"id": room, "label": word, "position": [*corner, 0], "floor_area": 12}
        for (room, word), corner in zip(home.rooms.items(), corners, strict=False)
    ]
    told = {"scene_id": "home", "building_kind": "home", "more_rooms": 0}
    seen = open_graph({**told, "rooms": rooms, "objects": objects})
    seen.passes(until=_clock(-days * DAY))
    return seen


def report(seen: SeenBuilding, home: Household, sightings: Sequence[Seen]) -> None:
    """Tell a graph what was seen."""
    for minute, thing, place in sightings:
        room = home.room_of[place]
        on = f"{room} floor" if place == room else place
        seen.saw(room, home.words[thing], object_id=thing, on=on, time=_clock(minute))


def _clock(minute: int) -> float:
    return MINUTE * (START * DAY + minute)


def answer(seen: SeenBuilding, home: Household, word: str) -> Floats:
    """Return P(each place has the thing), `[P]`."""
    number = {place: n for n, place in enumerate(home.places)}
    likely = np.zeros(len(number))
    for room in seen.where(word):
        pieces = [(one.piece, one.probability) for one in seen.where(word, within=room.room)]
        for piece, probability in pieces:
            likely[number[piece if piece in number else room.room]] += probability
        if not pieces:  # nothing says on what it is
            inside = [number[place] for place, one in home.room_of.items() if one == room.room]
            likely[inside] += room.probability / len(inside)
    return np.asarray((1 - ANYWHERE) * likely / likely.sum() + ANYWHERE / len(number))


@dataclass(frozen=True, eq=False)
class Asked:
    """A question, with all that a robot knows."""

    home: Household
    question: Question
    seen: SeenBuilding
    sightings: list[tuple[float, int]]  # of the thing: seconds, number of the place

    @property
    def word(self) -> str:
        """The word for the thing."""
        return self.home.words[self.question.thing]


def pose(homes: Sequence[Household], days: int, number: int) -> Iterator[Asked]:
    """Yield questions after a number of days."""
    for seed, home in enumerate(homes):
        before = train(home, days, random.Random(100 * days + seed))
        seen = begin(home, days)
        report(seen, home, before)
        for one in ask(home, number // len(homes), random.Random(seed)):
            now = seen.copy()
            report(now, home, one.morning)
            now.passes(until=_clock(one.minute))
            all_ = [*before, *one.morning]
            own = [(_clock(m), home.places.index(p)) for m, thing, p in all_ if thing == one.thing]
            yield Asked(home, one, now, own)


@cache
def _answer_first(home: Household, word: str) -> Floats:
    return answer(begin(home, 0), home, word)


def _by_rule(rule: Callable[..., Floats]) -> Callable[[Asked], Floats]:
    return lambda one: rule(one.sightings, _clock(one.question.minute), len(one.home.places))


@cache
def list_answers() -> dict[str, Callable[[Asked], Floats]]:
    """Return our answers and those of rivals, by name."""
    from bsg_rivals.habits import RULES  # a package of its own, that a `--help` does not need

    return {
        "ours": lambda one: answer(one.seen, one.home, one.word),
        "ours, the prior alone": lambda one: _answer_first(one.home, one.word),
        **{name: _by_rule(rule) for name, rule in RULES.items()},
    }


def judge(one: Asked, likely: Floats) -> tuple[float, float, bool]:
    """Return the log loss of places, of rooms, and whether the likeliest place is right."""
    home, true = one.home, one.home.places.index(one.question.place)
    same = [home.room_of[place] == home.room_of[one.question.place] for place in home.places]
    return -np.log(likely[true]), -np.log(likely[same].sum()), likely.argmax() == true


def compare(ours: Floats, other: Floats, things: Sequence[object]) -> str:
    """Return by how many per cent a mean is below another, with 95 % over things."""
    number = {thing: n for n, thing in enumerate(dict.fromkeys(things))}
    sums = np.zeros((2, len(number)))
    np.add.at(sums.T, [number[thing] for thing in things], np.stack([ours, other], axis=1))
    ours_, others = sums @ weigh_buildings(len(number), resamples=2000, seed=0)
    saved = 100 * (1 - ours_ / others)
    low, high = np.quantile(saved[1:], (0.025, 0.975))
    return f"{saved[0]:.1f} ({low:.1f} to {high:.1f})"


def measure(homes: Sequence[Household], days: Sequence[int], number: int) -> list[ResultsTable]:
    """Return the tables: right and log loss by days, and ours against the best rival."""
    answers = list_answers()
    places: dict[str, list[str]] = {name: [name] for name in answers}
    rooms: dict[str, list[str]] = {name: [name] for name in answers}
    against = []
    for many in days:
        asked = [*pose(homes, many, number)]
        found = {
            name: np.array([judge(one, rule(one)) for one in asked], dtype=np.float64)
            for name, rule in answers.items()
        }
        for name, judged in found.items():
            loss, loss_room, right = judged.mean(axis=0)
            places[name].append(f"{right:.3f} · {loss:.3f}")
            rooms[name].append(f"{loss_room:.3f}")
        things = [(id(one.home), one.question.thing) for one in asked]
        row = [str(many)]
        for column in (0, 1):
            rival = min([*answers][1:], key=lambda name: found[name][:, column].mean())
            losses = (found[name][:, column] for name in ("ours", rival))
            row += [rival, compare(*losses, things)]
        against.append(row)
    header = ("by", *(f"{many} day{'s' if many > 1 else ''}" for many in days))
    reading = f"{len(homes)} households of HOMER, {len(asked)} questions a cell."
    title = "Against the best rival"
    columns = (
        "days",
        "best rival: places",
        "places: saved, %",
        "best rival: rooms",
        "rooms: saved, %",
    )
    return [
        ResultsTable("Places", header, [*places.values()], reading, tested_on="chosen"),
        ResultsTable("Rooms", header, [*rooms.values()], reading, tested_on="chosen"),
        ResultsTable(
            title, columns, against, "Of the log loss, with 95 % over things.", tested_on="chosen"
        ),
    ]


def parse(argv: list[str] | None, **defaults: object) -> argparse.Namespace:
    """Return what a command says of households, days and questions."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--homer", type=Path, required=True, help="folder of HOMER's households")
    parser.add_argument("--households", nargs="+", default=["0", "1", "2"])
    parser.add_argument("--days", nargs="+", type=int, default=[1, 3, 10, 30, 50])
    parser.add_argument("--questions", type=int, default=500, help="of a number of days")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    parser.set_defaults(**defaults)
    options = parser.parse_args(argv)
    if not options.homer.is_dir():
        parser.exit(0, f"{options.homer}: not there, so nothing is measured\n")
    return options


def main(argv: list[str] | None = None) -> int:
    """Write the tables."""
    options = parse(argv)
    folders = [options.homer / f"household{name}" for name in options.households]
    tables = measure([read(one) for one in folders], options.days, options.questions)
    for table in tables:
        print(format_text(table.rows, header=table.header, numeric=table.header[1:]))
    files = [folder / "moves.csv" for folder in folders]
    write_figures(
        options.out, "habits", tables, argv=[__file__, *(argv or sys.argv[1:])], files=files
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
