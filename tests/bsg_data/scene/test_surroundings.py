"""Surroundings by hand: what is known, what is not, and what cannot be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from one_building import same_surroundings, surround_rooms

from bsg_data.errors import RecipeError
from bsg_data.scene.room_label import (
    RoomType,
    check_room_type,
    list_room_labels,
    read_building_kind,
    read_room_type,
)
from bsg_data.scene.scene_graph import Box
from bsg_data.scene.surroundings import (
    BUILDING_KINDS,
    EVIDENCE,
    KNOWN_SOURCES,
    SAID_KINDS,
    UNKNOWN,
    Surroundings,
    find_floor_area,
    measure_area,
)

LABELS = list_room_labels()
KITCHEN, DINING = LABELS.index("kitchen"), LABELS.index("dining room")
L_SHAPE = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]
BOX = Box((0, 0, 0), (3, 2, 2.5))


@pytest.fixture
def office() -> Surroundings:
    types: list[RoomType | None] = ["Kitchenette", {"kitchen": 0.7, "dining room": 0.3}]
    return surround_rooms([12.5, None], types, building_kind="office", source="hm3d")


def test_an_office_by_hand(office: Surroundings) -> None:
    np.testing.assert_array_equal(office.floor_area, [np.nan, 12.5, np.nan])
    assert office.labels.dtype == np.float32
    assert office.labels[1].tolist() == np.eye(len(LABELS))[KITCHEN].tolist()
    assert office.labels[2, [KITCHEN, DINING]].tolist() == pytest.approx([0.7, 0.3])
    assert not office.labels[0].any()
    assert office.building_kinds.tolist() == [BUILDING_KINDS.index("office")]
    assert office.sources.tolist() == [KNOWN_SOURCES.index("hm3d")]
    assert BUILDING_KINDS == ("home", "office", "school", "shop", "restaurant", "hotel", "hall")


def test_what_is_not_known_is_legal() -> None:
    nothing = surround_rooms([None], [None], source="my robot")
    assert same_surroundings(nothing, Surroundings.unknown(nodes=2))
    ward = surround_rooms([None], ["ward"], building_kind="hospital")  # of no model's training
    assert ward.building_kinds.tolist() == ward.sources.tolist() == [UNKNOWN]
    assert ward.labels[1, LABELS.index("bedroom")] == 1


WORDS = """
home: Home, house, apartment, flat, Villa, holiday home, Wohnung, maison
office: office building, coworking
school: kindergarten, university, Schule, école
shop: supermarket, store, Mall
restaurant: cafe, café, bar, canteen
hotel: hostel, guest house
hall: conference center, church
hospital: Hospital, clinic, care home, Krankenhaus
warehouse: warehouse, factory, distribution centre
museum: museum, art gallery
gym: gym, fitness center
library: library, public library
other: Other
"""


def test_a_word_for_a_building_is_read_as_its_kind() -> None:
    words = dict(line.split(": ") for line in WORDS.strip().split("\n"))
    assert set(words) == set(SAID_KINDS)
    read = {kind: set(map(read_building_kind, words[kind].split(", "))) for kind in words}
    assert read == {kind: {kind} for kind in words}
    assert {read_building_kind(word) for word in ("castle", "zzz", "unknown", "zzz 3", "")} == {
        None
    }


@given(shares=st.lists(st.floats(0, 1), min_size=1, max_size=len(LABELS)))
def test_a_room_type_is_a_distribution_or_nothing(shares: list[float]) -> None:
    """What the probabilities leave is spread over all labels."""
    total = max(1.0, sum(shares))
    types = {label: share / total for label, share in zip(LABELS, shares, strict=False)}
    row = surround_rooms([None], [types]).labels[1]
    rest = max(0.0, 1 - sum(types.values())) / len(LABELS) if any(types.values()) else 0.0
    expected = [types.get(label, 0.0) + rest for label in LABELS]
    assert row.tolist() == pytest.approx(expected, abs=1e-5)
    known = read_room_type(types)
    assert read_room_type(known.labels) == known


def test_evidence_is_left_out(office: Surroundings) -> None:
    less = office.without("floor_area", "sources")
    assert np.isnan(less.floor_area).all()
    assert less.sources.tolist() == [UNKNOWN]
    np.testing.assert_array_equal(less.labels, office.labels)
    assert same_surroundings(office.without(*EVIDENCE), Surroundings.unknown(nodes=3))
    assert same_surroundings(office.without(), office)


@pytest.mark.parametrize(
    "room_type",
    [
        {"kitchen": -0.1},
        {"kitchen": float("nan")},
        {"kitchen": 10**400},
        {"kitchen": 0.7, "bar": 0.4},
        {},
        {str(number): 0.0 for number in range(1001)},
    ],
)
def test_a_room_type_that_cannot_be_is_refused(room_type: RoomType) -> None:
    with pytest.raises(RecipeError):
        check_room_type(room_type)


def test_the_first_that_says_a_floor_area_counts() -> None:
    assert find_floor_area(5.5, footprint=L_SHAPE, box=BOX) == 5.5
    assert find_floor_area(None, footprint=L_SHAPE, box=BOX) == pytest.approx(4)
    line = [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)]
    for shape in (None, line, line[:2]):  # no shape, or one without an area
        assert find_floor_area(None, footprint=shape, box=BOX) == 6
        assert find_floor_area(None, footprint=shape, box=None) is None
    for area in (0.0, -1.0, float("nan"), float("inf"), 1e6):  # no room has it
        assert find_floor_area(area, footprint=None, box=BOX) == 6
    for box in (Box((0, 0, 0), (1e4, 1e4, 3)), Box((3, 0, 0), (1, 2, 2))):
        assert find_floor_area(None, footprint=None, box=box) is None


def test_polygons_have_the_area_of_the_shoelace_formula_or_what_they_cover() -> None:
    bow = [(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)]
    assert measure_area(bow) == pytest.approx(4)  # of its hull
    rng = np.random.default_rng(3)
    for _ in range(20):
        angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
        x, y = rng.uniform(1, 4, 9) * np.stack([np.cos(angles), np.sin(angles)])
        corners = list(zip(x.tolist(), y.tolist(), strict=True))
        shoelace = abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2
        assert measure_area(corners) == pytest.approx(shoelace, abs=1e-4)
