"""Every model, planner, metric and format keeps the contract that others inherit."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch

from bsg_data.arrays import Floats, Ints
from bsg_data.registry import Registry
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.catalogue import METRICS
from bsg_models.evaluation.metric import NodeMetric
from bsg_models.evaluation.truth import Truth
from bsg_models.search.catalogue import PLANNERS, Planner
from bsg_models.search.knowledge import Knowledge
from bsg_models.testing import MetricContract, ModelContract, PlannerContract
from bsg_models.zoo.catalogue import ZOO
from bsg_robot.graph.formats import FORMATS, FormatRow
from bsg_robot.testing import FormatContract, make_belief


class TestModels(ModelContract):
    @pytest.fixture(autouse=True, params=ZOO.names())
    def _row(self, request: pytest.FixtureRequest) -> None:
        self.name = request.param


class TestPlanners(PlannerContract):
    @pytest.fixture(autouse=True, params=PLANNERS.names())
    def _row(self, request: pytest.FixtureRequest) -> None:
        self.name = request.param


class TestMetrics(MetricContract):
    @pytest.fixture(autouse=True, params=METRICS.names())
    def _row(self, request: pytest.FixtureRequest) -> None:
        self.name = request.param


class TestFormats(FormatContract):
    @pytest.fixture(autouse=True, params=FORMATS.names())
    def _row(self, request: pytest.FixtureRequest) -> None:
        if request.param == "spark-dsg":
            pytest.importorskip("spark_dsg")
        self.name = request.param


def crowd_follower(known: Knowledge) -> Ints:
    """Go where the first search has most presence, whatever it says that it reads."""
    score = known.presence[:, :, 0] + 2 * known.presence[:1, :, 0]
    return np.where(known.unexplored, score, -1.0).argmax(axis=1)


def sum_of_errors(truth: Truth, expectation: Expectation) -> Floats:
    """Return a value that depends on how many nodes there are besides."""
    return np.arange(len(truth.inputs), dtype=float)


def write_line_by_line(belief: BeliefGraph, path: Path) -> None:
    """Write as much as it comes to."""
    with path.open("w", encoding="utf-8") as file:
        for node in belief.blind:
            file.write(belief.partial.class_space.classes[node.class_index] + "\n")


def read_nothing(path: Path) -> BeliefGraph:
    """Return always the same."""
    return make_belief("another", names=())


CARELESS: list[tuple[Registry[Any], Any, Callable[..., None]]] = [
    (
        PLANNERS,
        Planner(crowd_follower, "none"),
        PlannerContract.test_it_does_not_read_what_it_does_not_say,
    ),
    (
        PLANNERS,
        Planner(crowd_follower, "belief"),
        PlannerContract.test_a_search_goes_the_same_way_alone_and_among_others,
    ),
    (
        METRICS,
        NodeMetric(label="sum", less=True, about="careless", values=sum_of_errors),
        MetricContract.test_a_building_that_counts_twice_is_there_twice,
    ),
    (
        FORMATS,
        FormatRow("careless", (".careless",), write=write_line_by_line, read=read_nothing),
        FormatContract.test_nothing_half_written_stays,
    ),
    (
        FORMATS,
        FormatRow("careless", (".careless",), write=write_line_by_line, read=read_nothing),
        FormatContract.test_what_is_written_is_read,
    ),
    (
        FORMATS,
        FormatRow("careless", (".careless",), write=write_line_by_line, read=read_nothing),
        FormatContract.test_what_is_no_such_file_is_refused,
    ),
]


@pytest.mark.parametrize(("rows", "row", "proof"), CARELESS)
def test_a_careless_row_is_found_out(
    rows: Registry[Any],
    row: Any,
    proof: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    module = ModuleType("careless")
    module.ROW = row  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "careless", module)
    point = EntryPoint("careless", "careless:ROW", rows.group)
    monkeypatch.setitem(rows._rows, "careless", point)
    kinds = (PlannerContract, MetricContract, FormatContract)
    contract = next(kind() for kind in kinds if proof in vars(kind).values())
    contract.name = "careless"  # type: ignore[attr-defined]
    with pytest.raises(AssertionError):
        proof(contract, tmp_path) if "tmp_path" in proof.__annotations__ else proof(contract)


@pytest.mark.parametrize(
    ("method", "answer"),
    [
        ("loss", lambda *_: torch.ones(3, requires_grad=True)),
        ("loss", lambda *_: torch.tensor(torch.nan, requires_grad=True)),
        ("loss", lambda *_: torch.ones((), requires_grad=True)),  # of no parameter
        ("validation_loss", lambda *_: (float("inf"), 1)),
        ("validation_loss", lambda *_: (0.0, 0)),
    ],
)
def test_a_careless_loss_is_found_out(
    method: str, answer: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Careless(ModelContract):
        name = "ceci"

    Careless().test_losses_are_numbers()
    monkeypatch.setattr(ZOO["ceci"].make, method, answer)
    with pytest.raises(AssertionError):
        Careless().test_losses_are_numbers()
