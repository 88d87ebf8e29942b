"""Format a comparison of runs: JSON for programs, rows of text for a terminal or a page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.evaluation.catalogue import head_value
from bsg_models.evaluation.verdict import list_headlines
from bsg_models.studies.comparison import Comparison


def encode_comparison(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as JSON: metric → model → value, interval, nodes; unknown is null."""
    metrics: dict[str, dict[str, Any]] = {}
    for model, estimates in comparison.estimates.items():
        for name, e in estimates.items():
            values = {"value": e.value, "low": e.low, "high": e.high}
            known = {end: None if np.isnan(number) else number for end, number in values.items()}
            metrics.setdefault(name, {})[model] = {**known, "nodes": e.nodes}
    notes = list(comparison.notes)
    return {"split": comparison.split, **comparison.facts, "notes": notes, "metrics": metrics}


def headline_rows(comparison: Comparison) -> list[list[str]]:
    """Return one row per headline metric: its label, and the value of every model."""
    names = list_headlines(comparison.bootstraps)
    return [[head_value(name), *_cells(comparison, name)] for name in names]


def metric_rows(comparison: Comparison) -> list[list[str]]:
    """Return one row per metric: its name, its number of nodes, and the value of every model."""
    first = next(iter(comparison.estimates.values()))
    return [[name, str(e.nodes), *_cells(comparison, name)] for name, e in first.items()]


def _cells(comparison: Comparison, name: str) -> Iterator[str]:
    return (_cell(estimates[name]) for estimates in comparison.estimates.values())


def _cell(estimate: Estimate) -> str:
    """Return a value ± half the width of its 95 % interval."""
    if np.isnan(estimate.value):
        return "-"
    value = f"{estimate.value:.3g}"
    half = (estimate.high - estimate.low) / 2
    return value if np.isnan(half) else f"{value} ±{half:.1g}"
