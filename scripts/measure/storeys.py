"""Make worlds of pyrobosim from buildings of a dataset: the storey with most connected rooms.

Rooms are the boxes of the dataset, without overlaps. A way of `DOOR` metres leads through the wall
between adjacent rooms. The dataset does not say where in a room something is: one piece of
furniture of each class stands at a random place, and each thing lies in or on a random piece, or on
one that people choose. What does not fit is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from furniture import people
from shapely import get_coordinates, maximum_inscribed_circle, unary_union
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import nearest_points

from bsg_data.dataset.dataset import Dataset

LEAST_ROOMS = 5  # of a storey
RADIUS = 0.1  # metres, of the robot
SIDE = 0.5  # metres of a piece of furniture
STAND = SIDE / 2 + 0.25  # metres from its middle to where the robot stands
WALL = 0.1  # metres
DOOR = 0.7  # metres
# Classes in or on which things lie, and classes of such things.
FURNITURE = ("bed", "bookshelf", "cabinet", "couch", "desk", "dresser", "nightstand", "shelf")
FURNITURE += ("sink", "stove", "table", "wardrobe", "washing machine")
THINGS = ("bag", "basket", "blanket", "book", "bottle", "box", "clothes", "computer", "lamp")
THINGS += ("microwave", "paper", "pillow", "plant", "tableware", "towel", "toy", "tv", "vase")
Row = Mapping[str, Any]  # of a dataset's table
# With a room and the words of its pieces, the place of the piece on which a thing lies.
Put = Callable[[np.random.Generator, str, Sequence[str]], int]
_LEAST = 0.01  # share of a piece of which people were not asked


@dataclass(frozen=True, eq=False)
class Storey:
    """Rooms of one storey, ways through their doors, and the classes of what each room holds."""

    rooms: Mapping[str, Polygon]
    ways: Mapping[tuple[str, str], LineString]
    holds: Mapping[str, Sequence[str]]


def open_storeys(data: Dataset, scenes: Iterable[str]) -> Iterator[tuple[str, Storey]]:
    """Yield the storey of each building, in the order of ids, that has enough rooms."""
    columns = {
        "rooms": ["scene_id", "room_index", "label", "floor_index", "footprint"],
        "objects": ["scene_id", "room_index", "class"],
    }
    rows: dict[str, dict[str, list[Row]]] = {one: {"rooms": [], "objects": []} for one in scenes}
    for name, wanted in columns.items():
        for row in data.read_table(name, columns=wanted).to_pylist():
            if row["scene_id"] in rows:
                rows[row["scene_id"]][name].append(row)
    for scene, tables in sorted(rows.items()):
        storey = find_storey(**tables, pairs=data.connections(scene).pairs.tolist())
        if len(storey.rooms) >= LEAST_ROOMS:
            yield scene, storey


def find_storey(
    rooms: Sequence[Row], objects: Sequence[Row], pairs: Sequence[Sequence[int]]
) -> Storey:
    """Return the storey with most connected rooms, from rows of a dataset's tables."""
    kept: dict[int, Polygon] = {}
    doors: dict[tuple[int, int], LineString] = {}
    placed = [room for room in rooms if room["footprint"]]
    for level in {room["floor_index"] for room in placed}:
        floors = cut_floors([room for room in placed if room["floor_index"] == level])
        ways = open_doors(floors, pairs)
        chosen = max(join_rooms(floors, ways), key=len, default=set())
        if len(chosen) > len(kept):
            kept = {index: floors[index] for index in sorted(chosen)}
            doors = {pair: way for pair, way in ways.items() if chosen.issuperset(pair)}
    labels = {room["room_index"]: room["label"] or "room" for room in rooms}
    names = {index: join_words(f"{labels[index]} {index}") for index in kept}
    return Storey(
        {names[index]: floor for index, floor in kept.items()},
        {(names[a], names[b]): way for (a, b), way in doors.items()},
        {
            name: [one["class"] for one in objects if one["room_index"] == index]
            for index, name in names.items()
        },
    )


def put_anywhere(draw: np.random.Generator, _: str, pieces: Sequence[str]) -> int:
    """Return a piece of furniture on which a thing lies, each as likely."""
    return int(draw.integers(len(pieces)))


def put_as_people_choose(draw: np.random.Generator, room: str, pieces: Sequence[str]) -> int:
    """Return a piece, as likely as people choose it for anything in such a room."""
    shares = people("", room.rpartition("_")[0].replace("_", " "), pieces) + _LEAST
    return int(draw.choice(len(pieces), p=shares / shares.sum()))


def join_words(name: str) -> str:
    """Return a name as pyrobosim takes it."""
    return name.replace(" ", "_")


def cut_floors(rooms: Sequence[Row]) -> dict[int, Polygon]:
    """Return floors without overlaps; the smaller room keeps what two boxes have.

    Rooms that are narrower than the robot, or surround another, are left out.
    """
    boxes = {one["room_index"]: Polygon(np.reshape(one["footprint"], (-1, 2))) for one in rooms}
    taken, floors = Polygon(), {}
    for index, box in sorted(boxes.items(), key=lambda item: item[1].area):
        left = box.difference(taken).buffer(-WALL / 2, join_style="mitre")
        floor = max(getattr(left, "geoms", [left]), key=lambda part: part.area)
        taken = taken.union(box)
        if not floor.is_empty and not floor.interiors and measure_width(floor) > 6 * RADIUS:
            floors[index] = floor.simplify(0.01)
    return floors


def measure_width(floor: Polygon) -> float:
    """Return the diameter of the largest circle inside."""
    return float(2 * maximum_inscribed_circle(floor).length)


def open_doors(
    floors: Mapping[int, Polygon], pairs: Sequence[Sequence[int]]
) -> dict[tuple[int, int], LineString]:
    """Return the shortest way between adjacent rooms that runs through no third room or way."""
    ways: dict[tuple[int, int], LineString] = {}
    for a, b in (pair for pair in pairs if floors.keys() >= {*pair}):
        one, other = (
            room.buffer(-min(DOOR / 2, 0.45 * measure_width(room)))
            for room in (floors[a], floors[b])
        )
        starts = map(Point, get_coordinates(one.segmentize(0.2)))
        lines = [LineString(nearest_points(start, other)) for start in starts]
        thirds = [floor.buffer(WALL) for index, floor in floors.items() if index not in (a, b)]
        rest = unary_union(thirds + [way.buffer(DOOR, cap_style="flat") for way in ways.values()])
        for line in sorted(lines, key=lambda line: float(line.length)):
            if not line.buffer(DOOR / 2, cap_style="flat").intersects(rest):
                ways[a, b] = line
                break
    return ways


def join_rooms(rooms: Iterable[int], pairs: Iterable[tuple[int, int]]) -> list[set[int]]:
    """Return the connected parts of some rooms.

    >>> join_rooms([1, 2, 3], [(1, 3)])
    [{2}, {1, 3}]
    """
    parts = [{room} for room in rooms]
    for pair in pairs:
        joined = [part for part in parts if part.intersection(pair)]
        parts = [part for part in parts if part not in joined] + [set[int]().union(*joined)]
    return parts


def describe_world(
    storey: Storey, folder: Path, *, seed: int, put: Put = put_anywhere
) -> dict[str, Any]:
    """Return a storey as pyrobosim's YAML, with its metadata in a folder."""
    furniture, things = furnish(storey, np.random.default_rng(seed), put=put)
    sides = [(STAND, 0.0), (-STAND, 0.0), (0.0, STAND), (0.0, -STAND)]
    piece = {
        "footprint": {"type": "box", "dims": [SIDE, SIDE], "height": 0.5},
        "nav_poses": [_place(*side) for side in sides],
        "locations": [{"name": "top", "footprint": {"type": "parent"}}],
    }
    thing = {"footprint": {"type": "box", "dims": [0.02, 0.02]}}
    for kind, names, said in (("locations", FURNITURE, piece), ("objects", THINGS, thing)):
        text = yaml.safe_dump({join_words(name): said for name in names})
        (folder / f"{kind}.yaml").write_text(text, "utf-8")
    return {
        "params": {"name": "storey", "object_radius": 0.001},
        "metadata": {kind: [str(folder / f"{kind}.yaml")] for kind in ("locations", "objects")},
        "rooms": [
            {
                "name": name,
                "footprint": {"type": "polygon", "coords": _points(floor.exterior)[:-1]},
                "nav_poses": [_place(*_points(floor.representative_point())[0])],
                "wall_width": WALL / 2,
            }
            for name, floor in storey.rooms.items()
        ],
        "hallways": [
            {
                "room_start": one,
                "room_end": other,
                "width": DOOR,
                "conn_method": "points",
                "conn_points": _points(way),
                "wall_width": WALL / 2,
            }
            for (one, other), way in storey.ways.items()
        ],
        "locations": furniture,
        "objects": things,
        "robots": [{"name": "robot", "radius": RADIUS, "location": next(iter(storey.rooms))}],
    }


def furnish(
    storey: Storey, draw: np.random.Generator, *, put: Put
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return pieces of furniture at random places, and each thing on one of its room's pieces."""
    furniture: list[dict[str, Any]] = []
    things: list[dict[str, Any]] = []
    doors = unary_union([*storey.ways.values()]).buffer(DOOR)
    for room, floor in storey.rooms.items():
        middle = floor.representative_point().buffer(SIDE + RADIUS)
        free = floor.buffer(-STAND - 2 * RADIUS, join_style="mitre").difference(doors.union(middle))
        pieces, words = [], []
        for category in sorted({*storey.holds[room]} & {*FURNITURE}):
            if (place := _draw_place(free, draw)) is None:
                break
            free = free.difference(place.buffer(STAND + SIDE + RADIUS))
            pieces.append(join_words(f"{category} in {room}"))
            words.append(category)
            said = {"name": pieces[-1], "category": join_words(category), "parent": room}
            furniture.append(said | {"pose": _place(place.x, place.y)})
        held = [thing for thing in storey.holds[room] if thing in THINGS and pieces]
        things += [
            {"category": join_words(thing), "parent": pieces[put(draw, room, words)]}
            for thing in held
        ]
    return furniture, things


def _draw_place(free: BaseGeometry, draw: np.random.Generator) -> Point | None:
    for _ in range(200 * (not free.is_empty)):
        place = Point(*draw.uniform(free.bounds[:2], free.bounds[2:]))
        if free.contains(place):
            return place
    return None


def _points(shape: BaseGeometry) -> list[list[float]]:
    return [[float(x), float(y)] for x, y in get_coordinates(shape)]


def _place(x: float, y: float) -> dict[str, Any]:
    return {"position": {"x": x, "y": y}}
