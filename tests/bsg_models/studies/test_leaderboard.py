from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from bsg_data.build import build_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.errors import DatasetError
from bsg_data.sources.hm3d import HM3DFolder
from bsg_models.runs.checkpoint import load_checkpoint
from bsg_models.runs.run_folder import BEST
from bsg_models.studies.leaderboard import make_leaderboard
from bsg_models.studies.leaderboard_runs import LeaderboardRecipe, run_of
from bsg_models.zoo.config import RunConfig, find_config, override, validate_config

RECIPE = LeaderboardRecipe(folds=3, draws=2, resamples=3)
UNIFORM = ("data.mask.strategy=uniform", "data.mask.withhold=0.0")  # whose mask is to be set
SMALL = ("training.epochs=2", "model.width=8", "model.embedding=4")


def configure(name: str, *settings: str) -> RunConfig:
    tables = override(find_config(name).model_dump(mode="json"), settings)
    return validate_config(tables, source="test")


@pytest.fixture
def unsplit(hm3d_folder: Path, tmp_path: Path) -> Path:
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "unsplit")
    return tmp_path / "unsplit"


MODELS: Mapping[str, RunConfig] = {
    "train-mean": find_config("train-mean"),
    "gamma-poisson": find_config("gamma-poisson"),
    "ceci-sage": configure("ceci-sage", *SMALL),
    "pair": configure("ensemble", 'model.members=["gamma-poisson","train-mean"]', *UNIFORM),
}


def test_every_model_is_tested_on_every_building_once(unsplit: Path, tmp_path: Path) -> None:
    before = {p: p.read_bytes() for p in unsplit.rglob("*") if p.is_file()}
    seen: list[tuple[str, int, int]] = []
    board = make_leaderboard(
        unsplit, tmp_path / "board", MODELS, RECIPE, progress=lambda *words: seen.append(words)
    )
    assert {p: p.read_bytes() for p in unsplit.rglob("*") if p.is_file()} == before
    assert ("train", 18, 18) in seen  # 3 models, 3 folds, 2 masks
    assert ("measure", 8, 8) in seen
    rooms = read_manifest(unsplit).totals.rooms
    for mask in ("uniform", "rooms"):
        data = Dataset.open(tmp_path / "board" / mask / "dataset")
        assert data.manifest.pairs is not None
        assert data.manifest.pairs.mask.strategy == mask
        assert list(board.results[mask]) == list(MODELS)
        for result in board.results[mask].values():
            assert result.metrics.nodes["rooms/hidden_nll"] == rooms * RECIPE.draws
            assert result.seconds > 0
        for fold in range(3):
            run = run_of(tmp_path / "board" / mask, "ceci-sage", fold)
            config = load_checkpoint(run / BEST).header.config
            assert (config.data.fold, config.data.mask.strategy) == (fold, mask)
    unvisited = "rooms/presence_ap_micro/unvisited"
    assert np.isnan(board.results["uniform"]["train-mean"].metrics.point[unvisited])
    assert not np.isnan(board.results["rooms"]["train-mean"].metrics.point[unvisited])


def test_a_stopped_leaderboard_goes_on_and_another_recipe_starts_again(
    unsplit: Path, tmp_path: Path
) -> None:
    recipe = RECIPE.model_copy(update={"masks": ("uniform",)})
    models = {"ceci-sage": MODELS["ceci-sage"]}
    out = tmp_path / "board"
    first = make_leaderboard(unsplit, out, models, recipe)
    runs = [run_of(out / "uniform", "ceci-sage", fold) / BEST for fold in range(3)]
    stamps = [run.stat().st_mtime_ns for run in runs]
    runs[1].write_bytes(runs[1].read_bytes()[:100])  # as a full disk leaves it
    again = make_leaderboard(unsplit, out, models, recipe)
    after = [run.stat().st_mtime_ns for run in runs]
    assert [a == b for a, b in zip(stamps, after, strict=True)] == [True, False, True]
    a, b = (board.results["uniform"]["ceci-sage"].metrics for board in (first, again))
    assert a.point == pytest.approx(b.point, nan_ok=True)
    other = recipe.model_copy(update={"draws": 3})
    third = make_leaderboard(unsplit, out, models, other).results["uniform"]["ceci-sage"]
    assert third.metrics.nodes["rooms/hidden_nll"] == 3 / 2 * a.nodes["rooms/hidden_nll"]


def test_a_copy_of_another_dataset_is_refused(
    unsplit: Path, dataset: Path, hm3d_folder: Path, tmp_path: Path
) -> None:
    recipe = RECIPE.model_copy(update={"masks": ("uniform",)})
    models = {"train-mean": find_config("train-mean")}
    make_leaderboard(unsplit, tmp_path / "board", models, recipe)
    for path in (hm3d_folder / "train").glob("*00/*.txt"):
        path.unlink()
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "other")
    with pytest.raises(DatasetError, match="copy of another dataset; choose another --out"):
        make_leaderboard(tmp_path / "other", tmp_path / "board", models, recipe)
    # A dataset that is split and has pairs serves too: its own are not used.
    board = make_leaderboard(dataset, tmp_path / "third", models, recipe)
    assert board.results["uniform"]["train-mean"].metrics.point["rooms/hidden_nll"] > 0


def test_a_model_with_a_mask_of_its_own_is_trained_once_and_measured_on_every_kind(
    unsplit: Path, tmp_path: Path
) -> None:
    """Also an ensemble, whose members are those trained for it and those of the leaderboard."""
    mixed = ("data.mask.strategy=mixed", "data.mask.withhold=0.05")
    models = {
        "train-mean": configure("train-mean", *mixed),
        "pair": configure("ensemble", 'model.members=["gamma-poisson","train-mean"]', *mixed),
        "gamma-poisson": find_config("gamma-poisson"),
    }
    recipe = RECIPE.model_copy(update={"draws": 1})
    seen: list[tuple[str, int, int]] = []
    out = tmp_path / "board"
    board = make_leaderboard(
        unsplit, out, models, recipe, progress=lambda *words: seen.append(words)
    )
    assert max(seen) == ("train", 12, 12)  # two on mixed masks, one on each of two, three folds
    assert ("measure", 6, 6) in seen
    runs = {path.parent.relative_to(out).as_posix() for path in out.glob("*/fold-0/*/best.*")}
    assert runs == {
        "mixed/fold-0/train-mean",
        "mixed/fold-0/gamma-poisson",
        "mixed/fold-0/pair",
        "uniform/fold-0/gamma-poisson",
        "rooms/fold-0/gamma-poisson",
    }
    rooms = board.results["rooms"]
    assert list(rooms) == list(models)
    own = {name: result.trained_on for name, result in rooms.items()}
    assert own == {"train-mean": "mixed", "pair": "mixed", "gamma-poisson": None}
    points = [board.results[mask]["pair"].metrics.point for mask in recipe.masks]
    assert points[0]["rooms/hidden_nll"] != points[1]["rooms/hidden_nll"]
    config = load_checkpoint(run_of(out / "mixed", "pair", 2) / BEST).header.config
    assert (config.data.fold, str(config.data.mask)) == (2, "mixed, fraction 0.5, withhold 0.05")
