from __future__ import annotations

import csv
import re
from importlib.resources import files

import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_data.scene.room_label import (
    Origin,
    ReadRoom,
    RoomReader,
    RoomType,
    check_own_label,
    is_name,
    known_label,
    label_of,
    list_all_labels,
    list_room_labels,
    normalise_room,
    owner_of,
    read_room,
    read_room_type,
    say_again,
)
from bsg_data.scene.surroundings import SAID_KINDS

OF_SOURCES = """
mp3d b: bedroom; mp3d B: bar; mp3d z: -; table b: -; table Room 101: -; nobody's office: office
behavior childs_room: bedroom; behavior empty_room: -; procthor LivingRoom: living room
layouts kitchen/living room: kitchen; table Master-Bedroom 2: bedroom
s3dis conferenceRoom: meeting room; cobie Physical Examination Room: examination room
"""


def test_words_of_sources_and_of_people() -> None:
    """With their case: a letter is Matterport3D's word alone. Of several rooms the first counts."""
    for words, _, label in (one.partition(": ") for one in re.split("; |\n", OF_SOURCES.strip())):
        source, _, word = words.partition(" ")
        assert label_of(source, word) == (None if label == "-" else label), words
    assert label_of("table", None) is None


KNOWN = """
bar, bathroom, bedroom, break room, classroom, closet, computer room, conference hall, copy room,
corridor, dining room, entrance, game room, garage, garden, gym, infirmary, kitchen, laboratory,
laundry room, library, living room, lobby, locker room, lounge, meeting room, office, pantry,
phone room, playroom, restaurant, shop, spa, staircase, storage room, terrace, toilet, tv room,
utility room
"""


def test_every_label_is_a_word_for_itself_and_models_know_these_in_this_order() -> None:
    labels = list_all_labels()
    assert [label_of("table", label) for label in labels] == [*labels]
    assert ", ".join(list_room_labels()) == " ".join(KNOWN.split())
    assert {known_label(label) for label in labels} == set(list_room_labels())
    file = files("bsg_mappings").joinpath("room-labels-v1.csv")
    header, *rows = csv.reader(file.read_text("utf-8").splitlines())
    assert header == ["source", "source_label", "label"]
    assert rows == sorted(rows)
    assert len({(source, word) for source, word, _ in rows}) == len(rows)
    kinds = {kind for source, _, kind in rows if source in ("building", "kind")}
    assert kinds == set(SAID_KINDS)


NAMES = """
kitchen: kitchen, Kitchen, kitchen_2, kitchen-1, Kitchen 3, kitchens, the kitchen, 1.04 Kitchen
kitchen: R(3) kitchen, staff kitchen, StaffKitchen, kichen, kithcen, staff kichen, kitchen-diner
kitchen: kitchenette, kitchen/living room, kitchen and dining room, Kitchen (ground floor)
kitchen: kitchenette 2nd floor, Küche, KÜCHE 2, Kueche, kuche, cuisine, Wohnküche, Küche 3b
bathroom: bath room, bath_room, BathRoom, second bathroom, 2nd bathroom, bathroom2
bathroom: bathroom 2nd floor, bathroom, Bath, Bad, Badezimmer, Badezimmer OG, salle de bains
bathroom: bathroom upstairs, bathroom_master, bathroom on the first floor, en-suite, salle de bain
bedroom: bed_room, bed room, bedrom, bedroom A, Bedroom II, guest bedroom, parents bedroom
bedroom: parents' bedroom, bedroom_parents, on-call room, Bedroom - Emma, Emma's bedroom
bedroom: Bedroom (guest), MASTER BEDROOM, my bedroom, Schlafzimmer, chambre, Gästezimmer
child's bedroom: kid's room, kids’ room, childrens room, children's room, nursery, baby's room
child's bedroom: Kinderzimmer, Kinderzimmer Emma, chambre d'enfant, chambre d’enfants, child room
hotel room: hotel room 12, hotel suite
living room: livingroom, LivingRoom, living_room, livng room, sitting room, sunroom, parlor
living room: Wohnzimmer, Wohnzimmer 1, salon, séjour, sejour
toilet: toilets, toilet 2, toilett, W.C., WC 2, w/c, ladies' toilet, men's room, mens room, loo
toilet: Gäste-WC, WC Herren, toilettes, Toilette
corridor: hall, Hall #3, hallway, hallwy, main hall, corridor north, north corridor, corridoor
corridor: Flur, Flur OG, Diele, couloir
dining room: dinning room, diningroom, dining area, Esszimmer, salle à manger, salle a manger
meeting room: meeting rooms, Meeting Room 1, conferance room, boardroom, board-room
meeting room: meeting room Alpha, Besprechungsraum
office: open-plan, open-plan office, open plan office 3, home office, study, nurses' station
office: Büro, Buero 3, Arbeitszimmer, bureau, office Smith
nurse office: nurse's office, nurses office, school nurse
printer room: printer room, print room 2, printer rooms
server room: server room, Server-Room, data centre, IT room
phone booth: phone booth 4, phonebooth
reception: reception, recption, front desk
lobby: hotel lobby, atrium
patient room: patient room 1, patientroom, ward 3, ICU 4, ward room 1, Ward Nightingale
medication room: medication room, med room
pharmacy: pharmacy, drug store
examination room: doctor's office, doctors' room, doctor room, examination rooms
imaging room: x-ray, MRI room
storage room: store room, storeroom, stores, Abstellraum, débarras
basement: basement, cellar, Keller, cave, wine cellar
attic: attic, loft, Dachboden, grenier
shed: garden shed, tool shed
balcony: balcony 2, Balkon, balcon, loggia
garden: garden, back garden, Garten, jardin
pantry: pantry, larder, Speisekammer, cellier
shop: store, shop, book store
classroom: classrooms, class room 4, lecture theatre B
music room: music room, music studio
art room: art studio, painting room
laboratory: lab, chemistry lab, labs
laundry room: laundry, laundary, Waschküche, buanderie
waiting room: A: waiting room, waiting area 3
entrance: vestibul, entrance hall, foyer, mudroom, mud room, boot room, entrée
garage: garrage, car park, Garage, parking room
utility room: utilty room, garbage room, charging bay
workshop: workshop, wood shop
cleaning closet: janitor closet, cleaning cupboard, broom cupboard
linen room: linen cupboard, linen store
luggage room: luggage store, luggage room
cloakroom: cloakroom, coat room
cold storage: cold store, walk-in fridge, freezer room
archive: archive, records room, filing room
canteen: canteen, cafeteria, refectory
staff room: staff room, teachers' lounge
lift: lift, goods lift, elevator 2, Aufzug
aisle: aisle 3, aisles
warehouse: warehouse, warehouse floor
packing area: packing station 4, packing room
loading dock: loading bay, dispatch, goods in
infirmary: sick bay, first aid room
"""
NAMED = [
    (name.strip(), label)
    for label, _, names in (line.partition(": ") for line in NAMES.strip().splitlines())
    for name in names.split(",")
]
NO_NAMES = """R(0), Room 101, room, b, 7, R7, zzqx, cooking spot, closed, marker, pastry, warden,
towel bar, cassette deck, kitchen cabinet, toilet paper, kitchen door, office chair, bus stop, bay,
bay 3, gym bag, red room, melting room, kitchen store, garden hose, patio door, barroom"""


def test_the_name_of_a_room_is_read() -> None:
    assert [(name, read_room_type(name).labels) for name, _ in NAMED] == NAMED
    nameless = [name.strip() for name in NO_NAMES.split(",")]
    assert {name for name in nameless if read_room(name) != ReadRoom(None)} == set()
    assert read_room("call room").label is read_room("side room 2").label is None, "it may be any"


def test_only_rules_that_may_be_wrong_are_told() -> None:
    rules = {name: read_room(name).rule for name, _ in NAMED}
    assert len(NAMED) > 120
    assert {rules[name] for name in ("kitchens", "bath room", "W.C.", "kid's room")} == {None}
    assert rules["staff kitchen"] == "head noun"
    assert rules["kichen"] == rules["staff kichen"] == "misspelt"
    assert rules["meeting room Alpha"] == rules["Bedroom - Emma"] == "first words"
    assert [is_name(name) for name in ("zzqx", "R7", "room 5", "unknown")] == [True] + [False] * 3


def test_what_was_said_is_kept_beside_the_labels_and_can_be_said_again() -> None:
    read = read_room_type({"kichen": 0.5, "hall": 0.25, "corridor": 0.25})
    assert read.labels == {"kitchen": 0.5, "corridor": 0.5}
    kitchen, hall = read.origins
    assert kitchen == Origin("kitchen", "kichen", "misspelt")
    assert say_again(read.labels, read.origins) == {"kichen": 0.5, "hall": 0.5}
    assert say_again("kitchen", [kitchen]) == "kichen"
    assert say_again("attic", [kitchen]) == "attic"
    assert say_again("kitchen", [Origin("kitchen", "kitchen 2", by_name=True)]) is None
    assert read_room_type("kitchen").origins == ()
    assert hall.rule is None


@given(st.text())
def test_number_case_and_hyphens_of_a_room_do_not_matter(name: str) -> None:
    assert normalise_room(f" {name}_12") == normalise_room(f"{name}-7")
    label = label_of("table", name)
    assert label is None or known_label(label) in list_room_labels()
    owner = owner_of(name)
    assert owner is None or owner == owner.casefold()


@pytest.mark.parametrize(
    ("room_type", "labels", "unread"),
    [
        (None, None, ()),
        ("zzz", None, ("zzz",)),
        ("unknown", None, ()),
        ("call room", None, ("call room",)),
        ({"zzz": 0.5, "Küche": 0.25, "kitchen": 0.25}, {"kitchen": 0.5}, ("zzz",)),
        ({"zzz": 1.0}, None, ("zzz",)),
        ({"kitchen": 1.0, "zzz": 0.0}, "kitchen", ("zzz",)),
    ],
)
def test_what_is_not_read_of_a_type_is_not_said(
    room_type: RoomType | None, labels: RoomType | None, unread: tuple[str, ...]
) -> None:
    read = read_room_type(room_type)
    assert (read.labels, read.unread) == (labels, unread)
    assert read_room_type(read.labels).labels == labels


def test_a_kind_of_building_has_words_of_its_own() -> None:
    hotel, hospital = RoomReader(kind="hotel"), RoomReader(kind="hospital")
    rooms = ("Room 101", "101", "guest room 12", "deluxe double room 4")
    assert {hotel(name).label for name in rooms} == {"hotel room"}
    assert [RoomReader()(name).label for name in rooms] == [None, None, "bedroom", "bedroom"]
    assert [hotel(name).label for name in ("7", "R7", "kitchen")] == [None, None, "kitchen"]
    assert {hospital(name).label for name in ("bay 3", "side room")} == {"patient room"}


def test_words_of_the_user_count_first() -> None:
    read = RoomReader((("Kajüte", "bedroom"), ("Office", "living room"), ("Hall", None)))
    names = ("Kajüte", "KAJÜTE_2", "Office", "Hall", "kitchen", "zzz")
    labels = ["bedroom", "bedroom", "living room", None, "kitchen", None]
    assert [read(name).label for name in names] == labels
    assert (check_own_label("a", "attic"), check_own_label("a", "")) == ("attic", None)
    with refuses(RecipeError, "room-label-unknown"):
        check_own_label("Kajüte", "bedrom")


OWNERS = """
emma: Emma's teddy bear; emma's room; Emma’s bedroom; Bedroom - Emma; Bedroom (Emma)
tom: Kinderzimmer Tom; office Tom; child's bedroom - Tom; the bag of Tom's; Bedroom 2 Tom
dad: dad's keys
nobody: master's bedroom; men's room; children's room; nurse's office; kid's bike; Bedroom; ''s
nobody: Bedroom A; Bedroom North; BEDROOM GUEST; Office Chair; bedroom wall; dog's bowl; teddy bear
nobody: Meeting room Alpha; 7's room
"""


def test_who_owns_a_thing_or_a_room() -> None:
    for owner, _, names in (line.partition(": ") for line in OWNERS.strip().splitlines()):
        found = {name: owner_of(name) or "nobody" for name in names.split("; ")}
        assert found == dict.fromkeys(found, owner)
