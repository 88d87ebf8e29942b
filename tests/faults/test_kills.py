"""Every command that writes, killed at each of its changes of a file, and killed again.

The model is an unbroken command: run again, one leaves the same bytes. After a kill the dataset is
the old one or the new, and sound.
"""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from killed_process import snapshot, start, wait_for

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.manifest import MANIFEST, hash_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.exports.export import export_dataset
from bsg_data.merge import merge_datasets
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.seal import write_seal
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic
from bsg_models.studies.comparison import EvaluationRequest
from bsg_models.studies.evaluation_report import report_evaluation
from bsg_models.studies.leaderboard import LeaderboardRecipe, make_leaderboard
from bsg_models.studies.leaderboard_report import report_leaderboard
from bsg_models.studies.search_report import report_search
from bsg_models.studies.search_request import SearchRequest
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config, override, validate_config
from bsg_robot.answers.belief_report import BeliefRequest, report_beliefs
from bsg_robot.answers.seen_building import open_graph
from bsg_robot.graph.formats import write_belief
from bsg_robot.graph.graph_file import open_graph_file

pytestmark = pytest.mark.heavy

FOLDS = SplitRecipe(method="folds", ratios=None, folds=3)


def pairs_recipe(draws: int) -> PairsRecipe:
    return PairsRecipe(mask=MaskRecipe(strategy="rooms"), draws=draws)


def evaluate(work: Path, *, force: bool = False) -> None:
    """A folder of results, a page, and predictions elsewhere."""
    report_evaluation(
        EvaluationRequest(
            dataset=work / "dataset",
            runs=(work / "run",),
            out=work / "run" / "evaluation",
            html=work / "page.html",
            write_predictions=work / "predictions",
            resamples=2,
            force=force,
        )
    )


def search(work: Path) -> None:
    """A folder of results with a replay."""
    request = SearchRequest.read(
        work / "dataset",
        runs=(work / "run",),
        out=work / "search",
        trace="auto",
        planners=("nearest", "expected-cost"),
        worlds=("star",),
        episodes=2,
        resamples=2,
    )
    report_search(request)


def train(work: Path, *, force: bool = False) -> None:
    """A network, over a run with an evaluation by force."""
    small = ["model.width=4", "model.depth=1", "training.epochs=2", "training.validate_every=1"]
    tables = override(find_config("ceci").model_dump(mode="json"), small)
    config = validate_config(tables, source="test")
    train_run(config, work / "dataset", work / ("run" if force else "new"), force=force)


def rank(work: Path) -> None:
    """A leaderboard: trainings, and a report among them."""
    models = {"gamma-poisson": find_config("gamma-poisson")}
    recipe = LeaderboardRecipe(masks=("uniform",), folds=3, draws=1, resamples=2)
    board = make_leaderboard(work / "dataset", work / "board", models, recipe)
    report_leaderboard(board, work / "board")


def believe(work: Path) -> None:
    """Several files of one graph."""
    (work / "home.json").write_text('{"kitchen": ["stove"], "hall": []}')
    out = tuple(work / name for name in ("a.json", "a.html", "b.json"))
    graphs = (open_graph_file(work / "home.json"),)
    report_beliefs(BeliefRequest(run=work / "run", graphs=graphs, out=out))


def save_memory(work: Path) -> None:
    """What a home has taught, over what was saved before."""
    home = {"kitchen": ["mug"], "hall": []}
    for day in range(3):
        seen = open_graph(work / "home.json") if day else open_graph(home)
        seen.passes(24)
        seen.saw("hall" if day % 2 else "kitchen", "mug", object_id="1")
        write_belief(seen.belief(), work / "home.json")


# Command → the part of its kills that is tried, and its work in a folder with a dataset and a run.
COMMANDS: dict[str, tuple[int, Callable[[Path], object]]] = {
    "build": (1, lambda at: build_dataset(HM3DFolder(at / "hm3d"), at / "new", scenes_per_shard=5)),
    "build --force": (
        1,
        lambda at: build_dataset(HM3DFolder(at / "hm3d"), at / "dataset", force=True),
    ),
    "split --force": (1, lambda at: split_dataset(at / "dataset", FOLDS, force=True)),
    "pairs --force": (1, lambda at: write_pairs(at / "dataset", pairs_recipe(2), force=True)),
    "merge": (1, lambda at: merge_datasets([at / "dataset", at / "other"], at / "new")),
    "synth": (1, lambda at: list(write_synthetic(at / "new", scenes=2, seed=1))),
    "export": (1, lambda at: export_dataset(at / "dataset", at / "new", to="graphml")),
    "belief": (1, believe),
    "memory": (1, save_memory),
    "evaluate": (3, evaluate),
    "evaluate --force": (3, lambda at: evaluate(at, force=True)),
    "search": (8, search),
    "train": (3, train),
    "train --force": (3, lambda at: train(at, force=True)),
    "leaderboard": (8, rank),
}
TIMED = ("training.json", "metrics.csv", "SHA256SUMS", "leaderboard.json")


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
@pytest.mark.parametrize("command", COMMANDS)
def test_killed_twice_it_leaves_what_an_unbroken_one_leaves(
    command: str,
    dataset: Path,
    run: Path,
    hm3d_folder: Path,
    tmp_path: Path,
    stride: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A second kill comes anywhere in the command that repeats the first."""
    monkeypatch.setattr("bsg_models.studies.evaluation_report.plot_evaluation", lambda *_, **__: {})
    slow, work = COMMANDS[command]
    rng = random.Random(command)
    given, out = (tmp_path / name for name in ("given", "out"))
    given.mkdir()
    for folder in (dataset, run, hm3d_folder):
        folder.rename(given / folder.name)
    if command == "merge":
        list(write_synthetic(tmp_path / "others", scenes=1, seed=1))
        build_dataset(HM3DFolder(tmp_path / "others"), given / "other")
    if "--force" in command:
        (given / "run" / "evaluation").mkdir()
        (given / "run" / "evaluation" / "evaluation.json").write_text("{}")
        write_seal(given / "run" / "evaluation", ["evaluation.json"])
    shutil.copytree(given, out)
    work(out)
    whole, at, how = files_of(out), 1, ""
    states = {hash_manifest(folder / "dataset") for folder in (given, out)}
    while how != "done":
        shutil.rmtree(out)
        shutil.copytree(given, out)
        how = wait_for(*start(lambda: work(out), inside=out, kill_at=at)).how
        if (out / "dataset" / MANIFEST).is_file():
            assert hash_manifest(out / "dataset") in states
            assert check_dataset(out / "dataset") == ()
        for kill in (rng.randrange(1, 40), None):
            before = files_of(out)
            again = wait_for(*start(lambda: work(out), inside=out, kill_at=kill))
            # Where nothing but a lock was left to be removed, it was done.
            finished = again.how == "refused" and before == whole
            assert finished or again.how in ("done", "killed"), (at, kill, again)
        assert files_of(out) == whole, (at, set(files_of(out)) ^ set(whole))
        at += 1 if stride == 1 else stride * slow
    assert at > 1


def files_of(folder: Path) -> dict[str, bytes | None]:
    """Return the files below a folder, but for locks that nobody holds, and without times."""
    return {
        name: b"" if name.endswith(TIMED) else data
        for name, data in snapshot(folder).items()
        if not name.endswith(".lock") and data is not None
    }
