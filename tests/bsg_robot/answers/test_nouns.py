from __future__ import annotations

import numpy as np
import pytest
from conftest import SHARED
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.arrays import Floats
from bsg_data.words.normal import normalise_name
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_robot import open_graph
from bsg_robot.answers.nouns import (
    EPSILON,
    HEAD,
    NounTable,
    split_head,
)


def table() -> NounTable:
    """Return a table of two classes: a spoon goes with the first, a plank with the second."""
    return NounTable(
        rows={"spoon": 0, "plank": 1, "soup": 2},
        things=np.array([True, True, False]),
        vectors=np.array([[100], [-100], [-50]]),
        scale=np.array([0.01]),
        bases=np.array([0.0, 0.0, 0.0]),
        near=np.array([[0], [1], [1]]),
        counted=("stove", "shelf"),
        projection=np.array([[1.0], [-1.0]]),
        centre=np.array([0.5]),
        dispersion=2.0,
    )


def belief(hidden: Floats) -> Expectation:
    inputs = np.zeros(hidden.shape)
    return Expectation(inputs, poisson(hidden), hidden)


def test_a_rate_is_that_of_the_formula() -> None:
    hidden = np.array([[0.0, 0.0], [2.0, 1.0], [1.0, 3.0]])
    noun = table().find("spoon")
    assert noun is not None
    assert noun.like == ("stove",)
    counts = table().expect(noun, belief(hidden))
    # s = log (E₁ + ε) − log (E₂ + ε) + 0.5, v = 1
    rates = np.exp(0.5) * (hidden[1:, 0] + EPSILON) / (hidden[1:, 1] + EPSILON)
    np.testing.assert_allclose(counts.mean[1:, 0], rates)
    assert counts.mean[0, 0] == pytest.approx(rates.sum())
    np.testing.assert_allclose(counts.presence[1:, 0], 1 - (1 + rates / 2) ** -2)


def test_only_what_was_not_seen_hides_a_noun() -> None:
    whole = belief(np.array([[3.0, 3.0], [2.0, 1.0], [2.0, 1.0]]))
    searched = np.array([[0.0, 0.0], [2.0, 1.0], [0.0, 0.0]])
    seen = Expectation(searched, poisson(np.array([[0.0, 0], [0, 0], [2, 1]])), searched)
    noun = table().find("spoon")
    assert noun is not None
    left = table().expect(noun, seen).mean[:, 0]
    assert left[1] == 0.0
    assert left[2] == pytest.approx(table().expect(noun, whole).mean[2, 0])


@pytest.mark.parametrize(
    ("name", "head", "vector"),
    [
        ("spoons", "spoon", 1.0),
        ("my soup spoon", "spoon", HEAD * 1.0 - (1 - HEAD) * 0.5),
        ("spoon of wood", "spoon", 1.0),
        ("a pair of spoons", "spoon", 1.0),
        ("plankspoon", "spoon", HEAD * 1.0 - (1 - HEAD) * 1.0),  # two known words
        ("spoon gizmo", "spoon", 1.0),  # the last word that is known
    ],
)
def test_a_compound_goes_by_its_head(name: str, head: str, vector: float) -> None:
    noun = table().find(name)
    assert noun is not None
    assert noun.head.startswith(head)
    assert noun.vector == pytest.approx([vector])


@pytest.mark.parametrize("name", ["wooden", "gizmo", "", "   ", "?", "the"])
def test_a_word_that_is_no_known_thing_means_nothing(name: str) -> None:
    assert table().find(name) is None


@given(st.text(max_size=60))
def test_any_text_has_a_head_or_none(name: str) -> None:
    before, head = split_head(name)
    assert head or not before
    said = normalise_name(name) + "with"  # which `w/` is short for
    assert all(part in said for part in (*before, head))


@pytest.mark.skipif(not (SHARED.parent / "housekeep").is_dir(), reason="needs ../shared/housekeep")
def test_every_object_of_housekeep_is_understood() -> None:
    home = open_graph({"kitchen": []})
    rows = (SHARED.parent / "housekeep" / "objects.csv").read_text("utf-8").splitlines()[1:]
    for row in rows:
        home.understand(row.partition(",")[0])
