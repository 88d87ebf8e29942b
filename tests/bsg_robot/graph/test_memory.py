"""Where things were before: kept by the hour, bounded, in order, and whole in a file."""

from __future__ import annotations

from typing import Any

import pytest
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_data.inputs.bounds import MAX_ROBOT_SOUGHT
from bsg_models.belief.clock import DAY, HOUR
from bsg_robot import SeenBuilding, open_graph
from bsg_robot.graph import memory
from bsg_robot.graph.robot_json import RobotGraphError

NOW = 1_795_867_200.0  # seconds: a noon
HOME: dict[str, Any] = {
    "scene_id": "home",
    "rooms": [{"id": "kitchen"}, {"id": "hall"}],
    "objects": [{"id": "shelf", "room": "hall", "category": "shelf", "time": NOW}],
    "more_rooms": 0,
    "now": NOW,
}


@pytest.fixture
def seen() -> SeenBuilding:
    return open_graph(HOME)


def places(seen: SeenBuilding, name: str) -> list[tuple[float, int, str | None]]:
    """Return hour, room and piece of what is remembered of a thing."""
    found = [one for one in seen.graph.memory if one.name == name]
    return [((s.time - NOW) / HOUR, s.room_index, s.on) for one in found for s in one.sightings]


def where(seen: SeenBuilding, name: str) -> tuple[int, str | None, float] | None:
    """Return room, piece and hour of a known object."""
    known = [obj for obj in seen.graph.objects if obj.name == name]
    return (known[0].room_index, known[0].on, (known[0].time or 0) - NOW) if known else None


def test_sightings_of_an_hour_at_a_place_are_one(seen: SeenBuilding) -> None:
    for minutes in range(0, 150, 10):
        seen.saw("hall", "keys", object_id="1", on="shelf", time=NOW + 60 * minutes)
    assert places(seen, "1") == [(0, 2, "shelf"), (1, 2, "shelf"), (2, 2, "shelf")]
    seen.saw("kitchen", "keys", object_id="1", time=NOW + 9000)
    assert places(seen, "1")[3:] == []
    assert where(seen, "1") == (1, None, 9000)


def test_a_thing_keeps_its_latest_sightings_and_all_things_together_so_many(
    seen: SeenBuilding, monkeypatch: pytest.MonkeyPatch
) -> None:
    for day in range(100):
        seen.saw("hall", "keys", object_id="1", time=NOW + day * DAY)
    assert [hour / 24 for hour, *_ in places(seen, "1")] == [*range(39, 99)]
    monkeypatch.setattr(memory, "MOST_IN_ALL", 50)
    seen.saw("hall", "mug", object_id="2", time=NOW + 100 * DAY)
    seen.gone("2", time=NOW + 101 * DAY)
    assert [hour / 24 for hour, *_ in places(seen, "1")] == [*range(69, 99)]
    monkeypatch.setattr(memory, "MOST_THINGS", 1)
    seen.saw("hall", "mug", object_id="3", time=NOW + 102 * DAY)
    seen.gone("3", time=NOW + 103 * DAY)
    assert [one.name for one in seen.graph.memory] == ["3"]


def test_a_late_report_changes_nothing_that_is_later(seen: SeenBuilding) -> None:
    seen.saw("kitchen", "keys", object_id="1", time=NOW + 2 * HOUR)
    seen.looked("hall", "mug", time=NOW + 2 * HOUR)
    seen.searched("kitchen", time=NOW + 2 * HOUR)
    seen.saw("hall", "keys", object_id="1", on="shelf", time=NOW + HOUR)
    assert where(seen, "1") == (1, None, 7200)
    assert places(seen, "1") == [(1, 2, "shelf")]
    before = seen.graph
    seen.gone("1", time=NOW + HOUR)
    seen.searched("kitchen", found=[], time=NOW + HOUR)
    seen.entered("kitchen", hidden_share=0.5, time=NOW + HOUR)
    seen.looked("kitchen", "keys", time=NOW + HOUR)
    assert seen.graph == before
    seen.saw("hall", "mug", object_id="2", time=NOW + HOUR)
    assert seen.graph.looks == before.looks
    seen.gone("1")
    seen.saw("kitchen", "keys", object_id="1", time=NOW)
    assert where(seen, "1") is None
    assert places(seen, "1") == [(0, 1, None), (1, 2, "shelf"), (2, 1, None)]


def test_what_is_gone_is_remembered_and_is_the_same_when_it_comes_back(seen: SeenBuilding) -> None:
    name = seen.saw("hall", "keys", on="shelf")
    seen.passes(5)
    seen.gone(name)
    assert where(seen, name) is None
    assert places(seen, name) == [(0, 2, "shelf")]
    assert seen.saw("kitchen", "keys") == name
    seen.passes(1000)
    assert seen.saw("hall", "keys") == name  # they are improbably where they were
    assert places(seen, name) == [(0, 2, "shelf"), (5, 1, None)]
    assert seen.saw("kitchen", "keys") != name  # others, seen at once


def test_what_is_gone_is_not_expected_where_it_lay_for_a_while(seen: SeenBuilding) -> None:
    def on_shelf(seen: SeenBuilding) -> float:
        return next(o.probability for o in seen.where("keys", within="hall") if o.piece == "shelf")

    for day in range(5):
        seen.saw("hall", "keys", object_id="1", on="shelf", time=NOW + day * DAY)
    two = seen.copy()
    seen.gone("1")
    (look,) = seen.graph.looks
    assert (look.thing, look.at, look.time) == ("keys", "shelf", NOW + 4 * DAY)
    just_now = on_shelf(seen)
    seen.passes(24 * 30)
    assert on_shelf(seen) > 2 * just_now
    seen.saw("hall", "keys")
    assert not seen.graph.looks
    two.saw("hall", "keys", object_id="2", on="shelf", within=0)
    two.gone("1")
    assert not two.graph.looks


def test_without_a_clock_nothing_is_remembered() -> None:
    seen = open_graph({**HOME, "now": None, "objects": []})
    seen.saw("hall", "keys", object_id="1")
    seen.saw("kitchen", "keys", object_id="1")
    seen.gone("1")
    assert (seen.graph.memory, seen.graph.looks, seen.graph.now) == ((), (), None)
    seen.passes(0)
    assert seen.graph.now == 0


def test_looks_that_faded_make_room(seen: SeenBuilding) -> None:
    for minute in range(3 * MAX_ROBOT_SOUGHT):
        seen.looked("kitchen", f"thing {minute % 150} mug", time=NOW + 60 * minute)
    assert [one.time - NOW for one in seen.graph.looks] == [60 * n for n in range(200, 300)]
    seen.looked("kitchen", "mug", time=NOW + 365 * DAY)
    assert [one.thing for one in seen.graph.looks] == ["mug"]


def test_the_first_time_dates_all_that_is_known() -> None:
    seen = open_graph({"kitchen": ["mug"], "hall": []})
    seen.passes(until="2026-11-28T12:00:00Z")
    assert seen.graph.now == NOW
    assert [one.time for one in (*seen.graph.objects, *seen.graph.rooms)] == [NOW, NOW, None]
    seen.passes(2)
    assert seen.graph.now == NOW + 2 * HOUR


def test_a_time_that_cannot_be_changes_nothing(seen: SeenBuilding) -> None:
    before = seen.graph
    with refuses(RecipeError, "time-far", "home"):
        seen.saw("hall", "keys", time=NOW + 11 * 366 * DAY)
    with refuses(RecipeError, "time-back", "home"):
        seen.passes(until=NOW - 1)
    assert seen.graph is before


REMEMBERED = {"id": "1", "category": "mug", "sightings": [[NOW, "hall", None]]}


@pytest.mark.parametrize(
    "wrong",
    [
        {"now": NOW - 2 * DAY},  # before the last report
        {"now": 10**400},
        {"memory": [REMEMBERED, REMEMBERED]},
        {"memory": [REMEMBERED | {"sightings": []}]},
        {"memory": [REMEMBERED | {"sightings": [[NOW, "attic", None]]}]},
        {"memory": [REMEMBERED | {"sightings": [[NOW, "hall", None]] * 61}]},
        {"memory": [REMEMBERED | {"id": str(n)} for n in range(memory.MOST_THINGS + 1)]},
        {"memory": [REMEMBERED | {"sightings": [[]] * (memory.MOST_IN_ALL + 1)}]},
        {"customs": [{"thing": "mug"}]},
        {"customs": [{"thing": "mug", "room": "attic"}]},
    ],
)
def test_a_memory_that_cannot_be_is_refused(wrong: dict[str, Any]) -> None:
    with refuses(RobotGraphError, "graph-malformed", "graph"):
        open_graph({**HOME, **wrong})


def test_what_is_odd_but_may_be_is_read() -> None:
    """Of an object, too; at equal times; out of order; at furniture that is gone."""
    sightings = [[NOW, None, None], [NOW, "hall", "desk"], [NOW - 1, "hall", None]]
    odd = {"id": "shelf", "category": "zzqx", "sightings": sightings}
    customs = [{"thing": "zzqx", "room": "hall"}, {"thing": "mug", "at": "cabinet"}] * 2
    seen = open_graph({**HOME, "memory": [odd], "customs": customs})
    assert [one.time - NOW for one in seen.graph.memory[0].sightings] == [-1, 0, 0]
    assert 0 < seen.anywhere("mug") < 1
    assert seen.habits("shelf")
    assert [note for note in seen.notes if note.endswith(("'zzqx'", "'cabinet'"))] == [
        "what people say of what nobody has a word for is ignored: 'zzqx'",
        "people keep things at furniture that was not seen yet: 'cabinet'",
    ]
