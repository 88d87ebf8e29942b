"""Two commands on one run or one folder of results: one wins, the other waits or says so.

The second one starts at a known moment of the first: while it works, or when it is done.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from bsg_data.errors import BSGError, DatasetError
from bsg_data.recipes import MaskRecipe
from bsg_models.studies.belief_report import BeliefRequest, MaskedScenes, report_beliefs
from bsg_models.studies.evaluation_report import EvaluationRequest, report_evaluation
from bsg_models.studies.leaderboard import make_leaderboard
from bsg_models.studies.leaderboard_runs import LeaderboardRecipe
from bsg_models.studies.sealed_results import check_results
from bsg_models.studies.search_report import SearchRequest, report_search
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config, override, validate_config

pytestmark = pytest.mark.heavy

Work = Callable[[Callable[..., None]], object]


def commands(dataset: Path, run: Path, out: Path) -> dict[str, Work]:
    """Return what writes into one folder, each with what it calls while it works."""
    masked = MaskedScenes(dataset=dataset, split="test", mask=MaskRecipe())
    return {
        "evaluate": lambda during: report_evaluation(
            EvaluationRequest(runs=(run,), dataset=dataset, out=out, resamples=0, force=True),
            progress=during,
        ),
        "search": lambda during: report_search(
            SearchRequest(
                dataset=dataset,
                out=out,
                planners=("nearest",),
                worlds=("star:1-10",),
                episodes=1,
                masks=1,
                resamples=0,
                force=True,
            ),
            progress=during,
        ),
        "tables": lambda during: report_beliefs(
            BeliefRequest(run=run, scenes=masked, tables=out, force=True), progress=during
        ),
    }


@pytest.mark.parametrize("first", ["evaluate", "search", "tables"])
@pytest.mark.parametrize("second", ["evaluate", "search", "tables"])
def test_two_commands_into_one_folder(
    dataset: Path, run: Path, tmp_path: Path, first: str, second: str, full: bool
) -> None:
    if not full and (first, second) != ("tables", "search"):
        pytest.skip("the other pairs are tried by `make faults`")
    out = tmp_path / "out"
    works = commands(dataset, run, out)
    refused: list[str] = []

    def interrupt(*_: object) -> None:
        try:
            works[second](lambda *_: None)
        except DatasetError as error:
            refused.append(str(error))

    works[first](interrupt)
    said = [one for one in refused if "another command is writing there" in one]
    sound = bool(said) and said == refused and bool(check_results(out))
    assert sound


@pytest.mark.parametrize("work", ["evaluate", "search", "tables"])
def test_other_results_and_runs_are_left_alone(
    dataset: Path, run: Path, tmp_path: Path, work: str
) -> None:
    other = "evaluate" if work != "evaluate" else "tables"
    commands(dataset, run, tmp_path / "results")[other](lambda *_: None)
    unsealed = tmp_path / "unsealed"
    shutil.copytree(run, unsealed)
    (unsealed / "SHA256SUMS").unlink()
    for place in (tmp_path / "results", run, unsealed):
        before = {path: path.read_bytes() for path in place.rglob("*") if path.is_file()}
        with pytest.raises(DatasetError, match=r"holds other results|is a run of bsg-train"):
            commands(dataset, run, place)[work](lambda *_: None)
        assert {path: path.read_bytes() for path in place.rglob("*") if path.is_file()} == before
    for place in (dataset, dataset / "pairs"):
        with pytest.raises(DatasetError, match="is in the dataset"):
            commands(dataset, run, place)[work](lambda *_: None)


def test_a_training_that_comes_second_replaces_nothing(dataset: Path, tmp_path: Path) -> None:
    small = ["model.width=4", "training.epochs=2"]
    tables = override(find_config("ceci-gcn").model_dump(mode="json"), small)
    config = validate_config(tables, source="test")
    first = train_run(config, dataset, tmp_path / "run")
    next(first)
    for force in (False, True):
        with pytest.raises(BSGError, match=r"holds a run already|another command is writing"):
            list(train_run(config, dataset, tmp_path / "run", force=force))
    list(first)
    assert "last.safetensors" in check_results(tmp_path / "run")


def test_a_leaderboard_and_its_dataset_lie_apart(dataset: Path, tmp_path: Path) -> None:
    models, recipe = {"gamma-poisson": find_config("gamma-poisson")}, LeaderboardRecipe(folds=3)
    before = sorted(dataset.rglob("*"))
    (tmp_path / "link").symlink_to(dataset)
    for out in (dataset / "board", dataset, dataset.parent, tmp_path / "link" / "board"):
        with pytest.raises(DatasetError, match=r"one inside the other|is in the dataset"):
            make_leaderboard(dataset, out, models, recipe)
    assert sorted(dataset.rglob("*")) == before
    (tmp_path / "board").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "board" / "uniform").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(DatasetError, match="is a link"):
        make_leaderboard(dataset, tmp_path / "board", models, recipe)
    assert not list((tmp_path / "elsewhere").iterdir())
