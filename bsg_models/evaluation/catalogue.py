"""List all metrics, the names of their values, and their labels in tables.

A metric has one or several values for each of its node sets: `rooms/hidden_nll`,
`all/wasserstein_values/mean`, `rooms/presence_brier/unseen`. Packages add rows with entry points of
the group `bsg_models.metrics`; they follow this project's own.
"""

from __future__ import annotations

from bsg_data.errors import RecipeError
from bsg_data.registry import Registry
from bsg_models.evaluation.metric_kinds import Metric
from bsg_models.evaluation.presence import SELECTIONS
from bsg_models.evaluation.truth import NODE_SETS

_OURS = (
    *("wasserstein_values", "energy_values", "wasserstein_classes", "energy_classes"),
    *("total_variation", "mean_error", "mean_absolute_error", "hidden_nll"),
    *("correlation_frobenius", "presence_auroc_micro", "presence_ap_micro", "presence_brier"),
    *("presence_calibration_error", "presence_auroc_macro", "presence_ap_macro"),
    *("top1_unseen", "top3_unseen", "top5_unseen"),
)
METRICS: Registry[Metric] = Registry(
    "metric",
    Metric,  # type: ignore[type-abstract]
    group="bsg_models.metrics",
    rows={name: f"bsg_models.evaluation.metric_rows:{name.upper()}" for name in _OURS},
)


def name_value(metric: str, node_set: str, part: str) -> str:
    """Return the name of a value of a metric."""
    return f"{node_set}/{metric}/{part}" if part else f"{node_set}/{metric}"


def find_value(name: str) -> tuple[Metric, str, str]:
    """Return metric, node set and part of a value's name."""
    node_set, _, rest = name.partition("/")
    row, _, part = rest.partition("/")
    metric = METRICS[row]
    if (node_set, part) not in metric.keys:
        known = ", ".join(name_value(row, *key) for key in metric.keys)
        raise RecipeError(f"metric {row!r} has no value {name!r}; it has {known}")
    return metric, node_set, part


def list_values() -> tuple[str, ...]:
    """Return the names of all values, in the order of all tables.

    First come metrics of all nodes, by node set; then those of presence, by selection of cells;
    then those of rooms only.
    """
    rows, _ = METRICS.load_all()
    wide = [row for row, metric in rows.items() if metric.node_sets == NODE_SETS]
    names = [
        name_value(row, *key)
        for node_set in NODE_SETS
        for row in wide
        for key in rows[row].keys
        if key[0] == node_set
    ]
    for selection in (*SELECTIONS, None):
        for row in rows:
            if row not in wide:
                names += [
                    name_value(row, node_set, part)
                    for node_set, part in rows[row].keys
                    if part == selection or (selection is None and part not in SELECTIONS)
                ]
    return tuple(names)


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
    if metric.node_sets == NODE_SETS:
        label += ", all nodes" if node_set == "all" else f", {node_set}"
    elif node_set != metric.node_sets[0]:  # most are of rooms, and need not say so
        label += f", {node_set}"
    return label


def head_value(name: str) -> str:
    """Return the label of a value with an arrow to its better side."""
    less = find_value(name)[0].less
    return label_value(name) + ("" if less is None else " ↓" if less else " ↑")
