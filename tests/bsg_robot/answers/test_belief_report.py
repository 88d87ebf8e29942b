from __future__ import annotations

import json
from pathlib import Path

import pytest
from conftest import REPOSITORY, write_twelve
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError, MismatchError, RecipeError
from bsg_data.recipes import SplitRecipe
from bsg_data.sources.hm3d import HM3DFolder
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config
from bsg_robot.answers.belief_report import BeliefRequest, report_beliefs
from bsg_robot.graph.graph_file import open_graph_file

OFFICE = open_graph_file(REPOSITORY / "docs" / "office.json")


def test_files_are_refused_before_the_run_is_loaded(tmp_path: Path) -> None:
    twice = BeliefRequest(run=tmp_path, graphs=(OFFICE,), out=(OFFICE.path,))
    with refuses(RecipeError, "output-twice"):
        report_beliefs(twice)
    (tmp_path / "b.json").write_text("")
    with pytest.raises(DatasetError):
        report_beliefs(BeliefRequest(run=tmp_path, graphs=(OFFICE,), out=(tmp_path / "b.json",)))


@pytest.fixture
def wide_run(tmp_path: Path) -> Path:
    """A run on the twelve buildings by the wide class map."""
    data = tmp_path / "wide"
    source = HM3DFolder(write_twelve(tmp_path / "twelve"))
    build_dataset(source, data, class_map="hm3d-wide-v1")
    split_dataset(data, SplitRecipe())
    list(train_run(find_config("gamma-poisson"), data, tmp_path / "run"))
    return tmp_path / "run"


def test_a_graph_is_read_into_the_class_space_of_the_run(wide_run: Path, tmp_path: Path) -> None:
    report = report_beliefs(BeliefRequest(run=wide_run, graphs=(OFFICE,)))
    assert report.graphs[0].partial.class_space.name == "hm3d-wide-v1"
    path = tmp_path / "robot.json"
    rooms, objects = [{"id": "lounge"}], [{"id": "1", "room": "lounge", "category": "boots"}]
    path.write_text(json.dumps({"scene_id": "flat", "rooms": rooms, "objects": objects}))
    read = report_beliefs(BeliefRequest(run=wide_run, graphs=(open_graph_file(path),)))
    (obj,) = read.graphs[0].partial.objects
    assert read.graphs[0].partial.class_space.classes[obj.class_index or 0] == "shoe"


def test_a_run_of_another_space_is_refused_with_both_named(wide_run: Path, dataset: Path) -> None:
    with pytest.raises(MismatchError):
        report_beliefs(BeliefRequest(run=wide_run, dataset=dataset, split="test"))
