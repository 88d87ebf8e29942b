"""A storey becomes a world of pyrobosim, and a robot searches in it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from robot import (
    CHOICES,
    LOOK,
    MISSES,
    Search,
    by_distance,
    by_list,
    find,
    list_questions,
    open_world,
    report,
)
from shapely.geometry import LineString, box
from storeys import RADIUS, STAND, Storey, describe_world, find_storey

from bsg_models.robot.seen_building import open_graph


def row(index: int, *corners: float, label: str | None = None) -> dict[str, Any]:
    footprint = np.array(box(*corners).exterior.coords[:-1]).ravel().tolist()
    return {"room_index": index, "label": label, "floor_index": 0, "footprint": footprint}


def test_the_storey_has_the_most_connected_rooms() -> None:
    """Room 2 overlaps room 1 by half a metre and keeps it; nothing leads to room 3."""
    rooms = [row(1, 0, 0, 5, 4, label="living room"), row(2, 4.5, 0, 7.5, 4), row(3, 9, 0, 12, 4)]
    objects = [{"room_index": index, "class": "book"} for index in (1, 2, 3)]
    storey = find_storey(rooms, objects, [(1, 2)])
    assert storey.holds == {"living_room_1": ["book"], "room_2": ["book"]}
    one, other = (floor.bounds for floor in storey.rooms.values())
    assert one == pytest.approx((0.05, 0.05, 4.45, 3.95))
    assert other == pytest.approx((4.55, 0.05, 7.45, 3.95))
    (way,) = storey.ways.values()
    assert way.length == pytest.approx(0.1 + 2 * 0.35)


def test_furniture_leaves_room_for_the_robot(tmp_path: Path) -> None:
    floor = box(0, 0, 4, 4)
    storey = Storey({"kitchen_1": floor}, {}, {"kitchen_1": ["table", "sink", "bottle", "book"]})
    said = describe_world(storey, tmp_path, seed=0)
    free = floor.buffer(-STAND - 2 * RADIUS)
    at = [(one["pose"]["position"]["x"], one["pose"]["position"]["y"]) for one in said["locations"]]
    assert len(at) == 2
    assert all(free.covers(box(x, y, x, y).centroid) for x, y in at)
    assert np.hypot(*np.subtract(*at)) >= 2 * STAND
    assert {one["category"] for one in said["objects"]} == {"bottle", "book"}
    assert describe_world(storey, tmp_path, seed=0) == said


@pytest.mark.parametrize(("luck", "missed"), [(None, 0), (0, 0), (3, 1), (29, 2)])
def test_a_detector_that_misses_looks_again(luck: int | None, missed: int) -> None:
    """The robot stands before a table with a book; `nearest` then prefers the other room."""
    kitchen, hall = (SimpleNamespace(name=name, locations=[]) for name in ("kitchen", "hall"))
    for room in (kitchen, hall):
        table = SimpleNamespace(name=f"{room.name} table", parent=room, children=[])
        table.children.append(SimpleNamespace(parent=table, is_open=True))
        room.locations.append(table)
    (top,) = kitchen.locations[0].children
    book = SimpleNamespace(name="book 1", category="book")
    robot = SimpleNamespace(location=top, detect_objects=lambda: None, last_detected_objects=[book])
    tables = [kitchen.locations[0], hall.locations[0]]
    world = SimpleNamespace(robots=[robot], rooms=[kitchen, hall], objects=[book], locations=tables)
    seen = open_graph({"kitchen": [], "hall": []})
    left = {"kitchen": [top], "hall": [*hall.locations[0].children]}
    search = Search(world, seen, "book", "kitchen", luck, left)
    for _ in range(missed):
        search.look(top)
        assert not search.found
        assert search.left["kitchen"] == [top]
        assert {choose(search) for choose in (by_distance, by_list)} == {"hall"}
    looked = seen.graph.looks
    search.look(top)
    assert search.found
    assert search.looks == {"kitchen": missed} if missed else not search.looks
    assert (search.metres, search.seconds) == (0.0, LOOK * (1 + missed))
    assert [one.name for one in seen.graph.objects] == ["book 1"]
    assert [one.chance for one in looked] == pytest.approx([1 - MISSES**missed] * bool(missed))


def test_a_search_costs_its_way_and_its_looks(tmp_path: Path) -> None:
    """From (2, 2), the bed is 4.5 m away, straight through the door.

    The table is 0.7 m to the north; from there, the bed is 3.8 m ahead and 0.7 m diagonally.
    """
    pytest.importorskip("pyrobosim", reason="`make robot` installs pyrobosim; tests do not")
    rooms = {"kitchen_1": box(0, 0, 4, 4), "bedroom_2": box(4.1, 0, 8.1, 4)}
    way = {("kitchen_1", "bedroom_2"): LineString([(3.6, 2), (4.5, 2)])}
    storey = Storey(rooms, way, {"kitchen_1": ["table", "bottle"], "bedroom_2": ["bed", "pillow"]})
    said = describe_world(storey, tmp_path, seed=0)
    for one, (x, y) in zip(said["locations"], [(2.0, 3.2), (7.0, 2.0)], strict=True):
        one["pose"] = {"position": {"x": x, "y": y}}
    (tmp_path / "world.yaml").write_text(yaml.safe_dump(said), "utf-8")
    world = open_world(tmp_path / "world.yaml")
    question = ("pillow", "kitchen_1")
    assert question in list_questions(world)[False]
    searches = [find(world, question, one, model="universal") for one in CHOICES.values()]
    direct, detour, _ = searches
    assert all(one.found for one in searches)
    assert direct.metres == pytest.approx(4.5, rel=0.03)
    assert direct.seconds == pytest.approx(direct.metres + 5)
    assert detour.metres == pytest.approx(0.7 + 3.8 + 0.7 * 2**0.5, rel=0.03)
    assert detour.seconds == pytest.approx(detour.metres + 10)
    assert detour.whole == [("kitchen_1", pytest.approx(5))]
    assert direct.seen.where("pillow")[0].room == "bedroom_2"
    again = [find(world, question, one, model="universal", luck=0) for one in CHOICES.values()]
    assert all(one.found for one in again)
    assert len({one.looks["bedroom_2"] for one in again}) == 1
    table = report("One search", [[searches]], model="universal")
    assert [line[1] for line in table.rows] == ["100.0"] * 3
