"""Define the expectation: what a model believes about the nodes of interest.

What was seen is certain, so a model predicts the hidden counts, and expected = input + hidden. A
model that predicts totals, such as the paper's, gets hidden = max(total − input, 0).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Floats
from bsg_models.belief.count_distribution import (
    MIN_RATE,
    CountDistribution,
    blend_copies,
    concatenate,
    poisson,
)

LEAST_PRESENCE = 0.005  # a lower one is not told: such classes get no blind node


@dataclass(frozen=True, eq=False)
class Expectation:
    """Beliefs about N nodes of interest and C classes.

    Attributes:
        inputs: `[N, C]` histograms of what was seen, E′ × O′.
        hidden_counts: distribution of the hidden counts.
        raw_totals: `[N, C]` whole histograms, of a model that predicts those.
    """

    inputs: Floats
    hidden_counts: CountDistribution
    raw_totals: Floats | None = None

    @property
    def is_finite(self) -> bool:
        """Whether all values are finite; a dispersion may be infinite, which is a Poisson."""
        values = self.inputs if self.raw_totals is None else self.raw_totals
        return bool(np.isfinite(values).all()) and self.hidden_counts.is_finite

    @property
    def totals(self) -> Floats:
        """Predicted whole histograms before `input ≤ total` is imposed, `[N, C]`.

        E″ × O″ as the paper measures it.
        """
        return self.expected if self.raw_totals is None else self.raw_totals

    @cached_property
    def hidden(self) -> Floats:
        """Expected number of hidden objects, λ ≥ 0, `[N, C]`."""
        return self.hidden_counts.mean

    @property
    def expected(self) -> Floats:
        """Expected counts of all objects of the node, `[N, C]`."""
        return self.inputs + self.hidden

    @property
    def total(self) -> Floats:
        """Expected number of objects of all classes in the node, O″, `[N]`."""
        return np.asarray(self.expected.sum(axis=1))

    @property
    def distribution(self) -> Floats:
        """Shares of the classes in the expected counts, E″, `[N, C]`; all 0 if O″ is 0."""
        total = self.total[:, None]
        return np.divide(self.expected, total, out=np.zeros_like(self.expected), where=total > 0)

    @property
    def presence(self) -> Floats:
        """P(at least one hidden object of the class), `[N, C]`."""
        return self.hidden_counts.presence

    def log_probability(self, counts: Floats, *, floor: float = MIN_RATE) -> Floats:
        """Return log P(hidden = counts), `[N, C]`; see `CountDistribution.log_probability`."""
        return self.hidden_counts.log_probability(counts, floor=floor)

    def quantile(self, q: float) -> npt.NDArray[np.float64]:
        """Return the q-quantile of the count of all objects of the node, `[N, C]`."""
        return self.inputs + self.hidden_counts.quantile(q)

    def take(self, rows: npt.NDArray[np.integer]) -> Expectation:
        """Return the expectation of some nodes, `rows` `[M]`."""
        totals = None if self.raw_totals is None else self.raw_totals[rows]
        return Expectation(self.inputs[rows], self.hidden_counts.take(rows), totals)

    def take_classes(self, columns: npt.NDArray[np.integer]) -> Expectation:
        """Return the expectation of some classes, `columns` `[A]`."""
        totals = None if self.raw_totals is None else self.raw_totals[:, columns]
        counts = self.hidden_counts.take_classes(columns[None])
        return Expectation(self.inputs[:, columns], counts, totals)


def from_totals(inputs: Floats, totals: Floats) -> Expectation:
    """Return the expectation of a model that predicts whole histograms `[N, C]`."""
    return Expectation(inputs, poisson(np.maximum(totals - inputs, 0.0)), totals)


def mix_copies(expectation: Expectation, weights: Floats) -> Expectation:
    """Return the mixture, by weights `[L]`, of L consecutive copies of N nodes."""
    nodes, totals = len(expectation.inputs) // len(weights), expectation.raw_totals
    if totals is not None:
        totals = np.tensordot(weights, totals.reshape(len(weights), nodes, -1), axes=1)
    counts = blend_copies(expectation.hidden_counts, weights)
    return Expectation(expectation.inputs[:nodes], counts, totals)


def join(parts: Sequence[Expectation]) -> Expectation:
    """Return the expectations of several batches of nodes as one, in order."""
    return Expectation(
        np.concatenate([part.inputs for part in parts]),
        concatenate([part.hidden_counts for part in parts]),
        np.concatenate([part.totals for part in parts]),
    )
