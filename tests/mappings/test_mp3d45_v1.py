"""What mappings/README.md says of mp3d45-v1, proved on the files and on the real houses."""

from __future__ import annotations

import csv
from collections import Counter
from importlib.resources import files

import pytest
from conftest import REPOSITORY

from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import HOUSE as HOUSE_BOUND
from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.annotation_files import decode
from bsg_data.sources.mp3d import parse_house

HOUSE = REPOSITORY.parent / "shared" / "sources" / "17DRP5sb8fy.house.gz"
OURS, HM3D = load_class_map("mp3d45-v1"), load_class_map("hm3d45-v2")


def test_a_name_that_hm3d_has_means_the_same() -> None:
    shared = {name: entry for name in OURS.entries if (entry := HM3D.lookup(name)) is not None}
    assert len(shared) == 928
    assert {name: OURS.entries[name] for name in shared} == shared


def test_what_the_readme_counts() -> None:
    entries = OURS.entries.values()
    classes = {entry.class_index for entry in entries if entry.class_index is not None}
    assert len(entries) == 1659
    assert len(classes) == 45
    roles = Counter(OURS.classify(name).role for name in OURS.entries)
    assert roles == {"classified": 548, "structure": 467, "left-out": 621, "nameless": 23}
    rows = files("bsg_mappings").joinpath("mp3d45-v1.structure.csv").read_text("utf-8").split("\n")
    assert rows[1:-1] == sorted(rows[1:-1])
    categories = {entry.category for entry in entries}
    assert OURS.structure <= categories, "only what the map has"


@pytest.mark.parametrize(
    ("name", "category", "class_name"),
    [
        ("wall /otherroom", "wall", None),
        ("door / other room", "door", None),
        ("picture \\other room", "picture", "picture"),
        ("remove", "unknown", None),
        ("paingitn", "painting", "picture"),
        ("bed side table", "bedside table", "nightstand"),
        ("fireplace /w art", "fireplace", None),
        ("art / deer statue", "statue", None),
        ("wall behind stove", "wall", None),
        ("coffee table leg", "coffee table leg", None),
        ("television table", "tv stand", "cabinet"),
        ("dushbin", "trash can", "garbage bin"),
    ],
)
def test_names_that_only_matterport3d_has(name: str, category: str, class_name: str | None) -> None:
    entry = OURS.entries[name]
    index = entry.class_index
    assert (entry.category, None if index is None else OURS.classes[index]) == (
        category,
        class_name,
    )


@pytest.mark.skipif(not HOUSE.is_file(), reason="no samples here")
def test_every_name_of_a_house_has_a_row() -> None:
    house = parse_house(decode(read_bytes(HOUSE, HOUSE_BOUND), path=HOUSE), path=HOUSE)
    with files("bsg_mappings").joinpath("mp3d45-v1.csv").open(encoding="utf-8") as file:
        listed = [row["raw_category"] for row in csv.DictReader(file)]
    assert sorted(house.categories) == listed
