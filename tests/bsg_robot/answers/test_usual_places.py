"""What must hold of the places of things in any map, by the answers of every model that we ship."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from bsg_models import Predictor
from bsg_robot import EXPLORE, SeenBuilding, open_graph
from bsg_robot.things.things import list_things

MODELS = ("universal", "mixture", "open", "universal-wide")
PARTS = [thing for thing in list_things() if thing.wider not in (None, *thing.names)]
HOME: dict[str, list[str]] = {
    "kitchen": ["stove", "sink"],
    "hall": [],
    "bedroom": ["bed"],
    "bathroom": [],
    "living room": ["couch", "tv"],
}
NO_NAMES = {
    "R0": ["refrigerator", "stove", "sink"],
    "R1": ["bed", "wardrobe"],
    "R2": ["toilet", "shower"],
    "R3": ["sofa", "tv"],
}
NAMES = ("kitchen", "bathroom", "bedroom", "hall", "living room", "office", "garage", "zzqx", "R")
OTHERS = ("meeting room", "guest room 101", "patient room", "classroom", "aisle", "restaurant")
WORDS = ("stove", "bed", "toilet", "sofa", "desk", "lamp", "towel", "mug", "bag", "book", "plate")
WORDS += ("shoes", "laptop", "chair", "mirror", "box", "clothes", "cabinet", "zzqx")


@cache
def model(name: str) -> Predictor:
    return Predictor(name)


def see(said: Any, by: str = "universal") -> SeenBuilding:
    return open_graph(said, model=model(by))


def draw(seed: int) -> dict[str, Any]:
    """Return a map of a home, or of any building, with and without names, seen more or less."""
    rng = np.random.default_rng(seed)
    rooms, objects = [], []
    for number in range(rng.integers(1, 7)):
        name = f"{rng.choice((*NAMES, *OTHERS) if seed % 3 == 2 else NAMES)} {number}"
        shares = ({"visited": False}, {"floor_in_view": 0.7}, {"hidden_share": 0.4}, {})
        some = {"hidden_share": 0.0} if rng.random() < 0.1 else shares[rng.integers(4)]
        rooms.append({"id": name, **some})
        for word in rng.choice(WORDS, 0 if "visited" in some else rng.integers(0, 5)):
            score = {"score": 0.3} if rng.random() < 0.2 else {}
            objects.append({"room": name, "category": str(word), **score})
    more = {"more_rooms": int(rng.integers(0, 4))} if rng.random() < 0.5 else {}
    return {"scene_id": f"map {seed}", "rooms": rooms, "objects": objects, **more}


def places(seen: SeenBuilding, thing: str) -> dict[str | None, float]:
    """Return the probability of each room, and of the building as `anywhere`."""
    return {place.room: place.probability for place in seen.where(thing)} | {
        "anywhere": seen.anywhere(thing)
    }


@pytest.mark.parametrize(("by", "seeds"), [("universal", 6), *((name, 1) for name in MODELS[1:])])
def test_a_part_is_never_likelier_than_its_whole(by: str, seeds: int) -> None:
    """In each room, in those not found yet, and in the building; each row in one map or another."""
    wrong = []
    for seed in range(seeds):
        seen = see(draw(seed), by)
        wholes: dict[str, dict[str | None, float]] = {}
        for thing in PARTS[seed::6]:
            whole = wholes.setdefault(str(thing.wider), places(seen, str(thing.wider)))
            wrong += [
                (seed, room, thing.name, likely, thing.wider, whole[room])
                for room, likely in places(seen, thing.name).items()
                if likely > whole[room] + 1e-9
            ]
    assert wrong == []


MOVED = ("milk", "mug", "remote control", "shampoo", "keys", "microwave", "sink", "bed", "towel")


@pytest.mark.parametrize("by", MODELS)
@pytest.mark.parametrize("said", [HOME, NO_NAMES], ids=["names", "no names"])
@pytest.mark.parametrize("how", ["discovered", "more_rooms"])
def test_rooms_of_which_nothing_is_known_empty_no_other(by: str, said: Any, how: str) -> None:
    """A room moves by 5 % of itself at most, and the building never falls."""
    seen = see({**said, "more_rooms": 0}, by)
    before = {thing: places(seen, thing) for thing in MOVED}
    for number in (1, 5, 20):
        if how == "more_rooms":
            seen.more_rooms(number)
        else:
            for name in range(len(seen.rooms) - len(said), number):
                seen.discovered(f"X{name}")
        for thing, was in before.items():
            now = places(seen, thing)
            assert now["anywhere"] >= was["anywhere"] - 1e-9, (thing, number)
            for room in said:
                assert now[room] == pytest.approx(was[room], rel=0.05), (thing, room, number)
            new = {*now} - {*was}
            assert new == ({EXPLORE} if how == "more_rooms" else {f"X{n}" for n in range(number)})
            assert all(0 < now[room] < 1 for room in new)


@pytest.mark.parametrize("said", [{"hall": []}, {"hall": [], "kitchen": ["stove"]}], ids=len)
def test_a_room_that_is_found_is_one_of_those_that_were_not_found_yet(said: Any) -> None:
    """A home that surely has more rooms does not become whole because somebody saw a door."""
    seen = see(said)
    before = {thing: places(seen, thing) for thing in MOVED}
    for number in range(20):
        seen.discovered(f"X{number}")
        for thing, was in before.items():
            now = places(seen, thing)
            assert now["anywhere"] >= was["anywhere"] - 1e-9, (thing, number)
            for room in said:
                assert now[room] == pytest.approx(was[room], rel=0.05), (thing, room, number)
    assert EXPLORE not in now, "20 rooms are as many as a home has"


def test_rooms_of_which_nothing_is_known_take_nothing_from_the_room_of_an_owner() -> None:
    seen = see({**HOME, "Emma's room": [], "more_rooms": 0})
    before = places(seen, "Emma's book")
    seen.more_rooms(20)
    now = places(seen, "Emma's book")
    for room in (*HOME, "Emma's room"):
        assert now[room] == pytest.approx(before[room], rel=0.05), room


@pytest.mark.parametrize("by", MODELS)
def test_a_building_without_rooms_has_nothing(by: str) -> None:
    """By the table of things as by the model: both answer in one scale."""
    seen = see({"scene_id": "whole", "rooms": [], "more_rooms": 0}, by)
    for thing in MOVED:
        assert seen.anywhere(thing) == 0, thing


@pytest.mark.parametrize("by", MODELS)
@pytest.mark.parametrize(
    ("part", "whole"),
    [("boots", "shoes"), ("mug", "tableware"), ("laptop", "computer"), ("garage heater", "heater")],
)
def test_a_look_for_a_whole_misses_its_parts_and_not_the_other_way_round(
    part: str, whole: str, by: str
) -> None:
    """Boots were in the hall with 83 % after three looks for shoes."""
    for looked, other in ((whole, part), (part, whole)):
        seen = see({**HOME, "more_rooms": 0}, by)
        before = places(seen, other)
        for room in HOME:
            seen.looked(room, looked, chance=0.99)
        falls = [places(seen, other)[room] < 0.1 * before[room] for room in HOME]
        assert all(falls) if looked == whole else not any(falls), (looked, other)


@pytest.mark.parametrize("by", MODELS)
def test_a_searched_room_has_none_and_the_others_do_not_lose_it(by: str) -> None:
    for thing in ("mug", "towel", "keys", "lamp", "laptop"):
        seen = see(HOME, by)
        before = places(seen, thing)
        first = max(HOME, key=lambda room: before[room])
        seen.searched(first)
        after = places(seen, thing)
        assert after[first] == 0
        assert after["anywhere"] <= before["anywhere"]
        for room in {*HOME} - {first}:
            assert after[room] > 0.8 * before[room]


@pytest.mark.parametrize("by", MODELS)
@pytest.mark.parametrize("thing", ["bicycle", "vacuum cleaner", "backpack"])
def test_a_big_thing_does_not_hide_in_a_room_whose_floor_was_all_seen(by: str, thing: str) -> None:
    rooms = ("hall", "living room", "bedroom", "garage", "storage room", "R0")
    all_seen = [{"id": room, "floor_in_view": 1.0} for room in rooms]
    seen = see({"scene_id": "home", "rooms": all_seen, "more_rooms": 0}, by)
    assert max(place.probability for place in seen.where(thing)) < 0.1
    entered = see({"scene_id": "home", "rooms": [{"id": room} for room in rooms]}, by)
    assert entered.anywhere(thing) > 0.15


@pytest.mark.parametrize("thing", ["milk", "microwave", "mug", "chair", "towel"])
def test_more_of_a_room_was_seen_the_less_it_hides(thing: str) -> None:
    found = []
    for share in (1.0, 0.75, 0.5, 0.25, 0.0):
        rooms = [{"id": "kitchen", "hidden_share": share}, {"id": "bath"}, {"id": "bedroom"}]
        found.append(places(see({"scene_id": "home", "rooms": rooms}), thing)["kitchen"])
    assert found == sorted(found, reverse=True)
    assert found[-1] == 0 < found[-2]


@pytest.mark.parametrize("by", ["universal", "open"])
def test_an_unread_name_is_no_name(by: str) -> None:
    """Milk was in the kitchen with .85, and with .04 if it was called what nobody reads."""
    things = ["stove", "sink"]
    one, other = (see({room: things, "bath": [], "bedroom": []}, by) for room in ("zzqx", "R0"))
    for thing in ("milk", "towel", "microwave", "keys", "bag"):
        assert [*places(one, thing).values()] == [*places(other, thing).values()]
    assert places(one, "milk")["zzqx"] > 0.6


@pytest.mark.parametrize(
    ("said", "thing", "first"),
    [
        ({"bicycle store": [], "office": [], "lobby": []}, "bicycle", "bicycle store"),
        ({"Emma's room": ["bed"], "Liam's room": ["bed"]}, "Emma's teddy bear", "Emma's room"),
        ({"Emma's room": ["bed"], "Liam's room": ["bed"]}, "Liam's phone", "Liam's room"),
        ({"music room": [], "classroom": [], "corridor": []}, "violin", "music room"),
    ],
)
def test_a_room_that_is_called_by_a_thing_or_its_owner_has_it(
    said: Any, thing: str, first: str
) -> None:
    assert see(said).where(thing)[0].room == first
