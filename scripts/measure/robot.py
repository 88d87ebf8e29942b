"""Let a robot in pyrobosim search things, with and without beliefs, and write the tables.

    make robot
    python scripts/measure/robot.py --leaderboard board --worlds 20 --out docs/results/figures.json

The worlds are those that pyrobosim brings, and worlds that are made from buildings of a dataset
(`storeys.py`). A leaderboard has a model for each building that was not trained on it; for another
dataset the shipped model answers. The worlds of buildings are searched again with a detector that
misses `MISSES` of what is there.
"""

from __future__ import annotations

import argparse
import logging
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from results import ResultsTable, format_estimate, write_figures
from storeys import (
    Put,
    Storey,
    describe_world,
    open_storeys,
    put_anywhere,
    put_as_people_choose,
)

from bsg_data.dataset.dataset import Dataset
from bsg_data.tables import format_text
from bsg_models.evaluation.bootstrap import LEAST_BUILDINGS, estimate_value, weigh_buildings
from bsg_models.inputs.folds import scenes_of
from bsg_models.robot.seen_building import SeenBuilding, open_graph
from bsg_models.search.looks import metres_of_look

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
OWN = (
    "test_world",
    "test_world_multirobot",
    "pddlstream_simple_world",
    "roscon_2024_workshop_world",
)
SHIPPED = "universal"
MASK = "mixed"  # of the models of a leaderboard
LOOK = 5.0  # seconds for each detection
SPEED = 1.0  # metres a second
MISSES = 0.2  # P(a detection misses a thing that is there), of a detector that misses some
MOST_LOOKS = 10  # into a room, with such a detector
AREAS = (1, 8, 14, 22, 40, 400)  # m², between which searches of rooms are averaged
QUESTIONS = 5  # of a world that was made from a building
Question = tuple[str, str]  # a thing, and the room where the robot starts
# Worlds, and what the robot knows of them


def open_own() -> Iterator[Any]:
    """Yield the worlds that pyrobosim brings."""
    from pyrobosim.utils.general import get_data_folder

    for name in OWN:
        yield open_world(get_data_folder() / f"{name}.yaml")


def build_world(storey: Storey, *, seed: int, put: Put = put_anywhere) -> Any:
    """Return a storey as a world of pyrobosim."""
    with tempfile.TemporaryDirectory() as folder:
        said = describe_world(storey, Path(folder), seed=seed, put=put)
        file = Path(folder) / "world.yaml"
        file.write_text(yaml.safe_dump(said), "utf-8")
        return open_world(file)


def open_world(file: Path) -> Any:
    """Return a world with one robot that knows no things. It plans by A*, which draws nothing."""
    import pyrobosim.navigation  # noqa: F401 - registers the planners that a file may name
    from pyrobosim.core.yaml_utils import WorldYamlLoader
    from pyrobosim.navigation.a_star import AStarPlanner
    from pyrobosim.navigation.execution import ConstantVelocityExecutor

    world = WorldYamlLoader().from_file(file)
    for other in world.robots[1:]:
        world.remove_robot(other.name)
    robot = world.robots[0]
    robot.stop_sensor_threads()  # it detects at furniture; the thread of a lidar would never end
    robot.partial_obs_objects = True
    robot.set_path_planner(AStarPlanner(grid_resolution=0.1, grid_inflation_radius=robot.radius))
    robot.set_path_executor(ConstantVelocityExecutor(linear_velocity=SPEED, dt=0.5))
    return world


def know_world(world: Any, *, model: str) -> SeenBuilding:
    """Return what the robot knows before it starts: rooms, their names, ways, and furniture."""
    rooms = [
        {
            "id": room.name,
            "visited": False,
            "room_type": room.name,
            "position": [*map(float, room.centroid), 0.0],
            "floor_area": float(room.polygon.area),
        }
        for room in world.rooms
    ]
    furniture = [
        {
            "id": one.name,
            "room": one.parent.name,
            "category": _word(one.category),
            "position": [float(one.pose.x), float(one.pose.y), 0.0],
        }
        for one in world.locations
    ]
    ways = [[way.room_start.name, way.room_end.name] for way in world.hallways]
    said = {"scene_id": "world", "building_kind": "home", "rooms": rooms, "objects": furniture}
    seen = open_graph(said | {"adjacency": ways}, model=model)
    for room in world.rooms:
        if not room.locations:
            seen.searched(room.name)  # there is nothing to look into
    return seen


def _word(category: str) -> str:
    return category.replace("_", " ")


# A search


@dataclass
class Search:
    """One search: the robot, what it has seen, and what the search has cost."""

    world: Any
    seen: SeenBuilding
    thing: str
    room: str  # where the robot is
    luck: int | None  # seed of what detections miss; None: nothing
    left: dict[str, list[Any]]  # room → places of its furniture that were not searched
    looks: Counter[str] = field(default_factory=Counter)  # room → times that it was searched
    metres: float = 0.0
    seconds: float = 0.0
    found: bool = False
    at: str | None = None  # the furniture at which it looked last
    within: str | None = None  # the room that it searches whole; None if it has done so
    path: list[tuple[float, float]] = field(default_factory=list)
    begun: float = 0.0  # seconds, when it reached the first piece of the room
    whole: list[tuple[str, float]] = field(default_factory=list)  # room, seconds of all of it

    def go(self, goal: Any) -> bool:
        """Let pyrobosim plan a way and follow it; False if it does not get there."""
        robot = self.world.robots[0]
        way = robot.plan_path(goal=goal)
        if way is None or way.num_poses < 2:
            return False  # no way leads there
        arrived = robot.navigate(path=way, realtime_factor=-1).is_success()
        self.metres += way.length
        self.seconds += float(robot.path_executor.traj.t_pts[-1])
        self.path += [(pose.x, pose.y) for pose in way.poses]
        return bool(arrived)

    def look(self, place: Any) -> None:
        """Go to a piece of furniture, open it, detect, and report what is there."""
        robot, self.room = self.world.robots[0], place.parent.parent.name
        self.at = place.parent.name
        begins = len(self.left[self.room]) == len(list_places(self.world)[self.room])
        self.left[self.room].remove(place)
        if robot.location is place or self.go(place):
            self.begun = self.seconds if begins else self.begun
            if not place.is_open:
                robot.open_location()
            robot.detect_objects()
            self.seconds += LOOK
            for one in robot.last_detected_objects:
                if self.detects(one):
                    self.seen.saw(self.room, _word(one.category), object_id=one.name)
                    self.found |= one.category == self.thing
        if not self.found and not self.left[self.room]:
            self.leave()

    def detects(self, one: Any) -> bool:
        """Say whether a detection finds a thing: the n-th of one thing alike in every search."""
        number = self.world.objects.index(one), self.looks[self.room]
        return self.luck is None or np.random.default_rng([self.luck, *number]).random() >= MISSES

    def leave(self) -> None:
        """Report that the thing is not in the room, or that the robot has looked and may again."""
        self.within = None
        self.whole.append((self.room, self.seconds - self.begun))
        self.looks[self.room] += 1
        if self.luck is None or self.looks[self.room] == MOST_LOOKS:
            del self.left[self.room]
            self.seen.searched(self.room)
        else:
            self.left[self.room] = list_places(self.world)[self.room]
            self.seen.looked(self.room, _word(self.thing), chance=1 - MISSES)


def list_places(world: Any) -> dict[str, list[Any]]:
    """Return room → places of its furniture, of rooms with some."""
    return {
        room.name: [top for one in room.locations for top in one.children]
        for room in world.rooms
        if room.locations
    }


Choice = Callable[[Search], Any]  # the place to look at next; None: there is nowhere to go


def find_nearest(search: Search, room: str | None) -> Any:
    """Return the place of a room that is left and nearest; None without one."""
    from pyrobosim.utils.knowledge import apply_resolution_strategy

    left = search.left.get(room) if room is not None else None
    return apply_resolution_strategy(left, "nearest", search.world.robots[0]) if left else None


def room_by_room(choose: Callable[[Search], str | None]) -> Choice:
    """Return a way to search that chooses a room, and looks at all that is there."""

    def choose_place(search: Search) -> Any:
        search.within = search.within or choose(search)
        return find_nearest(search, search.within)

    return choose_place


def by_belief(search: Search) -> str | None:
    """Return the room that our `next_room` names."""
    return search.seen.next_room(_word(search.thing), here=search.room)


def by_distance(search: Search) -> str:
    """Return the nearest of the rooms that are left and were searched least often."""
    rooms = [*search.seen.rooms]
    costs = search.seen.ways().costs[rooms.index(search.room) + 1, 1:]
    return min(search.left, key=lambda room: (search.looks[room], costs[rooms.index(room)]))


def by_list(search: Search) -> str:
    """Return the room of the furniture that comes first in pyrobosim's list, its default."""
    every: list[str] = [one.parent.name for one in search.world.locations]
    rooms = [room for room in every if room in search.left]
    return min(rooms, key=lambda room: search.looks[room])


def by_piece(search: Search) -> Any:
    """Return the place that our `next_place` names, after saying where the last look missed."""
    if search.at is not None:
        search.seen.looked(search.room, _word(search.thing), at=search.at, chance=1.0)
    go = search.seen.next_place(
        _word(search.thing), here=search.room, at=search.at, look=LOOK * SPEED
    )
    if go is None:
        return None
    named = [place for place in search.left.get(go.room, ()) if place.parent.name == go.piece]
    return named[0] if named else find_nearest(search, go.room)


NEXT_ROOM, NEAREST = room_by_room(by_belief), room_by_room(by_distance)
CHOICES: Mapping[str, Choice] = {
    "next_room": NEXT_ROOM,
    "nearest": NEAREST,
    "first": room_by_room(by_list),
}
OF_PIECES: Mapping[str, Choice] = {
    "next_place": by_piece,
    "next_room": NEXT_ROOM,
    "nearest": NEAREST,
}


def find(
    world: Any, question: Question, choose: Choice, *, model: str, luck: int | None = None
) -> Search:
    """Search until it is found, or nothing is left."""
    (thing, start), robot = question, world.robots[0]
    robot.set_pose(world.get_room_by_name(start).nav_poses[0])
    robot.known_objects = set()
    search = Search(world, know_world(world, model=model), thing, start, luck, list_places(world))
    while not search.found and (place := choose(search) if search.left else None) is not None:
        search.look(place)
    return search


# Measurement and picture

Row = Sequence[Search]  # the searches of one question, by each choice


def list_questions(world: Any) -> dict[bool, list[Question]]:
    """Return every thing from every room, by whether the room holds the thing.

    Things that are in every room with furniture are left out.
    """
    rooms = {room.name for room in world.rooms if room.locations}
    where: dict[str, set[str]] = {}
    for one in world.objects:
        where.setdefault(one.category, set()).add(one.parent.parent.parent.name)
    found: dict[bool, list[Question]] = {False: [], True: []}
    for thing in sorted(thing for thing in where if where[thing] < rooms):
        for room in world.rooms:
            found[room.name in where[thing]].append((thing, room.name))
    return found


def draw_questions(world: Any, *, seed: int) -> list[Question]:
    """Return questions about different things, from rooms that do not hold them."""
    draw, every = np.random.default_rng(seed), list_questions(world)[False]
    things = draw.permutation(sorted({thing for thing, _ in every}))[:QUESTIONS]
    starts = {thing: [room for other, room in every if other == thing] for thing in things}
    return [(str(thing), str(draw.choice(rooms))) for thing, rooms in starts.items()]


def search_all(
    world: Any,
    questions: Sequence[Question],
    *,
    model: str,
    luck: int | None = None,
    choices: Mapping[str, Choice] = CHOICES,
) -> list[Row]:
    """Return the searches of some questions."""
    return [
        [find(world, one, choose, model=model, luck=luck) for choose in choices.values()]
        for one in questions
    ]


def average(worlds: Sequence[Sequence[Row]]) -> np.ndarray:
    """Return the means over the searches of each world, `[worlds, choices, 3]`.

    They are metres, seconds, and whether the thing was found.
    """
    every = [[[(s.metres, s.seconds, s.found) for s in row] for row in rows] for rows in worlds]
    return np.array([np.mean(world, axis=0) for world in every])


def report(
    title: str,
    worlds: Sequence[Sequence[Row]],
    *,
    model: str,
    choices: Mapping[str, Choice] = CHOICES,
) -> ResultsTable:
    """Return a table of means over worlds, with intervals."""
    found = average(worlds)
    resamples = 2000 if len(found) >= LEAST_BUILDINGS else 0
    weights = weigh_buildings(len(found), resamples=resamples, seed=0) / len(found)
    means = np.einsum("wcu,wr->cur", found, weights)  # [choices, units, 1 + resamples]
    saved = 100 * (1 - means[0] / means)
    lines = [
        [
            f"`{name}`",
            _cell(100 * means[number, 2]),
            *(_cell(means[number, unit]) for unit in (0, 1)),
            *(_cell(saved[number, unit]) if number else "–" for unit in (0, 1)),
        ]
        for number, name in enumerate(choices)
    ]
    header = ("searcher", "found, %", "metres", "seconds", "% of metres", "% of seconds")
    several = "95 % intervals over worlds" if resamples else "too few worlds for intervals"
    reading = (
        f"{sum(map(len, worlds))} questions in {len(found)} worlds, {several}; beliefs of "
        f"{model}. The last columns are what `{next(iter(choices))}` saves of this row's cost."
    )
    return ResultsTable(title, header, lines, reading)


def fit_looks(worlds: Sequence[Sequence[Row]]) -> ResultsTable:
    """Return how long whole rooms took, by floor area, and the rule that fits best."""
    searches = [search for rows in worlds for row in rows for search in row]
    whole = np.array(
        [(s.world.get_room_by_name(room).polygon.area, t) for s in searches for room, t in s.whole]
    )
    area, seconds = whole[whole[:, 1] > 0].T
    growth, first = np.polyfit(np.log(area), np.log(seconds), 1)
    lines = []
    for least, most in pairwise(AREAS):
        of = (area >= least) & (area < most)
        if not of.any():
            continue
        mean = area[of].mean()
        rule = metres_of_look(mean)
        numbers = f"{mean:.1f}", f"{seconds[of].mean():.1f}", f"{rule:.1f}"
        lines.append([f"{least} to {most}", f"{of.sum():,}", *numbers])
    header = ("m²", "searches", "mean m²", "seconds", "by our rule")
    reading = (
        f"{len(area):,} searches of whole rooms that did not find the thing, from the first piece "
        f"on. Least squares of the logarithms: {np.exp(first):.1f} · A^{growth:.2f} s."
    )
    return ResultsTable("A look into a room", header, lines, reading)


def _cell(values: np.ndarray) -> str:
    estimate = estimate_value(values[0], values[1:], nodes=1, rule="percentile")
    return format_estimate(estimate, digits=1)


def choose_typical(worlds: Sequence[Sequence[Row]]) -> Row:
    """Return the searches of a long question whose saving is nearest to the saving of all."""
    every = [row for rows in worlds for row in rows]
    ours, theirs = np.array([[one.seconds for one in row[:2]] for row in every]).T
    distance = np.abs(ours / theirs - ours.sum() / theirs.sum())
    return every[int(np.where(theirs >= theirs.mean(), distance, np.inf).argmin())]


def draw_searches(searches: Row, path: Path) -> None:
    """Draw the ways of one search by `next_room` and by `nearest`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), layout="constrained")
    for number, (name, search) in enumerate(zip(CHOICES, searches[:2], strict=False), 1):
        axes = figure.add_subplot(1, 2, number)
        for room in search.world.rooms:
            axes.fill(*room.polygon.exterior.xy, fc="#eef1f4", ec="#8a94a0", lw=1)
        for way in search.world.hallways:
            axes.fill(*way.polygon.exterior.xy, color="#eef1f4", lw=0)
        left = {place.parent.name for places in search.left.values() for place in places}
        for one in search.world.locations:
            color = "#ddd3c2" if one.name in left else "#8f7a56"
            axes.fill(*one.polygon.exterior.xy, color=color, lw=0)
        axes.plot(*np.transpose(search.path), color="#1f6f8b", lw=1.8)
        axes.plot(*search.path[0], "o", color="#1f6f8b", ms=8)
        axes.plot(*search.path[-1], "*", color="#c0392b", ms=16)
        title = f"{name}: {_word(search.thing)} after {search.metres:.0f} m, {search.seconds:.0f} s"
        axes.set_title(title, fontsize=12)
        axes.set_aspect("equal")
        axes.axis("off")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100, bbox_inches="tight")


def open_models(options: argparse.Namespace) -> tuple[Dataset, dict[str, str]]:
    """Return a dataset, and for each of its buildings a model that was not trained on it."""
    if options.leaderboard is None:
        data = Dataset.open(options.data)
        return data, dict.fromkeys(data.scene_ids, SHIPPED)
    board = options.leaderboard / MASK
    data = Dataset.open(board / "dataset")
    folds = range(len(data.splits))
    return data, {
        scene: str(board / f"fold-{fold}" / SHIPPED)
        for fold in folds
        for scene in scenes_of(data, "test", fold=fold)
    }


def main(argv: Sequence[str]) -> None:
    """Run all searches, and write the tables and the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="a dataset that the shipped model has not seen")
    parser.add_argument("--leaderboard", type=Path, help="buildings, each with a model")
    parser.add_argument("--worlds", type=int, default=10, help="number of buildings")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args(argv[1:])
    logging.disable(logging.WARNING)  # pyrobosim reports every step
    np.random.seed(options.seed)  # by which pyrobosim draws where on furniture things lie
    own: dict[bool, list[list[Row]]] = {False: [], True: []}
    for world in open_own():
        for beside, questions in list_questions(world).items():
            own[beside].append(search_all(world, questions, model=SHIPPED))
    data, models = open_models(options)
    made: dict[bool, list[list[Row]]] = {False: [], True: []}  # by whether it misses some
    put: list[list[Row]] = []  # with things on furniture as people choose it
    for number, (scene, storey) in enumerate(islice(open_storeys(data, models), options.worlds)):
        seed = options.seed + number
        world = build_world(storey, seed=seed)
        questions = draw_questions(world, seed=seed)
        for misses, searches in made.items():
            luck = seed if misses else None
            searches.append(search_all(world, questions, model=models[scene], luck=luck))
        world = build_world(storey, seed=seed, put=put_as_people_choose)
        questions = draw_questions(world, seed=seed)
        put.append(search_all(world, questions, model=models[scene], choices=OF_PIECES))
        print(f"{number + 1} of {options.worlds} worlds", file=sys.stderr, flush=True)
    shipped = f"`{SHIPPED}`"
    held = f"`{SHIPPED}@{MASK}`, trained on other buildings" if options.leaderboard else shipped
    tables = [
        report("Worlds made from buildings", made[False], model=held),
        report(f"A detector that misses {100 * MISSES:.0f} %", made[True], model=held),
        report("Things on furniture that people choose", put, model=held, choices=OF_PIECES),
        report("pyrobosim's own worlds", own[False], model=shipped),
        report("The same, from rooms that hold the thing", own[True], model=shipped),
        fit_looks([*made[False], *made[True]]),
    ]
    packages = ("belief-scene-graphs", "pyrobosim", "numpy")
    for one in tables:
        print(f"\n{one.title}: {one.reading}\n{format_text(one.rows, header=one.header)}")
    write_figures(options.out, "robot", tables, argv=argv, data=data, packages=packages)
    if options.picture:
        draw_searches(choose_typical(made[False]), options.picture)


if __name__ == "__main__":
    main(sys.argv)
