"""The scripts that measure results: means by hand, and every measurement of a tiny leaderboard."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import first_rooms
import foreign
import numpy as np
import pytest
import reproduction
from conftest import annotation_text, load_script, write_scene
from folds import (
    bootstrap,
    list_models,
    mask_of,
    measure,
    open_folds,
    tally_likelihood,
    tally_second,
    tally_surroundings,
    tally_unvisited,
    tally_views,
)
from one_building import surround_rooms
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.masked_buildings import MaskedBuildings, stack_masked
from bsg_data.observation.observation import Observation
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.connections import Connections
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.surroundings import Surroundings
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.hm3d import HM3DFolder
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.bootstrap import weigh_buildings
from bsg_models.evaluation.truth import Truth
from bsg_models.inputs.graphs import read_split

# A building and three rooms: half seen, glimpsed, unvisited; two classes, of which the first was
# seen once in the half-seen room and once in the glimpsed one.
INPUTS = np.array([[2, 0], [1, 0], [1, 0], [0, 0]])
HIDDEN = np.array([[2, 1], [1, 0], [0, 0], [1, 1]])
PRESENCE = np.array([[0.9, 0.9], [0.5, 0.25], [0.5, 0.25], [0.75, 0.5]])
VISITED = np.array([True, True, False, False])
Case = tuple[Truth, MaskedBuildings, Expectation]


@pytest.fixture
def case() -> Case:
    seen = Observation(
        scene_ids=("a",),
        starts=np.array([0, 4]),
        inputs=INPUTS,
        hidden_share=np.array([0.7, 0.5, 0.6, 1.0], dtype=np.float32),
        visited=VISITED,
        withheld=np.zeros((4, 2), dtype=bool),
        vocabulary=(),
        unclassified=np.zeros((4, 0), dtype=np.int64),
        connections=Connections.of_pairs(()),
        surroundings=Surroundings.unknown(nodes=4),
    )
    truth = Truth(
        INPUTS.astype(float),
        (INPUTS + HIDDEN).astype(float),
        np.array([True, False, False, False]),
        VISITED,
        np.zeros(4, dtype=np.int64),
        np.zeros(4, dtype=np.int64),
        ("a",),
    )
    found = Expectation(INPUTS.astype(float), poisson(-np.log1p(-PRESENCE)))
    return (
        truth,
        MaskedBuildings(seen, INPUTS + HIDDEN, np.zeros(1, dtype=np.int64), np.arange(len(INPUTS))),
        found,
    )


def test_views_are_told_apart_and_the_building_is_none_of_them(case: Case) -> None:
    shares = tally_views(*case)
    for view, row, gap in (("half-seen", 1, -0.25), ("glimpsed", 2, 0.75), ("unvisited", 3, -0.75)):
        added, cells = shares[f"gap/{view}"]
        assert cells.tolist() == [2.0 * (node == row) for node in range(4)]
        assert added.tolist() == pytest.approx([gap * (node == row) for node in range(4)])


def test_rooms_of_which_nothing_was_seen_are_counted_alone(case: Case) -> None:
    """Of the last room: said −log(1 − P) objects of each class, true what it hides."""
    shares = tally_unvisited(*case)
    for name, value in (
        ("said", -np.log1p(-PRESENCE[3]).sum()),
        ("true", HIDDEN[3].sum()),
        ("gap", (PRESENCE[3] - (HIDDEN[3] > 0)).mean()),
    ):
        added, cells = shares[name]
        assert cells.tolist() == [0, 0, 0, 1]
        assert added.tolist() == pytest.approx([0, 0, 0, value])


def test_a_second_one_is_asked_for_where_one_is_seen(case: Case) -> None:
    shares = tally_second(*case, classes={"bed": 0, "tv": 1})
    assert [part.sum() for part in shares["said/bed"]] == pytest.approx([1.0, 2.0])
    assert [part.sum() for part in shares["true/bed"]] == [1.0, 2.0]
    assert shares["said/tv"][1].sum() == 0


def test_evidence_is_measured_in_unvisited_rooms_that_have_it(case: Case) -> None:
    """All rooms have an area, and the unvisited one has no label."""
    truth, masked, found = case
    known = surround_rooms([9.0, 4.0, 12.0], ["kitchen", "bathroom", None])
    told = replace(masked, seen=replace(masked.seen, surroundings=known))
    shares = tally_surroundings(truth, told, found)
    added, cells = shares["floor_area"]
    assert added.tolist() == pytest.approx([0, 0, 0, -np.log(0.75) - np.log(0.5)])
    assert cells.tolist() == [0, 0, 0, 2]
    assert not shares["labels"][1].any()


def test_parts_are_pooled_or_averaged_and_a_weight_repeats_a_building() -> None:
    first = {"x": (np.array([1.0, 3.0, 5.0]), np.array([1.0, 1.0, 2.0]))}
    batches = [(0, ("b", "b", "a"), first), (1, ("c",), {"x": (np.array([8.0]), np.ones(1))})]
    pooled = bootstrap(batches, resamples=20)
    assert (pooled.point["x"], pooled.nodes["x"]) == (17 / 5, 5)
    times = weigh_buildings(3, resamples=20, seed=0)[:, 1:]  # of a, b and c
    cells = np.array([2, 2, 1]) @ times
    np.testing.assert_allclose(pooled.resampled["x"], np.array([5, 4, 8]) @ times / cells)
    none = (2, ("d",), {"x": (np.zeros(1), np.zeros(1))})
    for some in (batches, [*batches, none]):
        found = bootstrap(some, resamples=0, by_fold=True)
        assert found.point["x"] == (9 / 4 + 8) / 2


def test_every_building_is_asked_about_once_by_a_model_that_never_saw_it(board: Path) -> None:
    names = ["gamma-poisson@rooms", "mixture@rooms", "gamma-poisson@uniform", "mixture@uniform"]
    assert list_models(board) == names
    assert list_models(board, ["uniform"]) == names[2:]
    data = Dataset.open(board / "uniform" / "dataset")
    for number, one in enumerate(open_folds(board, "mixture@uniform")):
        assert one.scenes == data.splits[f"fold-{number}"]


def test_of_several_seeds_the_first_is_opened(board: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(board, tmp_path / "board"))
    shutil.copytree(copy / "rooms" / "fold-0", copy / "rooms" / "seed-1" / "fold-0")
    assert list_models(copy) == list_models(board)
    runs = [one.run for one in open_folds(copy, "mixture@rooms")]
    assert runs == [copy / "rooms" / f"fold-{fold}" / "mixture" for fold in range(3)]


def test_masks_are_those_that_the_leaderboard_stored(board: Path) -> None:
    for one in open_folds(board, "gamma-poisson@rooms"):
        sampled = stack_masked(list(one.stream(mask_of(one.data, "rooms"), draws=2)))
        stored = read_split(one.data, "test", fold=one.fold)
        a = stored.take(np.lexsort((stored.draws, stored.seen.scene_ids)))
        b = stack_masked([sampled.take(np.lexsort((sampled.draws, sampled.seen.scene_ids)))])
        np.testing.assert_array_equal(a.seen.inputs, b.seen.inputs)
        np.testing.assert_array_equal(a.seen.hidden_share, b.seen.hidden_share)


@pytest.mark.parametrize("name", ["gamma-poisson", "mixture"])
def test_the_likelihood_is_that_of_the_leaderboard(board: Path, name: str) -> None:
    report = json.loads((board / "leaderboard.json").read_text("utf-8"))
    models = list(open_folds(board, f"{name}@rooms"))
    mask = mask_of(models[0].data, "rooms")
    found = measure(models, tally_likelihood, mask=mask, draws=2, resamples=0, by_fold=True)
    theirs = report["masks"]["rooms"][name]["metrics"]["rooms/hidden_nll"]
    assert found.point["nll"] == pytest.approx(theirs["value"])
    assert found.nodes["nll"] == theirs["nodes"]


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("leaderboard", []),
        ("masks", ["--models", "gamma-poisson@rooms"]),
        ("fixtures", ["--models", "mixture@uniform"]),
        ("ablation", ["--base=mixture@rooms"]),
        ("rooms_found", ["--models", "mixture@uniform"]),
        pytest.param(
            "search",
            ["--episodes=4", "--worlds", "star:1-10", "--models", "mixture@uniform"],
            marks=pytest.mark.heavy,
        ),
    ],
)
def test_figures_are_written(board: Path, tmp_path: Path, name: str, options: list[str]) -> None:
    out = tmp_path / "figures.json"
    out.write_text('{"other": {"made": {}, "tables": {}}}', "utf-8")
    argv = [name, f"--leaderboard={board}", f"--out={out}", "--draws=1", "--resamples=5", *options]
    assert load_script("measure/report").main(argv) == 0
    assert list(json.loads(out.read_text("utf-8"))) == ["other", name]
    read_tables(out, name)


def read_tables(path: Path, name: str) -> dict[str, Any]:
    """Return the tables of a measurement: whole, with its command, without folders."""
    text = path.read_text("utf-8")
    assert str(path.parent.parent) not in text
    assert "nan" not in text
    found = json.loads(text)[name]
    assert found["made"]["command"].startswith("python scripts/measure/")
    assert found["tables"]
    for table in found["tables"].values():
        assert {len(row) for row in table["rows"]} == {len(table["header"])}
    return dict(found["tables"])


def test_rooms_that_were_not_entered_are_measured_alone(board: Path, tmp_path: Path) -> None:
    """There, and only there, a model that gives every room the same answer has an AUROC of 0.5."""
    out = tmp_path / "figures.json"
    load_script("measure/report").main(["leaderboard", f"--leaderboard={board}", f"--out={out}"])
    tables = read_tables(out, "leaderboard")
    rooms, alone = tables["Masks: rooms"], tables["Rooms not entered, masks: rooms"]
    cells = {row[0]: row[1:] for row in alone["rows"]}["`gamma-poisson`"]
    assert cells[0].split()[0] == "0.5000"
    cells = {row[0]: row[1:] for row in rooms["rows"]}["`gamma-poisson`"]
    assert float(cells[1].split()[0]) > 0.6


def test_rooms_without_area_or_label_are_no_result(board: Path, tmp_path: Path) -> None:
    argv = ["room_size", f"--leaderboard={board}", f"--out={tmp_path / 'f.json'}", "--draws=1"]
    with refuses(DatasetError, "evidence-unknown", golden=False):
        load_script("measure/report").main([*argv, "--models", "mixture@rooms", "--resamples=2"])


def test_one_source_is_tested_on_another(board: Path, tmp_path: Path) -> None:
    """The other one is of HM3D, too, so that all buildings are of its part. It has a split."""
    for k in range(6):
        rooms = {0: ["sofa", "tv", "lamp"], 1: ["bed", "lamp"] * (k + 3)}
        write_scene(tmp_path / "raw", f"{900 + k:05d}-zyxwvutsr{k:02d}", annotation_text(rooms))
    build_dataset(HM3DFolder(tmp_path / "raw"), tmp_path / "other")
    split_dataset(tmp_path / "other", SplitRecipe(ratios=(0.5, 0.25, 0.25)))
    write_pairs(tmp_path / "other", PairsRecipe(draws=1))
    out = tmp_path / "figures.json"
    load_script("measure/transfer").main(
        [
            f"--hm3d={board.parent / 'dataset'}",
            f"--behavior={tmp_path / 'other'}",
            f"--runs={tmp_path / 'runs'}",
            f"--out={out}",
            *("--model=gamma-poisson", "--folds=3", "--draws=1", "--resamples=5"),
        ]
    )
    (table,) = read_tables(out, "transfer").values()
    assert table["header"][1] == "HM3D (18)"
    rows = {row[0]: row[1] for row in table["rows"]}
    for name in ("HM3D", "BEHAVIOR", "HM3D and BEHAVIOR"):
        assert re.match(r"-?\d", rows[name])


@pytest.mark.heavy
def test_readings_of_the_paper_are_compared(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    argv = [f"--data={dataset}", f"--runs={tmp_path / 'runs'}", f"--out={out}", "--epochs=1"]
    few = ["--seeds=1", "--draws=1", "--resamples=2", "--workers=1", "--readings", "no dropout"]
    assert reproduction.main([*argv, *few]) == 0
    tables = read_tables(out, "reproduction")
    assert sum(row[0] == "no dropout" for one in tables.values() for row in one["rows"]) == 4


@pytest.mark.heavy
def test_ways_to_tell_the_hidden_share_are_compared(
    dataset: Path, run: Path, tmp_path: Path
) -> None:
    out, script = tmp_path / "figures.json", load_script("measure/hidden_share")
    argv = [f"--data={dataset}", f"--out={out}", "--models", str(run), "--draws=3"]
    assert script.main(argv) == 0
    (table,) = read_tables(out, "hidden_share").values()
    rows = {row[0]: row[1] for row in table["rows"]}
    assert list(rows) == list(script.WAYS)
    assert float(rows[script.TRUE]) == 0
    assert float(rows["no estimate, integrated over"]) > 0


def test_a_look_errs_as_much_as_it_says() -> None:
    script, rng = load_script("measure/hidden_share"), np.random.default_rng(0)
    looks = [script.look(rng, 0.6, 5.4) for _ in range(2000)]
    assert np.mean([one.mean for one in looks]) == pytest.approx(0.6, abs=0.02)
    assert np.std([one.mean for one in looks]) == pytest.approx((0.24 / 6.4) ** 0.5, abs=0.02)


def test_models_are_measured_on_whole_datasets_that_they_never_saw(tmp_path: Path) -> None:
    rooms = [(area, room, n) for area in (1, 2) for room in (1, 2, 3) for n in range(room)]
    labels = [f"chair_{n}_office_{room}_{area}" for area, room, n in rooms]
    (tmp_path / "labels.json").write_text(json.dumps(labels), "utf-8")
    build_dataset(open_source("s3dis", tmp_path / "labels.json"), tmp_path / "offices")
    out = tmp_path / "figures.json"
    words = [f"--data={tmp_path / 'offices'}", "--models=mixture", "--draws=3", "--resamples=5"]
    assert foreign.main([*words, f"--out={out}"]) == 0
    (table,) = read_tables(out, "real_buildings").values()
    assert table["reading"].startswith("6 rooms, 2 scenes; 4 classes that the source can name")
    assert [row[:2] for row in table["rows"]] == [  # it reads labels, and no kind
        ["`mixture`", "objects"],
        ["`mixture`", "labels"],
    ]


def test_small_homes_and_the_words_of_a_detector_are_understood() -> None:
    class_map = load_class_map()
    homes = json.loads(first_rooms.HOMES.read_text("utf-8"))
    assert len(homes) == 10
    things = {thing for home in homes for seen in home.values() for thing in seen}
    assert {*things, *first_rooms.SINGLE, *first_rooms.COCO} <= {*class_map.classes}
    assert {room for home in homes for room in home} <= {*list_room_labels()}


def test_a_detector_is_measured_on_what_it_knows(case: Case) -> None:
    _, masked, _ = case
    known = np.arange(masked.targets.shape[1]) == 0
    limited = first_rooms.limit_detector(masked.seen, known)
    assert np.array_equal(limited.inputs[:, known], masked.seen.inputs[:, known])
    assert not limited.inputs[:, ~known].any()
    assert limited.withheld[:, ~known].all()
    presence = np.full(masked.targets.shape, 0.25)
    tally = first_rooms.tally_known(masked, presence, known)
    rooms = ~masked.seen.is_building
    hidden = masked.hidden[rooms, 0] > 0
    assert tally["gap"][0].sum() == pytest.approx((0.25 - hidden).sum())
    expected = -np.where(hidden, np.log(0.25), np.log(0.75)).sum()
    assert tally["loss/0"][0].sum() == pytest.approx(expected)
