"""Synthetic buildings: reproducible, in HM3D's layout, with its irregularities and its rates."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import DatasetError, SourceError
from bsg_data.sources.hm3d import SYNTHETIC_MARK, HM3DFolder
from bsg_data.synthetic.building import (
    MAX_SCENES,
    SyntheticBuilding,
    SyntheticError,
    SyntheticRates,
    _draw_room_types,
    load_rates,
    synthesise,
)
from bsg_data.synthetic.buildings import write_synthetic

ROW = re.compile(r'([1-9][0-9]*),([1-9A-F][0-9A-F]{0,5}),"([^"\n]*)",(-1|[0-9]+)')
RATES = load_rates()


@pytest.fixture(scope="module")
def buildings() -> list[SyntheticBuilding]:
    """A hundred buildings of one seed."""
    return [synthesise(RATES, seed=7, number=number) for number in range(100)]


def contents(paths: list[Path], root: Path) -> dict[str, bytes]:
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in paths}


def z_score(found: list[float], expected: list[float]) -> float:
    """Return how many standard errors the mean of paired differences is from 0."""
    difference = np.array(found, dtype=float) - np.array(expected, dtype=float)
    return float(difference.mean() / (difference.std(ddof=1) / np.sqrt(len(difference))))


def expected_objects(rates: SyntheticRates, building: SyntheticBuilding) -> float:
    return sum(sum(rates.rates[kind]) for _, kind in building.room_types)


def in_rooms(building: SyntheticBuilding) -> int:
    return sum(row.region_id >= 0 for row in building.rows)


# Reproducibility


def test_bytes_depend_on_seed_and_number_only(tmp_path: Path) -> None:
    many = contents(list(write_synthetic(tmp_path / "a", scenes=12, seed=3)), tmp_path / "a")
    few = contents(list(write_synthetic(tmp_path / "b", scenes=5, seed=3)), tmp_path / "b")
    assert len(many) == 12
    assert few.items() < many.items()


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**64), number=st.integers(0, MAX_SCENES - 1))
def test_any_building_is_whole_and_the_same_again(seed: int, number: int) -> None:
    building = synthesise(RATES, seed=seed, number=number)
    assert building == synthesise(RATES, seed=seed, number=number)
    assert sorted(row.instance_id for row in building.rows) == [
        *range(1, len(building.rows) + 1),
    ]
    assert len({row.colour for row in building.rows}) == len(building.rows)
    regions = {region for region, _ in building.room_types}
    assert {row.region_id for row in building.rows} - {-1} == regions
    assert min(regions) in {0, 1}


def test_hm3d_ids_come_first_and_every_later_one_is_its_number() -> None:
    made = [synthesise(RATES, seed=0, number=n).scene_id for n in (7, 8, 899, 900, 901, 123_456)]
    assert [one.split("-")[0] for one in made] == [
        *("00007", "00800", "00899", "00900", "00901", "123456"),
    ]


# Layout


def test_every_line_is_a_row_of_hm3d(tmp_path: Path) -> None:
    for path in list(write_synthetic(tmp_path, scenes=20, seed=1)):
        data = path.read_bytes()
        assert b"\r" not in data
        first, *rows, last = data.decode("utf-8").split("\n")
        assert (first, last) == ("HM3D Semantic Annotations", "")
        matches = [ROW.fullmatch(row) for row in rows]
        assert all(matches)
        assert len({match[2] for match in matches if match}) == len(rows)


# Irregularities


def test_the_irregularities_of_real_files_occur(buildings: list[SyntheticBuilding]) -> None:
    some = buildings[:50]
    rows = [row for one in some for row in one.rows]
    names = Counter(row.name for row in rows)
    assert {"unknown", "wall"} <= set(names)
    assert any("," in name for name in names)
    assert any("/" in name for name in names)
    short = np.mean([len(row.colour) < 6 for row in rows])
    assert short == pytest.approx(1 / 16, abs=0.01), "as many colours as have a leading zero"
    assert any(row.region_id == -1 for row in rows)
    firsts = [one.room_types[0][0] for one in some]
    assert set(firsts) == {0, 1}
    assert any(row.region_id == 0 for row in rows), "region 0 is a real room"
    spans = [one.room_types[-1][0] - one.room_types[0][0] + 1 for one in some]
    assert any(span > len(one.room_types) for span, one in zip(spans, some, strict=True))
    ids = [[row.instance_id for row in one.rows] for one in some]
    assert 0 < sum(listed != sorted(listed) for listed in ids) < 15
    odd = [name for name in names if name not in RATES.categories]
    assert sum(names[name] for name in odd) / len(rows) == pytest.approx(0.05, abs=0.025)


# Statistics: z-scores of 100 buildings; 4 standard errors are passed once in 16,000


def test_number_of_objects_follows_the_rates_of_its_rooms(
    buildings: list[SyntheticBuilding],
) -> None:
    found = [float(in_rooms(one)) for one in buildings]
    assert abs(z_score(found, [expected_objects(RATES, one) for one in buildings])) < 4


@pytest.mark.parametrize("category", ["wall", "ceiling", "door", "chair", "toilet", "bed"])
def test_each_category_follows_the_rates_of_its_rooms(
    buildings: list[SyntheticBuilding], category: str
) -> None:
    index = RATES.categories.index(category)
    spellings = {raw for raw, _ in RATES.spellings[index]}
    others = {raw for i, s in enumerate(RATES.spellings) if i != index for raw, _ in s}
    assert not spellings & others, "the test counts by spelling"
    found = [
        float(sum(row.name in spellings and row.region_id >= 0 for row in one.rows))
        for one in buildings
    ]
    expected = [sum(RATES.rates[kind][index] for _, kind in one.room_types) for one in buildings]
    assert abs(z_score(found, expected)) < 4


def test_composition_follows_its_bin() -> None:
    """Draw compositions of one size; compare with all that rejection leaves of free draws."""
    rng = np.random.default_rng(0)
    total = 9
    rates = RATES.model_copy(update={"rooms": (*[0.0] * total, 1.0)})
    counts = next(weights for most, weights in rates.bins if total <= most)
    drawn = np.array(
        [np.bincount(_draw_room_types(rates, rng), minlength=len(counts)) for _ in range(3000)]
    )
    free = np.stack([rng.choice(len(w), 60000, p=np.array(w) / sum(w)) for w in counts], axis=1)
    kept = free[free.sum(axis=1) == total]
    error = np.sqrt(drawn.var(axis=0) / len(drawn) + kept.var(axis=0) / len(kept))
    assert (drawn.sum(axis=1) == total).all()
    assert (abs(drawn.mean(axis=0) - kept.mean(axis=0)) < 4.5 * error + 1e-3).all()


# What is refused


@pytest.mark.parametrize(("scenes", "seed"), [(0, 0), (MAX_SCENES + 1, 0), (1, -1)])
def test_numbers_out_of_range_are_refused_at_once(tmp_path: Path, scenes: int, seed: int) -> None:
    with refuses(SyntheticError, "number-range"):
        next(write_synthetic(tmp_path, scenes=scenes, seed=seed))
    assert not list(tmp_path.iterdir())


def test_a_second_run_does_not_mix_two_sets(tmp_path: Path) -> None:
    first = contents(list(write_synthetic(tmp_path, scenes=2, seed=0)), tmp_path)
    with refuses(DatasetError, "path-taken", tmp_path):
        next(write_synthetic(tmp_path, scenes=2, seed=1))
    list(write_synthetic(tmp_path, scenes=3, seed=1, force=True))
    again = contents(list(write_synthetic(tmp_path, scenes=2, seed=0, force=True)), tmp_path)
    assert again == first
    assert len(list(tmp_path.rglob("*.txt"))) == 2
    assert len(list(tmp_path.rglob("*.yaml"))) == 2


def test_a_stopped_run_is_made_again_without_force(tmp_path: Path) -> None:
    stream = write_synthetic(tmp_path / "out", scenes=3, seed=0)
    next(stream)
    stream.close()
    assert not (tmp_path / "out").exists()
    with refuses(SourceError, "source-unfinished", tmp_path / "out.partial"):
        HM3DFolder(tmp_path / "out.partial").find()
    assert len(list(write_synthetic(tmp_path / "out", scenes=2, seed=1))) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize(
    "where",
    [
        "train/00000-mine/mine.semantic.txt",
        "layouts/00000-mine.yaml",
        "BESIDE",
    ],
)
def test_force_removes_no_building_of_a_users(tmp_path: Path, where: str) -> None:
    out = tmp_path / "out"
    first, *_ = list(write_synthetic(out, scenes=10, seed=1))
    mine = first.with_name("notes.txt") if where == "BESIDE" else out / where
    mine.parent.mkdir(parents=True, exist_ok=True)
    mine.write_text("years of work")
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    with refuses(DatasetError, "foreign-file", out):
        next(write_synthetic(out, scenes=2, seed=2, force=True))
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_a_mark_that_says_nothing_removes_nothing(tmp_path: Path) -> None:
    list(write_synthetic(tmp_path / "out", scenes=2, seed=1))
    before = sorted((tmp_path / "out").rglob("*"))
    for said in ('{"finished": true}', "[]", "{", '{"seed": [], "scenes": 1}'):
        (tmp_path / "out" / SYNTHETIC_MARK).write_text(said)
        with refuses(DatasetError, "mark-broken"):
            next(write_synthetic(tmp_path / "out", scenes=2, seed=2, force=True))
    assert sorted((tmp_path / "out").rglob("*")) == before


def test_a_run_that_was_killed_at_its_first_file_is_made_again(tmp_path: Path) -> None:
    begun = tmp_path / "out.partial" / ".build" / "plan.json.partial"
    begun.parent.mkdir(parents=True)
    begun.touch()
    assert len(list(write_synthetic(tmp_path / "out", scenes=1, seed=1))) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
