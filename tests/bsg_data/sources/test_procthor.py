from __future__ import annotations

import gzip
import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from conftest import SHARED

from bsg_data.checks.graphs import find_faults
from bsg_data.dataset.scenes import make_tables
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Box, Edge, SceneGraph
from bsg_data.sources import procthor
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.source import Source
from bsg_data.testing import SourceContract

SAMPLE = SHARED.parent / "sources" / "procthor_150_houses.jsonl.gz"


def room(number: int, kind: str, *corners: tuple[float, float]) -> dict[str, Any]:
    polygon = [{"x": x, "y": 0, "z": z} for x, z in corners]
    return {"id": f"room|{number}", "roomType": kind, "floorPolygon": polygon, "children": []}


def thing(name: str, asset: str, *children: dict[str, Any], x: float = 1, z: float = 1) -> Any:
    place = {"x": x, "y": 0.5, "z": z}
    own = {"children": list(children)} if children else {}
    return {"id": name, "assetId": asset, "position": place, "kinematic": True, **own}


def house(**changes: Any) -> dict[str, Any]:
    """An L-shaped bedroom of 3 m², and a bathroom of 2 m² beside it."""
    bedroom = room(4, "Bedroom", (0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2))
    bathroom = room(2, "Bathroom", (2, 0), (4, 0), (4, 1), (2, 1))
    wall = [{"x": 0, "y": y, "z": z} for y in (0, 2.5) for z in (0, 2)]
    return {
        "rooms": [bedroom, bathroom],
        "doors": [
            {"id": "door|2|4", "room0": "room|4", "room1": "room|2", "assetId": "Doorway_1"},
            {"id": "door|4|2", "room0": "room|2", "room1": "room|4", "assetId": "Doorway_1"},
            {"id": "door|1|4", "room0": "room|4", "room1": "room|4", "assetId": "Doorway_2"},
            {"id": "door|0|4", "room0": "exterior", "room1": "room|4", "assetId": "Doorway_2"},
        ],
        "walls": [{"id": "wall|4|0", "roomId": "room|4", "polygon": wall}],
        "windows": [{"id": "window|4|0", "assetId": "Window_Fixed_96x48"}],
        "objects": [
            thing("4|0|0", "Bed_25", thing("4|0|1", "pillow_11"), thing("small|4|5", "Book_2")),
            thing("2|3", "Toilet_1", x=3, z=0.5),
            thing("9|1", "Sofa_1", x=9),
            thing("Painting", "Wall_Decor_Photo_2V", x=3, z=0.5),
            thing("Apple|surface|2|0", "Apple_24"),
        ],
        "metadata": {"schema": "1.0.0"},
        **changes,
    }


def write_lines(path: Path, *houses: Any) -> Path:
    text = "".join(f"{json.dumps(one)}\n" for one in houses).encode()
    path.write_bytes(gzip.compress(text) if path.name.endswith(".gz") else text)
    return path


class TestProcTHOR(SourceContract):
    name = "procthor"

    def write_example(self, folder: Path) -> Path:
        return write_lines(folder / "train.jsonl.gz", house(), house(objects=[]))


def read_all(path: Path) -> list[SceneGraph]:
    source, class_map = open_source("procthor", path), load_class_map()
    return [source.read(ref, class_map).graph for ref in source.find().scenes]


def test_a_house_worked_out_by_hand(tmp_path: Path) -> None:
    (graph,) = read_all(write_lines(tmp_path / "val.jsonl", house()))
    assert list(find_faults(make_tables([graph], load_class_map().classes))) == []
    assert (graph.source_split, graph.building_kind) == ("val", "home")
    bathroom, bedroom = graph.rooms
    assert [(r.region_id, r.source_label, r.label) for r in graph.rooms] == [
        (2, "Bathroom", "bathroom"),
        (4, "Bedroom", "bedroom"),
    ]
    assert (bathroom.floor_area, bedroom.floor_area) == (2.0, 3.0)
    assert bedroom.box == Box((0, 0, 0), (2, 2, 2.5))
    assert bedroom.centroid == (1, 1, 1.25)
    assert bathroom.box == Box((2, 0, 0), (4, 1, 0))  # no wall says how high it is
    assert {(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 2.0), (0.0, 2.0)} == set(bedroom.footprint)
    assert [r.floor_index for r in graph.rooms] == [0, 0]
    assert graph.adjacency == (Edge(1, 2, "adjacent", "door", pytest.approx(2.4109127)),)
    assert [(o.raw_category, o.room_index) for o in graph.objects] == [
        ("bed", 2),
        ("pillow", 2),
        ("book", 2),
        ("toilet", 1),
        ("sofa", 0),  # no room 9, and none around it: the building's
        ("wall decor photo", 1),  # by its place
        ("apple", 1),  # as ids are in ProcTHOR-10K
    ]
    assert graph.objects[3].centroid == (3, 0.5, 0.5)  # Z up
    assert {obj.box for obj in graph.objects} == {None}


def test_the_same_house_is_taken_once_and_its_number_is_that_in_its_file(tmp_path: Path) -> None:
    one, two = house(), house(objects=[])
    write_lines(tmp_path / "train.jsonl.gz", one, two)
    write_lines(tmp_path / "val.jsonl.gz", two)
    (tmp_path / "README.md").write_text("no houses")
    found = open_source("procthor", tmp_path).find()
    assert [ref.scene_id[:6] for ref in found.scenes] == ["00000-", "00001-"]
    assert [ref.location for ref in found.scenes] == ["train.jsonl.gz:1", "train.jsonl.gz:2"]
    assert [ref.source_split for ref in found.scenes] == ["train", "train"]
    (double,) = found.duplicates
    assert double.location == "val.jsonl.gz:1"
    assert "train.jsonl.gz:2" in double.reason


def many(count: int, *, beds: int = 1) -> list[Any]:
    return [house(objects=[thing(f"4|{n}", "Bed_1")] * beds) for n in range(count)]


def test_every_file_of_a_folder_is_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Scenes are ordered by their number in their file: three files are read in turns."""
    houses = many(60)
    for number, name in enumerate(("a.jsonl.gz", "b.jsonl", "c.json")):
        write_lines(tmp_path / name, *houses[number:40:2])
    (tmp_path / "c.json").write_text("\ufeff \r\n" + json.dumps(houses[40:], indent=2), "utf-8")
    source = open_source("procthor", tmp_path)
    opened = []
    open_stream = procthor.open_stream

    def count(path: Path, **options: Any) -> Any:
        opened.append(path)
        return open_stream(path, **options)

    scenes = source.find().scenes
    monkeypatch.setattr(procthor, "open_stream", count)
    assert _count_objects(source, scenes) == [1] * 60
    assert len(opened) == 3
    monkeypatch.setattr(procthor, "_MOST_OPEN", 2)
    assert _count_objects(source, scenes) == [1] * 60
    assert len(opened) > 6


def _count_objects(source: Source, scenes: Any) -> list[int]:
    return [len(source.read(ref, load_class_map()).graph.objects) for ref in scenes]


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork here")
def test_workers_do_not_move_the_place_of_one_another(tmp_path: Path) -> None:
    """A process that was forked shares the place in every file that was open before."""
    source = open_source("procthor", write_lines(tmp_path / "h.jsonl", *many(20, beds=300)))
    first, *scenes = source.find().scenes
    assert _count_objects(source, [first]) == [300]
    with ProcessPoolExecutor(2, multiprocessing.get_context("fork")) as executor:
        tasks = [executor.submit(_count_objects, source, scenes) for _ in range(4)]
        assert [task.result() for task in tasks] == [[300] * 19] * 4


def test_houses_are_read_in_any_order(tmp_path: Path) -> None:
    houses = [house(objects=[thing(f"4|{n}", "Bed_1")] * n) for n in range(5)]
    source = open_source("procthor", write_lines(tmp_path / "h.jsonl.gz", *houses))
    scenes, class_map = source.find().scenes, load_class_map()
    for order in ([4, 0, 2, 2, 1], [3, 4, 0]):
        sizes = [len(source.read(scenes[n], class_map).graph.objects) for n in order]
        assert sizes == order


@pytest.mark.skipif(not SAMPLE.is_file(), reason="needs ../shared/sources")
def test_things_of_real_houses_are_where_their_rooms_are() -> None:
    shapely = pytest.importorskip("shapely")
    for graph in read_all(SAMPLE):
        for obj in graph.objects:
            hull = shapely.Polygon(graph.rooms[obj.room_index - 1].footprint)
            assert hull.distance(shapely.Point(obj.centroid[:2])) < 0.01  # ids and places agree
