"""Estimate the hidden share of a room, and say how certain it is.

The hidden share is the share of a room's objects that the robot has not seen. A robot seldom knows
it exactly, so it gives a mean m and a standard deviation sd. They stand for the Beta distribution
with these moments. With ν = m (1 − m) / sd² − 1,

    S ~ Beta(a, b)      a = ν m,  b = ν (1 − m)

A Beta distribution lies between 0 and 1 and is uniform at m = 1/2 and sd = 1/√12. It is also the
posterior of a vague belief after counting objects as seen and unseen. docs/hidden-share.md says
what a robot should report.

A robot does know how much of the floor and the walls its camera had in view, or how long it was
inside. `CURVES` maps these to the share of the objects that a camera has seen by then.
`scripts/fit/hidden_share.py` at commit 4227eff measured the curves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from bsg_data.errors import RecipeError
from bsg_data.records import read_number

_CERTAIN = 1e-6  # a smaller standard deviation counts as 0: no share is known so exactly


@dataclass(frozen=True, slots=True)
class ShareBelief:
    """A belief about the hidden share of a room: a mean and a standard deviation.

    Attributes:
        mean: 0 if all objects were seen, 1 if none was.
        sd: standard deviation of a Beta distribution; 0 if the share is certain. Its square is
            less than mean · (1 − mean), so a mean of 0 or 1 is always certain.

    Raises:
        RecipeError: if no Beta distribution has these moments.
    """

    mean: float
    sd: float = 0.0

    def __post_init__(self) -> None:
        """Check the moments, and keep them as numbers of Python, which JSON can encode."""
        mean = read_number("hidden share", self.mean, most=1.0)
        limit = math.sqrt(mean * (1 - mean))
        name, wanted = f"standard deviation of a hidden share of {mean:g}", f"less than {limit:.3g}"
        sd = read_number(name, self.sd, most=math.inf, wanted=f"0, or {wanted}")
        if not (sd == 0 or sd < limit):
            raise RecipeError(f"{name}: expected 0, or {wanted}, found {sd:g}")
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "sd", sd)

    def __str__(self) -> str:
        """Return the mean in per cent, with ± the standard deviation."""
        return f"{self.mean:.0%} ± {self.sd:.0%}" if self.sd else f"{self.mean:.0%}"

    @property
    def is_certain(self) -> bool:
        """Whether the standard deviation is 0."""
        return self.sd < _CERTAIN

    @property
    def beta(self) -> tuple[float, float]:
        """The parameters a and b of the Beta distribution of an uncertain share."""
        size = self.mean * (1 - self.mean) / self.sd**2 - 1
        return size * self.mean, size * (1 - self.mean)


VAGUE = ShareBelief(0.5, 0.288)  # nearly uniform: all shares are about equally likely


# Fitted by scripts/fit/hidden_share.py at commit 4227eff to walks through ProcTHOR's rooms.
# The walls added nothing where the floor was known. A curve is the share of the objects that was
# seen, by one kind of evidence: its constants, and ν of the Beta distribution of the share.
CURVES: Mapping[str, tuple[tuple[float, ...], float]] = {
    "floor": ((0.94, 0.21, 8.0), 5.4),
    "walls": ((0.94, 0.30, 0.25), 4.4),
    "seconds and area": ((0.95, 5.6, 2.64, 0.445), 3.8),
    "seconds": ((0.95, 5.9, 11.4, 0.0), 3.4),
}


def estimate_hidden_share(
    *,
    visited: bool = True,
    seconds_inside: float | None = None,
    floor_area: float | None = None,
    floor_in_view: float | None = None,
    walls_in_view: float | None = None,
    recall: float = 1.0,
) -> ShareBelief:
    """Estimate the hidden share of a room from how the robot looked at it.

    If several values are given, the floor counts before the walls, and the walls before the time.
    Without any, a visited room gets `VAGUE`, and a room that was not visited hides everything.

    Args:
        visited: whether the robot was inside.
        seconds_inside: time that it spent in the room, moving at half a metre per second.
        floor_area: floor area of the room, square metres; used only with `seconds_inside`.
        floor_in_view: fraction of the floor that the camera had in view.
        walls_in_view: fraction of the walls, seen from above, that the camera had in view.
        recall: share of the objects in view that the robot's detector reports.

    Returns:
        Mean and standard deviation of the hidden share.

    Raises:
        RecipeError: if a value is impossible.

    Examples:
        >>> share = estimate_hidden_share(floor_in_view=0.6)
        >>> round(share.mean, 2), round(share.sd, 2)
        (0.55, 0.2)
    """
    fractions = {"floor_in_view": floor_in_view, "walls_in_view": walls_in_view, "recall": recall}
    sizes = {"seconds_inside": seconds_inside, "floor_area": floor_area}
    for values, limit in ((fractions, 1.0), (sizes, math.inf)):
        for name, value in values.items():
            if value is not None:
                read_number(name, value, most=limit)
    if seconds_inside and not visited:
        raise RecipeError("seconds_inside: expected none for a room that was not visited")
    if floor_in_view is not None:
        seen, size = _by_view("floor", floor_in_view)
    elif walls_in_view is not None:
        seen, size = _by_view("walls", walls_in_view)
    elif seconds_inside is not None:
        seen, size = _by_seconds(seconds_inside, floor_area)
    else:
        return VAGUE if visited else ShareBelief(1.0)
    mean = 1 - recall * seen
    return ShareBelief(mean, math.sqrt(mean * (1 - mean) / (size + 1)))


def _by_view(kind: str, view: float) -> tuple[float, float]:
    """Return the share of the objects seen, by the fraction of the floor or the walls, and ν."""
    (ceiling, weight, power), size = CURVES[kind]
    return ceiling * (weight * view**power + (1 - weight) * view), size


def _by_seconds(seconds: float, area: float | None) -> tuple[float, float]:
    kind = "seconds and area" if area else "seconds"
    (ceiling, first, pace, growth), size = CURVES[kind]
    looked = seconds + first  # the first look counts as these seconds
    return ceiling * -math.expm1(-looked / (pace * (area or 1.0) ** growth)), size
