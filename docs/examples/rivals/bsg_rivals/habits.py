"""Say where one thing of a home is by its past sightings alone, as others do.

Each rule takes the sightings of one thing (`[S]` seconds and numbers of places), the time of the
question, and the number of places P; it returns P(the thing is there), `[P]`. All places are alike
before the first sighting. Numbers are those of the least log loss on HOMER's households 0 to 2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Seen = Sequence[tuple[float, int]]  # seconds, number of a place; the latest is last
Rule = Callable[[Seen, float, int], Floats]
HOUR, DAY = 3600.0, 86_400.0
FLAT = 0.3  # weight of all places beside the sightings
FLAT_FREMEN = 1.0
COMPONENTS = 1  # of FreMEn
PERIODS = DAY / np.arange(1, 5)  # seconds; with those of a week it is worse


def last_seen(seen: Seen, now: float, places: int) -> Floats:
    """Return that a thing is where it was seen last."""
    return _spread(seen[-1:], np.ones(min(1, len(seen))), places, FLAT)


def most_often(seen: Seen, now: float, places: int) -> Floats:
    """Return the shares of the sightings."""
    return _spread(seen, np.ones(len(seen)), places, FLAT)


def by_hour(seen: Seen, now: float, places: int) -> Floats:
    """Return the shares of the sightings within two hours of this time of any day."""
    return _spread(seen, _is_hour(seen, now).astype(np.float64), places, FLAT)


def by_kernel(seen: Seen, now: float, places: int) -> Floats:
    """Return shares by weights of .6, 1 at this hour, and 3 · e^(−age / 5 h)."""
    age = now - np.array([time for time, _ in seen])
    return _spread(seen, 0.6 + _is_hour(seen, now) + 3 * np.exp(-age / (5 * HOUR)), places, FLAT)


def fremen(seen: Seen, now: float, places: int) -> Floats:
    """Return the frequency maps of Krajník et al. (T-RO 2017, doi:10.1109/TRO.2017.2665664).

    At a place, a binary signal s(t) says whether the thing was there. Of its spectrum

        γ_0 = mean of s(t_j),    γ_k = mean of (s(t_j) − γ_0) · e^(−i ω_k t_j)

    the mean and the strongest components stay:

        p(t) = γ_0 + 2 Σ |γ_k| cos(ω_k t + arg γ_k)

    clipped, and normalised over the places.
    """
    if not seen:
        return np.full(places, 1 / places)
    times = np.array([time for time, _ in seen])
    there = np.eye(places)[[place for _, place in seen]]
    mean, omega = there.mean(axis=0), 2 * np.pi / PERIODS
    spectrum = np.exp(-1j * np.outer(omega, times)) @ (there - mean) / len(times)
    strongest = np.argsort(-abs(spectrum), axis=0)[:COMPONENTS]
    kept = np.take_along_axis(spectrum, strongest, axis=0)
    signal = mean + 2 * (kept * np.exp(1j * omega[strongest] * now)).real.sum(axis=0)
    likely = signal.clip(1e-3, 1.0)
    sums = len(seen) * likely / likely.sum()
    return np.asarray((sums + FLAT_FREMEN / places) / (len(seen) + FLAT_FREMEN))


def _is_hour(seen: Seen, now: float) -> npt.NDArray[np.bool_]:
    apart = np.array([abs((now - time + DAY / 2) % DAY - DAY / 2) for time, _ in seen])
    return apart <= 2 * HOUR


def _spread(seen: Seen, weights: Floats, places: int, flat: float) -> Floats:
    """Return the shares of places by the weights of sightings, beside that of all places."""
    sums = np.bincount([place for _, place in seen], weights=weights, minlength=places)
    return np.asarray((sums + flat / places) / (weights.sum() + flat))


RULES: dict[str, Rule] = {
    "last seen": last_seen,
    "most often": most_often,
    "most often at this hour": by_hour,
    "FreMEn": fremen,
    "kernel of hour and age": by_kernel,
}
