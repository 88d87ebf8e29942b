"""Define this project's metrics, one object each; the catalogue's `METRICS` names them.

E is the distribution over classes of a histogram, O its total; ″ marks predicted values, no mark
true ones. Distances and errors use the raw totals of a model that predicts totals. Likelihood and
presence use the hidden counts.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bsg_data.arrays import Floats
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation import metrics
from bsg_models.evaluation.metric_kinds import NodeMetric, PooledMetric, Tally
from bsg_models.evaluation.truth import NODE_SETS, Truth


def _between_distributions(
    distance: Callable[[Floats, Floats], Floats],
) -> Callable[[Truth, Expectation], Floats]:
    """Return a function of the distance of E″ from E, both `[N, C]`, at every node."""

    def values(truth: Truth, expectation: Expectation) -> Floats:
        totals = np.where(truth.known, expectation.totals, 0.0)
        return distance(metrics.normalise(totals), metrics.normalise(truth.targets))

    return values


def _average_known(values: Floats, truth: Truth) -> Floats:
    """Return the mean of values `[N, C]` over the classes that are known, `[N]`."""
    where = True if truth.nameable is None else truth.nameable
    return np.asarray(values.mean(axis=1, where=where))


def _mean_error(truth: Truth, expectation: Expectation) -> Floats:
    """Return O″ − O per class, averaged over the classes, `[N]`."""
    return _average_known(expectation.totals - truth.targets, truth)


def _mean_absolute_error(truth: Truth, expectation: Expectation) -> Floats:
    """Return |O″ − O| per class, averaged over the classes, `[N]`."""
    return _average_known(np.abs(expectation.totals - truth.targets), truth)


def hidden_nll(truth: Truth, expectation: Expectation) -> Floats:
    """Return −log P(hidden counts) per class, averaged over the classes, `[N]`."""
    return _average_known(-expectation.log_probability(truth.hidden), truth)


def _topk_unseen(k: int) -> Callable[[Truth, Expectation], Floats]:
    """Return a function of the hits among the k likeliest unseen classes, `metrics.topk_unseen`."""

    def values(truth: Truth, expectation: Expectation) -> Floats:
        seen, hidden = truth.inputs > 0, truth.hidden > 0
        presence = np.where(truth.known, expectation.presence, 0.0)
        return metrics.topk_unseen(presence, seen, hidden, k=k)

    return values


def _brier(tally: Tally, node_set: str, part: str) -> Floats:
    """Return the mean of the squared errors of presence, `[W]`."""
    return np.asarray(tally.means((node_set, part, "squared"))[:, 0])


def _calibration_error(tally: Tally, node_set: str, part: str) -> Floats:
    """Return the sum over bins of |mean presence − outcome|, `[W]`."""
    return np.asarray(np.abs(tally.means((node_set, part, "gaps"))).sum(axis=1))


def _auroc(tally: Tally, node_set: str, part: str) -> Floats:
    return np.asarray(tally.cells[node_set].ranks.auroc[part][0])


def _average_precision(tally: Tally, node_set: str, part: str) -> Floats:
    return np.asarray(tally.cells[node_set].ranks.precision[part][0])


def _auroc_of_classes(tally: Tally, node_set: str, part: str) -> Floats:
    return metrics.mean_known(tally.cells[node_set].ranks.auroc[part][1:])


def _average_precision_of_classes(tally: Tally, node_set: str, part: str) -> Floats:
    return metrics.mean_known(tally.cells[node_set].ranks.precision[part][1:])


def _frobenius(tally: Tally, node_set: str, part: str) -> Floats:
    """Return the norms of the difference of predicted and true correlations, `[W]`."""
    both = zip(tally.products(node_set, "predicted"), tally.products(node_set, "true"), strict=True)
    return np.array([np.linalg.norm(_correlate(ours) - _correlate(true)) for ours, true in both])


def _correlate(products: Floats) -> Floats:
    """Return the correlations `[C, C]` from Σ z zᵀ, z = (1, counts)."""
    return metrics.correlate_sums(float(products[0, 0]), products[0, 1:], products[1:, 1:])


WASSERSTEIN_VALUES = NodeMetric(
    label="Wasserstein",
    less=True,
    spread=True,
    values=_between_distributions(metrics.wasserstein_values),
    about="distance of E″ and E with their 45 probabilities taken as samples, "
    "`scipy.stats.wasserstein_distance(p, q)`: our reading of the paper's Table I",
)
ENERGY_VALUES = NodeMetric(
    label="energy",
    less=True,
    spread=True,
    values=_between_distributions(metrics.energy_values),
    about="the same with `scipy.stats.energy_distance(p, q)`",
)
WASSERSTEIN_CLASSES = NodeMetric(
    label="Wasserstein over class indices",
    less=True,
    spread=True,
    values=_between_distributions(metrics.wasserstein_classes),
    about="Wasserstein distance of E″ and E with the class index as support",
)
ENERGY_CLASSES = NodeMetric(
    label="energy over class indices",
    less=True,
    spread=True,
    values=_between_distributions(metrics.energy_classes),
    about="energy distance of E″ and E with the class index as support",
)
TOTAL_VARIATION = NodeMetric(
    label="total variation",
    less=True,
    spread=True,
    values=_between_distributions(metrics.total_variation),
    about="½ Σ |E″ − E|: the share of probability on wrong classes",
)
MEAN_ERROR = NodeMetric(
    label="signed error in number",
    less=None,
    values=_mean_error,
    about="O″ − O per class, mean over classes and nodes; per class in `classes.csv` and in the "
    "box plot",
)
MEAN_ABSOLUTE_ERROR = NodeMetric(
    label="error in number",
    less=True,
    values=_mean_absolute_error,
    about="|O″ − O|, averaged in the same way",
)
HIDDEN_NLL = NodeMetric(
    label="NLL",
    less=True,
    values=hidden_nll,
    about="mean negative log-likelihood of the hidden counts per node and class, by the model's "
    "own distribution, or Poisson if it has none; a rate below 0.001 counts as 0.001, so that one "
    "impossible object does not dominate the mean",
)
CORRELATION_FROBENIUS = PooledMetric(
    label="Frobenius",
    less=True,
    measure=_frobenius,
    keys=tuple((node_set, "") for node_set in NODE_SETS),
    about="Frobenius norm of the difference of the two 45 × 45 Pearson correlation matrices of the "
    "counts over nodes; a class without variance correlates 0 with the others and 1 with itself",
)
PRESENCE_AUROC_MICRO = PooledMetric(
    label="AUROC micro",
    less=False,
    measure=_auroc,
    about="area under the ROC curve of P(at least one hidden object of the class) over all "
    "(room, class) cells, or (building, class) cells: of `all` classes, only of classes `unseen` "
    "in the node's input, or only in rooms that are `unvisited`",
)
PRESENCE_AP_MICRO = PooledMetric(
    label="AP micro",
    less=False,
    measure=_average_precision,
    about="average precision over the same cells",
)
PRESENCE_BRIER = PooledMetric(
    label="Brier score",
    less=True,
    measure=_brier,
    about="Brier score over the same cells",
)
PRESENCE_CALIBRATION_ERROR = PooledMetric(
    label="calibration error",
    less=True,
    measure=_calibration_error,
    about="expected calibration error over the same cells, in 15 bins",
)
PRESENCE_AUROC_MACRO = PooledMetric(
    label="AUROC macro",
    less=False,
    measure=_auroc_of_classes,
    about="area under the ROC curve over the nodes, mean over classes",
)
PRESENCE_AP_MACRO = PooledMetric(
    label="AP macro",
    less=False,
    measure=_average_precision_of_classes,
    about="average precision over the nodes, mean over classes",
)
TOP1_UNSEEN, TOP3_UNSEEN, TOP5_UNSEEN = (
    NodeMetric(
        label=f"top {k} unseen",
        less=False,
        over=("rooms",),
        values=_topk_unseen(k),
        about="share of the rooms hiding an unseen class in which a hidden class is "
        + ("the likeliest unseen class" if k == 1 else f"among the {k} likeliest unseen classes"),
    )
    for k in (1, 3, 5)
)
