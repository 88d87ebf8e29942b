from __future__ import annotations

import csv
import json
import pickle
from copy import deepcopy
from importlib.resources import files

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.scene.room_label import (
    LAYOUTS,
    ReadRoom,
    Understood,
    check_room_type,
    explain_rules,
    is_name,
    known_label,
    label_of,
    list_room_labels,
    normalise_room,
    read_room,
)


@pytest.mark.parametrize(
    ("source", "word", "label"),
    [
        ("mp3d", "b", "bedroom"),
        ("mp3d", "B", "bar"),  # with its case
        ("mp3d", "z", None),
        ("behavior", "childs_room", "bedroom"),
        ("behavior", "empty_room", None),
        ("procthor", "LivingRoom", "living room"),
        (LAYOUTS, "kitchen/living room", "kitchen"),  # the first that is named
        ("table", "Master-Bedroom 2", "bedroom"),
        ("table", "b", None),  # a letter is Matterport3D's word alone
        ("table", "Room 101", None),
        ("nobody's", "office", "office"),
        ("cobie", "Physical Examination Room", "examination room"),
        ("s3dis", "conferenceRoom", "meeting room"),
        ("table", None, None),
    ],
)
def test_words_of_sources_and_of_people(source: str, word: str | None, label: str | None) -> None:
    assert label_of(source, word) == label


# What v3 reads otherwise than v2; but for a mudroom, because models know little of that label.
CORRECTED = {
    ("any", "mudroom"): "entrance",
    ("any", "phone booth"): "phone booth",
    ("any", "photocopy room"): "printer room",
    ("any", "print room"): "printer room",
    ("any", "printer room"): "printer room",
    ("any", "server room"): "server room",
    ("nearest", "patient room"): "bedroom",
}


def read_rows(version: int) -> dict[tuple[str, str], str]:
    file = files("bsg_mappings").joinpath(f"room-labels-v{version}.csv")
    header, *rows = csv.reader(file.read_text("utf-8").splitlines())
    assert header == ["source", "source_label", "label"]
    assert rows == sorted(rows)
    found = {(source, word): label for source, word, label in rows}
    assert len(found) == len(rows)
    return found


def test_every_label_is_a_word_for_itself_and_models_know_those_of_the_first_list() -> None:
    """Weights were trained with these, in this order."""
    first, rows = read_rows(1), read_rows(3)
    labels = {label for (source, _), label in rows.items() if label and source != "building"}
    assert {label: label_of("table", label) for label in labels} == {n: n for n in labels}
    assert list_room_labels() == tuple(sorted({label for label in first.values() if label}))
    assert {known_label(label) for label in labels} == set(list_room_labels())
    kept = {key: label for key, label in first.items() if key not in CORRECTED}
    assert all(label_of(*key) == (label or None) for key, label in kept.items())


NAMES = """
kitchen: kitchen, Kitchen, kitchen_2, kitchen-1, Kitchen 3, kitchens, the kitchen, 1.04 Kitchen
kitchen: R(3) kitchen, staff kitchen, StaffKitchen, kichen, kithcen, staff kichen, kitchen-diner
kitchen: kitchenette, kitchen/living room, kitchen and dining room, Kitchen (ground floor)
bathroom: bath room, bath_room, BathRoom, second bathroom, 2nd bathroom, bathroom2
bathroom: bathroom 2nd floor, bathroom, Bath
bathroom: bathroom upstairs, bathroom_master, bathroom on the first floor, en-suite
bedroom: bed_room, bed room, bedrom, bedroom A, Bedroom II, guest bedroom, parents bedroom
bedroom: parents' bedroom, kid's room, kids’ room, childrens room, children's room, bedroom_parents
bedroom: on-call room
bedroom: Bedroom (guest), MASTER BEDROOM, my bedroom, hotel room 12, nursery, baby's room
living room: livingroom, LivingRoom, living_room, livng room, sitting room, sunroom, parlor
toilet: toilets, toilet 2, toilett, W.C., WC 2, w/c, ladies' toilet, men's room, mens room, loo
corridor: hall, Hall #3, hallway, hallwy, main hall, corridor north, north corridor, corridoor
dining room: dinning room, diningroom, dining area
meeting room: meeting rooms, Meeting Room 1, conferance room, boardroom, board-room
office: open-plan, open-plan office, open plan office 3, home office, study, nurses' station
printer room: printer room, print room 2, printer rooms
server room: server room, Server-Room, data centre, IT room
phone booth: phone booth 4, phonebooth
lobby: reception, recption, hotel lobby
patient room: patient room 1, patientroom, ward 3, ICU 4
medication room: medication room, med room
pharmacy: pharmacy, drug store
examination room: doctor's office, doctors' room, doctor room, examination rooms
imaging room: x-ray, MRI room
storage room: store room, storeroom, stores, cellar, basement, cold store, garden shed
shop: store, shop, book store
classroom: classrooms, class room 4, lecture theatre B
laboratory: lab, chemistry lab, labs
laundry room: laundry, laundary
waiting room: A: waiting room, waiting area 3
entrance: vestibul, entrance hall, foyer, mudroom, boot room
garage: garrage, car park
utility room: utilty room, garbage room, workshop
"""
NAMED = [
    (name.strip(), label)
    for label, _, names in (line.partition(": ") for line in NAMES.strip().splitlines())
    for name in names.split(",")
]
NO_NAMES = """R(0), Room 101, room, b, 7, R7, zzqx, Küche, Flur, closed, marker, pastry, warden,
towel bar, cassette deck, kitchen cabinet, toilet paper, kitchen door, office chair, bus stop"""


@pytest.mark.parametrize(("name", "label"), NAMED)
def test_the_name_of_a_room_is_read(name: str, label: str) -> None:
    assert read_room(name).label == label
    assert check_room_type(name) == label


@pytest.mark.parametrize("name", [name.strip() for name in NO_NAMES.split(",")])
def test_what_names_no_kind_of_room_is_none(name: str) -> None:
    assert read_room(name) == ReadRoom(None)


@pytest.mark.parametrize("name", ["call room", "side room 2"])
def test_a_word_for_different_rooms_names_none(name: str) -> None:
    assert read_room(name).label is None


def test_only_rules_that_may_be_wrong_are_told() -> None:
    rules = {name: read_room(name).rule for name, _ in NAMED}
    assert len(NAMED) > 120
    assert {rules[name] for name in ("kitchens", "bath room", "W.C.", "kid's room")} == {None}
    assert rules["staff kitchen"] == "head noun"
    assert rules["kichen"] == rules["staff kichen"] == "misspelt"
    assert explain_rules({"kichen": 0.5, "hall": 0.5}) == {"kichen": "kitchen (misspelt)"}
    assert [is_name(name) for name in ("zzqx", "R7", "room 5", "unknown")] == [True] + [False] * 3


def test_what_a_label_was_read_from_changes_nothing_else() -> None:
    label = check_room_type("Kitchens")
    assert isinstance(label, Understood)
    assert (label, label.said, hash(label)) == ("kitchen", "Kitchens", hash("kitchen"))
    for again in (pickle.loads(pickle.dumps(label)), deepcopy(label)):
        assert (again, again.said) == ("kitchen", "Kitchens")
    assert json.dumps(label) == '"kitchen"'


@given(st.text())
def test_number_case_and_hyphens_of_a_room_do_not_matter(name: str) -> None:
    assert normalise_room(f" {name}_12") == normalise_room(f"{name}-7")
    label = label_of("table", name)
    assert label is None or known_label(label) in list_room_labels()
