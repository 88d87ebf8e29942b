from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from bsg_data.build import build_dataset
from bsg_data.dataset.manifest import ClassMapEntry, Manifest, SourceEntry, Totals, read_manifest
from bsg_data.errors import DatasetError
from bsg_data.lock import hold
from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.hm3d import HM3DFolder
from bsg_models.errors import ConfigError
from bsg_models.evaluation.measurement import Bootstrap
from bsg_models.inputs.graphs import open_dataset
from bsg_models.rendering.figures import plot_leaderboard
from bsg_models.runs.checkpoint import load_checkpoint
from bsg_models.runs.run_folder import BEST
from bsg_models.studies.leaderboard import (
    Leaderboard,
    LeaderboardRecipe,
    ModelResult,
    make_leaderboard,
    run_of,
    sort_models,
)
from bsg_models.studies.leaderboard_table import (
    HEADLINES,
    MOMENTS,
    UNVISITED,
    compare,
    rank_models,
    write_json,
    write_markdown,
)
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import RunConfig, override, validate_config

RECIPE = LeaderboardRecipe(folds=3, draws=2, resamples=3)
SMALL = ("training.epochs=2", "model.width=8", "model.embedding=4")


def configure(name: str, *settings: str) -> RunConfig:
    tables = override(ZOO[name].model_dump(mode="json"), settings)
    return validate_config(tables, source="test")


@pytest.fixture
def unsplit(hm3d_folder: Path, tmp_path: Path) -> Path:
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "unsplit")
    return tmp_path / "unsplit"


MODELS: Mapping[str, RunConfig] = {
    "train-mean": ZOO["train-mean"],
    "gamma-poisson": ZOO["gamma-poisson"],
    "ceci-sage": configure("ceci-sage", *SMALL),
    "pair": configure("ensemble", 'model.members=["gamma-poisson","train-mean"]'),
}


@pytest.mark.slow
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
        data = open_dataset(tmp_path / "board" / mask / "dataset")
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


@pytest.mark.slow
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
    models = {"train-mean": ZOO["train-mean"]}
    make_leaderboard(unsplit, tmp_path / "board", models, recipe)
    for path in (hm3d_folder / "train").glob("*00/*.txt"):
        path.unlink()
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "other")
    with pytest.raises(DatasetError, match="copy of another dataset; choose another --out"):
        make_leaderboard(tmp_path / "other", tmp_path / "board", models, recipe)
    # A dataset that is split and has pairs serves too: its own are not used.
    board = make_leaderboard(dataset, tmp_path / "third", models, recipe)
    assert board.results["uniform"]["train-mean"].metrics.point["rooms/hidden_nll"] > 0


@pytest.mark.slow
def test_an_ensemble_is_the_mean_of_its_members(unsplit: Path, tmp_path: Path) -> None:
    recipe = RECIPE.model_copy(update={"masks": ("uniform",)})
    board = make_leaderboard(unsplit, tmp_path / "board", {"pair": MODELS["pair"]}, recipe)
    assert list(board.results["uniform"]) == ["pair"]  # members are trained and not shown
    members = [
        load_checkpoint(run_of(tmp_path / "board" / "uniform", "pair", fold) / BEST)
        for fold in range(3)
    ]
    names = {name.split(".")[1] for name in members[0].state_of("model") if "." in name}
    assert names == {"gamma-poisson", "train-mean"}
    assert all(checkpoint.header.calibrated for checkpoint in members)


def test_a_name_that_an_ensemble_needs_is_not_taken_by_another_model() -> None:
    single, ensembles = sort_models({"pair": MODELS["pair"]})
    assert (set(single), set(ensembles)) == ({"gamma-poisson", "train-mean"}, {"pair"})
    seeded = configure("ensemble", 'model.members=["train-mean"]', "seed=3")
    assert sort_models({"seeded": seeded})[0]["train-mean"].seed == 3
    with pytest.raises(ConfigError, match="with its own seed"):
        sort_models({"seeded": seeded, "train-mean": ZOO["train-mean"]})
    taken = {"pair": MODELS["pair"], "train-mean": ZOO["input"]}
    with pytest.raises(ConfigError, match="needs the zoo's train-mean"):
        sort_models(taken)


def test_two_leaderboards_never_write_into_one_folder(unsplit: Path, tmp_path: Path) -> None:
    models = {"train-mean": ZOO["train-mean"]}
    (tmp_path / "board").mkdir()
    with hold(tmp_path / "board"), pytest.raises(DatasetError, match="another command"):
        make_leaderboard(unsplit, tmp_path / "board", models, RECIPE)


def board(values: Mapping[str, float]) -> Leaderboard:
    """Return a leaderboard on which every metric of a model is one number."""
    names = [h.metric for group in HEADLINES.values() for h in group]
    names += [h.metric for h in UNVISITED]
    names += [f"all/{m}_values/{moment}" for m in ("wasserstein", "energy") for moment in MOMENTS]
    noise = np.array([-0.1, 0.0, 0.1])
    results = {
        model: ModelResult(
            Bootstrap(
                point=dict.fromkeys(names, value),
                resampled=dict.fromkeys(names, value + noise),
                nodes=dict.fromkeys(names, 7),
            ),
            seconds=1.5,
        )
        for model, value in values.items()
    }
    return Leaderboard(RECIPE, _small_manifest(), {"rooms": results})


def _small_manifest() -> Manifest:
    return Manifest(
        generator="test",
        source=SourceEntry(kind="hm3d", version=None, fingerprint="0"),
        class_map=ClassMapEntry.of(load_class_map()),
        options={},
        totals=Totals(scenes=3, rooms=9),
        files=(),
    )


def test_paired_comparisons_by_hand() -> None:
    """The noise of two models is the same, so that their difference has none."""
    made = board({"train-mean": 0.5, "gamma-poisson": 0.4, "ours": 0.3})
    results = made.results["rooms"]
    assert rank_models(results) == ["ours", "gamma-poisson", "train-mean"]
    found = compare(results, "ours")
    difference = found["unvisited_ap_minus_train_mean"]
    assert difference is not None
    assert (difference.value, difference.low, difference.high) == pytest.approx((-0.2,) * 3)
    ratio = found["nll_over_gamma_poisson"]
    assert ratio is not None
    assert ratio.value == pytest.approx(0.75)
    assert ratio.low < ratio.value < ratio.high
    alone = board({"ours": 0.3}).results["rooms"]
    assert compare(alone, "ours")["nll_over_gamma_poisson"] is None


def test_the_documents_say_the_same_as_the_board(tmp_path: Path) -> None:
    made = board({"train-mean": 0.5, "gamma-poisson": 0.4, "ours": 0.3})
    text = write_markdown(made)
    row = next(line for line in text.splitlines() if line.startswith("| ours | **0.3 ± 0.095**"))
    assert row.count("**0.3 ± 0.095**") == 2  # less is better for two of seven
    assert "0.75 ± " in row
    assert "| ours | 0.3 ± 0.095 |" in text  # unvisited: more is better, and it is the least
    assert "NLL is `rooms/hidden_nll`" in text
    twins = board({"one": 0.3, "other": 0.3})
    assert write_markdown(twins).count("**0.3 ± 0.095**") == 2 * (7 + 4)  # of a tie, both
    found = json.loads(json.dumps(write_json(made)))
    nll = found["masks"]["rooms"]["ours"]["metrics"]["rooms/hidden_nll"]
    assert nll == {
        "value": 0.3,
        "low": pytest.approx(0.205),
        "high": pytest.approx(0.395),
        "nodes": 7,
    }
    assert found["dataset"]["scenes"] == 3
    estimates = {n: s.metrics.estimates() for n, s in made.results["rooms"].items()}
    plot_leaderboard(
        estimates, {"rooms/hidden_nll": "hidden NLL ↓"}, tmp_path / "board.png", title="test"
    )
    assert (tmp_path / "board.png").read_bytes().startswith(b"\x89PNG")
