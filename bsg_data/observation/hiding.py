"""Sample which objects are hidden under a view, for one draw or many."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from bsg_data.arrays import Counts, Floats, Ints
from bsg_data.observation.view import View


@dataclass(frozen=True, eq=False)
class Hiding:
    """How the objects of some cells are hidden under a view.

    Attributes:
        certain: `[1 + R, K]` what is hidden whatever is drawn.
        taken: the cells of each share that loses an exact number of objects.
        rest: the cells whose objects are each hidden by itself, with the share of each cell.
    """

    certain: Counts
    taken: tuple[tuple[_Some, int], ...]
    rest: tuple[_Some, Floats] | None

    @classmethod
    def under(cls, view: View, cells: Counts) -> Hiding:
        """Return how the objects of cells `[1 + R, K]` are hidden under a view of the 1 + R."""
        share = view.hidden_share
        if not view.exact:
            some = _Some.of(cells)
            return cls(np.zeros_like(cells), (), (some, share[some.places // cells.shape[1]]))
        taken = []
        for one in np.unique(share[(share > 0) & (share < 1)]).tolist():
            some = _Some.of(np.where((share == one)[:, None], cells, 0))
            if number := _count_exactly(one, int(some.counts.sum())):
                taken.append((some, number))
        return cls(np.where((share == 1)[:, None], cells, 0), tuple(taken), None)

    def draw(self, rng: np.random.Generator) -> Counts:
        """Sample how many objects of every cell are hidden, `[1 + R, K]`.

        Single objects taken without replacement, counted per cell, are multivariate hypergeometric.
        """
        hidden = self.certain.copy()
        flat = hidden.reshape(-1)
        for some, number in self.taken:
            flat[some.places] = rng.multivariate_hypergeometric(
                some.counts, number, method="marginals"
            )
        if self.rest is not None:
            some, shares = self.rest
            # Cells without objects take no random number: leaving them out changes nothing.
            flat[some.places] = rng.binomial(some.counts, shares)
        return hidden


@dataclass(frozen=True, eq=False, slots=True)
class _Some:
    """The cells that hold objects: their places in the flattened cells, and how many in each."""

    places: Ints
    counts: Counts

    @classmethod
    def of(cls, cells: Counts) -> _Some:
        flat = cells.ravel()
        places = np.flatnonzero(flat)
        return cls(places, flat[places])


def _count_exactly(share: float, number: int) -> int:
    """Return ⌊share · number⌋, exact in decimals: 0.29 of 100 is 29, not 28."""
    return math.floor(Decimal(repr(share)) * number)
