from __future__ import annotations

import csv

import numpy as np
import pytest
from conftest import REPOSITORY

from bsg_data.scene.class_space import load_class_space
from bsg_data.scene.room_label import known_label, label_of, list_room_labels
from bsg_data.words.normal import normalise_name, separate
from bsg_robot.things.things import (
    Thing,
    find_keeping,
    find_receptacle,
    find_thing,
    list_receptacles,
    list_things,
    read_shares,
)

AT_HOME = {
    *(
        "bathroom",
        "bedroom",
        "closet",
        "corridor",
        "dining room",
        "entrance",
        "game room",
        "garage",
    ),
    *("garden", "gym", "kitchen", "laundry room", "library", "living room", "office", "pantry"),
    *("playroom", "staircase", "storage room", "terrace", "toilet", "tv room", "utility room"),
}
CLASSES = {name for s in ("hm3d45-v1", "hm3d-wide-v1") for name in load_class_space(s).classes}


def first_room(word: str, *rooms: str) -> str | None:
    """Return which of these rooms a person would search first."""
    thing = find_thing(word)
    assert thing is not None, word
    return max(rooms, key=thing.probability_in)


def test_names_are_sorted_and_every_row_is_whole() -> None:
    with (REPOSITORY / "bsg_robot/tables/things-v1.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file, strict=True))
    names = [row["thing"] for row in rows]
    assert names == sorted(set(names)) == [thing.name for thing in list_things()]
    for row in rows:
        weights = {label: int(weight) for label, weight in _split(row["rooms"])}
        assert sum(w for label, w in weights.items() if label in AT_HOME) == 100, row
        assert max(weights.values()) <= 250, row
        assert 0 <= float(row["home"]) <= 100, row
        assert 0 < float(row["sight"]) <= 100, row
        assert row["wider"] in {"", *CLASSES}, row


def _split(rooms: str) -> list[list[str]]:
    return [room.split(":") for room in rooms.split("|")]


def test_shares_sum_to_one_and_labels_are_read_by_models() -> None:
    for thing in list_things():
        labels = [label for label, _ in thing.rooms]
        at_home = [share for label, share in thing.rooms if label in AT_HOME]
        assert sum(at_home) == pytest.approx(1), thing.name
        assert {known_label(label) for label in labels} <= set(list_room_labels()), thing.name
        assert [label_of("any", label) for label in labels] == labels, thing.name
        assert len(labels) == len(set(labels)), thing.name
        assert 0 < thing.home <= 1, thing.name
        assert 0 < thing.sight <= 1, thing.name


def test_every_class_that_counts_things_has_a_row_of_its_own() -> None:
    """What a row says of a class is meant of all its things: one scale for classes and things."""
    rows = {name: find_thing(name) for name in sorted(CLASSES)}
    assert [name for name, thing in rows.items() if thing is None] == []
    wider = {name: thing.wider for name, thing in rows.items() if thing}
    default = load_class_space("hm3d45-v1").classes
    assert {name: wider[name] for name in default} == {name: name for name in default}
    assert len({thing.name for thing in rows.values() if thing}) == len(CLASSES)


def test_a_part_is_never_likelier_than_its_whole_in_any_room_or_home() -> None:
    """A mug is tableware: a room has tableware at least as often as a mug."""
    wrong = []
    labels = {room for thing in list_things() for room, _ in thing.rooms}
    for thing in list_things():
        whole = find_thing(thing.wider or thing.name)
        assert whole is not None, thing.name
        assert thing.home <= whole.home, thing.name
        for room in labels:
            if _is_in(thing, room) > _is_in(whole, room) + 1e-9:
                wrong.append((thing.name, whole.name, room))
    assert wrong == []


def _is_in(thing: Thing, room: str) -> float:
    """Return P(at least one) in a room."""
    return float(1 - (1 - thing.home) ** thing.probability_in(room))


def test_a_narrow_room_holds_what_is_named_there_alone() -> None:
    hammer, medicine, milk = (find_thing(word) for word in ("hammer", "medicine", "milk"))
    assert hammer is not None
    assert medicine is not None
    assert milk is not None
    assert hammer.probability_in("workshop") > 1 > hammer.probability_in("utility room") > 0
    assert hammer.probability_in("cold storage") == 0 < hammer.probability_in("storage room")
    assert milk.probability_in("cold storage") > 0
    assert medicine.probability_in("archive") == 0 == medicine.probability_in("child's bedroom")


@pytest.mark.parametrize(
    ("word", "low", "high"),
    [
        ("bicycle", 0.95, 1),
        ("sofa", 1, 1),
        ("fridge", 1, 1),
        ("tv", 0.95, 1),
        ("backpack", 0.7, 0.9),
        ("vacuum cleaner", 0.6, 0.85),
        ("keys", 0.45, 0.7),
        ("mug", 0.4, 0.6),
        ("scissors", 0.2, 0.4),
        ("passport", 0.03, 0.15),
        ("frozen peas", 0, 0.1),
    ],
)
def test_large_things_are_in_sight_and_small_ones_lie_in_drawers(
    word: str, low: float, high: float
) -> None:
    thing = find_thing(word) or find_thing("frozen food")
    assert thing is not None
    assert low <= thing.sight <= high


def test_every_name_is_in_small_letters_and_names_one_thing() -> None:
    names = [one for thing in list_things() for one in (thing.name, *thing.spellings)]
    assert all(one.isascii() and one == normalise_name(one) != "" for one in names)
    assert len({separate(one) for one in names}) == len(names)


def test_every_name_and_its_plural_lead_to_its_thing() -> None:
    names = {one: thing for thing in list_things() for one in (thing.name, *thing.spellings)}
    assert {one: find_thing(one) for one in names} == names
    plurals = {f"{one}s": thing for one, thing in names.items() if not one.endswith("s")}
    wrong = {one for one, thing in plurals.items() if find_thing(one) != thing}
    assert wrong == {"nuts", "tablets"}  # to eat; to swallow


def test_a_class_of_both_spaces_is_that_of_the_default() -> None:
    """A wider class that only `hm3d-wide-v1` has names a thing that the 45 leave out or split."""
    default = load_class_space("hm3d45-v1").classes
    wide = {thing.wider for thing in list_things()} - set(default) - {None}
    assert {"shoe", "food", "clock"} <= wide
    assert not wide & {"armchair", "cup", "laptop", "side table", "suitcase"}


@pytest.mark.parametrize(
    ("word", "name", "rooms", "low", "high"),
    [
        ("socks", "sock", ("bedroom", "closet", "laundry room"), 0.98, 1),
        ("settee", "sofa", ("living room",), 0.9, 1),
        ("cell phone", "phone", ("bedroom", "living room"), 0.95, 1),
        ("pills", "medicine", ("pharmacy",), 0.95, 1),
        ("car keys", "key", ("entrance", "corridor"), 0.98, 1),
        ("scissors", "scissors", ("kitchen",), 0.95, 1),
        ("knives", "knife", ("kitchen",), 0.98, 1),
        ("toothbrushes", "toothbrush", ("bathroom",), 0.98, 1),
        ("charger", "phone charger", ("bedroom",), 0.95, 1),
        ("insulin", "insulin", ("pharmacy",), 0.02, 0.1),
        ("alarm clock", "alarm clock", ("bedroom",), 0.4, 0.8),
        ("glasses", "eyeglasses", ("bedroom",), 0.6, 0.95),
        ("glass", "glass", ("kitchen",), 0.98, 1),
        ("tablets", "medicine", ("pharmacy",), 0.95, 1),
        ("tv_monitor", "television", ("living room",), 0.9, 1),
        ("desk lamp", "desk lamp", ("office", "bedroom"), 0.4, 0.8),
        ("bedside lamp", "bedside lamp", ("bedroom",), 0.7, 0.9),
        ("table lamp", "table lamp", ("living room", "bedroom"), 0.8, 1),
        ("office phone", "desk phone", ("office",), 0.05, 0.2),
        ("landline", "landline phone", ("living room",), 0.3, 0.5),
        ("thermometer", "clinical thermometer", ("bathroom",), 0.7, 0.9),
        ("bath", "bathtub", ("bathroom",), 0.7, 0.85),
        ("fireplace", "fireplace", ("living room",), 0.3, 0.45),
    ],
)
def test_what_a_person_would_say(
    word: str, name: str, rooms: tuple[str, ...], low: float, high: float
) -> None:
    """The rooms are the first ones, in any order; a home has one with `low` to `high`."""
    thing = find_thing(word)
    assert thing is not None
    assert thing.name == name
    asked = sorted({*AT_HOME, *rooms}, key=thing.probability_in, reverse=True)
    assert set(asked[: len(rooms)]) == set(rooms)
    assert low <= thing.home <= high


# The questions of a person, in a flat, a simple map, an office and a ward: where it is looked for.
FLAT = ("living room", "corridor", "kitchen", "bathroom", "bedroom", "utility room")
OFFICE = ("office", "copy room", "meeting room", "kitchen", "toilet", "corridor", "computer room")
WARD = ("patient room", "office", "pharmacy", "corridor", "bathroom", "storage room")


HOTEL = ("hotel room", "lobby", "reception", "linen room", "luggage room", "kitchen", "corridor")
HOTEL += ("lift", "restaurant")
SCHOOL = ("classroom", "music room", "art room", "gym", "canteen", "staff room", "nurse office")
SCHOOL += ("cleaning closet", "corridor", "toilet", "office")
WAREHOUSE = (
    "warehouse",
    "aisle",
    "cold storage",
    "loading dock",
    "packing area",
    "office",
    "toilet",
)
FIRM = ("office", "archive", "cloakroom", "reception", "kitchen", "meeting room", "lift", "toilet")
HOUSE = (
    "living room",
    "kitchen",
    "dining room",
    "bedroom",
    "child's bedroom",
    "bathroom",
    "office",
)
HOUSE += ("entrance", "garage", "laundry room", "basement", "attic", "patio", "garden", "shed")


@pytest.mark.parametrize(
    ("building", "word", "room"),
    [
        (FLAT, "towel", "bathroom"),
        (FLAT, "keys", "corridor"),
        (FLAT, "medicine", "bathroom"),
        (FLAT, "broom", "utility room"),
        (FLAT, "charger", "bedroom"),
        (OFFICE, "printer", "copy room"),
        (OFFICE, "toilet paper", "toilet"),
        (OFFICE, "stapler", "office"),
        (OFFICE, "whiteboard", "meeting room"),
        (WARD, "medicine", "pharmacy"),
        (WARD, "bed", "patient room"),
        (HOTEL, "remote", "hotel room"),
        (HOTEL, "hair dryer", "hotel room"),
        (HOTEL, "suitcase", "luggage room"),
        (HOTEL, "sheets", "linen room"),
        (SCHOOL, "violin", "music room"),
        (SCHOOL, "paint brush", "art room"),
        (SCHOOL, "basketball", "gym"),
        (SCHOOL, "chalk", "classroom"),
        (SCHOOL, "inhaler", "nurse office"),
        (SCHOOL, "mop", "cleaning closet"),
        (SCHOOL, "toilet paper", "toilet"),
        (WAREHOUSE, "hammer", "warehouse"),
        (WAREHOUSE, "box cutter", "packing area"),
        (WAREHOUSE, "milk", "cold storage"),
        (FIRM, "jacket", "cloakroom"),
        (FIRM, "binder", "archive"),
        (FIRM, "coffee machine", "kitchen"),
        (HOUSE, "teddy bear", "child's bedroom"),
        (HOUSE, "lego", "child's bedroom"),
        (HOUSE, "nappies", "child's bedroom"),
        (HOUSE, "jewelry", "bedroom"),
        (HOUSE, "reading glasses", "bedroom"),
        (HOUSE, "dining chair", "dining room"),
        (HOUSE, "patio table", "patio"),
        (HOUSE, "curio cabinet", "dining room"),
        (HOUSE, "cocktail cabinet", "living room"),
        (HOUSE, "cereal box", "kitchen"),
        (HOUSE, "cookbook", "kitchen"),
        (HOUSE, "lawn mower", "shed"),
        (HOUSE, "power washer", "shed"),
        (HOUSE, "Christmas decorations", "attic"),
        (HOUSE, "treadmill", "basement"),
        (HOUSE, "cabinet", "kitchen"),
    ],
)
def test_a_person_looks_there_first(building: tuple[str, ...], word: str, room: str) -> None:
    assert first_room(word, *building) == room


def test_a_label_that_models_read_as_another_has_its_own_share_or_that_of_the_other() -> None:
    medicine, bed = find_thing("medicine"), find_thing("hospital bed")
    assert medicine is not None
    assert bed is not None
    assert medicine.probability_in("pharmacy") > 0 == medicine.probability_in("storage room")
    assert "examination room" not in dict(bed.rooms)
    assert bed.probability_in("examination room") == bed.probability_in("infirmary") > 0


def test_every_everyday_thing_is_known() -> None:
    words = (REPOSITORY / "tests" / "everyday_things.txt").read_text("utf-8").splitlines()
    assert [word for word in words if find_thing(word) is None] == []


@pytest.mark.parametrize("word", ["", " ", "person", "blue", "fire", "irwell", "xyy", "red mug"])
def test_other_words_name_no_thing(word: str) -> None:
    assert find_thing(word) is None


@pytest.mark.parametrize(
    ("word", "name"),
    [
        ("fridge", "refrigerator"),
        ("Night_Stand", "nightstand"),
        ("CoffeeTable", "coffee table"),
        ("worktops", "counter"),
        ("chest of drawers", "dresser"),
        ("banana", None),
        ("wall", None),
        ("", None),
    ],
)
def test_words_of_robots_name_pieces_of_furniture(word: str, name: str | None) -> None:
    found = find_receptacle(word)
    assert (found and found.name) == name


@pytest.mark.parametrize(
    ("thing", "first"),
    [
        ("milk", "refrigerator"),
        ("mug", "top cabinet"),
        ("remote control", "coffee table"),
        ("winter coat", "coat rack"),
        ("dirty socks", "laundry basket"),
        ("book", "shelf"),
        ("keys", "key rack"),
        ("wallet", "console table"),
        ("hammer", "tool box"),
        ("petrol can", "shelf"),
        ("axe", "shelf"),
        ("tool box", "shelf"),
        ("firewood", "fireplace"),
        ("sewing machine", "bottom cabinet"),
        ("bedpan", "toilet"),
        ("bedside lamp", "nightstand"),
        ("desk lamp", "table"),
        ("fruit bowl", "counter"),
        ("slippers", "shoe rack"),
        ("flashlight", "drawer"),
    ],
)
def test_a_person_would_look_there_first(thing: str, first: str) -> None:
    kept = find_keeping(thing)
    assert kept is not None
    assert max(kept.weights, key=kept.weights.__getitem__) == first


def test_what_stands_by_itself_is_on_nothing_and_of_others_nothing_is_said() -> None:
    alone = "wardrobe, sofa, bicycle, fridges, guitar, skis, fire extinguisher, laundry basket, bin"
    for thing in alone.split(", "):
        kept = find_keeping(thing)
        assert kept is not None, thing
        assert not kept.weights, thing
    assert find_keeping("sextant") is None


def test_nothing_is_kept_in_itself() -> None:
    for thing in list_things():
        kept = find_keeping(thing.name)
        assert kept is None or thing.name not in kept.weights, thing.name


def test_the_tables_are_whole() -> None:
    shares, pieces = read_shares(), list_receptacles()
    assert set(shares.rooms) <= set(list_room_labels())
    assert shares.belongs.shape == shares.untidy.shape == (len(shares.rooms), len(pieces))
    assert ((shares.belongs > 0) & (shares.belongs < 1)).all()
    for piece in pieces:  # each is a piece of furniture, and is like itself
        found = find_receptacle(piece)
        assert found is not None, piece
        assert pieces.index(piece) in found.like
    known = [find_keeping(thing.name) for thing in list_things()]
    names = {name for kept in known if kept for name in kept.weights}
    assert [
        name for name in names if not (found := find_receptacle(name)) or found.name != name
    ] == []
    assert np.mean([one is not None for one in known]) > 0.98
    assert find_thing("milk") is not None
