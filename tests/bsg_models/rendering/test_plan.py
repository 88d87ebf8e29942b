"""A plan has every room where it lies, in its size, and no storey over another."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.scene.scene_graph import Box, Room
from bsg_models.rendering.plan import (
    KnownOutline,
    Outline,
    Plan,
    PlannedRoom,
    draw_plan,
    outline_room,
)

SQUARE: Outline = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
CORNERS = st.tuples(*[st.floats(-50, 50).map(lambda x: round(x, 2))] * 2)
ROOMS = st.lists(
    st.tuples(
        st.sampled_from(["hall", "bedroom", "x"]),
        st.none() | st.lists(CORNERS, min_size=3, max_size=6).map(tuple),
        st.none() | st.integers(0, 3),
    ),
    max_size=9,
).map(lambda rooms: [KnownOutline(i, *room) for i, room in enumerate(rooms, 1)])


def find(plan: Plan, number: int) -> PlannedRoom:
    return next(room for room in plan.rooms if room.number == number)


def test_the_upper_storey_is_drawn_above_and_y_points_down() -> None:
    high = tuple((x + 10, y + 5) for x, y in SQUARE)
    plan = draw_plan(
        [KnownOutline(1, "hall", SQUARE, 0), KnownOutline(2, "attic", high, 1)], aspect=0.5
    )
    assert [text for text, _ in plan.captions] == ["storey 1", "storey 0"]
    attic, hall = find(plan, 2), find(plan, 1)
    assert (attic.left, attic.right, hall.left, hall.right) == (0, 2, 0, 2)
    assert attic.bottom < hall.top  # its own corner of the page, wherever it lies in metres
    assert (attic.part, hall.part) == (0, 1)
    turned = draw_plan([KnownOutline(1, "a", ((0, 0), (4, 0), (4, 1)), None)])
    assert find(turned, 1).outline == ((0, 1), (4, 1), (4, 0))
    assert (turned.width, turned.height, turned.captions) == (4, 1, ())


@given(ROOMS)
def test_every_room_is_drawn_once_inside_the_page_in_its_own_size(
    rooms: list[KnownOutline],
) -> None:
    plan = draw_plan(rooms)
    assert sorted(room.number for room in plan.rooms) == [room.number for room in rooms]
    assert len({room.name for room in plan.rooms}) == len(rooms)
    for room in rooms:
        drawn = find(plan, room.number)
        assert -0.02 <= drawn.left <= drawn.right <= plan.width + 0.02
        assert -0.02 <= drawn.top <= drawn.bottom <= plan.height + 0.02
        if room.outline is not None:
            xs = [x for x, _ in room.outline]
            assert drawn.right - drawn.left == pytest.approx(max(xs) - min(xs), abs=0.03)
    for one in plan.rooms:
        for other in plan.rooms:
            if one.part != other.part:
                beside = one.right < other.left or other.right < one.left
                assert beside or one.bottom < other.top or other.bottom < one.top
    areas = [(room.right - room.left) * (room.bottom - room.top) for room in plan.rooms]
    assert areas == sorted(areas, reverse=True)  # small rooms over large ones


def test_an_outline_is_the_footprint_else_the_box_else_a_square() -> None:
    footprint, box = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.004)), Box((1, 2, 0), (3, 5, 2))
    known = Room(1, 7, box=box, footprint=footprint)
    assert outline_room(known, None) == ((0, 0), (1, 0), (0, 1))
    assert outline_room(Room(1, 7, box=box), None) == ((1, 2), (3, 2), (3, 5), (1, 5))
    assert outline_room(Room(1, 7), (2.0, 2.0, 0.0))[0] == (0.8, 0.8)  # type: ignore[index]
    assert outline_room(Room(1, 7), None) is None
