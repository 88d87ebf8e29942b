"""The share of a room's objects that a robot has not seen, where it is not sure of it.

A robot seldom knows this share. It can say how sure it is: a mean and a standard deviation, which
stand for the Beta distribution with these moments. With ν = m (1 − m) / sd² − 1,

    S ~ Beta(a, b)      a = ν m,  b = ν (1 − m)

A Beta lies between 0 and 1, is uniform at m = 1/2 and sd = 1/√12, and is what remains of a vague
belief after objects were counted as seen and unseen. docs/hidden-share.md says what to say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bsg_data.errors import RecipeError

CERTAIN = 1e-6  # a standard deviation below it is none: no share is known that well


@dataclass(frozen=True, slots=True)
class ShareBelief:
    """What a robot believes of the share of a room's objects that it has not seen.

    Attributes:
        mean: 0 where all was seen, 1 where nothing was.
        sd: standard deviation of a Beta distribution; 0 for one that is sure. Its square is less
            than mean · (1 − mean), so that a mean of 0 or 1 is sure.

    Raises:
        RecipeError: if no Beta distribution has these moments.

    Example:
        >>> ShareBelief(0.5, 0.25).beta
        (1.5, 1.5)
    """

    mean: float
    sd: float = 0.0

    def __post_init__(self) -> None:
        """Check the moments."""
        if not 0 <= self.mean <= 1:
            raise RecipeError(f"hidden share: expected 0 to 1, found {self.mean}")
        most = math.sqrt(self.mean * (1 - self.mean))
        if not (self.sd == 0 or 0 < self.sd < most):
            raise RecipeError(
                f"standard deviation of a hidden share of {self.mean:g}: expected 0, or less than "
                f"{most:.3g}, found {self.sd:g}"
            )

    @property
    def is_certain(self) -> bool:
        """Whether it is one number."""
        return self.sd < CERTAIN

    @property
    def beta(self) -> tuple[float, float]:
        """The parameters a and b of the Beta distribution.

        Raises:
            ZeroDivisionError: if the share is certain.
        """
        size = self.mean * (1 - self.mean) / self.sd**2 - 1
        return size * self.mean, size * (1 - self.mean)
