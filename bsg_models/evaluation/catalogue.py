"""List all metrics, the names of their values, and their labels in tables.

A metric has one or several values for each of its node sets: `rooms/hidden_nll`,
`all/wasserstein_values/mean`, `rooms/presence_brier/unseen`. Packages add rows with entry points of
the group `bsg_models.metrics`; they follow this project's own.
"""

from __future__ import annotations

from bsg_data.registry import Registry
from bsg_models.evaluation.metric import SELECTIONS, Metric
from bsg_models.evaluation.truth import NODE_SETS

_OURS = (
    *("wasserstein_values", "energy_values", "total_variation", "mean_absolute_error"),
    *("hidden_nll", "correlation_frobenius", "top3_unseen"),
    *("presence_auroc_micro", "presence_auroc_macro", "presence_ap_micro", "presence_ap_macro"),
    *("presence_brier", "presence_calibration_error"),
)
METRICS: Registry[Metric] = Registry(
    "metric",
    Metric,
    group="bsg_models.metrics",
    rows={name: f"bsg_models.evaluation.metric_rows:{name.upper()}" for name in _OURS},
)


def name_value(metric: str, node_set: str, part: str) -> str:
    """Return the name of a value of a metric."""
    return f"{node_set}/{metric}/{part}" if part else f"{node_set}/{metric}"


def find_value(name: str) -> tuple[Metric, str, str]:
    """Return metric, node set and part of a value's name."""
    node_set, _, row = name.partition("/")
    row, _, part = row.partition("/")
    return METRICS[row], node_set, part


def list_values() -> tuple[str, ...]:
    """Return the names of all values, in the order of all tables."""
    rows, _ = METRICS.load_all()
    return tuple(name_value(row, *key) for row, metric in rows.items() for key in metric.keys)


def list_added_values() -> tuple[str, ...]:
    """Return the names of all values of metrics that installed packages add."""
    return tuple(name for name in list_values() if name.split("/")[1] not in _OURS)


def label_value(name: str) -> str:
    """Return the label of a value in tables."""
    metric, node_set, part = find_value(name)
    label = metric.label
    if part in SELECTIONS:
        label = label if part == "all" else f"{part} {label}"
    elif part not in ("", "mean"):
        label = f"{part} of {label}"
    if metric.over == NODE_SETS:
        label += ", all nodes" if node_set == "all" else f", {node_set}"
    elif node_set != metric.over[0]:  # most are of rooms, and need not say so
        label += f", {node_set}"
    return label


def head_value(name: str) -> str:
    """Return the label of a value with an arrow to its better side."""
    less = find_value(name)[0].less
    return label_value(name) + ("" if less is None else " ↓" if less else " ↑")
