from __future__ import annotations

import hashlib

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.recipes import MaskRecipe

STREAMS = {"rooms": 0, "classified": 1, "unclassified": 2, "withheld": 4, "parts": 5, "detector": 6}
draws_strategy = st.lists(
    st.tuples(st.text(max_size=5), st.integers(0, 10**6)), min_size=1, max_size=20
)


def seed(recipe: MaskRecipe, scene: str, draw: int, stream: str) -> np.random.SeedSequence:
    words = np.frombuffer(hashlib.sha256(scene.encode()).digest()[:16], dtype="<u4").tolist()
    return np.random.SeedSequence([recipe.seed, *words, draw, STREAMS[stream]])


@settings(max_examples=12)
@given(st.sampled_from([0, 5, 2**32 - 1, 2**32, 2**62]), draws_strategy)
def test_many_draws_are_seeded_as_numpy_seeds_each(
    number: int, draws: list[tuple[str, int]]
) -> None:
    """Also where a user counts draws as NumPy does: `for draw in np.arange(5)`."""
    recipe, (scenes, numbers) = MaskRecipe(seed=number), zip(*draws, strict=True)
    streams = MaskStreams([recipe] * len(draws), scenes, np.array(numbers))
    for stream in STREAMS:
        for rng, (scene, draw) in zip(streams.of(stream), draws, strict=True):
            theirs = np.random.Generator(np.random.PCG64(seed(recipe, scene, draw, stream)))
            expected = theirs.random(4).tolist()
            assert rng.random(4).tolist() == expected
            (alone,) = MaskStreams([recipe], [scene], [draw]).of(stream)
            assert alone.random(4).tolist() == expected
