"""The random numbers of masks: one generator for each building, draw and stream.

The seed of a generator depends only on the seed of the recipe, the id of the building, the number
of the draw and the stream: never on order, workers or other buildings. It is what NumPy's
`SeedSequence` makes of these.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from functools import lru_cache
from struct import pack

import numpy as np

from bsg_data.recipes import MaskRecipe

# other numbers would make other masks, and other hashes of them
_STREAM = {"rooms": 0, "classified": 1, "unclassified": 2, "withheld": 4, "parts": 5, "detector": 6}


class MaskStreams:
    """The generators of M draws, each of one building by one recipe; the arguments are `[M]`."""

    def __init__(
        self, recipes: Sequence[MaskRecipe], scene_ids: Sequence[str], draws: Sequence[int]
    ) -> None:
        self.recipes = recipes
        self._words = [
            _words_of(recipe.seed, scene) + pack("<I", draw)
            for recipe, scene, draw in zip(recipes, scene_ids, draws, strict=True)
        ]

    def __len__(self) -> int:
        """Return the number of draws M."""
        return len(self._words)

    def of(self, stream: str) -> list[np.random.Generator]:
        """Return the generators of one stream of the draws: a key of `_STREAM`."""
        # All at once, from arrays: NumPy seeds more slowly from lists, or between draws.
        last = pack("<I", _STREAM[stream])
        seeds = (np.random.SeedSequence(np.frombuffer(w + last, "<u4")) for w in self._words)
        return [np.random.Generator(np.random.PCG64(seed)) for seed in seeds]


@lru_cache(maxsize=4096)
def _words_of(seed: int, scene_id: str) -> bytes:
    """Return the words of 32 bits of a seed, the lowest first, and four that stand for a scene."""
    words = max(1, math.ceil(seed.bit_length() / 32))
    return seed.to_bytes(4 * words, "little") + hashlib.sha256(scene_id.encode()).digest()[:16]
