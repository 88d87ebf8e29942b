"""Uncertain shares are integrated over: against numerical integration, and by what must hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import REPOSITORY
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import beta

from bsg_data.observation.hidden_share import ShareBelief
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.reports import enter
from bsg_data.observation.robot_json import read_robot_graph
from bsg_models.inputs.share_levels import spread_shares
from bsg_models.runs.predictor import Predictor

OFFICE = read_robot_graph(REPOSITORY / "docs" / "office.json")
PREDICTOR = Predictor()


def believe_shares(*shares: ShareBelief) -> PartialGraph:
    """Return the office where the rooms hide these shares."""
    rooms = tuple(
        replace(room, hidden_share=share.mean, hidden_share_sd=share.sd)
        for room, share in zip(OFFICE.rooms, shares, strict=True)
    )
    return replace(OFFICE, rooms=rooms, hidden_share=float(np.mean([s.mean for s in shares])))


def test_a_certain_graph_is_asked_once() -> None:
    seen = OFFICE.observation()
    levels, weights = spread_shares(OFFICE, seen)
    assert levels is seen
    assert weights.tolist() == [1]


def test_levels_by_hand() -> None:
    """Uniform and certain rooms; Gauss and Legendre's two nodes lie at 1/2 ± 1/√12."""
    graph = believe_shares(ShareBelief(0.5, 12**-0.5), ShareBelief(0.2), ShareBelief(1.0))
    levels, weights = spread_shares(graph, graph.observation(), levels=2)
    assert weights.tolist() == [0.5, 0.5]
    assert levels.scene_ids == ("office", "office")
    low, high = levels.hidden_share[:4], levels.hidden_share[4:]
    step = 12**-0.5
    np.testing.assert_allclose(low[1:], [0.5 - step, 0.2, 1.0], rtol=1e-6)
    np.testing.assert_allclose(high[1:], [0.5 + step, 0.2, 1.0], rtol=1e-6)
    np.testing.assert_allclose(low[0], low[1:].mean(), rtol=1e-6)  # the building follows
    np.testing.assert_array_equal(levels.inputs[4:], graph.histograms())


@settings(max_examples=50)
@given(mean=st.floats(0.02, 0.98), part=st.floats(0.02, 0.9))
def test_levels_have_the_moments_of_the_share(mean: float, part: float) -> None:
    sd = part * (mean * (1 - mean)) ** 0.5
    graph = believe_shares(ShareBelief(mean, sd), ShareBelief(0.2), ShareBelief(1.0))
    levels, weights = spread_shares(graph, graph.observation(), levels=64)
    shares = levels.hidden_share.reshape(64, 4)[:, 1].astype(float)
    assert ((shares >= 0) & (shares <= 1)).all()
    assert weights @ shares == pytest.approx(mean, abs=2e-3)
    assert (weights @ (shares - mean) ** 2) ** 0.5 == pytest.approx(sd, abs=4e-3)


@pytest.mark.parametrize("share", [ShareBelief(0.5, 12**-0.5), ShareBelief(0.3, 0.1)])
def test_presence_is_the_integral_over_the_share(share: ShareBelief) -> None:
    """Against adaptive integration over the density of the Beta, one room uncertain."""
    graph = believe_shares(ShareBelief(0.5), share, ShareBelief(0.5))
    found = PREDICTOR(graph, weigh_seen=False)
    for name in ("stove", "sink", "chair"):
        column = PREDICTOR.classes.index(name)

        def weigh(s: float, column: int = column) -> float:
            asked = replace(
                believe_shares(ShareBelief(0.5), ShareBelief(s), ShareBelief(0.5)),
                hidden_share=graph.share_with([0.5, s, 0.5]),
            )
            return float(PREDICTOR(asked).presence[2, column] * beta(*share.beta).pdf(s))

        integral, _ = quad(weigh, 0, 1, epsabs=1e-4, limit=20)
        assert found.presence[2, column] == pytest.approx(integral, abs=2e-3)


def test_a_searched_room_hides_nothing_beside_uncertain_ones() -> None:
    unsure = believe_shares(*[ShareBelief(0.5, 0.2)] * 3)
    graph = enter(unsure, 2, hidden_share=ShareBelief(0.0))
    found = PREDICTOR(graph)
    assert not found.presence[2].any()
    assert found.presence[1].max() > 0
