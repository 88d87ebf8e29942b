"""Every model, planner, metric and format keeps the contract that others inherit."""

from __future__ import annotations

import pytest

from bsg_models.belief.formats import FORMATS
from bsg_models.evaluation.catalogue import METRICS
from bsg_models.search.catalogue import PLANNERS
from bsg_models.testing import FormatContract, MetricContract, ModelContract, PlannerContract
from bsg_models.zoo.catalogue import ZOO


class TestModels(ModelContract):
    @pytest.fixture(autouse=True, params=ZOO.names())
    def _row(self, request: pytest.FixtureRequest) -> None:
        if request.param == "poisson-boosting":
            pytest.importorskip("lightgbm")
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
