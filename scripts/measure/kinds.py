"""Count which things rooms of each kind have, and measure how well kinds are inferred.

    bsg-data build --hm3d PATH --no-meshes --room-layouts PATH --out hm3d
    python scripts/measure/kinds.py --hm3d hm3d --mp3d ../shared/sources/mp3d_reverie \
        --counts mappings/kind-counts-v1.csv

A home is read as a robot tells it: things in rooms, and no label. The kinds of its rooms are
inferred by the table by hand, and by what was counted in the other homes, too.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from bsg_data.arrays import Floats
from bsg_data.files import write_bytes
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.room_label import label_of
from bsg_models.robot.kinds import KindTable, infer_kinds, list_seen, read_kinds

_FOLDS = 5
_FEWEST_ROOMS = 5  # that have a thing
_FEWEST_THINGS = {"HM3D": 1, "Matterport3D": 3}  # of a room that is asked about
_NOTED = {"HM3D": 1.0, "Matterport3D": 0.63}  # share of the things of the rooms
_SEEN = (1.0, 0.5)
_SPACE = load_class_map().space


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
        seen = ((number[room], str(name)) for room, name in zip(things.room, things.category))
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
        for number, area in enumerate(areas)
    )
    objects = tuple(
        SeenObject(str(number), int(room), name, name, None)
        for number, (room, name) in enumerate(seen)
    )
    graph = PartialGraph(scene, _SPACE, 1 - _NOTED[source], rooms, objects, adjacency)
    return Home(source, graph, tuple(kinds))


def count(homes: Iterable[Home], table: KindTable) -> tuple[Floats, Floats]:
    """Return in how many rooms of each kind a thing was, `[K, T]`, and of how many, `[K, 1]`."""
    seen, rooms = np.zeros(table.presence.shape), np.zeros((len(table.kinds), 1))
    for home in homes:
        for kind, things in zip(home.kinds, list_seen(home.graph, table), strict=True):
            if kind in table.column:
                rooms[table.column[kind]] += _NOTED[home.source]
                seen[table.column[kind], things] += 1
    return seen, rooms


def write_counts(homes: Sequence[Home], table: KindTable, path: Path) -> None:
    """Write the table of counts, without what is in few rooms."""
    seen, rooms = count(homes, table)
    lines = ["kind,thing,seen,rooms"]
    for row, kind in enumerate(table.kinds):
        for column, thing in enumerate(table.things):
            if seen[:, column].sum() >= _FEWEST_ROOMS and seen[row, column]:
                lines.append(f"{kind},{thing.name},{seen[row, column]:.0f},{rooms[row, 0]:.0f}")
    write_bytes(path, ("\n".join(lines) + "\n").encode())


def thin(home: Home, share: float, rng: np.random.Generator) -> Home:
    """Return a home of which a robot has seen a share of the things."""
    kept = tuple(one for one in home.graph.objects if rng.random() < share)
    rooms = tuple(
        replace(room, hidden_share=1 - share * (1 - room.hidden_share)) for room in home.graph.rooms
    )
    return replace(home, graph=replace(home.graph, rooms=rooms, objects=kept))


def judge(homes: Sequence[Home], tables: Sequence[KindTable]) -> str:
    """Return how often the likeliest kind is right, and the log loss; a table for each home."""
    right, loss = [], []
    for home, table in zip(homes, tables, strict=True):
        found = infer_kinds(home.graph, table)
        number = [0] * (1 + len(home.kinds))
        for obj in home.graph.objects:
            number[obj.room_index] += 1
        for row, kind, things in zip(found.rooms, home.kinds, number[1:], strict=True):
            if kind in table.column and things >= _FEWEST_THINGS[home.source]:
                right.append(row.argmax() == table.column[kind])
                loss.append(-math.log(max(row[table.column[kind]], 1e-9)))
    return f"{len(right):6,} {np.mean(right):7.3f} {np.mean(loss):9.2f}"


def main() -> None:
    """Count and measure."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--hm3d", type=Path, required=True, help="a dataset with room layouts")
    parser.add_argument("--mp3d", type=Path, required=True, help="its folder of tables")
    parser.add_argument("--counts", type=Path, help="write the table of counts here")
    options = parser.parse_args()
    homes = [*read_hm3d(options.hm3d), *read_mp3d(options.mp3d)]
    hand = read_kinds(counted=False)
    if options.counts:
        write_counts(homes, hand, options.counts)
    fold = {home.graph.scene_id: number % _FOLDS for number, home in enumerate(homes)}
    learned = [
        hand.learn(*count([h for h in homes if fold[h.graph.scene_id] != number], hand))
        for number in range(_FOLDS)
    ]
    print("homes         seen  table     rooms   right  log loss")
    for source in _NOTED:
        for share in _SEEN:
            rng = np.random.default_rng(0)
            some = [thin(home, share, rng) for home in homes if home.source == source]
            by_fold = [learned[fold[home.graph.scene_id]] for home in some]
            print(f"{source:13} {share:.2f}  by hand  {judge(some, [hand] * len(some))}")
            print(f"{source:13} {share:.2f}  counted  {judge(some, by_fold)}")


if __name__ == "__main__":
    main()
