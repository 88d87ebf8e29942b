"""Measure what plans save that weigh second looks, beside plans that look into each room once.

    python scripts/measure/looks.py --out docs/results/figures.json

A thing is in one of six rooms, at random places; the robot knows how likely each is, and plans anew
after every look. Looks that *overlook alike* are those of `bsg_models.search.looks`; only searches
count in which the thing is not overlooked for ever. A plan with *each room once* takes looks as
independent, and has no second one; *second looks* weighs them by the law that is true; *as if
alike* by that of looks that overlook alike.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from results import ResultsTable, write_figures

from bsg_data.arrays import Floats, Ints
from bsg_data.tables import format_text
from bsg_models.search.looks import ROOM
from bsg_models.search.plans import plan_search
from bsg_models.search.problem import pose_search

SEARCHES, ROOMS, LOOKS = 2500, 6, 4
MOST = 500  # looks of a search
APART = 1e-3  # Z of rooms that exclude each other
HEADER = ["looks", "rooms within, m", "chance", "each room once", "second looks", "as if alike"]


@dataclass(frozen=True)
class Belief:
    """How a robot takes its looks."""

    misses: Callable[[Floats], Floats]  # number of looks → P(they all miss a thing that is there)
    looks: int  # into a room, that a plan weighs


def main(argv: list[str] | None = None) -> int:
    """Write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    path = parser.parse_args(argv).out
    cells = product((False, True), (12, 40, 150), (0.8, 0.5))
    rows = [measure(alike, within, chance) for alike, within, chance in cells]
    print(format_text(rows, header=HEADER, numeric=HEADER[1:]))
    reading = (
        f"Metres of {SEARCHES:,} searches in {ROOMS} rooms, ways and looks; in brackets, what is "
        "saved of plans that look into each room once, per cent, with its 95 % interval."
    )
    table = ResultsTable("Second looks", HEADER, rows, reading, tested_on="unseen")
    write_figures(path, "second_looks", [table], argv=[__file__, *(argv or sys.argv[1:])])
    return 0


def measure(alike: bool, within: float, chance: float) -> list[str]:
    """Return a row: the same searches by each belief."""

    def overlook(looks: Floats) -> Floats:
        return ROOM + (1 - ROOM) * (1 - chance / (1 - ROOM)) ** looks

    def apart(looks: Floats) -> Floats:
        return (1 - chance) ** looks

    world = overlook if alike else apart
    beliefs = [Belief(apart, 1), Belief(world, LOOKS), Belief(overlook, LOOKS)]
    once, *others = (search(belief, alike, within, chance) for belief in beliefs)
    cells = [f"{once.mean():.1f}"]
    for costs in others:
        saved = 100 * (once - costs) / once.mean()
        error = 1.96 * saved.std() / np.sqrt(len(saved))
        cells.append(f"{costs.mean():.1f} ({saved.mean():.0f} ± {error:.0f})")
    return ["overlook alike" if alike else "independent", f"{within}", f"{chance}", *cells]


def search(belief: Belief, alike: bool, within: float, chance: float) -> Floats:
    """Return the costs of all searches, `[SEARCHES]`."""
    rng = np.random.default_rng(0)
    places = rng.uniform(0, within, (SEARCHES, ROOMS, 2))
    ways = np.linalg.norm(places[:, :, None] - places[:, None], axis=3)
    look, likely = rng.uniform(3, 15, (SEARCHES, ROOMS)), rng.dirichlet([0.6] * ROOMS, SEARCHES)
    there = (likely.cumsum(axis=1) < rng.random((SEARCHES, 1))).sum(axis=1).clip(max=ROOMS - 1)
    luck, misses = rng.random((SEARCHES, MOST)), 1 - chance / (1 - ROOM) if alike else 1 - chance
    here, costs = np.zeros(SEARCHES, dtype=np.int64), np.zeros(SEARCHES)
    looks, going = np.zeros((SEARCHES, ROOMS)), np.ones(SEARCHES, dtype=bool)
    for turn in range(MOST):
        some = np.flatnonzero(going)
        if not len(some):
            break
        room = choose(belief, likely[some], looks[some], ways[some], look[some], here[some])
        costs[some] += ways[some, here[some], room] + look[some, room]
        here[some] = room
        looks[some, room] += 1
        going[some] = (there[some] != room) | (luck[some, turn] < misses)
    return costs


def choose(
    belief: Belief, likely: Floats, looks: Floats, ways: Floats, look: Floats, here: Ints
) -> Ints:
    """Return the next room of each search, `[E]`."""
    every, before = np.arange(len(here)), belief.misses(looks)
    now = likely * before
    now /= now.sum(axis=1, keepdims=True) * before
    missed = [belief.misses(looks + n) for n in range(belief.looks + 1)]
    finds = np.stack([now * (a - b) for a, b in pairwise(missed)], axis=1)
    from_here = np.concatenate([ways, ways[every, here][:, None]], axis=1)
    scale = APART if belief.looks > 1 else 1.0
    problem, place = pose_search(from_here, finds[..., None] * scale, look=look, single=True)
    return np.asarray(place[every, plan_search(problem)[:, 0]])


if __name__ == "__main__":
    sys.exit(main())
