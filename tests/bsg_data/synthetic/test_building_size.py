"""Synthetic buildings of a stated size: as large as asked for, of the same types and things."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.synthetic.building_size import BuildingSize, draw_many_types, share_objects
from bsg_data.synthetic.buildings import draw_room_types, synthesise, write_synthetic
from bsg_data.synthetic.geometry import GeometryOptions
from bsg_data.synthetic.rates import load_rates

RATES = load_rates()
USUAL = len(RATES.rooms) - 1  # rooms of the largest building that was fitted


@settings(max_examples=15, deadline=None)
@given(rooms=st.integers(1, 90), more=st.one_of(st.none(), st.integers(0, 3000)))
def test_a_building_is_as_large_as_asked_for(rooms: int, more: int | None) -> None:
    size = BuildingSize(rooms, None if more is None else rooms + more)
    building = synthesise(RATES, seed=1, number=3, size=size)
    assert building == synthesise(RATES, seed=1, number=3, size=size)
    inside = [row.room_index for row in building.rows if row.room_index >= 0]
    assert set(inside) == {region for region, _ in building.room_types}
    assert len(building.room_types) == rooms
    if more is not None:
        assert len(inside) == rooms + more
    assert len({row.colour for row in building.rows}) == len(building.rows)


def test_another_size_is_another_building() -> None:
    sizes = [BuildingSize(), BuildingSize(rooms=9), BuildingSize(objects=99)]
    made = [synthesise(RATES, seed=0, number=0, size=size) for size in sizes]
    assert len({one.hash for one in made}) == 3
    assert len({one.scene_id[:6] for one in made}) == 1


def test_many_rooms_are_of_the_types_of_the_largest_fitted_buildings() -> None:
    rng = np.random.default_rng(0)
    _, counts = RATES.bins[-1]
    usual = sum(np.average(np.arange(len(some)), weights=some) for some in counts)
    fitted = [draw_room_types(RATES, rng, rooms=round(usual)) for _ in range(200)]
    expected = np.bincount(np.concatenate(fitted), minlength=len(counts)) / round(usual) / 200
    found = np.bincount(draw_many_types(RATES, 7000, rng), minlength=len(counts)) / 7000
    assert abs(found - expected).max() < 0.03
    assert len(draw_room_types(RATES, rng, rooms=USUAL + 1)) == USUAL + 1


def test_objects_are_shared_in_proportion() -> None:
    counts = np.array([[6, 2, 0], [0, 0, 2], [0, 1, 0]])
    shared = share_objects(counts, 100_000, np.random.default_rng(0))
    assert shared.sum() == 100_000
    np.testing.assert_allclose(shared / 100_000, counts / counts.sum(), atol=0.01)
    one_a_room = share_objects(counts, 3, np.random.default_rng(0))
    assert one_a_room.sum(axis=1).tolist() == [1, 1, 1]
    assert ((one_a_room > 0) <= (counts > 0)).all()


def test_the_folder_says_the_size(tmp_path: Path) -> None:
    size = BuildingSize(rooms=3, objects=30)
    paths = list(write_synthetic(tmp_path / "sized", scenes=2, seed=0, size=size))
    assert [len(path.read_text("utf-8").splitlines()) - 1 for path in paths] == [30, 30]
    mark = json.loads((tmp_path / "sized" / "synthetic.json").read_text("utf-8"))
    assert mark["size"] == {"rooms": 3, "objects": 30}
    list(write_synthetic(tmp_path / "usual", scenes=1, seed=0))
    assert "size" not in json.loads((tmp_path / "usual" / "synthetic.json").read_text("utf-8"))


@pytest.mark.parametrize(
    ("size", "meshes", "expected"),
    [
        (BuildingSize(rooms=0), False, "rooms of buildings: expected 1 to 100,000, found 0"),
        (BuildingSize(rooms=100_001), False, "expected 1 to 100,000, found 100,001"),
        (
            BuildingSize(objects=4_000_001),
            False,
            "objects of buildings: expected 34 .*, found 4,000,001",
        ),
        (
            BuildingSize(rooms=9, objects=8),
            False,
            r"expected 9 \(one per room\) to 4,000,000, found 8",
        ),
        (
            BuildingSize(rooms=101),
            True,
            "rooms of buildings with a mesh: expected 1 to 100, found 101",
        ),
        (
            BuildingSize(objects=10_001),
            True,
            "objects of buildings with a mesh: expected .*, found 10,001",
        ),
    ],
)
def test_an_impossible_size_is_refused_at_once(
    tmp_path: Path, size: BuildingSize, meshes: bool, expected: str
) -> None:
    geometry = GeometryOptions() if meshes else None
    with pytest.raises(ValueError, match=expected):
        write_synthetic(tmp_path, scenes=1, seed=0, size=size, geometry=geometry)
    assert not list(tmp_path.iterdir())
