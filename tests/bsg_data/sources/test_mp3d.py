"""Matterport3D's houses: one by hand, folders and packed files, and the real ones."""

from __future__ import annotations

import gzip
from collections import Counter
from pathlib import Path

import pytest
from conftest import REPOSITORY
from house_files import HOUSE, change
from refusals import refuses

from bsg_data.errors import SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Box, SceneGraph
from bsg_data.sources.catalogue import SOURCES
from bsg_data.sources.mp3d import REGION_LABELS, MatterportHouses
from bsg_data.testing import SourceContract

SAMPLES = REPOSITORY.parent / "shared" / "sources"
ROW = SOURCES["mp3d"]


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
    source = MatterportHouses(path)
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
    assert [obj.role for obj in graph.objects] == [
        "classified",
        "classified",
        "nameless",
        "structure",
        "structure",
    ]
    assert graph.objects[0].centroid == (1, 1, 0.25)
    assert graph.objects[2].box is None


def test_levels_are_counted_from_the_bottom(tmp_path: Path) -> None:
    text = HOUSE.replace("4 3 1 1  0", "4 3 1 2  0").replace(
        "L  0  0  -  4 2 0  0 0 0  8 4 3  0 0 0 0 0",
        "L  0  0  -  4 2 3  0 0 3  8 4 6  0 0 0 0 0\nL  1  0  -  4 2 0  0 0 0  8 4 3  0 0 0 0 0",
    )
    both = text.replace("R  1 0", "R  1 1")
    assert [room.floor_index for room in read(write_house(tmp_path / "a.house", both)).rooms] == [
        1,
        0,
    ]
    none = text.replace("R  1 0", "R  1 -1")
    assert [room.floor_index for room in read(write_house(tmp_path / "a.house", none)).rooms] == [
        0,
        0,
    ], "without a level of every room, the floors decide"


def test_every_letter_of_the_description_has_a_label() -> None:
    assert "".join(sorted(REGION_LABELS)) == "BCDSZabcdefghijklmnoprstuvwxyz"


def test_a_house_found_twice_is_taken_once(tmp_path: Path) -> None:
    write_house(tmp_path / "abc.house")
    write_house(
        tmp_path / "packed" / "abc.house.gz", change("E  0", "-").replace(" 1 5 4", " 0 5 4")
    )
    found = MatterportHouses(tmp_path).find()
    assert [ref.location for ref in found.scenes] == ["abc.house"]
    assert "with OTHER annotation" in found.duplicates[0].reason


@pytest.mark.parametrize(
    ("name", "data", "code"),
    [
        ("a.house.gz", b"ASCII 1.1", "file-unreadable"),
        ("a.house", b"ASCII 1.1\nC  0  1 caf\xe9", "line-malformed"),
        ("a.house", b"", "line-malformed"),
        ("house.txt", b"", "source-empty"),
    ],
)
def test_a_damaged_file_or_none_is_a_source_error(
    tmp_path: Path, name: str, data: bytes, code: str
) -> None:
    (tmp_path / name).write_bytes(data)
    with refuses(SourceError, code):
        read(tmp_path)


@pytest.mark.skipif(not list(SAMPLES.glob("*.house.gz")), reason="no samples here")
def test_the_real_houses_are_read() -> None:
    source = MatterportHouses(SAMPLES)
    graphs = {
        ref.scene_id: source.read(ref, load_class_map(ROW.class_map)).graph
        for ref in source.find().scenes
    }
    sizes = {name: (len(graph.rooms), len(graph.objects)) for name, graph in graphs.items()}
    assert sizes == {"17DRP5sb8fy": (10, 187), "x8F5xyUWy9e": (14, 277)}, "a Z of 15 is no room"
    for graph in graphs.values():
        for room in graph.rooms:
            assert room.box is not None
            assert room.label is not None
            width, depth, height = (
                high - low for low, high in zip(room.box.minimum, room.box.maximum, strict=True)
            )
            assert 1.5 < height < 6, "z is up: rooms are as high as rooms are"
            assert room.floor_area is not None
            assert 0 < room.floor_area <= width * depth + 1e-6
        joined = {end for edge in graph.adjacency for end in (edge.source, edge.target)}
        assert len(joined) == len(graph.rooms), "every room is reached"
        roles = Counter(obj.role for obj in graph.objects)
        assert roles["unmapped"] == 0
