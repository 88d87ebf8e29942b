"""Measure how far repeated looks into a room miss the same things.

    python scripts/measure/looks.py --houses HOUSES.jsonl.gz --out docs/results/figures.json

A camera looks ten times into each room of ProcTHOR's houses and of two of Matterport's, each time
for as long as lets it see the share c of all things. Two laws of P(n looks miss) are fitted to
the share of the things that n looks miss: by a strength k, ∏ ((1 − c)k + i)/(k + i) for i < n,
where each thing has its own chance, from a Beta distribution; and by a share s = σ(1 − c) that all
looks overlook, s + (1 − s)rⁿ, where each look finds the rest. ProcTHOR says where things are, not
how large: nothing hides behind furniture there, but boxes do in Matterport's rooms.
"""

from __future__ import annotations

import argparse
import gzip
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from results import ResultsTable, write_figures
from scipy.special import comb

from bsg_data.arrays import Bools, Floats
from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.catalogue import open_source

HEIGHT, RANGE, MARGIN = 1.2, 5.0, 0.3  # metres: of the camera, that it sees, from walls
WIDTH, TALL = np.radians(90), np.radians(60)  # of its field of view
SPEED, TURN, STEP, MOST = 0.5, 1.0, 0.5, 120  # m/s, rad/s, seconds: of a picture, of a walk
WALKS, LEAST, RESAMPLES = 10, 3, 500  # looks into a room; things in it; of the buildings
LOOKS = np.arange(1, 6)
CLOSED = ("Fridge", "Safe", "Microwave")  # all that they hold is hidden
DRAWERS = ("Dresser", "Desk", "Side_Table", "RoboTHOR_dresser", "RoboTHOR_desk", "RoboTHOR_side")
CHANCES = (0.5, 0.7, 0.8, 0.9)
KINDS = ("another start and route", "the same start, another route", "a turn at another place")
LAW = Callable[[Floats, Floats], Floats]


class Room(NamedTuple):
    """A floor, and things above it; metres.

    Attributes:
        home: building, or room of few buildings, that a resample takes whole.
        corners: `[V, 2]`.
        things: `[O, P, 3]` points, any of which shows a thing.
        closed: `[O]` things in a fridge or in a drawer.
        boxes: `[K, 2, 3]` that hide what is behind them.
    """

    home: str
    corners: Floats
    things: Floats
    closed: Bools
    boxes: Floats


def read_procthor(path: Path) -> Iterator[Room]:
    """Yield the rooms of ProcTHOR's houses that hold some things; its Y is up."""
    with gzip.open(path, "rt") as file:
        lines = file.readlines()
    for number, line in enumerate(lines):
        house: dict[str, Any] = json.loads(line)
        found: dict[str, list[tuple[list[float], bool]]] = {}
        waiting = [(thing, False) for thing in house["objects"]]
        while waiting:
            thing, closed = waiting.pop()
            x, height, y = (thing["position"][axis] for axis in "xyz")
            room = next((part for part in thing["id"].split("|") if part.isdigit()), "")
            found.setdefault(f"room|{room}", []).append(([x, y, height], closed))
            for held in thing.get("children", []):
                low = held["position"]["y"] < 2 * height - 0.03  # its position is its middle
                shut = thing["assetId"].startswith(CLOSED)
                drawer = thing["assetId"].startswith(DRAWERS) and low
                waiting.append((held, closed or shut or drawer))
        for room in house["rooms"]:
            corners = np.array([[one["x"], one["z"]] for one in room["floorPolygon"]])
            inside = found.get(room["id"], [])
            if len(inside) >= LEAST:
                things = np.array([[place] for place, _ in inside])
                shut_in = np.array([closed for _, closed in inside])
                yield Room(str(number), corners, things, shut_in, np.zeros((0, 2, 3)))


def read_matterport(path: Path) -> Iterator[Room]:
    """Yield the rooms of a house of Matterport's; their floors are convex hulls."""
    source = open_source("mp3d", path)
    graph = source.read(source.find().scenes[0], load_class_map()).graph
    parts = np.stack(np.meshgrid([0.1, 0.9], [0.1, 0.9], [0.1, 0.9]), axis=-1).reshape(-1, 3)
    parts = np.concatenate([[[0.5, 0.5, 0.5]], parts])
    for room in graph.rooms:
        inside = [one for one in graph.objects if one.room_index == room.room_index]
        shown = [one.box for one in inside if one.box and one.role != "structure"]
        if room.footprint is not None and len(shown) >= LEAST:
            boxes = np.array([[box.minimum, box.maximum] for box in shown])
            boxes[:, :, 2] -= room.floor_z or 0.0
            things = boxes[:, None, 0] + parts * (boxes[:, None, 1] - boxes[:, None, 0])
            closed = np.zeros(len(boxes), dtype=bool)
            home = f"{path.name} {room.room_index}"
            yield Room(home, np.array(room.footprint), things, closed, boxes)


def is_free(points: Floats, corners: Floats) -> Bools:
    """Return which points `[M, 2]` lie in a room and not beside a wall."""
    a, wall = corners, np.roll(corners, -1, axis=0) - corners
    gap = points[:, None] - a
    along = np.clip((gap * wall).sum(2) / (wall**2).sum(1), 0, 1)
    far = np.hypot(*np.moveaxis(gap - along[..., None] * wall, 2, 0)).min(1) >= MARGIN
    with np.errstate(divide="ignore", invalid="ignore"):
        right = gap[..., 0] < gap[..., 1] * wall[:, 0] / wall[:, 1]
    over = (gap[..., 1] >= 0) != (points[:, None, 1] >= np.roll(a, -1, axis=0)[:, 1])
    return np.asarray(far & ((over & right).sum(1) % 2 == 1))


def choose_start(corners: Floats, rng: np.random.Generator) -> Floats:
    """Return a place far from the middle of a room, `[0, 2]` or `[1, 2]`."""
    places = rng.uniform(corners.min(0), corners.max(0), (500, 2))
    places = places[is_free(places, corners)][:10]
    centre = corners.mean(0)
    return places[np.argsort(-np.hypot(*(places - centre).T))[:1]]


def walk(corners: Floats, place: Floats, rng: np.random.Generator) -> Floats:
    """Return places and headings of a camera from picture to picture, `[T, 3]`."""
    heading, spin = float(np.arctan2(*(corners.mean(0) - place)[::-1])), rng.random() / 2
    poses: list[list[float]] = []
    while len(poses) * STEP < MOST:
        for _ in range(50):
            target = rng.uniform(corners.min(0), corners.max(0))
            if is_free(np.linspace(place, target, 20), corners).all():
                break
        else:
            target = place
        turn = (np.arctan2(*(target - place)[::-1]) - heading + np.pi) % (2 * np.pi) - np.pi
        for by in (turn, *([2 * np.pi] if rng.random() < spin or target is place else [])):
            parts = np.linspace(0, 1, int(abs(by) / TURN / STEP) + 2)[1:]
            poses += [[*place, heading + by * part] for part in parts]
            heading += by
        parts = np.linspace(0, 1, int(np.hypot(*(target - place)) / SPEED / STEP) + 2)[1:]
        poses += [[*(place + part * (target - place)), heading] for part in parts]
        place = target
    return np.array(poses[: int(MOST / STEP)])


def see(poses: Floats, room: Room) -> Bools:
    """Return which things are in range, in the field of view and behind nothing, `[T, O]`."""
    flat, count = room.things.reshape(-1, 3), room.things.shape[1]
    away = flat[:, :2] - poses[:, None, :2]
    far = np.hypot(away[..., 0], away[..., 1])
    turned = np.arctan2(away[..., 1], away[..., 0]) - poses[:, 2:]
    seen = (far <= RANGE) & (np.abs((turned + np.pi) % (2 * np.pi) - np.pi) <= WIDTH / 2)
    seen &= np.abs(np.arctan2(flat[:, 2] - HEIGHT, far)) <= TALL / 2
    for pose, found in zip(poses, seen, strict=True):
        near = np.flatnonzero(found)
        hidden = is_cut(pose[:2], flat[near, :2], room.corners)
        eye = np.array([*pose[:2], HEIGHT])
        found[near] = ~hidden & ~is_behind(eye, flat[near], room.boxes, near // count)
    return np.asarray(seen.reshape(len(poses), -1, count).any(axis=2))


def is_cut(place: Floats, points: Floats, corners: Floats) -> Bools:
    """Return which lines from a place to points `[M, 2]` a wall cuts before their ends."""
    away, wall = (points - place)[:, None], np.roll(corners, -1, axis=0) - corners
    gap = corners - place
    with np.errstate(divide="ignore", invalid="ignore"):
        across = away[..., 0] * wall[:, 1] - away[..., 1] * wall[:, 0]
        on_line = (gap[:, 0] * wall[:, 1] - gap[:, 1] * wall[:, 0]) / across
        on_wall = (gap[:, 0] * away[..., 1] - gap[:, 1] * away[..., 0]) / across
    cut = (on_line > 1e-6) & (on_line < 1 - 1e-3) & (on_wall >= 0) & (on_wall <= 1)
    return np.asarray(cut.any(axis=1))


def is_behind(eye: Floats, points: Floats, boxes: Floats, own: Any) -> Bools:
    """Return which points `[M, 3]` a box hides that is not their own and does not hold them."""
    away = (points - eye)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (boxes - eye) / np.where(away == 0, 1e-12, away)[:, :, None]
    enter, leave = ends.min(axis=2).max(axis=2), ends.max(axis=2).min(axis=2)
    hides = (enter < leave) & (enter > 0) & (enter < 1)
    hides &= ~((points[:, None] >= boxes[:, 0]) & (points[:, None] <= boxes[:, 1])).all(axis=2)
    if len(boxes):
        hides[np.arange(len(points)), own] = False
    return np.asarray(hides.any(axis=1))


def turn_about(corners: Floats, rng: np.random.Generator) -> Floats:
    """Return the poses of a whole turn at a place of a room, `[T, 3]`."""
    places = rng.uniform(corners.min(0), corners.max(0), (500, 2))
    place = places[is_free(places, corners)][0]
    headings = np.arange(0, 2 * np.pi / TURN, STEP) * TURN + rng.uniform(0, 2 * np.pi)
    return np.column_stack([np.tile(place, (len(headings), 1)), headings])


def look(room: Room, kind: str, rng: np.random.Generator) -> Floats:
    """Return the seconds after which each of the looks has seen a thing, `[O, WALKS]`."""
    starts = [choose_start(room.corners, rng) for _ in range(WALKS)]
    if not all(map(len, starts)):  # a room that is too narrow
        return np.full((0, WALKS), np.inf)
    first = []
    for (start,) in starts[:1] * WALKS if kind == KINDS[1] else starts:
        turns = kind == KINDS[2]
        poses = turn_about(room.corners, rng) if turns else walk(room.corners, start, rng)
        seen = see(poses, room)
        first.append(np.where(seen.any(axis=0), seen.argmax(axis=0) * STEP, np.inf))
    return np.stack(first, axis=1)


def share_by_beta(chance: Floats, strength: Floats) -> Floats:
    """Return P(n looks miss) where each thing has its own chance, `[..., LOOKS]`."""
    before, strength = LOOKS - 1, strength[..., None]
    miss = ((1 - chance[..., None]) * strength + before) / (strength + before)
    return np.asarray(np.cumprod(miss, axis=-1), dtype=np.float64)


def share_overlooked(chance: Floats, sigma: Floats) -> Floats:
    """Return P(n looks miss) where all looks overlook a share, `[..., LOOKS]`."""
    chance, sigma = chance[..., None], sigma[..., None]
    share = sigma * (1 - chance)
    miss = (1 - chance) * (1 - sigma) / (1 - share)
    return np.asarray(share + (1 - share) * miss**LOOKS)


LAWS: dict[str, tuple[LAW, Floats]] = {
    "k": (share_by_beta, np.geomspace(0.05, 200, 801)),
    "σ": (share_overlooked, np.linspace(0, 1, 801)),
}


def count_missed(first: Floats, homes: Any, seconds: float) -> Floats:
    """Return the shares of the things that n looks miss, `[1 + RESAMPLES, LOOKS]`."""
    missed = (first > seconds).sum(axis=1)
    sums = comb(missed[:, None], LOOKS) / comb(WALKS, LOOKS)  # of all n of the looks
    _, number = np.unique(homes, return_inverse=True)
    by_home = np.column_stack([np.bincount(number, weights=one) for one in sums.T])
    size, rng = np.bincount(number), np.random.default_rng(0)
    taken = rng.integers(0, len(size), (RESAMPLES, len(size)))
    whole = np.vstack([np.arange(len(size)), taken])
    return np.asarray(by_home[whole].sum(axis=1) / size[whole].sum(axis=1)[:, None])


def fit(missed: Floats, law: str) -> tuple[str, str]:
    """Return the constant of a law with its interval, and its error as a factor of P(n looks miss).

    `missed` is `[chances, 1 + RESAMPLES, LOOKS]`; one constant is fitted to all chances.
    """
    share, grid = LAWS[law]
    said = share(1 - missed[..., :1], grid)
    apart = np.log(said[..., 1:]) - np.log(missed[..., None, 1:])
    error = np.sqrt((apart**2).mean(axis=(0, 3)))  # [1 + RESAMPLES, grid]
    best = grid[error.argmin(axis=1)]
    low, high = np.quantile(best[1:], (0.025, 0.975))
    return f"{best[0]:.2f} ({low:.2f} to {high:.2f})", f"× {np.exp(error[0].min()):.2f}"


def tabulate(first: Floats, homes: Any, names: tuple[str, str]) -> list[list[str]]:
    """Return a row a chance, and one of all chances together."""
    rows: list[list[str]] = []
    all_missed: list[Floats] = []
    for chance in CHANCES:
        seconds = float(np.quantile(first, chance, method="lower"))
        if np.isinf(seconds):
            continue
        missed = count_missed(first, homes, seconds)
        if not all_missed or missed[0, 0] < all_missed[-1][0, 0]:
            all_missed.append(missed)
            finds = [f"{one:.2f}" for one in 1 - missed[0, 1:] / missed[0, :-1]]
            said = [cell for law in LAWS for cell in fit(missed[None], law)]
            rows.append([*names, f"{1 - missed[0, 0]:.2f}", *finds, *said])
    said = [cell for law in LAWS for cell in fit(np.stack(all_missed), law)]
    return [*rows, [*names, "all", *[""] * 4, *said]]


def simulate(rooms: Sequence[Room], kind: str) -> tuple[Floats, Any, Bools]:
    """Return when each look sees a thing, `[O, WALKS]`, with its home and whether it is closed."""
    looks = [look(room, kind, np.random.default_rng([number])) for number, room in enumerate(rooms)]
    used = [room for room, first in zip(rooms, looks, strict=True) if len(first)]
    homes = np.repeat([room.home for room in used], [len(room.things) for room in used])
    return np.concatenate(looks), homes, np.concatenate([room.closed for room in used])


def measure(procthor: Sequence[Room], matterport: Sequence[Room]) -> Iterator[list[str]]:
    """Yield the rows of the table."""
    for kind in KINDS:
        first, homes, closed = simulate(procthor, kind)
        yield from tabulate(first[~closed], homes[~closed], ("ProcTHOR, in the open", kind))
        hidden = np.where(closed[:, None], np.inf, first)
        yield from tabulate(hidden, homes, ("ProcTHOR, also closed in", kind))
        if matterport:
            first, homes, _ = simulate(matterport, kind)
            yield from tabulate(first, homes, ("Matterport, behind furniture", kind))


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--houses", type=Path, required=True, help="ProcTHOR's, JSONL.gz")
    parser.add_argument("--matterport", type=Path, nargs="*", default=[], help=".house.gz")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    options = parser.parse_args(argv)
    procthor = list(read_procthor(options.houses))
    matterport = [room for path in options.matterport for room in read_matterport(path)]
    rows = list(measure(procthor, matterport))
    held = np.concatenate([room.closed for room in procthor])
    reading = (
        f"{WALKS} looks into each of {len(procthor)} rooms of ProcTHOR ({len(held)} things, of "
        f"which {held.sum()} are closed in: {held.mean():.0%}) and {len(matterport)} of "
        "Matterport. Each look takes the seconds in which one look finds the share c. The nth look "
        "finds a share of what the looks before it missed. Intervals are of 95 %, over houses "
        "(Matterport: rooms). Errors are root mean squares of log P(n looks miss), n = 2 to 5, "
        "as factors."
    )
    nth = ("2nd finds", "3rd finds", "4th finds", "5th finds")
    header = ("things", "looks", "c", *nth, "k", "error by k", "σ", "error by σ")
    table = ResultsTable("What repeated looks find", header, rows, reading, tested_on="chosen")
    for row in (header, *rows):
        print(" | ".join(row))
    files = [options.houses, *options.matterport]
    words = [__file__, *(argv or sys.argv[1:])]
    write_figures(options.out, "looks", [table], argv=words, files=files)
    return 0


if __name__ == "__main__":
    sys.exit(main())
