"""Measure models on homes of other people: rooms are labelled, and nobody has entered any.

    python scripts/measure/homes.py --homes REFIT --models universal mixture --out FIGURES

HOMES is a folder with objects.csv (scene, room, class, count) and rooms.csv (scene, room,
room_label, and area where it is known). A class whose absence says nothing has no loss.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from folds import Shares, bootstrap
from results import ResultsTable, format_estimate, write_figures

from bsg_data.arrays import Bools, Floats
from bsg_models import Predictor, open_graph
from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.evaluation.measurement import Fold, measure
from bsg_models.evaluation.truth import Truth

SURVEYED = (
    *("computer", "dishwasher", "lamp", "microwave", "refrigerator", "shower", "stove", "tv"),
    "washing machine",
)
FOUND = (
    *("bathtub", "bed", "couch", "dishwasher", "microwave", "refrigerator", "shower", "sink"),
    *("stove", "toilet", "tv", "washing machine"),
)
AUROC = "rooms/presence_auroc_macro/unvisited"
COLUMNS = {
    "rooms: log loss ↓": "rooms",
    "AUROC ↑": AUROC,
    "first room right ↑": "first",
    "somewhere: log loss ↓": "somewhere",
    "somewhere, said": "said",
    "somewhere, true": "true",
}
_LEAST = 1e-6


class Home(NamedTuple):
    """A home of R rooms."""

    name: str
    graph: dict[str, object]
    there: Bools  # [R, A] whether a room has an object of a class


def read_homes(folder: Path, classes: Sequence[str]) -> list[Home]:
    """Return the homes of a folder, in the order of their names."""
    objects, rooms = (pd.read_csv(folder / f"{name}.csv") for name in ("objects", "rooms"))
    objects = objects[objects["count"] > 0]
    held = set(objects[["scene", "room", "class"]].itertuples(index=False, name=None))
    homes = []
    for scene, own in rooms.groupby("scene"):
        told = [
            {"id": str(row.room), "visited": False}
            | ({"room_type": row.room_label} if isinstance(row.room_label, str) else {})
            | ({"floor_area": float(row.area)} if getattr(row, "area", 0) > 0 else {})
            for row in own.itertuples()
        ]
        there = [[(scene, room, one) in held for one in classes] for room in own["room"]]
        graph = {"scene_id": str(scene), "building_kind": "home", "rooms": told, "objects": []}
        homes.append(Home(str(scene), graph, np.array(there)))
    return homes


def measure_model(
    model: str, homes: Sequence[Home], classes: Sequence[str], *, resamples: int
) -> Bootstrap:
    """Return the measures of a model, and their values on resamples of the homes."""
    predictor = Predictor(Path(model) if "/" in model else model)
    columns = [predictor.classes.index(name) for name in classes]
    asked = np.isin(np.arange(len(predictor.classes)), columns)
    batches, shares = [], []
    for home in homes:
        expectation = predictor(open_graph(home.graph, model=predictor).graph)
        batches.append((_tell_truth(home, columns, asked), expectation))
        scenes = [home.name] * len(expectation.inputs)
        shares.append((0, scenes, _tally(expectation.presence[:, columns], home.there)))
    ranked = measure([Fold([home.name for home in homes], batches)], resamples=resamples)
    means = bootstrap(shares, resamples=resamples)
    return Bootstrap(
        means.point | ranked.point, means.resampled | ranked.resampled, means.nodes | ranked.nodes
    )


def _tell_truth(home: Home, columns: Sequence[int], asked: Bools) -> Truth:
    """Return what is in a home of which nothing was seen, the building first."""
    targets = np.zeros((1 + len(home.there), len(asked)))
    targets[1:, columns] = home.there
    targets[0] = targets[1:].sum(axis=0)
    first = np.arange(len(targets)) == 0
    return Truth(
        inputs=np.zeros_like(targets),
        targets=targets,
        is_building=first,
        visited=first,
        building=np.zeros(len(targets), dtype=np.int64),
        draw=np.zeros(len(targets), dtype=np.int64),
        scene_ids=(home.name,),
        nameable=np.tile(asked, (len(targets), 1)),
    )


def _tally(said: Floats, there: Bools) -> Shares:
    """Return what each node adds to each mean, and the number of its cells."""
    every = np.concatenate([there.any(axis=0, keepdims=True), there])
    loss = -np.log(np.where(every, said, 1 - said).clip(min=_LEAST))
    whole = np.arange(len(every)) == 0
    right = (there[said[1:].argmax(axis=0), np.arange(there.shape[1])] & every[0]).sum()
    classes = np.full(len(every), there.shape[1])
    return {
        "rooms": (loss.sum(axis=1) * ~whole, classes * ~whole),
        "first": (right * whole, every[0].sum() * whole),
        "somewhere": (loss.sum(axis=1) * whole, classes * whole),
        "said": (said.sum(axis=1) * whole, classes * whole),
        "true": (every.sum(axis=1) * whole, classes * whole),
    }


def report_homes(options: argparse.Namespace, folder: Path) -> ResultsTable:
    """Return a table of all models on the homes of a folder."""
    classes = FOUND if options.only_presence else SURVEYED
    homes = read_homes(folder, classes)
    found = {}
    for model in options.models:
        print(f"measures {model} on {folder.name}", file=sys.stderr, flush=True)
        found[model] = measure_model(model, homes, classes, resamples=options.resamples)
    columns = {
        title: name
        for title, name in COLUMNS.items()
        if name in (AUROC, "first") or not options.only_presence
    }
    first = found[options.models[0]]
    rows = []
    for model, values in found.items():
        cells = [format_estimate(values.estimate(name), digits=3) for name in columns.values()]
        if not options.only_presence:
            difference = values.difference(first, "rooms")
            cells.append(format_estimate(difference, digits=3, signed=True))
        rows.append([f"`{Path(model).name}`", *cells])
    against = () if options.only_presence else (f"rooms, against `{options.models[0]}`",)
    rooms = sum(len(home.there) for home in homes)
    reading = (
        f"{len(homes)} homes, {rooms} rooms, {len(classes)} classes: {', '.join(classes)}. "
        "Intervals are of 95 %, over homes."
    )
    return ResultsTable(folder.name, ("model", *columns, *against), rows, reading)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--homes", type=Path, required=True, help="folder")
    parser.add_argument("--models", nargs="+", required=True, help="shipped models, or runs")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    parser.add_argument("--only-presence", action="store_true", help="absence says nothing")
    parser.add_argument("--resamples", type=int, default=500)
    options = parser.parse_args(argv)
    table = report_homes(options, options.homes)
    words = [__file__, *(argv or sys.argv[1:])]
    name = "found_homes" if options.only_presence else "surveyed_homes"
    write_figures(options.out, name, [table], argv=words)
    return 0


if __name__ == "__main__":
    sys.exit(main())
