"""Which runs a leaderboard needs, and what they leave."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from configurations import configure

from bsg_data.build import build_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.errors import DatasetError
from bsg_data.sources.hm3d import HM3DFolder
from bsg_models.runs.checkpoint import load_checkpoint
from bsg_models.runs.checkpoint_file import BEST
from bsg_models.studies.leaderboard import (
    LeaderboardRecipe,
    make_leaderboard,
    run_of,
)
from bsg_models.studies.leaderboard_report import write_json
from bsg_models.zoo.config import RunConfig, find_config

RECIPE = LeaderboardRecipe(folds=2, draws=2, resamples=3)
MIXED = (
    *("data.mask.strategy=mixed", "data.mask.withhold=0.05", "data.mask.detector=0.0"),
    "data.min_scenes=10",
)
SMALL = ("training.epochs=2", "model.width=8", "model.embedding=4")
PAIR = 'model.members=["gamma-poisson","train-mean"]'


@pytest.fixture
def unsplit(hm3d_folder: Path, tmp_path: Path) -> Path:
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "unsplit")
    return tmp_path / "unsplit"


MODELS: Mapping[str, RunConfig] = {
    "gamma-poisson": find_config("gamma-poisson"),
    "ceci-sage": configure("ceci-sage", *SMALL),
    "pair": configure("ensemble", PAIR, *MIXED),
}


def test_every_model_is_tested_on_every_building_once(unsplit: Path, tmp_path: Path) -> None:
    """Also an ensemble with a mask of its own, which is trained once and measured on every kind."""
    before = {p: p.read_bytes() for p in unsplit.rglob("*") if p.is_file()}
    seen: list[tuple[str, int, int]] = []
    board = make_leaderboard(
        unsplit, tmp_path / "board", MODELS, RECIPE, progress=lambda *words: seen.append(words)
    )
    assert {p: p.read_bytes() for p in unsplit.rglob("*") if p.is_file()} == before
    assert ("train", 10, 10) in seen  # 2 models, 2 folds, 2 masks; and one with its own mask
    assert ("measure", 6, 6) in seen
    rooms = read_manifest(unsplit).totals.rooms
    for mask in ("uniform", "rooms"):
        data = Dataset.open(tmp_path / "board" / mask / "dataset")
        assert data.manifest.pairs is not None
        assert data.manifest.pairs.mask.strategy == mask
        assert list(board.results[mask]) == list(MODELS)
        for result in board.results[mask].values():
            assert result.metrics.nodes["rooms/hidden_nll"] == rooms * RECIPE.draws
            assert result.seconds > 0
        for fold in range(2):
            run = run_of(tmp_path / "board" / mask, "ceci-sage", fold)
            config = load_checkpoint(run / BEST).header.config
            assert (config.data.fold, config.data.mask.strategy) == (fold, mask)
    unvisited, nll = "rooms/presence_ap_micro/unvisited", "rooms/hidden_nll"
    points = [board.results[mask]["pair"].metrics.point for mask in RECIPE.masks]
    assert np.isnan(points[0][unvisited])
    assert not np.isnan(points[1][unvisited])
    assert points[0][nll] != points[1][nll]
    own = {name: result.trained_on for name, result in board.results["rooms"].items()}
    assert own == {"gamma-poisson": None, "ceci-sage": None, "pair": "mixed"}
    assert not run_of(tmp_path / "board" / "rooms", "pair", 0).exists()
    config = load_checkpoint(run_of(tmp_path / "board" / "mixed", "pair", 1) / BEST).header.config
    assert (config.data.fold, str(config.data.mask)) == (1, "mixed, fraction 0.5, withhold 0.05")


def test_a_stopped_leaderboard_goes_on_and_another_recipe_starts_again(
    unsplit: Path, tmp_path: Path
) -> None:
    recipe = RECIPE.model_copy(update={"masks": ("uniform",)})
    models = {"ceci-sage": MODELS["ceci-sage"]}
    out = tmp_path / "board"
    first = make_leaderboard(unsplit, out, models, recipe)
    runs = [run_of(out / "uniform", "ceci-sage", fold) / BEST for fold in range(2)]
    stamps = [run.stat().st_mtime_ns for run in runs]
    runs[1].write_bytes(runs[1].read_bytes()[:100])  # as a full disk leaves it
    again = make_leaderboard(unsplit, out, models, recipe)
    after = [run.stat().st_mtime_ns for run in runs]
    assert [a == b for a, b in zip(stamps, after, strict=True)] == [True, False]
    a, b = (board.results["uniform"]["ceci-sage"].metrics for board in (first, again))
    assert a.point == pytest.approx(b.point, nan_ok=True)
    other = recipe.model_copy(update={"draws": 3})
    third = make_leaderboard(unsplit, out, models, other).results["uniform"]["ceci-sage"]
    assert third.metrics.nodes["rooms/hidden_nll"] == 3 / 2 * a.nodes["rooms/hidden_nll"]


def test_a_copy_of_another_dataset_is_refused(
    unsplit: Path, hm3d_folder: Path, tmp_path: Path
) -> None:
    recipe = RECIPE.model_copy(update={"masks": ("uniform",)})
    models = {"train-mean": find_config("train-mean")}
    make_leaderboard(unsplit, tmp_path / "board", models, recipe)
    for path in (hm3d_folder / "train").glob("*00/*.txt"):
        path.unlink()
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "other")
    with pytest.raises(DatasetError):
        make_leaderboard(tmp_path / "other", tmp_path / "board", models, recipe)


SEEDED: Mapping[str, RunConfig] = {
    "gamma-poisson": find_config("gamma-poisson"),
    "ceci-sage": MODELS["ceci-sage"],
}
TWO = LeaderboardRecipe(masks=("uniform",), folds=2, draws=2, resamples=20, seeds=2)
ONE = TWO.model_copy(update={"seeds": 1})


def list_runs(out: Path) -> set[str]:
    return {path.parent.relative_to(out).as_posix() for path in out.rglob(BEST)}


def test_each_seed_trains_a_model_in_each_fold_unless_none_changes_it(
    unsplit: Path, tmp_path: Path
) -> None:
    out = tmp_path / "board"
    one = make_leaderboard(unsplit, out, SEEDED, ONE)
    usual = {f"uniform/fold-{fold}/{name}" for fold in range(2) for name in SEEDED}
    assert list_runs(out) == usual
    stamps = {path: path.stat().st_mtime_ns for path in out.rglob(BEST)}
    two = make_leaderboard(unsplit, out, SEEDED, TWO)
    assert list_runs(out) == usual | {f"uniform/seed-1/fold-{fold}/ceci-sage" for fold in range(2)}
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in stamps.items())
    runs = [run_of(out / "uniform", "ceci-sage", 1, seed=seed) / BEST for seed in range(2)]
    first, second = (load_checkpoint(run) for run in runs)
    assert (first.header.config.seed, second.header.config.seed) == (0, 1)
    assert [*map(str, first.tensors.values())] != [*map(str, second.tensors.values())]
    before, after = (board.results["uniform"] for board in (one, two))
    assert [after[name].seeds for name in SEEDED] == [1, 2]
    counted, nll = "gamma-poisson", "rooms/hidden_nll"
    assert after[counted].metrics.estimate(nll) == before[counted].metrics.estimate(nll)
    points = [results["ceci-sage"].metrics.point[nll] for results in (before, after)]
    assert points[0] != points[1], "the second is a mean of two"
    assert write_json(two)["masks"]["uniform"]["ceci-sage"]["seeds"] == 2
