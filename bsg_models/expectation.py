"""What a model believes about the nodes of interest: the contract of every model (DESIGN, §7).

What was seen is a fact, so a model believes something about the *hidden* counts, and
expected = input + hidden. A model that predicts totals, as the paper's does, gets
hidden = max(total − input, 0) and keeps its raw totals for the paper's own metrics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

Floats = npt.NDArray[np.float64]
MIN_RATE = 1e-3  # no model may call a hidden object impossible: log 0 would swallow all the rest


@dataclass(frozen=True, eq=False)
class Expectation:
    """Beliefs about N nodes of interest and C classes.

    Attributes:
        inputs: `[N, C]` histograms of what was seen, E′ × O′.
        hidden: `[N, C]` expected number of hidden objects, λ ≥ 0.
        totals: `[N, C]` what the model predicts as the whole histogram, before `input ≤ total` is
            imposed: E″ × O″ as the paper measures it.
        dispersion: `[N, C]` r > 0 of a negative binomial with variance λ + λ²/r; None: Poisson.
    """

    inputs: Floats
    hidden: Floats
    totals: Floats
    dispersion: Floats | None = None

    @property
    def expected(self) -> Floats:
        """Expected counts of everything in the node, `[N, C]`."""
        return self.inputs + self.hidden

    @property
    def presence(self) -> Floats:
        """P(at least one hidden object of the class), `[N, C]`."""
        return -np.expm1(self.log_probability(np.zeros_like(self.hidden), floor=0.0))

    def log_probability(self, counts: Floats, *, floor: float = MIN_RATE) -> Floats:
        """Return log P(hidden = counts), `[N, C]`.

        Args:
            counts: `[N, C]` whole numbers.
            floor: rates below it count as this much.
        """
        rate = np.maximum(self.hidden, floor)
        if self.dispersion is None:
            log_rate = np.log(rate, out=np.full_like(rate, -np.inf), where=rate > 0)
            scaled = np.where(counts > 0, counts * np.where(counts > 0, log_rate, 0.0), 0.0)
            return np.asarray(scaled - rate - gammaln(counts + 1))
        r = self.dispersion
        log_share = np.log(rate, out=np.full_like(rate, -np.inf), where=rate > 0) - np.log(rate + r)
        scaled = np.where(counts > 0, counts * np.where(counts > 0, log_share, 0.0), 0.0)
        shape = gammaln(counts + r) - gammaln(r) - gammaln(counts + 1)
        return np.asarray(shape - r * np.log1p(rate / r) + scaled)


def from_totals(inputs: Floats, totals: Floats) -> Expectation:
    """Return the expectation of a model that predicts whole histograms `[N, C]`."""
    return Expectation(inputs, np.maximum(totals - inputs, 0.0), totals)


def from_hidden(inputs: Floats, hidden: Floats, dispersion: Floats | None = None) -> Expectation:
    """Return the expectation of a model that predicts hidden counts `[N, C]`."""
    return Expectation(inputs, hidden, inputs + hidden, dispersion)
