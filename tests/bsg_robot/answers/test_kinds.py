"""The kinds of rooms: by hand for two, by labels, by things, and what must hold of any map."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY

from bsg_models import Predictor
from bsg_models.belief.partial_graph import PartialGraph
from bsg_robot import SeenBuilding, open_graph
from bsg_robot.answers.kind_table import KindTable, read_kinds
from bsg_robot.answers.kinds import infer_kinds
from bsg_robot.graph.robot_json import parse_robot_graph
from bsg_robot.things.things import find_thing

FAST = Predictor("mixture")  # loaded once; kinds ask no model
TABLE = read_kinds()
NO_NAMES = {
    "R0": ["refrigerator", "stove", "sink"],
    "R1": ["bed", "wardrobe"],
    "R2": ["toilet", "shower"],
    "R3": ["sofa", "tv", "coffee table"],
    "R4": ["washing machine", "laundry basket"],
    "R5": ["desk", "office chair", "printer"],
    "R6": ["car", "workbench", "bicycle"],
}
READ_AS = ("kitchen", "bedroom", "bathroom", "living room", "laundry room", "office", "garage")


def see(said: Any) -> SeenBuilding:
    return open_graph(said, model=FAST)


def graph_of(said: Any) -> PartialGraph:
    return parse_robot_graph(said, path=Path("map"))


def kinds_of(said: Any, room: str) -> dict[str, float]:
    return {kind.name: kind.probability for kind in see(said).kinds(room)}


def of_room(*things: str, kind: Any = None, **facts: Any) -> dict[str, float]:
    """Return the kinds of the one room of a map."""
    room = {"id": "R", "hidden_share": 0.5, **facts} | ({"room_type": kind} if kind else {})
    objects = [{"room": "R", "category": thing} for thing in things]
    return kinds_of({"scene_id": "map", "rooms": [room], "objects": objects}, "R")


def test_every_label_is_a_kind_and_every_row_is_whole() -> None:
    with (REPOSITORY / "mappings" / "room-labels-v1.csv").open(encoding="utf-8") as file:
        rows = [
            row
            for row in csv.DictReader(file)
            if row["source"] not in ("building", "kind", "source")
        ]
    assert {row["label"] for row in rows if row["label"]} <= {*TABLE.kinds}
    assert [*TABLE.kinds] == sorted({*TABLE.kinds})
    assert TABLE.buildings[0] == "home"
    assert (TABLE.numbers >= 0).all()
    assert (TABLE.numbers.sum(axis=1) > 1).all()
    assert (np.stack([TABLE.floor_area, TABLE.spread, TABLE.neighbours]) > 0).all()
    assert ((TABLE.presence > 0) & (TABLE.presence < 1)).all()
    assert (TABLE.shares >= 0).all()


def by_hand(**numbers: float) -> KindTable:
    """Return a table of kitchens and bedrooms, with stoves and beds."""
    things = tuple(thing for name in ("stove", "bed") if (thing := find_thing(name)))
    return KindTable(
        kinds=tuple(numbers),
        buildings=("home", "office"),
        numbers=np.array([[*numbers.values()], [0.0, 0.0]]),
        floor_area=np.array([10.0, 15.0]),
        spread=np.array([0.5, 0.5]),
        neighbours=np.array([2.0, 1.0]),
        passages=np.array([False, False]),
        things=things,
        shares=np.eye(2),
        presence=np.array([[0.9, 0.05], [0.02, 0.8]]),
        is_class=np.array([True, True]),
    )


def test_the_naive_bayes_by_hand() -> None:
    """One thing seen counts 6/7, one that is missed .6; half of the room was surely seen."""
    graph = graph_of(
        {
            "scene_id": "two",
            "building_kind": "home",
            "rooms": [{"id": "R", "hidden_share": 0.5, "hidden_share_sd": 0}],
            "objects": [{"room": "R", "category": "stove"}],
        }
    )

    def weigh(number: float, stove: float, bed: float, *, bed_is_heard: bool) -> dict[float, float]:
        """Return the weight of a kind, by the share of what is in view that is noticed."""
        missed = {notice: 1 - notice * 0.5 * bed if bed_is_heard else 1 for notice in (0.2, 0.95)}
        return {
            notice: number * (notice * stove) ** (6 / 7) * missed[notice] ** 0.6
            for notice in (0.2, 0.95)
        }

    for heard in (True, False):  # a detector that knows no bed tells nothing of beds
        asked = graph if heard else replace(graph, detector=(("stove", None),))
        kitchen = weigh(1.0, 0.9, 0.05, bed_is_heard=heard)
        bedroom = weigh(2.0, 0.02, 0.8, bed_is_heard=heard)
        likely = {
            notice: chance * (kitchen[notice] + bedroom[notice])
            for notice, chance in ((0.2, 0.25), (0.95, 0.75))
        }
        one, other = (
            sum(likely[notice] * row[notice] for notice in likely) for row in (kitchen, bedroom)
        )
        found = infer_kinds(asked, by_hand(kitchen=1.0, bedroom=2.0))
        assert found.rooms[0] == pytest.approx([one / (one + other), other / (one + other)])


def test_what_is_said_with_a_probability_leaves_the_rest_to_the_things() -> None:
    alone = of_room(kind={"kitchen": 0.6, "bedroom": 0.4}, visited=False, hidden_share=1)
    assert alone == pytest.approx({"kitchen": 0.6, "bedroom": 0.4}, abs=0.011)
    certain = of_room(kind="cold storage", visited=False, hidden_share=1)
    assert certain["cold storage"] >= 0.98
    maybe = of_room(kind={"kitchen": 0.6}, visited=False, hidden_share=1)
    assert maybe["kitchen"] == pytest.approx(0.6, abs=0.06)
    assert of_room("stove", "sink", kind={"kitchen": 0.6})["kitchen"] > 0.97
    assert of_room("bed", "wardrobe", kind={"kitchen": 0.6})["bedroom"] > 0.5
    assert of_room("bed", "wardrobe", kind="kitchen")["kitchen"] > 0.15, "a label is obeyed longer"


def test_rooms_without_names_are_read_by_their_things() -> None:
    seen = see(NO_NAMES)
    assert tuple(seen.kinds(room)[0].name for room in seen.rooms) == READ_AS
    assert all(seen.kinds(room)[0].probability > 0.5 for room in seen.rooms)
    likely = [kind.probability for kind in seen.kinds("R0")]
    assert likely == sorted(likely, reverse=True)
    assert 0.9 < sum(likely) <= 1.01


def test_the_order_of_rooms_and_things_does_not_matter() -> None:
    lamps = ["bedroom lamp", "office lamp"]  # of which the word before tells the room
    graph = graph_of({**NO_NAMES, "kitchen": [], "R7": [], "R8": ["mirror"], "R9": lamps})
    order = np.random.default_rng(0).permutation(len(graph.rooms))
    number = {0: 0} | {int(old) + 1: new for new, old in enumerate(order, 1)}
    mixed = replace(
        graph,
        rooms=tuple(graph.rooms[row] for row in order),
        objects=tuple(replace(o, room_index=number[o.room_index]) for o in graph.objects[::-1]),
    )
    one, other = infer_kinds(graph, TABLE), infer_kinds(mixed, TABLE)
    np.testing.assert_allclose(other.rooms, one.rooms[order], atol=1e-9)
    np.testing.assert_allclose(other.building, one.building, atol=1e-9)


TYPICAL = {
    "kitchen": ("sink", "kettle", "toaster", "microwave", "refrigerator", "stove", "dishwasher"),
    "bedroom": ("wardrobe", "nightstand", "chest of drawers", "pillow", "blanket", "bed"),
    "bathroom": ("mirror", "towel", "sink", "shampoo", "toothbrush", "shower", "toilet"),
    "living room": ("cushion", "tv", "coffee table", "armchair", "sofa", "remote control"),
    "laundry room": ("laundry basket", "ironing board", "detergent", "dryer", "washing machine"),
    "office": ("bookshelf", "printer", "office chair", "desk", "computer monitor"),
    "garage": ("toolbox", "lawn mower", "snow tire", "car"),
}


@pytest.mark.parametrize("kind", TYPICAL)
def test_one_more_thing_that_is_typical_of_a_kind_never_lowers_it(kind: str) -> None:
    """By a percent, in which kinds are said; in whatever order they are seen."""
    for seed in range(6):
        things = np.random.default_rng(seed).permutation(TYPICAL[kind])
        found = []
        for number in range(len(things) + 1):
            objects = [{"room": "R", "category": str(thing)} for thing in things[:number]]
            said = {"scene_id": "map", "rooms": [{"id": "R"}, {"id": "S"}], "objects": objects}
            found.append(infer_kinds(graph_of(said), TABLE).rooms[0, TABLE.column[kind]])
        assert (np.diff(found) > -0.01).all(), (things, found)
        assert found[-1] > 0.75 > 10 * found[0] / 3


def test_a_room_of_which_nothing_is_known_is_of_a_kind_that_is_missing() -> None:
    def kitchen(*rooms: str) -> float:
        found = infer_kinds(graph_of({room: [] for room in (*rooms, "R", "S")}), TABLE)
        one, other = found.rooms[-2:, TABLE.column["kitchen"]]
        assert one == other, "nothing tells them apart"
        return float(one)

    assert kitchen("bath", "bedroom") > 2 * kitchen("bath", "bedroom", "kitchen")


def test_floor_area_and_doors_tell_a_corridor_from_a_closet() -> None:
    def kind(area: float, doors: int) -> dict[str, float]:
        beside = [f"S{number}" for number in range(doors)]
        rooms = [{"id": "R", "floor_area": area, "hidden_share": 0.2}]
        rooms += [{"id": one, "visited": False} for one in beside]
        pairs = [["R", one] for one in beside]
        return kinds_of({"scene_id": "map", "rooms": rooms, "adjacency": pairs}, "R")

    assert kind(12, 6)["corridor"] > 2 * kind(12, 1)["corridor"]
    assert kind(2, 1).get("closet", 0) > 2 * kind(40, 1).get("closet", 0)
    assert kind(5e-324, 1) == kind(1e-9, 1), "the least area that JSON can say"
