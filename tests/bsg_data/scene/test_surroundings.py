"""Surroundings by hand: what is known, what is not, and what cannot be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.errors import RecipeError
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.surroundings import (
    BUILDING_KINDS,
    EVIDENCE,
    KNOWN_SOURCES,
    MAX_FLOOR_AREA,
    Surroundings,
    check_building_kind,
    check_room_type,
    label_rows,
    repeat_surroundings,
    stack_surroundings,
)

LABELS = list_room_labels()
KITCHEN, DINING = LABELS.index("kitchen"), LABELS.index("dining room")


def same(a: Surroundings, b: Surroundings) -> bool:
    return (
        np.array_equal(a.floor_area, b.floor_area, equal_nan=True)
        and np.array_equal(a.labels, b.labels)
        and (a.building_kinds, a.sources) == (b.building_kinds, b.sources)
    )


@pytest.fixture
def office() -> Surroundings:
    return Surroundings.of_rooms(
        [12.5, None],
        ["Kitchenette", {"kitchen": 0.7, "dining room": 0.3}],
        building_kind="office",
        source="hm3d",
    )


def test_an_office_by_hand(office: Surroundings) -> None:
    np.testing.assert_array_equal(office.floor_area, [np.nan, 12.5, np.nan])
    assert office.labels.shape == (3, len(LABELS))
    assert office.labels.dtype == np.float32
    assert not office.labels[0].any()
    assert office.labels[1].tolist() == np.eye(len(LABELS))[KITCHEN].tolist()
    assert office.labels[2, [KITCHEN, DINING]].tolist() == pytest.approx([0.7, 0.3])
    assert (office.building_kinds, office.sources) == (("office",), ("hm3d",))
    assert office.building_kind_index.tolist() == [BUILDING_KINDS.index("office")]
    assert office.source_index.tolist() == [KNOWN_SOURCES.index("hm3d")]


def test_what_is_not_known_is_legal() -> None:
    nothing = Surroundings.of_rooms([None], [None])
    assert same(nothing, Surroundings.unknown(nodes=2))
    assert nothing.building_kind_index.tolist() == [Surroundings.UNKNOWN]
    assert nothing.source_index.tolist() == [Surroundings.UNKNOWN]
    others = Surroundings.of_rooms([], [], building_kind="other", source="my robot")
    assert (others.building_kinds, others.sources) == (("",), ("my robot",))
    assert others.source_index.tolist() == [Surroundings.UNKNOWN]


def test_what_probabilities_lack_of_1_is_spread_over_all_labels() -> None:
    rows = Surroundings.of_rooms([None], [{"kitchen": 0.61, "unknown": 0.2}]).labels[1]
    assert rows[KITCHEN] == pytest.approx(0.61 + 0.39 / len(LABELS))
    assert rows[DINING] == pytest.approx(0.39 / len(LABELS))


@given(shares=st.lists(st.floats(0, 1), min_size=1, max_size=len(LABELS)))
def test_a_room_type_is_a_distribution_or_nothing(shares: list[float]) -> None:
    total = max(1.0, sum(shares))
    said = {label: share / total for label, share in zip(LABELS, shares, strict=False)}
    row = Surroundings.of_rooms([None], [said]).labels[1]
    assert (row >= 0).all()
    assert row.sum() == pytest.approx(1.0 if any(said.values()) else 0.0, abs=1e-5)
    known = check_room_type(said)
    assert check_room_type(known) == known


def test_taking_inverts_stacking(office: Surroundings) -> None:
    shed = Surroundings.unknown(nodes=4)
    both = stack_surroundings([office, shed, office])
    assert len(both) == 10
    assert both.building_kinds == ("office", "", "office")
    assert same(both.take(slice(0, 3), buildings=slice(0, 1)), office)
    assert same(both.take(slice(3, 7), buildings=slice(1, 2)), shed)
    assert same(repeat_surroundings(office, 2), stack_surroundings([office, office]))


def test_evidence_is_left_out(office: Surroundings) -> None:
    less = office.without("floor_area", "sources")
    assert np.isnan(less.floor_area).all()
    assert less.sources == ("",)
    np.testing.assert_array_equal(less.labels, office.labels)
    assert less.building_kinds == ("office",)
    assert same(office.without(*EVIDENCE), Surroundings.unknown(nodes=3))
    assert same(office.without(), office)
    with pytest.raises(
        RecipeError, match="'colour' is no evidence; expected one of floor_area, labels"
    ):
        office.without("colour")


def test_labels_of_a_dataset_that_nobody_lists_are_unknown() -> None:
    rows = label_rows(["kitchen", None, "zzqx"])
    assert rows[:, KITCHEN].tolist() == [1, 0, 0]
    assert rows.sum() == 1


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ({"areas": [0.0]}, "above 0 and at most 100,000, found 0.0"),
        ({"areas": [float("nan")]}, "found nan"),
        ({"areas": [2 * MAX_FLOOR_AREA]}, "found 200000.0"),
        ({"areas": []}, "of the same rooms, found 0 and 1"),
        ({"types": ["kitchn"]}, "found 'kitchn'; did you mean kitchen"),
        ({"types": ["zzqx"]}, "found 'zzqx'; leave it out"),
        ({"types": [{"kitchn": 1.0}]}, "did you mean kitchen"),
        (
            {"types": [{"kitchen": -0.1}]},
            "room 1: 'kitchen': expected a probability, 0 to 1",
        ),
        ({"types": [{"kitchen": float("nan")}]}, "found nan"),
        ({"types": [{"kitchen": 10**400}]}, "expected a probability, 0 to 1"),
        ({"types": [{"kitchen": 0.7, "bar": 0.4}]}, "add up to 1 or less, found 1.1"),
        ({"types": [{str(n): 0.0 for n in range(1001)}]}, "at most 1000 labels"),
        ({"kind": "castle"}, "found 'castle'; known are home, office"),
    ],
)
def test_what_cannot_be_is_refused(said: dict[str, Any], expected: str) -> None:
    with pytest.raises(RecipeError, match=expected):
        Surroundings.of_rooms(
            said.get("areas", [None]), said.get("types", [None]), building_kind=said.get("kind")
        )


def test_kinds_of_buildings_in_any_spelling() -> None:
    assert [check_building_kind(kind) for kind in ("Home", "unknown", "", None)] == [
        "home",
        None,
        None,
        None,
    ]
