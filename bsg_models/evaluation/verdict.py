"""Decide whether one model is better than another, by the interval of their paired difference.

Both use the same resamples of the buildings, so buildings that are hard for both do not widen the
interval. Comparing two separate intervals for overlap would show less.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Literal

import numpy as np

from bsg_models.evaluation.bootstrap import Bootstrap, Estimate
from bsg_models.evaluation.catalogue import (
    find_value,
    head_value,
    label_value,
    list_added_values,
)

_Verdict = Literal["better", "not distinguishable", "worse"]

# The values that are shown first, by topic; those of metrics of other packages follow.
HEADLINES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "what is hidden": (
            "rooms/hidden_nll",
            "rooms/presence_auroc_macro/all",
            "rooms/presence_auroc_micro/all",
            "rooms/presence_auroc_macro/unseen",
            "rooms/presence_ap_micro/unseen",
            "rooms/presence_calibration_error/all",
            "rooms/top3_unseen",
        ),
        "unvisited rooms": (
            "rooms/presence_ap_micro/unvisited",
            "rooms/presence_ap_macro/unvisited",
            "rooms/presence_auroc_macro/unvisited",
            "rooms/presence_calibration_error/unvisited",
        ),
        "whole histograms": (
            "all/wasserstein_values/mean",
            "all/energy_values/mean",
            "rooms/total_variation/mean",
            "rooms/correlation_frobenius",
            "all/correlation_frobenius",
            "building/mean_absolute_error",
        ),
    }
)


def _judge(ours: Bootstrap, other: Bootstrap, name: str) -> _Verdict:
    """Return whether a model is better in a value than another with the same resamples.

    It is better or worse if the interval of the paired difference excludes 0; without resamples, if
    the values differ.
    """
    less = find_value(name)[0].less
    gap = ours.difference(other, name)
    low, high = (gap.value, gap.value) if np.isnan(gap.low) else (gap.low, gap.high)
    if gap.value == 0 or not (low > 0 or high < 0):
        return "not distinguishable"
    return "better" if (high < 0) == less else "worse"


def judge_all(
    bootstraps: Mapping[str, Bootstrap], *, runs: Sequence[str]
) -> dict[str, dict[str, list[str]]]:
    """Return what is compared → verdict → the headlines with this verdict.

    The first run is compared with doubling what was seen, every other run with the first. A
    headline that is not defined for both, or has no better side, has no verdict.
    """
    judged: dict[str, dict[str, list[str]]] = {}
    for run in runs:
        is_first = run == runs[0]
        other = bootstraps["doubled" if is_first else runs[0]]
        rival = "doubling what was seen" if is_first else runs[0]
        labels: dict[str, list[str]] = {"better": [], "not distinguishable": [], "worse": []}
        for name in list_headlines(model.point for model in bootstraps.values()):
            has_side = find_value(name)[0].less is not None
            if has_side and not np.isnan(bootstraps[run].point[name] - other.point[name]):
                labels[_judge(bootstraps[run], other, name)].append(label_value(name))
        heading = f"{run}, compared with {rival} (by 95 % intervals of the paired difference)"
        judged[heading] = {verdict: some for verdict, some in labels.items() if some}
    return judged


def list_headlines(points: Iterable[Mapping[str, float]]) -> list[str]:
    """Return the names of the headlines that are defined for any of some models, in order."""
    ours = [name for group in HEADLINES.values() for name in group]
    models = list(points)
    return [
        name
        for name in (*ours, *list_added_values())
        if not all(np.isnan(values[name]) for values in models)
    ]


def headline_rows(estimates: Mapping[str, Mapping[str, Estimate]]) -> list[list[str]]:
    """Return one row per headline metric: its label, and the value of every model."""
    points = ({name: e.value for name, e in values.items()} for values in estimates.values())
    return [
        [head_value(name), *(values[name].show() for values in estimates.values())]
        for name in list_headlines(points)
    ]


def metric_rows(estimates: Mapping[str, Mapping[str, Estimate]]) -> list[list[str]]:
    """Return one row per metric: its name, its number of nodes, and the value of every model."""
    first = next(iter(estimates.values()))
    return [
        [name, str(e.nodes), *(values[name].show() for values in estimates.values())]
        for name, e in first.items()
    ]


def explain(bootstraps: Mapping[str, Bootstrap], *, runs: Sequence[str]) -> list[str]:
    """Return the verdicts of `judge_all` as lines."""
    lines = []
    for heading, verdicts in judge_all(bootstraps, runs=runs).items():
        lines.append(f"{heading}:")
        for verdict, labels in verdicts.items():
            lines.append(f"  {verdict}: {labels[0]}")
            lines += [" " * (len(verdict) + 4) + label for label in labels[1:]]
    return lines
