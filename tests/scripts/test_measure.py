"""The scripts that measure results: means by hand, and every measurement of a tiny leaderboard."""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pieces
import pytest
import receptacle_shares
from conftest import REPOSITORY, load_script
from folds import (
    bootstrap,
    list_models,
    mask_of,
    measure,
    open_folds,
    tally_likelihood,
    tally_unvisited,
)

from bsg_data.dataset.dataset import Dataset
from bsg_models.evaluation.bootstrap import weigh_buildings
from bsg_models.evaluation.measurement import predict_all, read_truth

PLACEMENTS = REPOSITORY.parent / "shared" / "housekeep" / "placements.csv"


def test_rooms_of_which_nothing_was_seen_are_counted_alone(board: Path) -> None:
    one = next(iter(open_folds(board, "mixture@rooms")))
    for masked in one.stream(mask_of(one.data, "rooms"), draws=1):
        found, seen = predict_all(one.model, masked), masked.seen
        alone = (seen.hidden_share == 1) & ~seen.is_building
        wrong = (found.presence - (masked.hidden > 0)).mean(axis=1)
        values = {"said": found.hidden.sum(axis=1), "true": masked.hidden.sum(axis=1), "gap": wrong}
        shares = tally_unvisited(read_truth(masked), masked, found)
        for name, value in values.items():
            added, cells = shares[name]
            assert cells.tolist() == alone.tolist()
            np.testing.assert_allclose(added, value * alone, atol=1e-12)


def test_parts_are_pooled_and_a_weight_repeats_a_building() -> None:
    first = {"x": (np.array([1.0, 3.0, 5.0]), np.array([1.0, 1.0, 2.0]))}
    batches = [(0, ("b", "b", "a"), first), (1, ("c",), {"x": (np.array([8.0]), np.ones(1))})]
    pooled = bootstrap(batches, resamples=20)
    assert (pooled.point["x"], pooled.nodes["x"]) == (17 / 5, 5)
    times = weigh_buildings(3, resamples=20, seed=0)[:, 1:]  # of a, b and c
    cells = np.array([2, 2, 1]) @ times
    np.testing.assert_allclose(pooled.resampled["x"], np.array([5, 4, 8]) @ times / cells)


def test_every_building_is_asked_about_once_by_a_model_that_never_saw_it(
    board: Path, tmp_path: Path
) -> None:
    """Of several seeds, the first is asked."""
    names = ["gamma-poisson@rooms", "mixture@rooms", "gamma-poisson@uniform", "mixture@uniform"]
    assert list_models(board) == names
    assert list_models(board, ["uniform"]) == names[2:]
    data = Dataset.open(board / "uniform" / "dataset")
    for number, one in enumerate(open_folds(board, "mixture@uniform")):
        assert one.scenes == data.splits[f"fold-{number}"]
    copy = Path(shutil.copytree(board, tmp_path / "board"))
    shutil.copytree(copy / "rooms" / "fold-0", copy / "rooms" / "seed-1" / "fold-0")
    assert list_models(copy) == list_models(board)
    runs = [one.run for one in open_folds(copy, "mixture@rooms")]
    assert runs == [copy / "rooms" / f"fold-{fold}" / "mixture" for fold in range(3)]


def test_masks_and_likelihood_are_those_of_the_leaderboard(board: Path) -> None:
    report = json.loads((board / "leaderboard.json").read_text("utf-8"))
    models = list(open_folds(board, "mixture@rooms"))
    mask = mask_of(models[0].data, "rooms")
    found = [measure([one], tally_likelihood, mask=mask, draws=2, resamples=0) for one in models]
    theirs = report["masks"]["rooms"]["mixture"]["metrics"]["rooms/hidden_nll"]
    assert np.mean([one.point["nll"] for one in found]) == pytest.approx(theirs["value"])
    assert sum(one.nodes["nll"] for one in found) == theirs["nodes"]


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("leaderboard", []),
        ("rooms_found", ["--models", "mixture@uniform"]),
        ("labels", ["--models", "mixture@rooms", "--folds", "0", "2"]),
        ("choices", ["--models", "mixture@uniform", "--folds", "0", "2"]),
        ("paper", ["--models", "mixture@uniform"]),
        *(
            pytest.param(
                name,
                ["--episodes=4", "--worlds", "star:1-10", "--models", "mixture@uniform"],
                marks=pytest.mark.heavy,
            )
            for name in ("paper_search", "search", "singles")
        ),
    ],
)
def test_figures_are_written(board: Path, tmp_path: Path, name: str, options: list[str]) -> None:
    out = tmp_path / "figures.json"
    out.write_text('{"other": {"made": {}, "tables": {}}}', "utf-8")
    argv = [name, f"--leaderboard={board}", f"--out={out}", "--draws=1", "--resamples=5", *options]
    assert load_script("measure/report").main(argv) == 0
    assert list(json.loads(out.read_text("utf-8"))) == ["other", name]
    tables = read_tables(out, name)
    assert ("Rooms not entered, masks: rooms" in tables) == (name == "leaderboard")
    if name == "choices":
        (table,) = tables.values()
        assert [row[-1] for row in table["rows"]] == ["0, 0"], "epochs of the folds measured"


def read_tables(path: Path, name: str) -> dict[str, Any]:
    """Return the tables of a measurement: whole, with its command, without folders."""
    text = path.read_text("utf-8")
    assert str(path.parent.parent) not in text
    assert "nan" not in text
    found = json.loads(text)[name]
    assert found["made"]["command"].startswith("python scripts/measure/")
    assert found["made"]["commit"]
    assert found["made"]["dataset"]
    assert found["tables"]
    for table in found["tables"].values():
        assert {len(row) for row in table["rows"]} == {len(table["header"])}
        assert table["tested_on"] in ("unseen", "training", "chosen")
    return dict(found["tables"])


def test_a_room_is_ranked_with_those_that_have_a_label_or_with_those_that_have_none(
    board: Path,
) -> None:
    report = load_script("measure/report")
    options = argparse.Namespace(draws=1)
    (one, *_) = open_folds(board, "mixture@rooms")
    batches = list(report._predict_by_label(one, options))
    entered = {
        kind: np.concatenate([batch[kind].truth.visited for batch in batches])
        for kind in report.LABELS
    }
    assert (~entered["all"]).any()
    assert (entered["all"] == (entered["labelled"] & entered["unlabelled"])).all()
    assert (entered["labelled"] | entered["unlabelled"]).all()


def test_what_is_said_of_furniture_is_judged_by_people(tmp_path: Path) -> None:
    """Of one thing in one room: people chose the second of three pieces."""
    rows = ["object,split,room,receptacle,people_right"]
    rows += [f"milk,val,kitchen,{one},{n}" for one, n in (("oven", 0), ("fridge", 8), ("sink", 2))]
    (tmp_path / "placements.csv").write_text("\n".join(rows), "utf-8")
    votes = pieces.read_votes(tmp_path / "placements.csv", split="val")
    scores = {"ours": [3.0, 2.0, 1.0], "chance": [1.0, 1.0, 1.0]}
    for said in scores.values():
        found = pieces.judge(votes, lambda *_, said=said: np.array(said))
        shares = np.array(said) / sum(said)
        loss = -(0.8 * np.log(shares[1]) + 0.2 * np.log(shares[2]))
        np.testing.assert_allclose(found, [[1 / 2, 1, loss, 1]])
    out = tmp_path / "figures.json"
    assert pieces.main([f"--housekeep={tmp_path / 'placements.csv'}", f"--out={out}"]) == 0
    assert "placements.csv" in json.loads(out.read_text("utf-8"))["pieces"]["made"]["dataset"]


@pytest.mark.skipif(not PLACEMENTS.is_file(), reason="needs ../shared")
def test_the_shipped_shares_are_made_of_the_answers(tmp_path: Path) -> None:
    made = tmp_path / "made.csv"
    assert receptacle_shares.main([f"--housekeep={PLACEMENTS}", f"--out={made}"]) == 0
    shipped = REPOSITORY / "bsg_robot/tables/receptacle-shares-v1.csv"
    assert made.read_bytes() == shipped.read_bytes()
