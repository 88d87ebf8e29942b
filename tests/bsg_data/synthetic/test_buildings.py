"""Synthetic buildings: reproducible, in HM3D's layout, with the means of their table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.room_label import LAYOUTS, label_of
from bsg_data.synthetic.building import (
    name_building,
    read_rooms,
    synthesise,
)
from bsg_data.synthetic.buildings import write_synthetic

TABLE = read_rooms()


def contents(paths: list[Path], root: Path) -> dict[str, bytes]:
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in paths}


def test_bytes_depend_on_seed_and_number_only(tmp_path: Path) -> None:
    many = contents(list(write_synthetic(tmp_path / "a", scenes=12, seed=3)), tmp_path / "a")
    few = contents(list(write_synthetic(tmp_path / "b", scenes=5, seed=3)), tmp_path / "b")
    assert len(many) == 12
    assert few.items() < many.items()


def test_hm3d_ids_come_first_and_every_later_one_is_its_number() -> None:
    ids = [name_building(0, number)[1] for number in (7, 8, 899, 900, 901, 123_456)]
    assert [one.split("-")[0] for one in ids] == [
        *("00007", "00800", "00899", "00900", "00901", "123456"),
    ]


def test_every_kind_has_a_label_and_every_class_a_name() -> None:
    assert {kind for kind in TABLE.kinds if label_of(LAYOUTS, kind) is None} == {"other"}
    class_map = load_class_map()
    found = {entry.class_index for name in TABLE.names if (entry := class_map.lookup(name))}
    assert found >= {*range(len(class_map.classes))}
    assert TABLE.names[0] == "wall", "which every room has"
    assert "stairs" in TABLE.names


def test_rooms_hold_what_the_table_says() -> None:
    """Means of 300 buildings; no region is empty, and some instances are in none."""
    found, rooms = np.zeros(TABLE.counts.shape), np.zeros(len(TABLE.kinds))
    firsts, astray = set(), 0
    for number in range(300):
        building = synthesise(seed=7, number=number)
        kinds = [TABLE.kinds.index(kind) for kind in building.rooms]
        np.add.at(rooms, kinds, 1)
        regions = sorted({row.region_id for row in building.rows} - {-1})
        assert regions == [*range(regions[0], regions[0] + len(kinds))]
        firsts.add(regions[0])
        astray += len(building.rows)
        for row in building.rows:
            if row.region_id >= 0:
                found[kinds[row.region_id - regions[0]], TABLE.names.index(row.name)] += 1
    assert firsts == {0, 1}
    assert 0 < astray - found.sum() < 300
    means = found / rooms[:, None]
    large = (TABLE.counts * rooms[:, None] > 500) & (np.arange(len(TABLE.names)) > 0)
    np.testing.assert_allclose(means[large], TABLE.counts[large], rtol=0.25)
    assert means.sum() == pytest.approx(TABLE.counts.sum(), rel=0.05)


@pytest.mark.parametrize(("scenes", "seed"), [(0, 0), (1, -1)])
def test_numbers_out_of_range_are_refused_at_once(tmp_path: Path, scenes: int, seed: int) -> None:
    with refuses(RecipeError, "number-range"):
        next(write_synthetic(tmp_path, scenes=scenes, seed=seed))
    assert not list(tmp_path.iterdir())
