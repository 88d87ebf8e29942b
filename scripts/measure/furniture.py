"""Measure on which furniture things are said to be, and what it saves a robot.

    python scripts/measure/furniture.py --housekeep PLACEMENTS --houses HOUSES --out FIGURES

Housekeep: pieces of a room ranked by what ten people each said (its own measure, val). ProcTHOR: in
150 synthetic houses, the piece on which a small thing lies, and searches for such things by a robot
that knows the rooms, and sees furniture when it enters one.
"""

from __future__ import annotations

import argparse
import csv
import gzip
import json
import math
import re
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from results import ResultsTable, format_estimate, write_figures

from bsg_data.arrays import Bools, Floats
from bsg_data.errors import RecipeError
from bsg_data.observation.partial_graph import KnownRoom, SeenObject
from bsg_data.scene.things import find_receptacle, read_shares
from bsg_models.belief.pieces import TIDY, find_pieces, furnish
from bsg_models.evaluation.bootstrap import Estimate, estimate_value, weigh_buildings
from bsg_models.robot.seen_building import SeenBuilding, open_graph

VOTES = 6  # of ten people make a piece right
LOOK = 5.0  # seconds of a look at a piece; the robot drives 1 m/s
HIDDEN = 0.9  # share of a room's things that the robot does not see as it comes in
CHANCE = 0.95  # that the robot gives a look
SEARCHES = 3  # in each house
MOST_STOPS = 80
_ROOMS = {  # Housekeep's and ProcTHOR's rooms, as robots call them
    "childs_room": "bedroom",
    "exercise_room": "gym",
    "home_office": "office",
    "lobby": "entrance",
    "pantry_room": "pantry",
    "television_room": "tv room",
    "LivingRoom": "living room",
}
_ASSET = re.compile(r"(?:_\d+)+\w*$")
_MADE = re.compile(r"^robothor_|_(?:ai2|v)(?=_|$)")
_SAID = {"cellphone": "phone", "keychain": "key", "creditcard": "credit card", "cd": "dvd"}
Rank = Callable[..., Floats]  # thing, room, pieces → a number for each
Rooms = Mapping[str, float]  # a number for each room


def say(room: str) -> str:
    """Return a kind of room as a robot says it."""
    return _ROOMS.get(room, room.replace("_", " ").casefold())


def rate(thing: str, room: str, pieces: Sequence[str], *, tidy: float = TIDY) -> Floats:
    """Return the shares that the library gives the pieces of a room, unseen ones apart."""
    known = KnownRoom("room", hidden_share=1.0, room_type=room)
    objects = [SeenObject(str(n), 1, one, None, None) for n, one in enumerate(pieces)]
    found = furnish(thing, known, find_pieces(objects), classes=(), unseen=np.zeros(0), tidy=tidy)
    return np.ones(len(pieces)) if found is None else found.shares({})[:-1]


def people(_: str, room: str, pieces: Sequence[str], *, tidy: float = TIDY) -> Floats:
    """Return how often people chose each piece, for all things alike."""
    said = read_shares()
    row = said.rooms.index(room) if room in said.rooms else slice(None)
    shares = tidy * said.belongs[row] + (1 - tidy) * said.untidy[row]
    shares = shares if shares.ndim == 1 else shares.mean(axis=0)
    kinds = [find_receptacle(piece) for piece in pieces]
    return np.array([shares[[*kind.like]].mean() if kind else 0.0 for kind in kinds])


def uniform(_: str, __: str, pieces: Sequence[str], *, tidy: float = TIDY) -> Floats:
    """Return the same for each piece."""
    return np.ones(len(pieces))


# Housekeep


Votes = dict[str, dict[str, dict[str, int]]]  # thing → room → piece → people, of ten


def read_votes(path: Path, *, split: str) -> Votes:
    """Return how many people said that a thing belongs on a piece, for the things of a split."""
    votes: Votes = defaultdict(lambda: defaultdict(dict))
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["split"] == split:
                own = votes[row["object"].replace("_", " ")][say(row["room"])]
                own[row["receptacle"].replace("_", " ")] = int(float(row["people_right"]))
    return votes


def judge_people(votes: Votes, rank: Rank, weigh_rooms: Callable[[str], Rooms]) -> Floats:
    """Return what each thing adds to each measure, `[things, 6]`: three sums and their numbers.

    The average precision of the pieces of a room, as Housekeep's own evaluator has it; that of all
    pieces of a home; and the log loss of what is said of a room's pieces against people's shares.
    """
    sums = np.zeros((len(votes), 6))
    for own, (thing, rooms) in zip(sums, votes.items(), strict=True):
        weights, scores, chosen = weigh_rooms(thing), [], []
        for room, pieces in rooms.items():
            said = np.array([*pieces.values()], float)
            shares = rank(thing, room, [*pieces], tidy=1.0)
            scores.append(shares * weights.get(room, 0.0))
            chosen.append(said >= VOTES)
            if chosen[-1].any():
                own += (average_precision(shares, chosen[-1]), 1, 0, 0, 0, 0)
            if said.any():
                likely = np.maximum(shares / shares.sum(), 1e-9)
                own += (0, 0, 0, 0, -(said / said.sum()) @ np.log(likely), 1)
        right = np.concatenate(chosen)
        if right.any():
            own += (0, 0, average_precision(np.concatenate(scores), right), 1, 0, 0)
    return sums


def judge_calibration(votes: Votes, rank: Rank) -> Floats:
    """Return what is said of pieces and the share of people, and their number, by tenths."""
    sums = np.zeros((10, 3))
    for thing, rooms in votes.items():
        for room, pieces in rooms.items():
            people_said = np.array([*pieces.values()], float)
            if people_said.any():
                shares = rank(thing, room, [*pieces], tidy=1.0)
                said = shares / shares.sum()
                row = np.column_stack([said, people_said / people_said.sum(), np.ones(len(said))])
                np.add.at(sums, np.minimum((10 * said).astype(int), 9), row)
    return sums


def weigh_by_belief(thing: str) -> Rooms:
    """Return P(a room has the thing) in a home with Housekeep's rooms that nobody has entered."""
    try:
        return {place.room: place.probability for place in _open_rooms().where(thing)}
    except RecipeError:  # a word that nobody knows
        return dict.fromkeys(read_shares().rooms, 1.0)


@cache
def _open_rooms() -> SeenBuilding:
    rooms = [{"id": one, "room_type": one, "visited": False} for one in read_shares().rooms]
    return open_graph({"scene_id": "home", "building_kind": "home", "rooms": rooms})


def weigh_alike(_: str) -> Rooms:
    """Return the same for each room."""
    return dict.fromkeys(read_shares().rooms, 1.0)


def average_precision(scores: Floats, right: Bools) -> float:
    """Return the mean precision at the ranks of those that are right.

    >>> float(average_precision(np.array([3.0, 2.0, 1.0]), np.array([True, False, True])).round(3))
    0.833
    """
    hits = right[np.argsort(-scores, kind="stable")]
    return np.float64((hits.cumsum() / np.arange(1, len(hits) + 1))[hits].mean())


# ProcTHOR


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of furniture of a house, and the small things on it."""

    name: str
    word: str
    room: str
    position: tuple[float, float, float]
    things: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class House:
    """A house: its rooms, and its furniture."""

    rooms: Mapping[str, tuple[str, tuple[float, float, float]]]  # id → kind, middle
    doors: tuple[tuple[str, str], ...]
    pieces: tuple[Piece, ...]


def read_houses(path: Path) -> Iterator[House]:
    """Yield the houses of a file."""
    with gzip.open(path, "rt", encoding="utf-8") as file:
        for line in file:
            yield read_house(json.loads(line))


def read_house(said: dict[str, Any]) -> House:
    """Return a house from its JSON."""
    rooms = {}
    for room in said["rooms"]:
        corners = np.array([(one["x"], one["z"]) for one in room["floorPolygon"]])
        x, y = corners.mean(axis=0).tolist()
        rooms[room["id"].split("|")[1]] = (say(room["roomType"]), (x, y, 0.0))
    doors = {
        tuple(sorted(one[end].split("|")[1] for end in ("room0", "room1"))) for one in said["doors"]
    }
    pieces = []
    for one in said["objects"]:
        word, room = name_asset(one["assetId"]), one["id"].split("|")[0]
        if room in rooms and find_receptacle(word):
            at = one["position"]
            small = [o for o in one.get("children", ()) if o["id"].startswith("small|")]
            things = tuple(name_asset(o["assetId"]) for o in small)
            pieces.append(Piece(one["id"], word, room, (at["x"], at["z"], 0.0), things))
    kept = {(a, b) for a, b in doors if a != b and {a, b} <= rooms.keys()}
    return House(rooms, tuple(sorted(kept)), tuple(pieces))


def name_asset(asset: str) -> str:
    """Return what an asset is.

    >>> name_asset("RoboTHOR_side_table_v"), name_asset("Side_Table_228_2_1")
    ('side table', 'side table')
    """
    name = _MADE.sub("", _ASSET.sub("", asset.casefold()))
    return _SAID.get(name, name.replace("_", " "))


def judge_houses(houses: Sequence[House], rank: Rank) -> Floats:
    """Return the sums of right first pieces and of log losses, and the number, `[houses, 3]`."""
    sums = np.zeros((len(houses), 3))
    for number, house in enumerate(houses):
        for room, (kind, _) in house.rooms.items():
            pieces = [one for one in house.pieces if one.room == room]
            words = [one.word for one in pieces]
            for piece in pieces:
                for thing in piece.things:
                    rates = rank(thing, kind, words)
                    chances = rates / rates.sum()
                    right = np.array([word == piece.word for word in words])  # alike pieces are one
                    best = np.isclose(chances, chances.max())
                    loss = -math.log(max(float(chances[right].sum()), 1e-9))
                    sums[number] += ((best & right).sum() / best.sum(), loss, 1)
    return sums


# Searches


class Robot:
    """A robot that looks for one thing in a house, and what it has seen."""

    def __init__(self, house: House, thing: str, start: str) -> None:
        self.house, self.thing, self.here = house, thing, start
        self.at: str | None = None
        self.place = house.rooms[start][1]
        self.seconds, self.entered, self.looked = 0.0, set[str](), set[str | None]()
        rooms = [
            {"id": name, "room_type": kind, "position": middle, "visited": False}
            for name, (kind, middle) in house.rooms.items()
        ]
        self.seen = open_graph(
            {"scene_id": "house", "building_kind": "home", "rooms": rooms, "objects": []}
            | {"adjacency": house.doors}
        )
        self.enter(start)

    def enter(self, room: str) -> None:
        """Go into a room, to its middle, and see its furniture."""
        self.drive(room, self.house.rooms[room][1])
        self.at = None
        self.entered.add(room)
        self.seen.entered(room, hidden_share=HIDDEN)
        for one in self.house.pieces:
            if one.room == room:
                self.seen.saw(room, one.word, object_id=one.name, position=one.position, within=0)

    def drive(self, room: str, place: tuple[float, float, float]) -> None:
        """Go to a place; through other rooms, by their middles."""
        if room != self.here:
            ways = self.seen.ways()
            names = [*self.house.rooms]
            a, b = names.index(self.here) + 1, names.index(room) + 1
            straight = math.dist(self.house.rooms[self.here][1], self.house.rooms[room][1])
            detour = max(1.0, float(ways.costs[a, b]) / max(straight, 0.1))
            self.seconds += detour * math.dist(self.place, place)
        else:
            self.seconds += math.dist(self.place, place)
        self.here, self.place = room, place

    def look(self, piece: Piece) -> bool:
        """Go to a piece and look; return whether the thing is there."""
        self.drive(piece.room, piece.position)
        self.at = piece.name
        self.seconds += LOOK
        self.looked.add(piece.name)
        if self.thing in piece.things:
            return True
        self.seen.looked(piece.room, self.thing, at=piece.name, chance=CHANCE)
        return False

    def pieces(self, room: str | None = None) -> list[Piece]:
        """Return the pieces that it saw and has not looked at, the nearest first."""
        left = [
            one
            for one in self.house.pieces
            if one.room in self.entered and one.name not in self.looked and room in (None, one.room)
        ]
        return sorted(left, key=lambda one: math.dist(self.place, one.position))


def by_place(robot: Robot) -> bool | None:
    """Take one step by `next_place`."""
    go = robot.seen.next_place(robot.thing, here=robot.here, at=robot.at, look=LOOK, chance=CHANCE)
    if go is None:
        return None
    if go.piece is not None:
        return robot.look(next(one for one in robot.house.pieces if one.name == go.piece))
    if go.room in robot.entered:  # it looks about, and finds nothing more
        robot.drive(go.room, robot.house.rooms[go.room][1])
        robot.at, robot.seconds = None, robot.seconds + LOOK
        if robot.pieces(go.room):
            robot.seen.entered(go.room, floor_in_view=1.0)
        else:
            robot.seen.looked(go.room, robot.thing, chance=CHANCE)
    else:
        robot.enter(go.room)
    return False


def by_room(robot: Robot) -> bool | None:
    """Take one step: the nearest piece of the room that `next_room` names."""
    left = robot.pieces(robot.here)
    begun = any(one.name in robot.looked for one in robot.house.pieces if one.room == robot.here)
    if left and begun:  # it goes on until the room is done
        return robot.look(left[0])
    room = robot.seen.next_room(robot.thing, here=robot.here, chance=CHANCE)
    if room is None:
        return None
    if room not in robot.entered:
        robot.enter(room)
        return False
    left = robot.pieces(room)
    if left:
        return robot.look(left[0])
    robot.seen.searched(room)
    return False


def by_distance(robot: Robot) -> bool | None:
    """Take one step to what is nearest: a piece, or a room that was not entered."""
    left = robot.pieces()
    rooms = [
        (math.dist(robot.place, middle), name)
        for name, (_, middle) in robot.house.rooms.items()
        if name not in robot.entered
    ]
    if left and (not rooms or math.dist(robot.place, left[0].position) <= min(rooms)[0]):
        return robot.look(left[0])
    if not rooms:
        return None
    robot.enter(min(rooms)[1])
    return False


WAYS: Mapping[str, Callable[[Robot], bool | None]] = {
    "`next_place`": by_place,
    "nearest piece in the room of `next_room`": by_room,
    "nearest": by_distance,
}


def search(house: House, thing: str, start: str, step: Callable[[Robot], bool | None]) -> float:
    """Return the seconds until a thing is found; those of all looks if it is not."""
    robot = Robot(house, thing, start)
    for _ in range(MOST_STOPS):
        found = step(robot)
        if found:
            break
        if found is None:
            left = robot.pieces()
            if not left:
                break
            if robot.look(left[0]):
                break
    return robot.seconds


def search_houses(houses: Sequence[House]) -> Floats:
    """Return the mean seconds of each way of searching in each house, `[houses, ways]`."""
    rows = []
    for number, house in enumerate(houses):
        rng = np.random.default_rng(number)
        things = sorted({thing for one in house.pieces for thing in one.things if is_known(thing)})
        if not things:
            continue
        chosen = rng.choice(things, size=min(SEARCHES, len(things)), replace=False)
        starts = rng.choice([*house.rooms], size=len(chosen))
        pairs = [*zip(map(str, chosen), map(str, starts), strict=True)]
        rows.append(
            [np.mean([search(house, *pair, step) for pair in pairs]) for step in WAYS.values()]
        )
        print(f"searched house {number + 1} of {len(houses)}", end="\r", file=sys.stderr)
    return np.array(rows)


def is_known(thing: str) -> bool:
    """Return whether the robot understands a word."""
    try:
        _open_nothing().understand(thing)
    except RecipeError:
        return False
    return find_receptacle(thing) is None


@cache
def _open_nothing() -> SeenBuilding:
    return open_graph({"scene_id": "none", "rooms": []})


def measure(values: Floats, weights: Floats, *, of: Callable[[Floats], float]) -> Estimate:
    """Return a figure of all rows, with its interval over resamples of them."""
    point = of(values)
    resampled = [of(np.repeat(values, column.astype(int), axis=0)) for column in weights.T]
    return estimate_value(point, np.array(resampled), nodes=len(values))


def tabulate(options: argparse.Namespace) -> list[ResultsTable]:
    """Return the tables."""
    ways: dict[str, Rank] = {
        "ours": rate,
        "how often people chose a piece": people,
        "chance": uniform,
    }
    votes = read_votes(options.housekeep, split="val")
    weights = weigh_buildings(len(votes), resamples=options.resamples, seed=0)
    rows, bins = [], []
    for name, one in ways.items():
        sums = judge_people(votes, one, weigh_by_belief if one is rate else weigh_alike)
        rows.append([name, *(show(sums[:, [k, k + 1]], weights) for k in (0, 2, 4))])
    for tenth, (said, true, number) in enumerate(judge_calibration(votes, rate)):
        if number:
            cells = [f"{said / number:.3f}", f"{true / number:.3f}", f"{number:.0f}"]
            bins.append([f"{tenth / 10:.1f} to {(tenth + 1) / 10:.1f}", *cells])
    published = [["RoBERTa, tuned", "0.791", "–", "–"], ["GloVe, tuned", "0.760", "–", "–"]]
    header = ("by", "pieces of a room, mAP ↑", "of the home, mAP ↑", "of a room, log loss ↓")
    people_said = ResultsTable("Pieces of a room, by people", header, [*rows, *published])
    calibrated = ResultsTable(
        "What is said of pieces", ("said", "mean said", "people's share", "pieces"), bins
    )
    houses = [*read_houses(options.houses)][: options.most]
    weights = weigh_buildings(len(houses), resamples=options.resamples, seed=0)
    rows = []
    for name, one in ways.items():
        sums = judge_houses(houses, one)
        rows.append([name, show(sums[:, [0, 2]], weights), show(sums[:, [1, 2]], weights)])
    lying = ResultsTable("Pieces of simulated rooms", ("by", "first right ↑", "log loss ↓"), rows)
    seconds = search_houses(houses)
    weights = weigh_buildings(len(seconds), resamples=options.resamples, seed=0)
    rows = []
    for column, name in enumerate(WAYS):
        mean = measure(seconds, weights, of=lambda v, c=column: float(v[:, c].mean()))  # type: ignore[misc]
        saved = measure(
            seconds,
            weights,
            of=lambda v, c=column: float(100 * (1 - v[:, 0].mean() / v[:, c].mean())),  # type: ignore[misc]
        )
        rows.append(
            [
                name,
                format_estimate(mean, digits=1),
                format_estimate(saved, digits=1) if column else "–",
            ]
        )
    header = ("by", "seconds until found ↓", "`next_place` saves, %")
    return [people_said, calibrated, lying, ResultsTable("Searches of furniture", header, rows)]


def show(sums: Floats, weights: Floats) -> str:
    """Return the ratio of two sums, with its interval."""
    ratio = measure(sums, weights, of=lambda v: float(v[:, 0].sum() / max(v[:, 1].sum(), 1e-9)))
    return format_estimate(ratio, digits=3)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--housekeep", type=Path, required=True, help="placements.csv")
    parser.add_argument("--houses", type=Path, required=True, help="houses, a JSON a line, gzip")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    parser.add_argument("--most", type=int, default=None, metavar="N", help="houses")
    parser.add_argument("--resamples", type=int, default=500)
    options = parser.parse_args(argv)
    words = [__file__, *(argv or sys.argv[1:])]
    write_figures(options.out, "furniture", tabulate(options), argv=words)
    return 0


if __name__ == "__main__":
    sys.exit(main())
