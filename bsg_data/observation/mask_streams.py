"""The random numbers of masks: one generator for each building, draw and stream.

The seed of a generator depends only on the seed of the recipe, the id of the building, the number
of the draw and the number of the stream: never on order, workers or other buildings.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from bsg_data.recipes import MaskRecipe

Words = npt.NDArray[np.uint32]
Stream = Literal["rooms", "classified", "unclassified", "withheld", "parts", "detector"]
_STREAM: dict[Stream, int] = {
    "rooms": 0,
    "classified": 1,
    "unclassified": 2,
    "withheld": 4,  # 3 was of a version before
    "parts": 5,
    "detector": 6,
}
_FEW = 4  # draws that are sooner seeded one by one
# Of NumPy's `SeedSequence`, whose algorithm is fixed: the beginnings and factors of its two hashes,
# and the factors of its mixture.
_POOL = 4
_HASH_IN, _TIMES_IN = 0x43B0D7E5, 0x931E8875
_HASH_OUT, _TIMES_OUT = 0x8B51F9DD, 0x58F38DED
_LEFT, _RIGHT = np.uint32(0xCA01F9DD), np.uint32(0x4973F715)
_SHIFT = np.uint32(16)
# Of the generator PCG64.
_STEP = 0x2360ED051FC65DA44385DF649FCCF645
_MODULUS = 2**128


def mask_generator(
    recipe: MaskRecipe, *, scene_id: str, draw: int, stream: Stream
) -> np.random.Generator:
    """Return the generator of one part of one draw of one scene."""
    entropy = [recipe.seed, *_digest(scene_id), draw, _STREAM[stream]]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy)))


def mask_generators(
    recipe: MaskRecipe, *, scene_id: str, draws: Sequence[int], stream: Stream
) -> Iterator[np.random.Generator]:
    """Yield what `mask_generator` returns for each draw, a tenth of the time apiece.

    It is one generator, which is seeded anew for each draw: be done with one before the next.
    """
    if len(draws) < _FEW:
        for draw in draws:
            yield mask_generator(recipe, scene_id=scene_id, draw=draw, stream=stream)
        return
    same = [*_split_words(recipe.seed), *_digest(scene_id)]
    words = [np.array([word], dtype=np.uint32) for word in (*same, _STREAM[stream])]
    words.insert(-1, np.array(draws, dtype=np.uint32))
    bits = np.random.PCG64(0)
    generator = np.random.Generator(bits)
    for first, second, third, fourth in _generate_states(words).tolist():
        increment = ((third << 64 | fourth) << 1 | 1) % _MODULUS
        state = ((increment + (first << 64 | second)) * _STEP + increment) % _MODULUS
        bits.state = {
            "bit_generator": "PCG64",
            "state": {"state": state, "inc": increment},
            "has_uint32": 0,
            "uinteger": 0,
        }
        yield generator


def _digest(scene_id: str) -> list[int]:
    """Return four words that stand for a building."""
    digest = hashlib.sha256(scene_id.encode()).digest()[:16]
    return [int(word) for word in np.frombuffer(digest, dtype="<u4")]


def _split_words(number: int) -> list[int]:
    """Return a whole number as words of 32 bits, the lowest first; at least one."""
    words = [number & 0xFFFFFFFF]
    while number := number >> 32:
        words.append(number & 0xFFFFFFFF)
    return words


def _generate_states(entropy: Sequence[Words]) -> npt.NDArray[np.uint64]:
    """Return what `SeedSequence(words).generate_state(4, np.uint64)` does for each draw, `[D, 4]`.

    The four words or more are each `[D]`, or `[1]` where they are the same for every draw.
    """
    hashed = _Hash(_HASH_IN, _TIMES_IN)
    pool = [hashed(word) for word in entropy[:_POOL]]
    for source in range(_POOL):
        for place in range(_POOL):
            if place != source:
                pool[place] = _mix(pool[place], hashed(pool[source]))
    for word in entropy[_POOL:]:
        for place in range(_POOL):
            pool[place] = _mix(pool[place], hashed(word))
    hashed = _Hash(_HASH_OUT, _TIMES_OUT)
    words = np.stack([hashed(pool[k % _POOL]) for k in range(2 * _POOL)], axis=1)
    low, high = words[:, 0::2].astype(np.uint64), words[:, 1::2].astype(np.uint64)
    return low | high << np.uint64(32)


class _Hash:
    """The hash of `SeedSequence`, which changes with each word `[D]` that it has hashed."""

    def __init__(self, start: int, times: int) -> None:
        self._value, self._times = start, times

    def __call__(self, word: Words) -> Words:
        before = np.uint32(self._value)
        self._value = self._value * self._times & 0xFFFFFFFF
        mixed: Words = (word ^ before) * np.uint32(self._value)
        return mixed ^ mixed >> _SHIFT


def _mix(one: Words, other: Words) -> Words:
    mixed: Words = one * _LEFT - other * _RIGHT
    return mixed ^ mixed >> _SHIFT
