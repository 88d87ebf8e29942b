"""Generators of many draws, beside those that NumPy seeds one by one."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.observation.mask_streams import mask_generator, mask_generators
from bsg_data.recipes import MaskRecipe


@settings(max_examples=30)
@given(
    seed=st.one_of(st.integers(0, 2**32), st.integers(0, 2**130)),
    scene=st.text(max_size=20),
    first=st.integers(0, 2**31),
    count=st.integers(1, 7),
    stream=st.sampled_from(["rooms", "classified", "unclassified", "withheld", "parts"]),
)
def test_many_generators_are_those_that_numpy_seeds(
    seed: int, scene: str, first: int, count: int, stream: str
) -> None:
    recipe, draws = MaskRecipe(seed=seed), range(first, first + count)
    seeded = mask_generators(recipe, scene_id=scene, draws=draws, stream=stream)
    for draw, rng in zip(draws, seeded, strict=True):
        alone = mask_generator(recipe, scene_id=scene, draw=draw, stream=stream)
        assert rng.bit_generator.state == alone.bit_generator.state
        # Half a word is kept for the next draw of 32 bits; it must not stay for another generator.
        np.testing.assert_array_equal(rng.integers(7, size=3), alone.integers(7, size=3))
        assert rng.random() == alone.random()
