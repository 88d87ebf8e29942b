"""Measure what a search for a thing costs a robot that has lived in a home, by days.

    python scripts/measure/living.py --homer PATH --out docs/results/figures.json

The households and tours are those of `habits.py`. Rooms are 5 m apart, pieces of furniture of a
room 2 m. A robot in a random room goes where `next_place` says, until it finds the thing: a look at
a piece costs 2.5 m, one into a room 13 m; each finds 8 of 10. A robot that does not learn asks what
is known of all homes; one that goes where it saw the thing last does so, and then asks the same.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from habits import Asked, Household, begin, compare, parse, pose, read
from results import ResultsTable, write_figures

from bsg_data.arrays import Floats
from bsg_data.tables import format_text
from bsg_robot import SeenBuilding
from bsg_robot.answers.place import Destination

CHANCE = 0.8  # of a look
BETWEEN, PIECE, ROOM = 2.0, 2.5, 13.0  # metres: of a way in a room, and of looks
MOST = 60  # looks of a search


@dataclass
class Robot:
    """A robot that searches a home."""

    home: Household
    seen: SeenBuilding
    room: str
    piece: str | None = None
    metres: float = 0.0

    def look(self, word: str, place: str, to: Destination, luck: float) -> bool:
        """Go somewhere, look for a thing that is at a place, and return whether it is found."""
        rooms = self.seen.rooms
        way = self.seen.ways().costs[1 + rooms.index(self.room), 1 + rooms.index(to.room)]
        near = BETWEEN if (self.room, self.piece) != (to.room, to.piece) else 0.0
        self.metres += float(way) if to.room != self.room else near
        self.metres += ROOM if to.piece is None else PIECE
        self.room, self.piece = to.room, to.piece
        there = to.piece in (place, f"{place} floor") if to.piece else self._holds(place)
        if there and luck < CHANCE:
            return True
        self.seen.looked(to.room, word, at=to.piece, chance=CHANCE)
        return False

    def _holds(self, place: str) -> bool:
        return self.home.room_of[place] == self.room


def search(robot: Robot, one: Asked, first: Destination | None, rng: random.Random) -> float:
    """Return the metres of a search, which may begin somewhere."""
    for _ in range(MOST):
        to = first or robot.seen.next_place(one.word, here=robot.room, at=robot.piece, look=PIECE)
        first = None
        if to is None or robot.look(one.word, one.question.place, to, rng.random()):
            break
    return robot.metres


def _last(one: Asked) -> Destination | None:
    """Return where a thing was seen last."""
    if not one.sightings:
        return None
    place = one.home.places[max(one.sightings)[1]]
    room = one.home.room_of[place]
    return Destination(room, None if place == room else place)


def _know_nothing(one: Asked) -> SeenBuilding:
    return begin(one.home, 0)


def _nowhere(one: Asked) -> None:
    return None


SEARCHES: dict[str, tuple[Callable[[Asked], SeenBuilding], Callable[[Asked], Destination | None]]]
SEARCHES = {
    "ours": (lambda one: one.seen.copy(), _nowhere),
    "the prior alone": (_know_nothing, _nowhere),
    "last seen first, then the prior": (_know_nothing, _last),
}


def measure(homes: Sequence[Household], days: Sequence[int], number: int) -> ResultsTable:
    """Return the metres by days, and what ours saves."""
    rows = []
    for many in days:
        asked = [*pose(homes, many, number)]
        things = [(id(one.home), one.question.thing) for one in asked]
        costs: dict[str, Floats] = {}
        for name, (know, first) in SEARCHES.items():
            costs[name] = np.zeros(len(asked))
            for seed, one in enumerate(asked):
                rng = random.Random(seed)
                robot = Robot(one.home, know(one), rng.choice([*one.home.rooms]))
                costs[name][seed] = search(robot, one, first(one), rng)
        ours, *others = costs.values()
        saved = [compare(ours, other, things) for other in others]
        rows.append([str(many), *(f"{each.mean():.1f}" for each in costs.values()), *saved])
    header = ("days", *SEARCHES, "saved of the prior, %", "saved of last seen first, %")
    reading = f"Metres of ways and looks, {len(asked)} searches a row; with 95 % over things."
    return ResultsTable("Searches", header, rows, reading, tested_on="chosen")


def main(argv: list[str] | None = None) -> int:
    """Write the table."""
    options = parse(argv, days=[1, 3, 10, 30], questions=300)
    folders = [options.homer / f"household{name}" for name in options.households]
    table = measure([read(one) for one in folders], options.days, options.questions)
    print(format_text(table.rows, header=table.header, numeric=table.header[1:]))
    files = [folder / "moves.csv" for folder in folders]
    words = [__file__, *(argv or sys.argv[1:])]
    write_figures(options.out, "living", [table], argv=words, files=files)
    return 0


if __name__ == "__main__":
    sys.exit(main())
