"""Compare the correlations of the classes over nodes, predicted and true (the paper's IV-B)."""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Floats, Ints
from bsg_models.evaluation.metric import RANKED, Value, Values, Weights
from bsg_models.evaluation.metrics import correlate_sums
from bsg_models.evaluation.truth import Prediction

_SIDES = ("predicted", "true")


class Correlations:
    """Sums Σ z zᵀ over nodes, z = (1, counts of the classes), under weights of the buildings."""

    def __init__(self, weights: Weights) -> None:
        self._weights = weights
        self._nodes = dict.fromkeys(RANKED, 0)
        self._products: dict[tuple[str, str], Floats] = {}  # `[W, 1 + C, 1 + C]`

    def add(self, prediction: Prediction, building: Ints) -> None:
        """Add some nodes, of the buildings `[N]` by number."""
        truth = prediction.truth
        totals = np.where(truth.known, prediction.expectation.totals, 0.0)
        for node_set in RANKED:
            rows = prediction.rows[node_set]
            self._nodes[node_set] += len(rows)
            for side, counts in zip(_SIDES, (totals, truth.targets), strict=True):
                products = _sum_products(self._weights, building[rows], counts[rows])
                self._products[node_set, side] = products + self._products.get((node_set, side), 0)

    def finish(self) -> Values:
        """Return the Frobenius norm of the difference of both matrices, of each node set."""
        parts = {**{node_set: (node_set,) for node_set in RANKED}, "all": RANKED}
        return {
            ("correlation_frobenius", node_set, ""): Value(
                self._compare(of), sum(self._nodes[part] for part in of)
            )
            for node_set, of in parts.items()
        }

    def _compare(self, node_sets: tuple[str, ...]) -> Floats:
        predicted, true = (
            correlate_sums(np.sum([self._products[part, side] for part in node_sets], axis=0))
            for side in _SIDES
        )
        return np.asarray(np.linalg.norm(predicted - true, axis=(1, 2)))


def _sum_products(weights: Weights, building: Ints, counts: Floats) -> Floats:
    """Return Σ z zᵀ over some nodes under every weight."""
    rows = np.column_stack([np.ones(len(counts)), counts])
    numbers, place = np.unique(building, return_inverse=True)
    products = np.zeros((len(numbers), rows.shape[1], rows.shape[1]))
    for number in range(len(numbers)):
        own = rows[place == number]
        products[number] = own.T @ own
    return np.tensordot(weights[numbers].T.astype(float), products, axes=1)
