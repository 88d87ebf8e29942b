from __future__ import annotations

import csv
import re

import pytest
from conftest import REPOSITORY

from bsg_data.scene.class_space import load_class_space
from bsg_data.scene.room_label import known_label, label_of, list_room_labels
from bsg_data.words.normal import normalise_name, separate
from bsg_robot.answers.words import find_everyday
from bsg_robot.things.things import (
    Thing,
    find_keeping,
    find_receptacle,
    find_thing,
    list_things,
    read_shares,
)

AT_HOME = set(
    """
bathroom, bedroom, closet, corridor, dining room, entrance, game room, garage, garden, gym, kitchen,
laundry room, library, living room, office, pantry, playroom, staircase, storage room, terrace,
toilet, tv room, utility room
""".replace("\n", " ")
    .strip()
    .split(", ")
)
CLASSES = {name for s in ("hm3d45-v1", "hm3d-wide-v1") for name in load_class_space(s).classes}


def test_every_row_is_whole() -> None:
    with (REPOSITORY / "bsg_robot/tables/things-v1.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file, strict=True))
    things = list_things()
    assert [row["thing"] for row in rows] == sorted({one.name for one in things})
    for thing in things:
        labels = [label for label, _ in thing.rooms]
        at_home = [share for label, share in thing.rooms if label in AT_HOME]
        assert sum(at_home) == pytest.approx(1), thing.name
        assert max(share for _, share in thing.rooms) <= 2.5, thing.name
        assert {known_label(label) for label in labels} <= set(list_room_labels()), thing.name
        assert [label_of("any", label) for label in labels] == labels, thing.name
        assert len(labels) == len(set(labels)), thing.name
        assert 0 < thing.home <= 1, thing.name
        assert 0 < thing.sight <= 1, thing.name
        assert thing.wider in {None, *CLASSES}, thing.name


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
    labels = {room for thing in list_things() for room, _ in thing.rooms}
    for thing in list_things():
        whole = find_thing(thing.wider or thing.name)
        assert whole is not None, thing.name
        assert thing.home <= whole.home, thing.name
        wrong = [room for room in labels if _is_in(thing, room) > _is_in(whole, room) + 1e-9]
        assert wrong == [], thing.name


def _is_in(thing: Thing, room: str) -> float:
    """Return P(at least one) in a room."""
    return float(1 - (1 - thing.home) ** thing.probability_in(room))


def test_a_narrow_room_holds_what_is_named_there_and_others_what_a_like_room_does() -> None:
    def weigh(word: str, *rooms: str) -> list[float]:
        thing = find_thing(word)
        assert thing is not None, word
        return [thing.probability_in(room) for room in rooms]

    shop, utility, cold, store = weigh(
        "hammer", "workshop", "utility room", "cold storage", "storage room"
    )
    assert shop > 1 > utility > 0 == cold < store
    assert weigh("milk", "cold storage") > [0]
    pharmacy, archive, child, store = weigh(
        "medicine", "pharmacy", "archive", "child's bedroom", "storage room"
    )
    assert pharmacy > 0 == archive == child == store, "models read a pharmacy as a storage room"
    room, infirmary = weigh("hospital bed", "examination room", "infirmary")
    assert room == infirmary > 0


def test_every_name_and_its_plural_lead_to_its_thing() -> None:
    names = {one: thing for thing in list_things() for one in thing.names}
    assert all(one.isascii() and one == normalise_name(one) != "" for one in names)
    assert len({separate(one) for one in names}) == sum(len(one.names) for one in list_things())
    assert {one: find_thing(one) for one in names} == names
    plurals = {f"{one}s": thing for one, thing in names.items() if not one.endswith("s")}
    wrong = {one for one, thing in plurals.items() if find_thing(one) != thing}
    assert wrong == {"nuts", "tablets"}  # to eat; to swallow


# word → thing: where it is looked for first, in any order: between how many homes have one.
SAID = """
socks → sock: bedroom, closet, laundry room: .98 1
settee → sofa: living room: .9 1
cell phone → phone: bedroom, living room: .95 1
pills → medicine: pharmacy: .95 1
car keys → key: entrance, corridor: .98 1
scissors → scissors: kitchen: .95 1
knives → knife: kitchen: .98 1
toothbrushes → toothbrush: bathroom: .98 1
charger → phone charger: bedroom: .95 1
insulin → insulin: pharmacy: .02 .1
alarm clock → alarm clock: bedroom: .4 .8
glasses → eyeglasses: bedroom: .6 .95
glass → glass: kitchen: .98 1
tablets → medicine: pharmacy: .95 1
tv_monitor → television: living room: .9 1
a tv → television: living room: .9 1
desk lamp → desk lamp: office, bedroom: .4 .8
bedside lamp → bedside lamp: bedroom: .7 .9
table lamp → table lamp: living room, bedroom: .8 1
office phone → desk phone: office: .05 .2
landline → landline phone: living room: .3 .5
thermometer → clinical thermometer: bathroom: .7 .9
bath → bathtub: bathroom: .7 .85
fireplace → fireplace: living room: .3 .45
"""


def test_what_a_person_would_say() -> None:
    for said, places, homes in (line.split(": ") for line in SAID.strip().splitlines()):
        word, _, name = said.partition(" → ")
        rooms, (low, high) = places.split(", "), map(float, homes.split())
        thing = find_everyday(word)
        assert thing is not None, said
        assert thing.name == name
        asked = sorted({*AT_HOME, *rooms}, key=thing.probability_in, reverse=True)
        assert set(asked[: len(rooms)]) == set(rooms), said
        assert low <= thing.home <= high, said


# The questions of a person, in buildings with these rooms: where it is looked for.
LOOKED_FOR = """
living room, corridor, kitchen, bathroom, bedroom, utility room
  bathroom: towel, medicine; corridor: keys; utility room: broom; bedroom: charger
office, copy room, meeting room, kitchen, toilet, corridor, computer room
  copy room: printer; toilet: toilet paper; office: stapler; meeting room: whiteboard
patient room, office, pharmacy, corridor, bathroom, storage room
  pharmacy: medicine; patient room: bed
hotel room, lobby, reception, linen room, luggage room, kitchen, corridor, lift, restaurant
  hotel room: remote, hair dryer; luggage room: suitcase; linen room: sheets
classroom, music room, art room, gym, canteen, staff room, nurse office, cleaning closet, toilet
  music room: violin; art room: paint brush; gym: basketball; classroom: chalk
  nurse office: inhaler; cleaning closet: mop; toilet: toilet paper
warehouse, aisle, cold storage, loading dock, packing area, office, toilet
  warehouse: hammer; packing area: box cutter; cold storage: milk
office, archive, cloakroom, reception, kitchen, meeting room, lift, toilet
  cloakroom: jacket; archive: binder; kitchen: coffee machine
living room, kitchen, dining room, bedroom, child's bedroom, bathroom, office, entrance, garage, \
laundry room, basement, attic, patio, garden, shed
  child's bedroom: teddy bear, lego, nappies; bedroom: jewelry, reading glasses
  dining room: dining chair, curio cabinet; patio: patio table; living room: cocktail cabinet
  kitchen: cereal box, cookbook, cabinet; shed: lawn mower, power washer
  attic: Christmas decorations; basement: treadmill
"""


def test_a_person_looks_there_first() -> None:
    rooms: list[str] = []
    for line in LOOKED_FOR.replace("\\\n", "").strip().splitlines():
        if not line.startswith(" "):
            rooms = line.split(", ")
            continue
        for room, _, words in (one.partition(": ") for one in line.strip().split("; ")):
            found = {word: find_thing(word) for word in words.split(", ")}
            first = {w: max(rooms, key=t.probability_in) for w, t in found.items() if t}
            assert first == dict.fromkeys(found, room)


def test_every_everyday_thing_is_known() -> None:
    words = (REPOSITORY / "tests" / "everyday_things.txt").read_text("utf-8").splitlines()
    assert [word for word in words if find_thing(word) is None] == []
    others = ["", " ", "person", "blue", "fire", "irwell", "xyy", "red mug"]
    assert [*map(find_thing, others)] == [None] * len(others)


KEPT = """
milk: refrigerator; mug: top cabinet; remote control: coffee table; winter coat: coat rack
dirty socks: laundry basket; book, petrol can, axe, tool box: shelf; keys: key rack
wallet: console table; hammer: tool box; firewood: fireplace; sewing machine: bottom cabinet
bedpan: toilet; bedside lamp: nightstand; desk lamp: table; fruit bowl: counter
slippers: shoe rack; flashlight: drawer
"""


def test_a_person_would_look_on_this_piece_first() -> None:
    for words, _, piece in (one.partition(": ") for one in re.split(r"; |\n", KEPT.strip())):
        for word in words.split(", "):
            kept = find_keeping(word)
            assert kept is not None, word
            assert max(kept.weights, key=kept.weights.__getitem__) == piece, word


def test_what_stands_by_itself_is_on_nothing_and_of_others_nothing_is_said() -> None:
    alone = "wardrobe, sofa, bicycle, fridges, guitar, skis, fire extinguisher, laundry basket, bin"
    for thing in alone.split(", "):
        kept = find_keeping(thing)
        assert kept is not None, thing
        assert not kept.weights, thing
    assert find_keeping("sextant") is None


def test_the_tables_are_whole() -> None:
    shares, pieces = read_shares(), read_shares().pieces
    assert set(shares.rooms) <= set(list_room_labels())
    assert shares.belongs.shape == shares.untidy.shape == (len(shares.rooms), len(pieces))
    assert ((shares.belongs > 0) & (shares.belongs < 1)).all()
    for piece in pieces:  # each is a piece of furniture, and is like itself
        found = find_receptacle(piece)
        assert found is not None, piece
        assert pieces.index(piece) in found.like
    known = {thing.name: kept for thing in list_things() if (kept := find_keeping(thing.name))}
    assert len(known) > 0.98 * len(list_things())
    for thing, kept in known.items():
        pieces_of = {name: find_receptacle(name) for name in kept.weights}
        assert {name: piece and piece.name for name, piece in pieces_of.items()} == {
            name: name for name in kept.weights if name != thing
        }, "nothing is kept in itself"
