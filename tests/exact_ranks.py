"""AUROC and average precision of sorted scores, without bins, and what bins may change in them."""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints


def cumulate(scores: Floats, truth: Bools, weights: Floats) -> tuple[Floats, Floats]:
    """Return the weight of positives and of negatives down to each distinct score."""
    falling = np.unique(scores)[::-1]
    at = [scores == score for score in falling]
    true = np.array([weights[some & truth].sum() for some in at])
    false = np.array([weights[some & ~truth].sum() for some in at])
    return true, false


def auroc(scores: Floats, truth: Bools, weights: Floats) -> float:
    """Return P(a positive is above a negative); ties count half; nan if there is no pair."""
    true, false = cumulate(scores, truth, weights)
    below = false.sum() - np.cumsum(false)
    pairs = true.sum() * false.sum()
    return float(true @ (below + false / 2) / pairs) if pairs else float("nan")


def average_precision(scores: Floats, truth: Bools, weights: Floats) -> float:
    """Return Σ (recallₖ − recallₖ₋₁) · precisionₖ over the scores; nan without positives."""
    true, false = cumulate(scores, truth, weights)
    total, terms = true.sum(), 0.0
    for k in np.flatnonzero(true):
        above = true[: k + 1].sum()
        terms += true[k] * above / (above + false[: k + 1].sum())
    return float(terms / total) if total else float("nan")


def bounds(bins: Ints, truth: Bools, weights: Floats) -> tuple[float, float]:
    """Return by how much bins can change AUROC and average precision at most."""
    t, f = cumulate(bins.astype(float), truth, weights)
    total, others = t.sum(), f.sum()
    over, beyond = np.cumsum(t) - t, np.cumsum(f) - f
    high = (over + t) / np.maximum(over + beyond + t, 1e-300)
    low = over / np.maximum(over + beyond + f, 1e-300)
    return (
        float((t * f).sum() / max(2 * total * others, 1e-300)),
        float((t * (high - low)).sum() / max(total, 1e-300)),
    )
