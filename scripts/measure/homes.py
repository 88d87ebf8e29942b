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
from results import ResultsTable, format_estimate, write_figures
from scipy.stats import rankdata

from bsg_data.arrays import Bools, Floats
from bsg_models import Predictor, open_graph
from bsg_models.evaluation.bootstrap import Estimate, weigh_buildings

SURVEYED = (
    *("computer", "dishwasher", "lamp", "microwave", "refrigerator", "shower", "stove", "tv"),
    "washing machine",
)
FOUND = (
    *("bathtub", "bed", "couch", "dishwasher", "microwave", "refrigerator", "shower", "sink"),
    *("stove", "toilet", "tv", "washing machine"),
)
COLUMNS = {
    "rooms: log loss ↓": "rooms",
    "AUROC ↑": "auroc",
    "first room right ↑": "first",
    "somewhere: log loss ↓": "somewhere",
    "somewhere, said": "said",
    "somewhere, true": "true",
}
_LEAST = 1e-6


class Home(NamedTuple):
    """A home of R rooms."""

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
        homes.append(Home(graph, np.array(there)))
    return homes


def measure(
    model: str, homes: Sequence[Home], classes: Sequence[str], *, resamples: int
) -> dict[str, Floats]:
    """Return measure → its value `[1 + resamples]`, of all homes and of every resample of them."""
    predictor = Predictor(Path(model) if "/" in model else model)
    columns = [predictor.classes.index(name) for name in classes]
    said = [_expect(predictor, home)[:, columns] for home in homes]
    sums = np.array([_score(one, home.there) for one, home in zip(said, homes, strict=True)])
    weights = weigh_buildings(len(homes), resamples=resamples, seed=0).T
    totals = weights @ sums  # [W, 10]
    names = ("rooms", "first", "somewhere", "said", "true")
    found = dict(zip(names, (totals[:, ::2] / totals[:, 1::2]).T, strict=True))
    return {**found, "auroc": np.array([_rank(said, homes, own) for own in weights])}


def _expect(predictor: Predictor, home: Home) -> Floats:
    """Return P(at least one), `[1 + R, C]`, the building first."""
    return np.asarray(predictor(open_graph(home.graph, model=predictor).graph).presence)


def _score(said: Floats, there: Bools) -> list[float]:
    """Return what a home adds to each sum, and to how many it adds."""
    some, held = said[0], there.any(axis=0)
    right = there[said[1:].argmax(axis=0), np.arange(there.shape[1])][held]
    return [
        *(_loss(said[1:], there).sum(), there.size),
        *(right.sum(), len(right)),
        *(_loss(some, held).sum(), len(held)),
        *(some.sum(), len(held)),
        *(held.sum(), len(held)),
    ]


def _loss(said: Floats, true: Bools) -> Floats:
    return -np.log(np.where(true, said, 1 - said).clip(min=_LEAST))


def _rank(said: Sequence[Floats], homes: Sequence[Home], weight: Floats) -> float:
    """Return the AUROC of rooms, mean over classes, with every home so often."""
    chosen = np.repeat(np.arange(len(homes)), weight.astype(int))
    p = np.concatenate([said[one][1:] for one in chosen])
    there = np.concatenate([homes[one].there for one in chosen])
    found = []
    for own, true in zip(p.T, there.T, strict=True):
        ones = int(true.sum())
        if 0 < ones < len(true):
            area = rankdata(own)[true].sum() - ones * (ones + 1) / 2
            found.append(area / (ones * (len(true) - ones)))
    return float(np.mean(found))


def report_homes(options: argparse.Namespace, folder: Path) -> ResultsTable:
    """Return a table of all models on the homes of a folder."""
    classes = FOUND if options.only_presence else SURVEYED
    homes = read_homes(folder, classes)
    found = {}
    for model in options.models:
        print(f"measures {model} on {folder.name}", file=sys.stderr, flush=True)
        found[model] = measure(model, homes, classes, resamples=options.resamples)
    columns = {
        title: name
        for title, name in COLUMNS.items()
        if name in ("auroc", "first") or not options.only_presence
    }
    first = found[options.models[0]]
    rows = []
    for model, values in found.items():
        cells = [_format(values[name]) for name in columns.values()]
        if not options.only_presence:
            cells.append(_format(values["rooms"] - first["rooms"], signed=True))
        rows.append([f"`{Path(model).name}`", *cells])
    against = () if options.only_presence else (f"rooms, against `{options.models[0]}`",)
    rooms = sum(len(home.there) for home in homes)
    reading = (
        f"{len(homes)} homes, {rooms} rooms, {len(classes)} classes: {', '.join(classes)}. "
        "Intervals are of 95 %, over homes."
    )
    return ResultsTable(folder.name, ("model", *columns, *against), rows, reading)


def _format(values: Floats, *, signed: bool = False) -> str:
    low, high = np.nanpercentile(values[1:], [2.5, 97.5]).tolist()
    return format_estimate(Estimate(float(values[0]), low, high, 0), digits=3, signed=signed)


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
