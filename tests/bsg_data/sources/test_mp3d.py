"""Matterport3D's houses: one by hand, folders and packed files, and the real ones."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest
from conftest import REPOSITORY
from house_files import HOUSE, change

from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Box, SceneGraph
from bsg_data.sources.catalogue import SOURCES, open_source
from bsg_data.sources.mp3d import _parse_house
from bsg_data.testing import SourceContract

TRIMMED = REPOSITORY.parent / "shared" / "cases" / "01-mp3d-house-trimmed" / "flat.house"
ROW = SOURCES["mp3d"]
PATH = Path("house.house")


class TestMatterportHouses(SourceContract):
    """The contract of all sources, on two houses."""

    name = "mp3d"

    def write_example(self, folder: Path) -> Path:
        write_house(folder / "v1" / "17DRP5sb8fy" / "house_segmentations" / "17DRP5sb8fy.house")
        write_house(folder / "packed" / "x8F5xyUWy9e.house.gz")
        return folder


def write_house(path: Path, text: str = HOUSE) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    packed = path.suffix == ".gz"
    path.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
    return path


def read(path: Path) -> SceneGraph:
    """Return the only house of a path."""
    source = open_source("mp3d", path)
    (ref,) = source.find().scenes
    return source.read(ref, load_class_map(ROW.class_map)).graph


def test_a_house_by_hand(tmp_path: Path) -> None:
    graph = read(write_house(tmp_path / "abc.house"))
    assert (graph.scene_id, graph.source, graph.up_axis) == ("abc", "mp3d", None)
    kitchen, bedroom = graph.rooms
    assert (kitchen.region_id, kitchen.source_label, kitchen.label) == (0, "kitchen", "kitchen")
    assert kitchen.box == Box((0, 0, 0), (4, 4, 2.5))
    assert kitchen.floor_area == 12, "16 m² without the corner of 4 m²"
    assert kitchen.footprint is not None
    assert set(kitchen.footprint) == {(0, 0), (4, 0), (4, 2), (2, 4), (0, 4)}, "the convex hull"
    assert (bedroom.floor_z, bedroom.floor_index) == (0.1, 0)
    assert bedroom.floor_area == pytest.approx(15.6)
    assert bedroom.centroid == pytest.approx((6.05, 2, 1.3))
    (edge,) = graph.adjacency
    assert (edge.source, edge.target, edge.method) == (1, 2, "door")
    assert [(obj.instance_id, obj.room_index, obj.raw_category) for obj in graph.objects] == [
        (0, 1, "coffee table"),
        (1, 2, "bed"),
        (2, 2, ""),
        (3, 0, "wall"),
        (4, 0, "wall /otherroom"),
    ], "what is in no room and in a mirror is the building's"
    assert graph.objects[0].centroid == (1, 1, 0.25)
    turned = graph.objects[1].box  # a square of 2 m turned by 45 degrees is 2 √2 m wide
    assert turned is not None
    assert turned.minimum == pytest.approx((6 - 2**0.5, 2 - 2**0.5, 0), abs=1e-6)
    assert turned.maximum == pytest.approx((6 + 2**0.5, 2 + 2**0.5, 1), abs=1e-6)
    assert graph.objects[2].box is None, "radii below 0 are an empty box"


def test_levels_are_counted_from_the_bottom(tmp_path: Path) -> None:
    text = HOUSE.replace("4 3 1 1  0", "4 3 1 2  0").replace(
        "L  0  0  -  4 2 0  0 0 0  8 4 3  0 0 0 0 0",
        "L  0  0  -  4 2 3  0 0 3  8 4 6  0 0 0 0 0\nL  1  0  -  4 2 0  0 0 0  8 4 3  0 0 0 0 0",
    )
    # Without a level of every room, the floors decide.
    for level, expected in (("1", [1, 0]), ("-1", [0, 0])):
        house = write_house(tmp_path / "a.house", text.replace("R  1 0", f"R  1 {level}"))
        assert [room.floor_index for room in read(house).rooms] == expected


def test_a_portal_may_be_written_as_an_r_and_an_empty_region_inside_out() -> None:
    text = change("P  0 0 1", "R  0 1 0  D  4 1 0  4.1 2 2  0 0 0 0")
    assert _parse_house(text.encode(), path=PATH).portals == {(0, 1)}
    empty = "R  2 -1  0 0  -  0 0 0  1e+30 1e+30 1e+30  -1e+30 -1e+30 -1e+30  0  0 0 0 0"
    house = _parse_house(change("R  2", empty).encode(), path=PATH)
    assert (house.regions[2].box, house.regions[2].level) == (None, -1)


def without(*kinds: str) -> str:
    """Return the house without its lines of some kinds, which H still counts."""
    lines = (line for line in HOUSE.split("\n") if not line.startswith(kinds))
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("kinds", "reasons"),
    [
        (["P  00eb", "I", "E"], []),
        (["V  5"], ["H counts 10 V lines, and 9 are there"]),
        (["V", "S"], ["H counts 10 V lines, and 0", "H counts 2 S lines, and 0"]),
        (["V", "S  1"], ["H counts 10 V lines, and 0", "H counts 2 S lines, and 1"]),
        (["P  0 0 1"], ["H counts 1 portal lines, and 0 are there: doors and boxes tell what"]),
    ],
)
def test_what_is_missing_is_not_used_and_reported(
    tmp_path: Path, kinds: list[str], reasons: list[str]
) -> None:
    source = open_source("mp3d", write_house(tmp_path / "a.house", without(*kinds)))
    (ref,) = source.find().scenes
    reading = source.read(ref, load_class_map(ROW.class_map))
    said = [skip.reason for skip in reading.left_out]
    assert [a.startswith(b) for a, b in zip(said, reasons, strict=True)] == [True] * len(reasons)
    kitchen, has_floor = reading.graph.rooms[0], kinds[0][0] != "V"
    corner = (4, 2) if has_floor else (4, 4)  # that of the box
    assert corner in set(kitchen.footprint or ())
    assert kitchen.floor_area == (12 if has_floor else None)


@pytest.mark.skipif(not TRIMMED.is_file(), reason="needs ../shared/cases")
def test_a_house_that_somebody_trimmed() -> None:
    graph = read(TRIMMED)
    assert [room.label for room in graph.rooms] == ["kitchen"]
    assert [obj.category for obj in graph.objects] == ["chair", "sink"]
