"""Every model, metric and format keeps its contract, and a careless one is found out."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
from contracts import FormatContract

from bsg_data.arrays import Floats
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.catalogue import METRICS
from bsg_models.evaluation.metric import NodeMetric
from bsg_models.evaluation.truth import Truth
from bsg_models.testing import MetricContract, ModelContract
from bsg_models.zoo.catalogue import ZOO
from bsg_robot.graph.formats import FORMATS


class TestModels(ModelContract):
    @pytest.fixture(autouse=True, params=ZOO.names())
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


def sum_of_errors(truth: Truth, expectation: Expectation) -> Floats:
    """Return a value that depends on how many nodes there are besides."""
    return np.arange(len(truth.inputs), dtype=float)


def test_a_careless_metric_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("careless")
    row = NodeMetric(label="sum", less=True, about="careless", values=sum_of_errors)
    module.ROW = row  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "careless", module)
    point = EntryPoint("careless", "careless:ROW", METRICS.group)
    monkeypatch.setitem(METRICS._rows, "careless", point)
    contract = MetricContract()
    contract.name = "careless"  # type: ignore[misc]
    with pytest.raises(AssertionError):
        contract.test_a_building_that_counts_twice_is_there_twice()


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
