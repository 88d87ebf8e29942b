"""Measure what share of a room's objects a camera has not seen: the constants of the estimator.

    python scripts/fit/hidden_share.py --procthor HOUSES.jsonl.gz --mp3d HOUSE.house.gz ...

A camera walks through rooms whose floors and objects are known. At moments of a walk it is known
which part of the floor and of the walls was in view so far, how many seconds it was inside, and
which objects it has not seen. Prints the constants of `bsg_data.observation.hidden_share`, and how
they predict the shares of both sources.

ProcTHOR says where an object is, not how large: nothing hides behind furniture there. The boxes of
Matterport's objects do hide what is behind them. So constants are fitted to ProcTHOR's rooms, and
Matterport's tell one factor alone: what is seen when all floor and walls were in view. All other
moments there are a test. Takes about two minutes.
"""

from __future__ import annotations

import argparse
import gzip
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely
from scipy.optimize import minimize
from scipy.special import betaln

from bsg_data.observation.hidden_share import CURVES, Curve, Sight
from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.catalogue import open_source

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
HEIGHT, RANGE = 1.2, 5.0  # metres: of the camera above the floor, and how far it sees
WIDTH, TALL = np.radians(90), np.radians(60)  # of its field of view
SPEED, TURN = 0.5, 1.0  # metres and radians a second
STEP = 0.5  # seconds from one picture to the next
MARGIN = 0.3  # metres that it keeps from walls
SPACING = 0.25  # metres between the points of floor and walls
MOMENTS = (0, 1, 2, 4, 8, 15, 30, 60)  # seconds inside at which a walk is asked
CLOSED = ("Fridge", "Safe", "Microwave")  # what is in them nobody sees
LEAST = 3  # objects in a room that tells anything
ALL = 0.97  # of floor and walls in view, from which on all counts as in view


class Space(NamedTuple):
    """A room as a camera sees it.

    Attributes:
        corners: `[V, 2]` of its floor, metres.
        objects: `[O, P, 3]` points of its objects, any of which shows it, above the floor.
        boxes: `[K, 2, 3]` lowest and highest corners of what hides what is behind it.
    """

    corners: Floats
    objects: Floats
    boxes: Floats


class Moment(NamedTuple):
    """What a camera has seen of a room at one moment of a walk."""

    seconds_inside: float
    floor_area: float
    floor_in_view: float
    walls_in_view: float
    unseen: int
    objects: int


def read_procthor(path: Path) -> Iterator[Space]:
    """Yield the rooms of ProcTHOR's houses; its Y is up."""
    with gzip.open(path, "rt") as lines:
        for line in lines:
            house = json.loads(line)
            found: dict[str, list[Floats]] = {}
            waiting = list(house["objects"])
            while waiting:
                thing = waiting.pop()
                if not thing["assetId"].startswith(CLOSED):
                    waiting += thing.get("children", [])
                x, height, y = (thing["position"][axis] for axis in "xyz")
                room = next((p for p in thing["id"].split("|") if p.isdigit()), "")
                found.setdefault(room, []).append(np.array([[x, y, height]]))
            for room in house["rooms"]:
                corners = np.array([[c["x"], c["z"]] for c in room["floorPolygon"]], dtype=float)
                objects = found.get(room["id"].removeprefix("room|"), [])
                if len(objects) >= LEAST:
                    yield Space(corners, np.stack(objects), np.zeros((0, 2, 3)))


def read_mp3d(path: Path) -> Iterator[Space]:
    """Yield the rooms of a house of Matterport's; their floors are convex hulls."""
    source = open_source("mp3d", path)
    graph = source.read(source.find().scenes[0], load_class_map()).graph
    for room in graph.rooms:
        inside = [o for o in graph.objects if o.room_index == room.room_index]
        boxes = [
            o.box for o in inside if o.box and o.role in ("classified", "left-out", "unmapped")
        ]
        if room.footprint is None or len(boxes) < LEAST:
            continue
        ends = np.array([[box.minimum, box.maximum] for box in boxes])
        ends[:, :, 2] -= room.floor_z or 0.0
        yield Space(np.array(room.footprint), sample_boxes(ends), ends)


def sample_boxes(ends: Floats) -> Floats:
    """Return the centre and eight points towards the corners of boxes, `[O, 9, 3]`."""
    corners = np.stack(np.meshgrid([0.1, 0.9], [0.1, 0.9], [0.1, 0.9]), axis=-1).reshape(-1, 3)
    places = np.concatenate([[[0.5, 0.5, 0.5]], corners])
    return np.asarray(ends[:, None, 0] + places * (ends[:, None, 1] - ends[:, None, 0]))


def walk(space: Space, rng: np.random.Generator) -> Iterator[Moment]:
    """Yield the moments of one walk through a room, from a place beside its wall."""
    room = shapely.Polygon(space.corners).buffer(0)
    inner = room.buffer(-MARGIN)
    if inner.is_empty or room.area < 1:
        return
    floor, walls = sample_floor(room, rng), sample_walls(space.corners)
    seen = [np.zeros(len(points), dtype=bool) for points in (floor, walls, space.objects)]
    spin = rng.random() * 0.5  # how often it looks round, of its stops
    poses = list(take_poses(inner, rng, spin=spin))
    for number, (place, heading) in enumerate(poses):
        now = (
            sees(place, heading, floor, space.corners),
            sees(place, heading, walls, space.corners),
            sees_objects(place, heading, space),
        )
        for known, found in zip(seen, now, strict=True):
            known |= found
        if number * STEP in MOMENTS:
            shares = [float(known.mean()) for known in seen[:2]]
            unseen = int((~seen[2]).sum())
            yield Moment(number * STEP, float(room.area), *shares, unseen, len(space.objects))


def take_poses(
    inner: Any, rng: np.random.Generator, *, spin: float
) -> Iterator[tuple[Floats, float]]:
    """Yield place and heading of a camera every `STEP`, until the last of the `MOMENTS`."""
    left = int(MOMENTS[-1] / STEP) + 1
    along = rng.random() * inner.exterior.length if inner.geom_type == "Polygon" else 0.0
    begin = inner.exterior if inner.geom_type == "Polygon" else inner.centroid
    place = np.array(begin.interpolate(along).coords[0] if along else begin.centroid.coords[0])
    centre = np.array(inner.representative_point().coords[0])
    heading = float(np.arctan2(*(centre - place)[::-1]))
    yield place, heading
    while left > 0:
        target = choose_target(inner, place, rng)
        wanted = float(np.arctan2(*(target - place)[::-1]))
        turns = [wanted - heading, *([2 * np.pi] if rng.random() < spin else [])]
        for turn in turns:
            turn = (turn + np.pi) % (2 * np.pi) - np.pi if turn != 2 * np.pi else turn
            for part in np.linspace(0, 1, int(abs(turn) / TURN / STEP) + 1)[1:]:
                yield place, heading + turn * part
                left -= 1
            heading += turn
        heading = wanted
        steps = int(np.linalg.norm(target - place) / SPEED / STEP) + 1
        for part in np.linspace(0, 1, steps + 1)[1:]:
            yield place + part * (target - place), heading
            left -= 1
        place = target


def choose_target(inner: Any, place: Floats, rng: np.random.Generator) -> Floats:
    """Return a random place to which the way is straight and inside; where there is none, near."""
    low_x, low_y, high_x, high_y = inner.bounds
    for _ in range(50):
        target = rng.uniform((low_x, low_y), (high_x, high_y))
        if inner.buffer(1e-6).covers(shapely.LineString([place, target])):
            return np.asarray(target)
    return np.array(inner.representative_point().coords[0])


def sample_floor(room: Any, rng: np.random.Generator) -> Floats:
    """Return points of a floor on a grid, `[F, 2]`."""
    low_x, low_y, high_x, high_y = room.bounds
    start = rng.random(2) * SPACING
    x, y = np.meshgrid(
        np.arange(low_x + start[0], high_x, SPACING), np.arange(low_y + start[1], high_y, SPACING)
    )
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    return points[shapely.contains_xy(room, points)]


def sample_walls(corners: Floats) -> Floats:
    """Return points along the walls, `[W, 2]`."""
    parts = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        number = max(1, int(np.linalg.norm(b - a) / SPACING))
        parts.append(a + (np.arange(number)[:, None] + 0.5) / number * (b - a))
    return np.concatenate(parts)


def sees(place: Floats, heading: float, points: Floats, corners: Floats) -> Bools:
    """Return which points `[M, 2]` are in range, in the field of view and behind no wall."""
    away = points - place
    distance = np.hypot(*away.T)
    turned = np.arctan2(away[:, 1], away[:, 0]) - heading
    visible = (distance <= RANGE) & (np.abs((turned + np.pi) % (2 * np.pi) - np.pi) <= WIDTH / 2)
    near = np.flatnonzero(visible)
    visible[near] = ~crosses(place, points[near], corners)
    return np.asarray(visible)


def crosses(place: Floats, points: Floats, corners: Floats) -> Bools:
    """Return which lines from a place to points `[M, 2]` a wall cuts before their ends."""
    a, b = corners, np.roll(corners, -1, axis=0)
    away, wall = (points - place)[:, None], (b - a)[None]
    turn = away[..., 0] * wall[..., 1] - away[..., 1] * wall[..., 0]
    gap = (a - place)[None]
    with np.errstate(divide="ignore", invalid="ignore"):
        on_line = (gap[..., 0] * wall[..., 1] - gap[..., 1] * wall[..., 0]) / turn
        on_wall = (gap[..., 0] * away[..., 1] - gap[..., 1] * away[..., 0]) / turn
    cut = (on_line > 1e-6) & (on_line < 1 - 1e-3) & (on_wall >= 0) & (on_wall <= 1)
    return np.asarray(cut.any(axis=1))


def sees_objects(place: Floats, heading: float, space: Space) -> Bools:
    """Return which objects `[O]` show a point that no wall and no box hides."""
    number, points, _ = space.objects.shape
    flat = space.objects.reshape(-1, 3)
    eye = np.array([*place, HEIGHT])
    away = flat - eye
    slope = np.abs(np.arctan2(away[:, 2], np.hypot(away[:, 0], away[:, 1])))
    visible = sees(place, heading, flat[:, :2], space.corners) & (slope <= TALL / 2)
    near = np.flatnonzero(visible)
    if len(space.boxes):
        own = np.repeat(np.arange(number), points)[near]
        visible[near] = ~is_behind(eye, flat[near], space.boxes, own)
    return np.asarray(visible.reshape(number, points).any(axis=1))


def is_behind(eye: Floats, points: Floats, boxes: Floats, own: npt.NDArray[np.int64]) -> Bools:
    """Return which points `[M, 3]` a box hides that holds neither the point nor the eye."""
    away = (points - eye)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (boxes[None] - eye) / np.where(away == 0, 1e-12, away)[:, :, None]
    enter, leave = ends.min(axis=2).max(axis=2), ends.max(axis=2).min(axis=2)
    between = (enter < leave) & (enter > 0) & (enter < 1)
    holds = ((points[:, None] >= boxes[None, :, 0]) & (points[:, None] <= boxes[None, :, 1])).all(2)
    between &= ~holds
    between[np.arange(len(points)), own] = False
    return np.asarray(between.any(axis=1))


class Table(NamedTuple):
    """Moments as columns, each `[M]`; see `Moment`."""

    seconds_inside: Floats
    floor_area: Floats
    floor_in_view: Floats
    walls_in_view: Floats
    unseen: Floats
    objects: Floats

    @property
    def sight(self) -> Sight:
        """What a robot knows at these moments."""
        return Sight(
            floor_in_view=self.floor_in_view,
            walls_in_view=self.walls_in_view,
            seconds_inside=self.seconds_inside,
            floor_area=self.floor_area,
        )


def simulate(spaces: Sequence[Space], *, walks: int) -> Table:
    """Return the moments of some walks through every room."""
    rows = [
        moment
        for number, space in enumerate(spaces)
        for one in range(walks)
        for moment in walk(space, np.random.default_rng([number, one]))
    ]
    return Table(*np.array(rows).T)


BINS = ((0.0, 0.1), (0.1, 0.3), (0.3, 0.5), (0.5, 0.7), (0.7, 1.0))  # of predicted shares
BOUNDS = {  # of the constants, in their order
    "floor": ((0.5, 1), (0, 1), (0.05, 20)),
    "walls": ((0.5, 1), (0, 1), (0.25, 20)),  # a lower power would be a step at 0
    "seconds": ((0.5, 1), (0, 60), (0.1, 100), (0, 0)),
    "seconds and area": ((0.5, 1), (0, 60), (0.1, 100), (0, 2)),
}


def fit_curve(kind: str, table: Table) -> Curve:
    """Return a curve with the constants of the greatest likelihood.

    Of n objects the unseen ones are beta-binomial: a share from the Beta distribution, then each
    object by itself, so that rooms of few objects do not widen the Beta.
    """
    curve, sight = CURVES[kind], table.sight

    def cost(values: Floats) -> float:
        return -float(
            log_likelihood(curve.seen(values[:-1], sight), np.exp(values[-1]), table).mean()
        )

    start = np.array([*curve.constants, np.log(curve.size)])
    bounds = [*BOUNDS[kind], (-1, 5)]
    found = minimize(cost, start, method="L-BFGS-B", bounds=bounds).x
    return Curve(curve.seen, tuple(float(v) for v in found[:-1]), float(np.exp(found[-1])))


def log_likelihood(seen: float | Floats, size: float, table: Table) -> Floats:
    """Return log P(unseen objects) of every moment, `[M]`, without the binomial coefficient."""
    share = np.clip(1 - np.asarray(seen), 1e-3, 1 - 1e-3)
    a, b = size * share, size * (1 - share)
    return np.asarray(betaln(a + table.unseen, b + table.objects - table.unseen) - betaln(a, b))


def see_most(table: Table) -> float:
    """Return the share of the objects that were seen when all floor and walls were in view."""
    everything = (table.floor_in_view >= ALL) & (table.walls_in_view >= ALL)
    return float(1 - table.unseen[everything].sum() / table.objects[everything].sum())


def print_curve(kind: str, curve: Curve, tables: Mapping[str, Table]) -> None:
    """Print a curve's constants, and the shares that it predicts beside the true ones."""
    constants = ", ".join(f"{value:.3g}" for value in curve.constants)
    print(f"{kind}: ({constants}), {curve.size:.2g}")
    for name, table in tables.items():
        predicted = 1 - np.asarray(curve.seen(curve.constants, table.sight))
        true = table.unseen / table.objects
        sd = np.sqrt(predicted * (1 - predicted) / (curve.size + 1))
        for low, high in BINS:
            inside = (predicted >= low) & (predicted < high)
            if inside.sum() >= 50:
                print(
                    f"  {name:9} {low:.1f}–{high:.1f} {inside.sum():6}  "
                    f"predicted {predicted[inside].mean():.2f} ± {sd[inside].mean():.2f}  "
                    f"true {true[inside].mean():.2f} ± {(true - predicted)[inside].std():.2f}"
                )


def main() -> None:
    """Walk, fit and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--procthor", type=Path, required=True, help="ProcTHOR's houses, .jsonl.gz")
    parser.add_argument("--mp3d", type=Path, nargs="+", required=True, help=".house files")
    options = parser.parse_args()
    tables = {
        "ProcTHOR": simulate(list(read_procthor(options.procthor)), walks=1),
        "Matterport": simulate([r for path in options.mp3d for r in read_mp3d(path)], walks=10),
    }
    most = {name: see_most(table) for name, table in tables.items()}
    print("seen when all was in view:", ", ".join(f"{n} {s:.3f}" for n, s in most.items()))
    for kind in CURVES:
        curve = fit_curve(kind, tables["ProcTHOR"])
        hidden_by_things = most["Matterport"] / most["ProcTHOR"]
        constants = (curve.constants[0] * hidden_by_things, *curve.constants[1:])
        print_curve(kind, curve._replace(constants=constants), tables)


if __name__ == "__main__":
    main()
