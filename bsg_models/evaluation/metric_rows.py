"""Define this project's metrics, one object each; the catalogue's `METRICS` names them.

E is the distribution over classes of a histogram, O its total; ″ marks predicted values, no mark
true ones. Distances and errors use the raw totals of a model that predicts totals. Likelihood and
presence use the hidden counts. A `Metric` alone is computed by `presence` or `correlations`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bsg_data.arrays import Floats
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation import metrics
from bsg_models.evaluation.metric import RANKED, SELECTIONS, Metric, NodeMetric
from bsg_models.evaluation.truth import Truth


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


def _mean_absolute_error(truth: Truth, expectation: Expectation) -> Floats:
    """Return |O″ − O| per class, averaged over the classes, `[N]`."""
    return _average_known(np.abs(expectation.totals - truth.targets), truth)


def hidden_nll(truth: Truth, expectation: Expectation) -> Floats:
    """Return −log P(hidden counts) per class, averaged over the classes, `[N]`."""
    return _average_known(-expectation.log_probability(truth.hidden), truth)


def _top_three_unseen(truth: Truth, expectation: Expectation) -> Floats:
    """Return the hits among the 3 likeliest unseen classes, `metrics.topk_unseen`, `[N]`."""
    presence = np.where(truth.known, expectation.presence, 0.0)
    return metrics.topk_unseen(presence, truth.inputs > 0, truth.hidden > 0, k=3)


WASSERSTEIN_VALUES = NodeMetric(
    label="Wasserstein",
    less=True,
    parts=metrics.MOMENTS,
    values=_between_distributions(metrics.wasserstein_values),
    about="distance of E″ and E with their 45 probabilities taken as samples, "
    "`scipy.stats.wasserstein_distance(p, q)`: our reading of the paper's Table I",
)
ENERGY_VALUES = NodeMetric(
    label="energy",
    less=True,
    parts=metrics.MOMENTS,
    values=_between_distributions(metrics.energy_values),
    about="the same with `scipy.stats.energy_distance(p, q)`",
)
TOTAL_VARIATION = NodeMetric(
    label="total variation",
    less=True,
    parts=metrics.MOMENTS,
    values=_between_distributions(metrics.total_variation),
    about="½ Σ |E″ − E|: the share of probability on wrong classes",
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
CORRELATION_FROBENIUS = Metric(
    label="Frobenius",
    less=True,
    about="Frobenius norm of the difference of the two 45 × 45 Pearson correlation matrices of the "
    "counts over nodes; a class without variance correlates 0 with the others and 1 with itself",
)
PRESENCE_AUROC_MICRO = Metric(
    over=RANKED,
    parts=SELECTIONS,
    label="AUROC micro",
    less=False,
    about="area under the ROC curve of P(at least one hidden object of the class) over all "
    "(room, class) cells, or (building, class) cells: of `all` classes, only of classes `unseen` "
    "in the node's input, or only in rooms that are `unvisited`",
)
PRESENCE_AP_MICRO = Metric(
    over=("rooms",),
    parts=SELECTIONS,
    label="AP micro",
    less=False,
    about="average precision over the same cells of rooms",
)
PRESENCE_BRIER = Metric(
    over=RANKED,
    parts=SELECTIONS,
    label="Brier score",
    less=True,
    about="Brier score over the same cells",
)
PRESENCE_CALIBRATION_ERROR = Metric(
    over=RANKED,
    parts=SELECTIONS,
    label="calibration error",
    less=True,
    about="expected calibration error over the same cells, in 15 bins",
)
PRESENCE_AUROC_MACRO = Metric(
    over=RANKED,
    parts=SELECTIONS,
    label="AUROC macro",
    less=False,
    about="area under the ROC curve over the nodes, mean over classes",
)
PRESENCE_AP_MACRO = Metric(
    over=("rooms",),
    parts=SELECTIONS,
    label="AP macro",
    less=False,
    about="average precision over the rooms, mean over classes",
)
TOP3_UNSEEN = NodeMetric(
    label="top 3 unseen",
    less=False,
    over=("rooms",),
    values=_top_three_unseen,
    about="share of the rooms hiding an unseen class in which a hidden class is among the 3 "
    "likeliest unseen classes",
)
