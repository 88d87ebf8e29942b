"""Measure what models say at a robot's start: in small homes, and with a detector of few words.

    bsg-leaderboard hm3d --masks uniform,rooms --out board
    python scripts/measure/first_rooms.py --leaderboard board --models universal@mixed --out FIGURES

`small_homes.json` has ten homes by hand: rooms with the objects that were seen in them, half of
each, and there is one more room that was not entered.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from folds import FoldModel, Shares, bootstrap, mask_of, open_dataset, open_folds
from results import ResultsTable, format_estimate, write_figures

from bsg_data.arrays import Bools
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_data.observation.observation import Observation
from bsg_models.evaluation.measurement import predict_all
from bsg_models.robot.seen_building import SeenBuilding, open_graph
from bsg_models.zoo.model import one_thread

HOMES = Path(__file__).with_name("small_homes.json")
SINGLE = ("refrigerator", "toilet", "tv", "microwave", "stove", "dishwasher", "bathtub")
# The classes that COCO's 80 words name.
COCO = frozenset(
    (
        *("bag", "bed", "book", "bottle", "chair", "computer", "couch", "microwave", "plant"),
        *("refrigerator", "sink", "stove", "table", "tableware", "toilet", "tv", "vase"),
    )
)
Home = Mapping[str, Sequence[str]]


def open_home(home: Home, model: str, *, told: bool) -> SeenBuilding:
    """Return a small home; `told` says its kind and those of its rooms."""
    kinds = {room: {"room_type": room} if told else {} for room in home}
    ids = {room: f"r{number}" for number, room in enumerate(home)}  # names of rooms are read
    said: dict[str, Any] = {
        "scene_id": "home",
        "rooms": [{"id": ids[room], "hidden_share": 0.5, **kinds[room]} for room in home],
        "objects": [
            {"id": f"{room} {number}", "room": ids[room], "category": thing}
            for room, things in home.items()
            for number, thing in enumerate(things)
        ],
    }
    said["rooms"].append({"id": "r9", "visited": False})
    return open_graph(said | ({"building_kind": "home"} if told else {}), model=model)


def report_homes(models: Sequence[str], homes: Sequence[Home]) -> ResultsTable:
    """Return P(another one) where one was seen, the largest of the homes, and the next room."""
    rows = []
    for model in models:
        for told in (False, True):
            opened = [open_home(home, model, told=told) for home in homes]
            again = {
                thing: max(
                    place.unseen for seen in opened for place in seen.where(thing) if place.seen
                )
                for thing in SINGLE
            }
            more = [sum(one.expected for one in seen.expected("r9")) for seen in opened]
            cells = [f"{100 * chance:.0f}" for chance in again.values()]
            what = "kind of the home and of its rooms" if told else "nothing"
            rows.append([f"`{model}`", what, *cells, f"{min(more):.0f} to {max(more):.0f}"])
    reading = (
        "P(another one is hidden in a room that shows one), in per cent, the largest of ten homes "
        "written by hand; and the objects expected in a room that nobody has entered, from the "
        "home with the fewest to that with the most. Half of every other room was seen."
    )
    header = ("model", "told besides objects", *SINGLE, "objects in the next room")
    return ResultsTable("A second one in small homes", header, rows, reading)


def limit_detector(seen: Observation, known: Bools) -> Observation:
    """Return what a robot sees whose detector knows some classes `[C]` and no other word."""
    inputs, unclassified = np.where(known, seen.inputs, 0), np.zeros_like(seen.unclassified)
    return replace(seen, inputs=inputs, unclassified=unclassified, withheld=seen.withheld | ~known)


def tally_known(masked: MaskedBuildings, presence: Any, known: Bools) -> Shares:
    """Return `gap` and `loss` of the presence of known classes in rooms, and `loss/CLASS`."""
    rooms = (~masked.seen.is_building).astype(float)
    hidden, said = masked.hidden[:, known] > 0, np.clip(presence[:, known], 1e-6, 1 - 1e-6)
    loss = -np.where(hidden, np.log(said), np.log1p(-said))
    values = {"gap": (said - hidden).mean(axis=1), "loss": loss.mean(axis=1)}
    values |= {f"loss/{number}": column for number, column in enumerate(loss.T)}
    return {name: (value * rooms, rooms) for name, value in values.items()}


def report_detector(board: Path, models: Sequence[str], *, draws: int) -> ResultsTable:
    """Return how well the presence of known classes is said, with intervals over buildings."""
    rows, losses = [], []
    for name in models:
        print(f"measures {name} with a detector of few words", file=sys.stderr, flush=True)
        known = np.isin(open_dataset(board, name).manifest.class_space.classes, [*COCO])
        with one_thread():
            found = bootstrap(_ask(board, name, known, draws), resamples=1000)
        losses.append([found.point[f"loss/{number}"] for number in range(known.sum())])
        gap = format_estimate(found.estimate("gap"), signed=True)
        rows.append([f"`{name}`", gap, format_estimate(found.estimate("loss"))])
    best = np.array(losses[0])
    for row, others in zip(rows, losses, strict=True):
        row.append(f"{(best < others).sum()} of {len(best)}")
    reading = (
        f"The detector knows {len(COCO)} of the 45 classes, those that COCO has, and no other "
        "word; half of every room was seen. Presence and log-loss are of these classes in HM3D's "
        "rooms, each building predicted by a model that was not trained on it, with 95 % intervals "
        f"over buildings. The last column counts the classes where {rows[0][0]} has a lower "
        "log-loss."
    )
    header = ("model@training mask", "presence predicted − true", "log-loss", "first is better")
    return ResultsTable("A detector of few words", header, rows, reading)


def _ask(
    board: Path, name: str, known: Bools, draws: int
) -> Iterator[tuple[int, Sequence[str], Shares]]:
    for one in open_folds(board, name):
        for masked in one.stream(mask_of(one.data, "uniform"), draws=draws):
            yield one.fold, _scenes(masked), _tally(one, masked, known)


def _scenes(masked: MaskedBuildings) -> Sequence[str]:
    return [masked.seen.scene_ids[building] for building in masked.seen.building]


def _tally(one: FoldModel, masked: MaskedBuildings, known: Bools) -> Shares:
    told = masked.seen.without("labels", "floor_area")
    limited = replace(masked, seen=limit_detector(told, known))
    return tally_known(masked, predict_all(one.model, limited).presence, known)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--leaderboard", type=Path, required=True, help="its folder")
    parser.add_argument("--shipped", nargs="+", default=["universal", "ensemble", "mixture"])
    parser.add_argument("--models", nargs="+", required=True, help="NAME@MASK, the best first")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    parser.add_argument("--draws", type=int, default=3, help="masks of every building")
    options = parser.parse_args(argv)
    homes = json.loads(HOMES.read_text("utf-8"))
    tables = [
        report_homes(options.shipped, homes),
        report_detector(options.leaderboard, options.models, draws=options.draws),
    ]
    data = open_dataset(options.leaderboard, options.models[0])
    words = [__file__, *(argv or sys.argv[1:])]
    write_figures(options.out, "first_rooms", tables, argv=words, data=data)
    return 0


if __name__ == "__main__":
    sys.exit(main())
