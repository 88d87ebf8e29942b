from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import REPOSITORY, write_twelve
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError, MismatchError, RecipeError
from bsg_data.recipes import SplitRecipe
from bsg_data.results import write_seal
from bsg_data.sources.hm3d import HM3DFolder
from bsg_models.belief.graph_file import open_graph_file
from bsg_models.studies import belief_report
from bsg_models.studies.belief_report import (
    BeliefRequest,
    report_beliefs,
)
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config

OFFICE = open_graph_file(REPOSITORY / "docs" / "office.json")


def test_files_are_refused_before_the_run_is_loaded(tmp_path: Path) -> None:
    twice = BeliefRequest(run=tmp_path, graphs=(OFFICE,), out=(OFFICE.path,))
    with refuses(RecipeError, "output-twice"):
        report_beliefs(twice)
    (tmp_path / "b.json").write_text("")
    with pytest.raises(DatasetError):
        report_beliefs(BeliefRequest(run=tmp_path, graphs=(OFFICE,), out=(tmp_path / "b.json",)))


def test_files_of_a_run_are_not_replaced(run: Path) -> None:
    (run / "kept.json").write_text("measured")
    write_seal(run, ["best.safetensors", "kept.json"])
    asked = BeliefRequest(run=run, graphs=(OFFICE,), out=(run / "kept.json",), force=True)
    with pytest.raises(DatasetError):
        report_beliefs(asked)
    assert (run / "kept.json").read_text() == "measured"


@pytest.fixture
def old_run(tmp_path: Path) -> Path:
    """A run on the twelve buildings by the first class map."""
    data = tmp_path / "old"
    source = HM3DFolder(write_twelve(tmp_path / "twelve"))
    build_dataset(source, data, class_map="hm3d45-v1")
    split_dataset(data, SplitRecipe())
    list(train_run(find_config("gamma-poisson"), data, tmp_path / "run"))
    return tmp_path / "run"


def test_a_graph_is_read_into_the_class_space_of_the_run(old_run: Path, tmp_path: Path) -> None:
    report = report_beliefs(BeliefRequest(run=old_run, graphs=(OFFICE,)))
    assert report.graphs[0].partial.class_space.name == "hm3d45-v1"
    path = tmp_path / "robot.json"
    rooms, objects = [{"id": "lounge"}], [{"id": "1", "room": "lounge", "category": "TV-stands"}]
    path.write_text(json.dumps({"scene_id": "flat", "rooms": rooms, "objects": objects}))
    old = report_beliefs(BeliefRequest(run=old_run, graphs=(open_graph_file(path),)))
    (obj,) = old.graphs[0].partial.objects
    assert (obj.raw_category, obj.category) == ("TV-stands", None)  # the first map has no rules


def test_a_run_of_another_space_is_refused_with_both_named(old_run: Path, dataset: Path) -> None:
    with pytest.raises(MismatchError):
        report_beliefs(BeliefRequest(run=old_run, dataset=dataset, split="test"))


def test_any_number_of_beliefs_goes_to_tables_and_some_to_a_page(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    list(train_run(find_config("gamma-poisson"), dataset, tmp_path / "run"))
    run, tables = tmp_path / "run", tmp_path / "all.tables"
    request = BeliefRequest(run=run, dataset=dataset, split="train", out=(tables,))
    whole = report_beliefs(request)
    monkeypatch.setattr(belief_report, "MOST_HELD", 2)
    some, page = tmp_path / "b.tables", tmp_path / "p.html"
    steps: list[tuple[int, int]] = []
    few = report_beliefs(
        replace(request, out=(some, page)), progress=lambda *step: steps.append(step)
    )
    assert few.graphs == whole.graphs[:2]
    assert (few.number, few.blind, few.rooms) == (whole.number, whole.blind, whole.rooms)
    assert few.number == len(whole.graphs) == len(steps) > 2
    for name in ("nodes", "edges", "histograms"):
        assert (some / f"{name}.parquet").read_bytes() == (tables / f"{name}.parquet").read_bytes()
    shown = page.read_text("utf-8")
    assert few.graphs[1].partial.scene_id in shown
    assert whole.graphs[2].partial.scene_id not in shown


def test_tables_take_the_place_of_no_run_and_of_no_file_of_somebody_else(old_run: Path) -> None:
    """With --force they replaced the seal of a run, which was then not checked any more."""
    before = {path.name: path.read_bytes() for path in old_run.iterdir()}
    run = old_run.rename(old_run.with_name("run.tables"))
    into_run = BeliefRequest(run=run, graphs=(OFFICE,), out=(run,), force=True)
    with pytest.raises(DatasetError):
        report_beliefs(into_run)
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before
    other = run.with_name("evaluated.tables")
    other.mkdir()
    (other / "evaluation.json").write_text("{}")
    write_seal(other, ["evaluation.json"])
    with pytest.raises(DatasetError):
        report_beliefs(replace(into_run, out=(other,)))
    mine = run.with_name("mine.tables")
    mine.mkdir()
    (mine / "edges.parquet").write_text("mine")
    with pytest.raises(DatasetError):
        report_beliefs(replace(into_run, out=(mine,)))
    assert (mine / "edges.parquet").read_text() == "mine"
    (mine / "edges.parquet").unlink()
    for _ in range(2):  # over its own tables it writes
        report_beliefs(replace(into_run, out=(mine,)))
