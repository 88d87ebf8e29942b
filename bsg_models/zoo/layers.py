"""The layers of networks as functions: NumPy answers by them, and torch trains by the same ones.

A network is its weights, a dictionary of arrays by name, and functions of them. `Weight` says the
shape of an array and what a training starts from. Every function takes arrays of NumPy or tensors
of torch, and returns the same kind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bsg_models.arrays import Array, library_of

Weights = Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class Weight:
    """An array that a network learns, or holds."""

    shape: tuple[int, ...]
    value: float = 0.0  # at the start
    spread: float = 0.0  # half the width of the uniform distribution around it, at the start
    learned: bool = True


class NoDropout:
    """What is dropped of an answer: nothing. Trainings drop at random."""

    def channels(self, values: Array, share: float, *, spared: Sequence[slice] = ()) -> Array:
        """Return values of which a share is 0 and the others scaled up, but columns `spared`."""
        return values

    def entries(self, values: Array, share: float) -> Array:
        """Return values of which a share is 0, without scaling."""
        return values

    def rows(self, rows: Array, share: float) -> Array:
        """Return rows of which a share is 0."""
        return rows


NO_DROPOUT = NoDropout()


def _functions_of(x: Array) -> Any:
    """Return torch's functions of networks: each is one step of a gradient instead of several."""
    return library_of(x).nn.functional


def linear_weights(
    name: str, width: int, out: int, *, bias: bool = True, zero: bool = False
) -> dict[str, Weight]:
    """Return the weights of `linear`, drawn as torch draws them."""
    spread = 0.0 if zero else width**-0.5
    weights = {f"{name}.weight": Weight((out, width), spread=spread)}
    return weights | ({f"{name}.bias": Weight((out,), spread=spread)} if bias else {})


def linear(weights: Weights, name: str, x: Array) -> Array:
    """Return x Wᵀ + b, `[..., out]` of `[..., width]`."""
    weight, bias = weights[f"{name}.weight"], weights.get(f"{name}.bias")
    if not isinstance(x, np.ndarray):
        return _functions_of(x).linear(x, weight, bias)
    product = x @ weight.T
    return product if bias is None else product + bias


def norm_weights(name: str, width: int) -> dict[str, Weight]:
    """Return the weights of `norm`."""
    return {f"{name}.weight": Weight((width,), value=1.0), f"{name}.bias": Weight((width,))}


def norm(weights: Weights, name: str, x: Array) -> Array:
    """Return x with mean 0 and variance 1 over its last axis, scaled and shifted."""
    weight, bias = weights[f"{name}.weight"], weights[f"{name}.bias"]
    if not isinstance(x, np.ndarray):
        return _functions_of(x).layer_norm(x, weight.shape, weight, bias)
    centred = x - x.mean(axis=-1, keepdims=True)
    scale = ((centred * centred).mean(axis=-1, keepdims=True) + 1e-5) ** -0.5
    return centred * scale * weight + bias


def silu(x: Array) -> Array:
    """Return x · sigmoid(x)."""
    if not isinstance(x, np.ndarray):
        return _functions_of(x).silu(x)
    return x * (0.5 * np.tanh(0.5 * x) + 0.5)


def logit(x: Array) -> Array:
    """Return the log odds of probabilities above 0 and below 1."""
    xp = library_of(x)
    return xp.log(x) - xp.log1p(-x)


def log_softmax(x: Array, *, axis: int) -> Array:
    """Return x minus the logarithm of the sum of its exponentials over an axis."""
    xp = library_of(x)
    if xp is not np:
        return xp.log_softmax(x, dim=axis)
    shifted = x - xp.amax(x, axis=axis, keepdims=True)
    return shifted - xp.log(xp.exp(shifted).sum(axis=axis, keepdims=True))
