"""The random numbers of masks: one generator for each building, draw and stream.

The seed of a generator depends only on the seed of the recipe, the id of the building, the number
of the draw and the stream: never on order, workers or other buildings. It is what NumPy's
`SeedSequence` makes of these. Many draws are seeded at once, by the same arithmetic on arrays: one
after another, that would take longer than the masks.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.random.bit_generator import ISeedSequence

from bsg_data.recipes import MaskRecipe

Words = npt.NDArray[np.uint32]
# 3 was of a version before
_STREAM = {"rooms": 0, "classified": 1, "unclassified": 2, "withheld": 4, "parts": 5, "detector": 6}
_FEW = 8  # draws that are sooner seeded one by one
# Of `SeedSequence`, whose algorithm is fixed: the words of its pool, the starts and factors of its
# two hashes, and the factors of its mixture.
_POOL = 4
_IN, _OUT = (0x43B0D7E5, 0x931E8875), (0x8B51F9DD, 0x58F38DED)
_LEFT, _RIGHT, _SHIFT = np.uint32(0xCA01F9DD), np.uint32(0x4973F715), np.uint32(16)


class MaskStreams:
    """The generators of M draws, each of one building by one recipe; the arguments are `[M]`."""

    def __init__(
        self, recipes: Sequence[MaskRecipe], scene_ids: Sequence[str], draws: Sequence[int]
    ) -> None:
        keys = [(recipe.seed, scene) for recipe, scene in zip(recipes, scene_ids, strict=True)]
        places = {key: place for place, key in enumerate(dict.fromkeys(keys))}
        # of each building, in any draw
        self._words = [np.array([*_split(n), *_digest(one)], dtype=np.uint32) for n, one in places]
        self._building = [places[key] for key in keys]
        self._draws = np.array(draws, dtype=np.uint32)
        self._pool: Words | None = None

    def __len__(self) -> int:
        """Return the number of draws M."""
        return len(self._draws)

    def of(self, stream: str) -> Iterator[np.random.Generator]:
        """Yield the generators of one part of the draws: a key of `_STREAM`.

        Each is made when it is asked for, since one that is new is fastest.
        """
        word = np.uint32(_STREAM[stream])
        if len(self) < _FEW or len({len(words) for words in self._words}) > 1:
            for building, draw in zip(self._building, self._draws, strict=True):
                words = np.append(self._words[building], [draw, word])
                yield np.random.Generator(np.random.PCG64(words))
            return
        number = len(self._words[0])
        if self._pool is None:
            pool = _mix_words(np.stack(self._words))[self._building]
            self._pool = _absorb(pool, self._draws[:, None], number)
        pool = _absorb(self._pool, word, number + 1)
        hashed = _hash(np.tile(pool, 2), _OUT, 0)
        states = hashed.astype("<u4").view("<u8").astype(np.uint64)
        for state in states:
            seed: Any = _Seed(state)  # NumPy's stubs do not know it for a seed
            yield np.random.Generator(np.random.PCG64(seed))


class _Seed(ISeedSequence):
    """A seed that is known already."""

    def __init__(self, state: npt.NDArray[np.uint64]) -> None:
        self._state = state

    def generate_state(self, n_words: int, dtype: Any = np.uint32) -> npt.NDArray[np.uint64]:
        """Return the four words of 64 bits that PCG64 asks for."""
        return self._state


def mask_generator(
    recipe: MaskRecipe, *, scene_id: str, draw: int, stream: str
) -> np.random.Generator:
    """Return the generator of one part of one draw of one building."""
    (rng,) = MaskStreams([recipe], [scene_id], [draw]).of(stream)
    return rng


def _digest(scene_id: str) -> list[int]:
    """Return four words that stand for a building."""
    digest = hashlib.sha256(scene_id.encode()).digest()
    return [int(word) for word in np.frombuffer(digest[:16], dtype="<u4")]


def _split(number: int) -> list[int]:
    """Return a whole number as words of 32 bits, the lowest first; at least one."""
    return [number >> shift & 0xFFFFFFFF for shift in range(0, max(number.bit_length(), 1), 32)]


def _mix_words(words: Words) -> Words:
    """Return the pool `[M, 4]` of the words `[M, W]` of every draw, W at least 4."""
    pool = _hash(words[:, :_POOL], _IN, 0)
    for source in range(_POOL):
        others = [place for place in range(_POOL) if place != source]
        hashed = _hash(pool[:, [source] * 3], _IN, _POOL + 3 * source)
        pool[:, others] = _mix(pool[:, others], hashed)
    for number in range(_POOL, words.shape[1]):
        pool = _absorb(pool, words[:, number : number + 1], number)
    return pool


def _absorb(pool: Words, word: Any, number: int) -> Words:
    """Return the pool with one word more, the one with this number."""
    words = np.broadcast_to(word, pool.shape)
    return _mix(pool, _hash(words, _IN, _POOL * number))


def _hash(words: Words, factors: tuple[int, int], first: int) -> Words:
    """Return the hashes of words `[M, n]`, those with the numbers `first` and up."""
    constants = _list_constants(factors, first, words.shape[1] + 1)
    mixed: Words = (words ^ constants[:-1]) * constants[1:]
    return mixed ^ mixed >> _SHIFT


def _mix(one: Words, other: Words) -> Words:
    mixed: Words = one * _LEFT - other * _RIGHT
    return mixed ^ mixed >> _SHIFT


@lru_cache(maxsize=64)
def _list_constants(factors: tuple[int, int], first: int, number: int) -> Words:
    start, times = factors
    powers = (pow(times, power, 2**32) for power in range(first, first + number))
    return np.array([start * power % 2**32 for power in powers], dtype=np.uint32)
