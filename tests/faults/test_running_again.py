"""A killed command simply runs again, without --force, and leaves what an unbroken one leaves."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from killed_process import start, wait_for
from watched_folder import snapshot

from bsg_data.errors import DatasetError
from bsg_models.studies.comparison import EvaluationRequest
from bsg_models.studies.evaluation_report import report_evaluation
from bsg_models.studies.search_report import report_search
from bsg_models.studies.search_request import SearchRequest
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config, override, validate_config
from bsg_robot.answers.belief_report import BeliefRequest, report_beliefs
from bsg_robot.graph.graph_file import open_graph_file

pytestmark = [
    pytest.mark.heavy,
    pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning"),
]
PARTIAL = "run.partial"  # what a stopped training goes on from
HOME = {"kitchen": ["stove", "sink"], "bedroom": ["bed"], "hall": []}


def believe(run: Path, dataset: Path, out: Path) -> None:
    """Files of one graph."""
    path = dataset.parent / "home.json"
    path.write_text(json.dumps(HOME))
    names = ("a.json", "a.html", "b.json")
    graphs = (open_graph_file(path),)
    report_beliefs(BeliefRequest(run=run, graphs=graphs, out=tuple(out / name for name in names)))


def evaluate(run: Path, dataset: Path, out: Path) -> None:
    """A folder of results, and a page beside it."""
    request = EvaluationRequest(
        dataset=dataset, runs=(run,), out=out / "evaluation", html=out / "page.html", resamples=2
    )
    report_evaluation(request)


def search(run: Path, dataset: Path, out: Path) -> None:
    """A folder of results with a replay."""
    request = SearchRequest.read(
        dataset,
        runs=(run,),
        out=out / "search",
        trace="auto",
        planners=("nearest", "expected-cost"),
        worlds=("star",),
        episodes=2,
        resamples=2,
    )
    report_search(request)


def train(_: Path, dataset: Path, out: Path) -> None:
    """A run, and what a stopped one goes on from beside it."""
    small = ["model.width=4", "model.depth=1", "training.epochs=2", "training.validate_every=1"]
    tables = override(find_config("ceci").model_dump(mode="json"), small)
    train_run(validate_config(tables, source="test"), dataset, out / "run")


@pytest.mark.parametrize(("work", "slow"), [(believe, 1), (evaluate, 4), (search, 8), (train, 4)])
def test_killed_at_any_change_of_a_file(
    work: Callable[[Path, Path, Path], None],
    slow: int,
    run: Path,
    dataset: Path,
    tmp_path: Path,
    stride: int,
) -> None:
    whole = tmp_path / "whole"
    whole.mkdir()
    work(run, dataset, whole)
    expected = list_names(whole)
    assert expected
    at = 1
    while True:
        out = tmp_path / "out"
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir()
        ended = wait_for(*start(lambda at=out: work(run, dataset, at), inside=out, kill_at=at))  # type: ignore[misc]
        if ended.how == "done":
            break
        assert ended.how == "killed", ended
        before, refused = list_names(out), ""
        try:
            work(run, dataset, out)
        except DatasetError as error:
            refused = error.code
        if refused:  # it was killed after all was committed, while it tidied up
            assert refused == "path-taken"
            left = (name.rpartition("/")[2] for name in before - expected if PARTIAL not in name)
            assert expected <= before
            assert all(name.startswith(".") for name in left)
        else:
            assert list_names(out) == expected
        at += 1 if stride == 1 else stride * slow
    assert at > 1


def list_names(folder: Path) -> set[str]:
    """Return the files below a folder, but for locks that nobody holds."""
    return {name for name in snapshot(folder) if not name.endswith(".lock")}
