"""The script that makes the table of nouns: a planted world, and formulas by hand."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from nouns import (
    EVERY_ROOM,
    HALF_SEEN,
    Calibration,
    Fit,
    HeldOut,
    Lexicon,
    Rooms,
    Sources,
    calibrate,
    distil,
    learn,
)

from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation

RNG = np.random.default_rng(0)
KINDS = ("cook", "wash")
WORDS = {f"{kind}{letter}": KINDS.index(kind) for kind in KINDS for letter in "abcdefgh"}


@pytest.fixture(scope="module")
def planted() -> Sources:
    """Return rooms of two kinds, and two kinds of words that each prefer one of them."""
    vectors = np.array([np.eye(2)[side] + RNG.normal(0, 0.1, 2) for side in WORDS.values()])
    rank = {word: row for row, word in enumerate(WORDS)}
    senses = {word: [word] for word in WORDS}
    lexicon = Lexicon(vectors, rank, senses, dict.fromkeys(WORDS, 6), dict.fromkeys(WORDS, ()), {})
    kinds = RNG.integers(0, 2, 400)
    states = np.log(np.where(np.eye(2)[kinds] > 0, 4.0, 0.2))
    rates = np.array([np.where(kinds == side, 0.8, 0.05) for side in WORDS.values()]).T
    rooms = Rooms(
        tuple(WORDS),
        RNG.poisson(rates).astype(np.float32),
        states,
        np.ones(400),
        np.full(400, HALF_SEEN),
        tuple(f"{room % 20}/0" for room in range(400)),
    )
    correct = np.zeros(len(EVERY_ROOM))
    correct[0] = 1
    objects = pd.DataFrame({"object": ["cooka"], "split": ["train"], "correct": [correct]})
    labelled = np.tile(states[:1], (len(EVERY_ROOM), 1))
    return Sources(lexicon, rooms, rooms.take(names=("cooka",)), labelled, objects)


FIT = Fit(basis=2, ridge=1.0, taxonomy=0.0, kin=0.0)


def test_a_table_says_what_the_regression_says(planted: Sources) -> None:
    rates = learn(planted, fit=FIT)
    calibration = Calibration(0.3, 0.5, 2.0)
    words = dict.fromkeys(WORDS, True)
    table = distil(rates, words, [*WORDS], calibration)
    hidden = np.array([[0.0, 0.0], [4.0, 0.2], [0.2, 4.0]])
    noun = table.find("cookb")
    assert noun is not None
    assert "cookb" not in noun.like
    assert all(one.startswith("cook") for one in noun.like)
    said = table.expect(noun, Expectation(np.zeros(hidden.shape), poisson(hidden), hidden))
    logs = rates.log_rates(["cookb"], np.log(hidden[1:] + 0.005))
    np.testing.assert_allclose(said.mean[1:], calibration.rates(logs), rtol=0.05)


def test_calibration_finds_the_shift_that_was_made() -> None:
    logs = RNG.normal(-3, 1, (4000, 5))
    shares = RNG.uniform(0.1, 1, 4000)
    hidden = RNG.poisson(shares[:, None] * np.exp(0.5 + 0.7 * logs))
    scenes = tuple(f"{row}/0" for row in range(4000))
    found = calibrate(HeldOut(tuple("abcde"), logs, shares, hidden, scenes, {}))
    assert found.shift == pytest.approx(0.5, abs=0.2)
    assert found.slope == pytest.approx(0.7, abs=0.1)
