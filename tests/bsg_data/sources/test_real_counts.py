"""Real sources, counted building by building by a parser of a few lines that shares nothing."""

from __future__ import annotations

import csv
import gzip
import io
import json
import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import openpyxl
import pytest
from conftest import REPOSITORY

from bsg_data import build_dataset, open_source
from bsg_data.dataset.dataset import Dataset
from bsg_data.scene.class_map import load_class_map

SHARED = REPOSITORY.parent / "shared"
Counts = Mapping[str, tuple[int, int]]  # scene → rooms and objects


def count_texts(folder: Path) -> Counts:
    found = {}
    for path in folder.rglob("*.semantic.txt"):
        rows = [line for line in path.read_text("utf-8").split("\n")[1:] if line.strip()]
        regions = {int(row.rpartition(",")[2]) for row in rows}
        found[path.parent.name] = sum(region >= 0 for region in regions), len(rows)
    return found


def count_statistics(path: Path) -> Counts:
    found: dict[str, tuple[int, int]] = {}
    with zipfile.ZipFile(path) as archive:
        (name,) = (
            n for n in archive.namelist() if n.endswith("Per_Scene_Region_Neighborhoods.csv")
        )
        text = io.StringIO(archive.read(name).decode())
    for scene, region, _, objects, *_ in list(csv.reader(text))[1:]:
        rooms, number = found.get(scene, (0, 0))
        found[scene] = rooms + (int(region) >= 0), number + int(objects)
    return found


def count_houses(path: Path) -> Counts:
    found = {}
    with gzip.open(path, "rt", encoding="utf-8") as lines:
        for number, line in enumerate(lines):
            house = json.loads(line)
            found[f"{number:05d}"] = len(house["rooms"]), count_things(house["objects"])
    return found


def count_things(things: list[dict[str, Any]]) -> int:
    return sum(1 + count_things(thing.get("children", [])) for thing in things)


def count_matterport(folder: Path) -> Counts:
    found = {}
    for path in folder.glob("*.house.gz"):
        with gzip.open(path, "rt") as file:
            lines = [line.split() for line in file if line.strip()]
        regions = [line for line in lines if line[0] == "R" and len(line) != 15]
        rooms = sum(line[5] != "Z" for line in regions)
        found[path.name.partition(".")[0]] = rooms, sum(line[0] == "O" for line in lines)
    return found


def count_sheets(path: Path) -> Counts:
    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    sheets = {name: list(book[name].iter_rows(values_only=True)) for name in ("Space", "Component")}
    spaces = {str(row[0]).strip().casefold() for row in sheets["Space"][1:] if row[0]}
    return {path.stem: (len(spaces), sum(any(row) for row in sheets["Component"][1:]))}


def count_listing(path: Path) -> Counts:
    found: dict[str, tuple[set[str], int]] = {}
    for name in json.loads(path.read_text("utf-8"))[1:]:  # the first has no label
        match = re.fullmatch(r"(.*?)_(\d+)_(.*?)_(\d+)_(.*)", name)
        assert match
        _, _, room, number, area = match.groups()
        rooms, objects = found.get(f"area_{area}", (set(), 0))
        found[f"area_{area}"] = rooms | {f"{room}_{number}"}, objects + 1
    return {area: (len(rooms), objects) for area, (rooms, objects) in found.items()}


CLINIC = "sources/clinic_cobie.xlsx"


@pytest.mark.parametrize(
    ("kind", "place", "count", "scenes", "known"),
    [
        ("hm3d", "hm3d/annotations", count_texts, 145, (0, 0)),
        ("hm3d-stats", "hm3d/HM3DSem-v0.2-train.zip", count_statistics, 145, (0, 0)),
        ("procthor", "sources/procthor_150_houses.jsonl.gz", count_houses, 150, (937, 731)),
        ("mp3d", "sources", count_matterport, 2, (24, 28)),
        ("s3dis", "sources/s3dis_semantic_labels.json", count_listing, 5, (204, 0)),
        pytest.param("cobie", CLINIC, count_sheets, 1, (226, 223), marks=pytest.mark.heavy),
    ],
)
def test_every_building_has_the_rooms_and_objects_of_its_file(
    kind: str,
    place: str,
    count: Callable[[Path], Counts],
    scenes: int,
    known: tuple[int, int],
    tmp_path: Path,
) -> None:
    """Its map has a row for every name; rooms have labels and connections."""
    path = SHARED / place
    if not path.exists():
        pytest.skip(f"../shared/{place} is not on this machine")
    totals = build_dataset(open_source(kind, path), tmp_path / "dataset").totals
    dataset = Dataset.open(tmp_path / "dataset")
    columns = ["scene_id", "num_rooms", "num_objects"]
    rows = dataset.read_table("scenes", columns=columns).to_pylist()
    cut = 5 if kind == "procthor" else None  # an id has a hash behind the number of its line
    found = {row["scene_id"][:cut]: (row["num_rooms"], row["num_objects"]) for row in rows}
    assert found == count(path)
    assert (len(found), totals.unmapped, (totals.labelled, totals.adjacent)) == (scenes, 0, known)
    if kind == "s3dis":
        names = dataset.read_table("objects", columns=["raw_category"])["raw_category"]
        assert set(names.to_pylist()) == set(load_class_map("s3dis45-v1").entries)
