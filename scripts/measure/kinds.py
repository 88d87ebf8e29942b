"""Measure how well the kinds of rooms are inferred without labels, and the scale of answers.

    bsg-data build --hm3d PATH --no-meshes --room-layouts PATH --out hm3d
    python scripts/measure/kinds.py --hm3d hm3d --mp3d PATH --refit PATH \
        --out docs/results/figures.json

The folder of `--mp3d` has rooms.csv (scene, room, room_label) and objects.csv (scene, room,
category). People labelled rooms of 50 homes of HM3D's train split, and those of Matterport3D. The
tables that are read were written by hand; no room taught them anything.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pandas as pd
from folds import READS
from results import ResultsTable, write_figures

from bsg_data.arrays import Bools
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.room_label import label_of
from bsg_models import Predictor
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_robot import SeenBuilding, open_graph
from bsg_robot.answers import posterior
from bsg_robot.answers.kind_table import read_kinds
from bsg_robot.answers.kinds import infer_kinds
from bsg_robot.answers.usual_places import OF_HOMES
from bsg_robot.things.things import classify_seen

_FEWEST_THINGS = {"HM3D": 1, "Matterport3D": 3}  # of a room that is asked about
_NOTED = {"HM3D": 1.0, "Matterport3D": 0.63}  # share of the things of the rooms
_SEEN = (1.0, 0.5)
_ASKED = (
    *("bathtub", "bed", "couch", "dishwasher", "microwave", "refrigerator", "shower", "sink"),
    *("stove", "toilet", "tv", "washing machine"),
)
_SURVEYED = (
    *("computer", "dishwasher", "lamp", "microwave", "refrigerator", "shower", "stove", "tv"),
    "washing machine",
)
_WEIGHTS = (0.0, 0.2, 0.4, 0.6, 1.0)
_CLASS_MAP = load_class_map()


@dataclass(frozen=True)
class Home:
    """A home as a robot tells it, and the kinds of its rooms by people."""

    source: str
    graph: PartialGraph
    kinds: tuple[str | None, ...]


def read_hm3d(folder: Path) -> Iterator[Home]:
    """Yield the homes of a dataset in which people labelled rooms."""
    rooms, objects, edges = (
        pd.read_parquet(folder / name) for name in ("rooms", "objects", "edges")
    )
    objects = objects[objects.role != "structure"]
    doors = edges[(edges.source_kind == "room") & (edges.target_kind == "room")]
    for scene, known in rooms.groupby("scene_id", observed=True):
        if known.label.isna().all():
            continue
        beside = doors[doors.scene_id == scene][["source_index", "target_index"]]
        things = objects[(objects.scene_id == scene) & (objects.room_index > 0)]
        areas = [None if math.isnan(area) else float(area) for area in known.floor_area]
        seen = zip(things.room_index, things.category.astype(str), strict=True)
        yield _make(
            "HM3D",
            str(scene),
            areas,
            [label if isinstance(label, str) else None for label in known.label],
            seen,
            adjacency=tuple((int(one), int(two)) for one, two in beside.itertuples(index=False)),
        )


def read_mp3d(folder: Path) -> Iterator[Home]:
    """Yield the homes of Matterport3D, of whose things some were noted."""
    rooms = pd.read_csv(folder / "rooms.csv", dtype=str)
    objects = pd.read_csv(folder / "objects.csv", dtype=str)
    for scene, known in rooms.groupby("scene"):
        number = {room: index for index, room in enumerate(known.room, 1)}
        things = objects[(objects.scene == scene) & objects.room.isin(number)]
        labels = [label_of("mp3d", said) or label_of("any", said) for said in known.room_label]
        seen = zip(map(number.__getitem__, things.room), things.category.astype(str), strict=True)
        yield _make("Matterport3D", str(scene), [None] * len(known), labels, seen)


def _make(
    source: str,
    scene: str,
    areas: Sequence[float | None],
    kinds: Sequence[str | None],
    seen: Iterable[tuple[int, str]],
    *,
    adjacency: tuple[tuple[int, int], ...] = (),
) -> Home:
    rooms = tuple(
        KnownRoom(f"R{number}", 1 - _NOTED[source], floor_area=area)
        for number, area in enumerate(areas, 1)
    )
    objects = []
    for number, (room, name) in enumerate(seen):
        read = classify_seen(name, _CLASS_MAP)
        facts = (name, read.category, read.class_index)
        objects.append(SeenObject(str(number), int(room), *facts))
    share = 1 - _NOTED[source]
    graph = PartialGraph(scene, _CLASS_MAP.space, share, rooms, tuple(objects), adjacency)
    return Home(source, graph, tuple(kinds))


def thin(home: Home, share: float, rng: np.random.Generator) -> Home:
    """Return a home of which a robot has seen a share of the things."""
    kept = tuple(one for one in home.graph.objects if rng.random() < share)
    rooms = tuple(
        replace(room, hidden_share=1 - share * (1 - room.hidden_share)) for room in home.graph.rooms
    )
    return replace(home, graph=replace(home.graph, rooms=rooms, objects=kept))


def judge(homes: Sequence[Home]) -> list[str]:
    """Return the number of rooms, how often the likeliest kind is right, and the log loss."""
    table, right, loss = read_kinds(), [], []
    for home in homes:
        found = infer_kinds(home.graph, table)
        number = np.bincount(
            [obj.room_index for obj in home.graph.objects], minlength=1 + len(home.kinds)
        )
        for row, kind, things in zip(found.rooms, home.kinds, number[1:], strict=True):
            if kind in table.column and things >= _FEWEST_THINGS[home.source]:
                right.append(row.argmax() == table.column[kind])
                loss.append(-math.log(max(row[table.column[kind]], 1e-9)))
    return [f"{len(right):,}", f"{np.mean(right):.3f}", f"{np.mean(loss):.2f}"]


def report_kinds(homes: Sequence[Home]) -> ResultsTable:
    """Return how well kinds are inferred, with all noted things seen and with half of them."""
    rows = []
    for source in _NOTED:
        for share in _SEEN:
            rng = np.random.default_rng(0)
            some = [thin(home, share, rng) for home in homes if home.source == source]
            rows.append([source, f"{share:.0%}", *judge(some)])
    noted, fewest = _NOTED["Matterport3D"], _FEWEST_THINGS["Matterport3D"]
    reading = (
        f"Rooms of HM3D with a thing or more, and of Matterport3D, where {noted:.0%} of the things "
        f"were noted, with {fewest} or more."
    )
    header = ("homes", "things seen", "rooms", "likeliest kind right", "log loss")
    return ResultsTable("kinds", header, rows, reading, tested_on="chosen")


def find_first(homes: Sequence[Home], predictor: Predictor, *, told: bool) -> list[bool]:
    """Return whether the first room that is named for a class has one, of each home that has one.

    A robot has seen all things that were noted, but those of the class.
    """
    right = []
    for home in homes:
        kinds = home.kinds if told else [None] * len(home.kinds)
        rooms = [replace(r, room_type=k) for r, k in zip(home.graph.rooms, kinds, strict=True)]
        for asked in _ASKED:
            index = _CLASS_MAP.space.class_index(asked)
            there = {obj.room_index for obj in home.graph.objects if obj.class_index == index} - {0}
            if there:
                left = tuple(obj for obj in home.graph.objects if obj.class_index != index)
                graph = replace(home.graph, rooms=tuple(rooms), objects=left, more_rooms=0)
                first = SeenBuilding(graph, predictor).where(asked)[0].room
                right.append(first in {f"R{number}" for number in there})
    return right


def report_first(homes: Sequence[Home], models: Sequence[str]) -> ResultsTable:
    """Return how often the first room is right, with kinds of rooms told and not told."""
    rows = []
    for model in models:
        print(f"asks {model}", file=sys.stderr, flush=True)
        predictor = Predictor(Path(model) if "/" in model else model)
        right = [np.mean(find_first(homes, predictor, told=one)) for one in (True, False)]
        reads = "yes" if predictor.reads_labels else "–"
        rows.append([f"`{Path(model).name}`", reads, *(f"{one:.3f}" for one in right)])
    reading = f"Twelve classes: {', '.join(_ASKED)}. What was noted of each was not seen."
    header = ("model", READS, "labels told ↑", "no labels told ↑")
    return ResultsTable("first room", header, rows, reading, tested_on="chosen")


def read_refit(folder: Path) -> list[tuple[dict[str, object], Bools]]:
    """Return homes that nobody has entered, and which rooms have one of each class, `[R, A]`."""
    objects, rooms = (pd.read_csv(folder / f"{name}.csv") for name in ("objects", "rooms"))
    objects = objects[objects["count"] > 0]
    held = set(objects[["scene", "room", "class"]].itertuples(index=False, name=None))
    homes = []
    for scene, own in rooms.groupby("scene"):
        told = [
            {"id": str(row.room), "visited": False}
            | ({"room_type": row.room_label} if isinstance(row.room_label, str) else {})
            | ({"floor_area": float(row.area)} if row.area > 0 else {})
            for row in own.itertuples()
        ]
        there = [[(scene, room, one) in held for one in _SURVEYED] for room in own["room"]]
        graph = {"scene_id": str(scene), "building_kind": "home", "rooms": told, "objects": []}
        homes.append((graph, np.array(there)))
    return homes


def report_scale(homes: Sequence[tuple[dict[str, object], Bools]], model: str) -> ResultsTable:
    """Return what weights of the rate of homes do to answers, and the weight that is ours."""
    predictor, rows = Predictor(model), []
    for weight in _WEIGHTS:
        with patch.object(posterior, "OF_HOMES", weight):
            rows.append([f"{weight:g}", *_judge_homes(homes, predictor)])
    reading = (
        f"{len(homes)} homes of REFIT, labels told, nobody inside; {len(_SURVEYED)} classes. "
        f"Ours is {OF_HOMES:g}, by `{model}`."
    )
    header = (
        *("weight of homes", "rooms: log loss ↓", "somewhere: log loss ↓", "somewhere, said"),
        *("somewhere, true", "first room right ↑"),
    )
    return ResultsTable("one scale", header, rows, reading, tested_on="chosen")


def _judge_homes(
    homes: Sequence[tuple[dict[str, object], Bools]], predictor: Predictor
) -> list[str]:
    rooms, somewhere, right = [], [], []
    for graph, there in homes:
        seen = open_graph(graph, model=predictor)
        for asked, held in zip(_SURVEYED, there.T, strict=True):
            likely = {place.room: place.probability for place in seen.where(asked)}
            said = np.array([likely[room] for room in seen.rooms])
            rooms += [*np.where(held, said, 1 - said)]
            somewhere.append((seen.anywhere(asked), held.any()))
            if held.any():
                right.append(held[said.argmax()])
    said, true = np.array(somewhere).T
    losses = (rooms, np.where(true, said, 1 - said))
    means = [-np.log(np.clip(one, 1e-6, 1.0)).mean() for one in losses]
    return [f"{one:.3f}" for one in (*means, said.mean(), true.mean(), np.mean(right))]


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--hm3d", type=Path, required=True, help="a dataset with room layouts")
    parser.add_argument("--mp3d", type=Path, required=True, help="its folder of tables")
    parser.add_argument("--refit", type=Path, required=True, help="its folder of tables")
    parser.add_argument("--models", nargs="+", default=["universal"], help="names, or runs")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    options = parser.parse_args(argv)
    found = [*read_mp3d(options.mp3d)]
    tables = [
        report_kinds([*read_hm3d(options.hm3d), *found]),
        report_first(found, options.models),
        report_scale(read_refit(options.refit), options.models[0]),
    ]
    words = [__file__, *(argv or sys.argv[1:])]
    files = [folder / "objects.csv" for folder in (options.mp3d, options.refit)]
    write_figures(options.out, "kinds", tables, argv=words, files=files)
    return 0


if __name__ == "__main__":
    sys.exit(main())
