"""Uncertain shares are narrowed by what was seen and integrated over, as integrals say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY
from scipy.integrate import quad
from scipy.stats import beta, poisson

from bsg_data.arrays import Ints
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.count_distribution import poisson as poisson_counts
from bsg_models.belief.hidden_share import VAGUE, ShareBelief
from bsg_models.belief.partial_graph import PartialGraph
from bsg_models.inputs import hidden_shares
from bsg_models.inputs.hidden_shares import EVIDENCE, update_shares
from bsg_models.runs.predictor import Predictor
from bsg_robot.graph.reports import enter, hide_of_room
from bsg_robot.graph.robot_json import parse_robot_graph, read_robot_graph

OFFICE = read_robot_graph(REPOSITORY / "docs" / "office.json")
PREDICTOR = Predictor()
KITCHEN = 2  # its number in the office


def believe_kitchen(share: ShareBelief) -> PartialGraph:
    """Return the office where the kitchen hides this share, and the others what they did."""
    return hide_of_room(OFFICE, KITCHEN, share)


def expect_two_of_each(seen: Observation, rooms: Ints) -> CountDistribution:
    """Return a model that expects two hidden objects of every class where nothing was seen."""
    assert not seen.inputs[KITCHEN].any()
    assert seen.hidden_share[KITCHEN] == 1
    assert not seen.visited[KITCHEN]
    assert (seen.inputs[0] == seen.inputs[1:].sum(axis=0)).all()
    return poisson_counts(np.full((len(rooms), seen.inputs.shape[1]), 2.0))


@pytest.mark.parametrize("prior", [VAGUE, ShareBelief(0.8, 0.1)])
def test_the_posterior_by_hand(prior: ShareBelief) -> None:
    """The kitchen shows 6 of its objects, and 2 of each of 45 classes were expected."""
    graph = believe_kitchen(prior)
    counts = graph.histograms()[KITCHEN]

    def weigh(share: float, power: int) -> float:
        log_p = poisson.logpmf(counts, 2 * (1 - share)).sum()
        return float(np.exp(EVIDENCE * log_p + 40) * beta(*prior.beta).pdf(share) * share**power)

    total, first, second = (
        quad(weigh, 0, 1, args=(power,), points=[0.9, 0.97])[0] for power in range(3)
    )
    mean = first / total
    (after,) = update_shares([graph], graph.observation(), expect_rooms=expect_two_of_each)
    found = after.rooms[KITCHEN - 1]
    assert found.hidden_share == pytest.approx(mean, abs=2e-3)
    assert found.hidden_share_sd == pytest.approx((second / total - mean**2) ** 0.5, abs=2e-3)


def test_a_predictor_averages_over_the_posterior() -> None:
    graph = believe_kitchen(VAGUE)
    (after,) = update_shares([graph], graph.observation(), expect_rooms=expect_two_of_each)
    assert after.hidden_share == graph.share_with([r.hidden_share for r in after.rooms])
    assert after.objects == graph.objects
    posterior = hide_of_room(OFFICE, KITCHEN, PREDICTOR.believe_shares(graph)[KITCHEN - 1])
    np.testing.assert_allclose(
        PREDICTOR(graph).presence, PREDICTOR(posterior, weigh_seen=False).presence, atol=1e-9
    )
    plain = PREDICTOR(graph, weigh_seen=False).presence[KITCHEN]
    assert np.abs(PREDICTOR(graph).presence[KITCHEN] - plain).max() > 0.1


def test_several_buildings_are_answered_as_each_alone() -> None:
    graphs = believe_kitchen(VAGUE), furnish(2), OFFICE
    alone = [PREDICTOR(graph) for graph in graphs]
    together = PREDICTOR(*graphs)
    np.testing.assert_array_equal(together.inputs, np.vstack([answer.inputs for answer in alone]))
    presence = np.vstack([answer.presence for answer in alone])
    np.testing.assert_allclose(together.presence, presence, atol=1e-5)


def test_withheld_classes_are_no_evidence() -> None:
    graph = believe_kitchen(VAGUE)
    everything = range(len(PREDICTOR.classes))
    after = PREDICTOR.believe_shares(graph, withheld=everything)[1]
    assert after.mean == pytest.approx(VAGUE.mean, abs=1e-3)
    assert after.sd == pytest.approx(VAGUE.sd, abs=1e-3)


def furnish(rooms: int) -> PartialGraph:
    """Return a building whose rooms were all visited, each with four things at random."""
    rng = np.random.default_rng(0)
    things = ("chair", "table", "lamp", "bed", "sink", "toilet", "cabinet", "picture")
    document = {
        "scene_id": "furnished",
        "rooms": [{"id": str(room), "visited": True} for room in range(rooms)],
        "objects": [
            {"id": f"{room} {place}", "room": str(room), "category": str(rng.choice(things))}
            for room in range(rooms)
            for place in range(4)
        ],
    }
    return parse_robot_graph(document, path=Path("furnished"))


@pytest.mark.parametrize(("name", "size"), [("_NODES", 70), ("_CELLS", 1)])
def test_parts_are_told_what_the_whole_is(
    monkeypatch: pytest.MonkeyPatch, name: str, size: int
) -> None:
    graph = furnish(12)
    whole = PREDICTOR.believe_shares(graph)
    monkeypatch.setattr(hidden_shares, name, size)
    for share, other in zip(whole, PREDICTOR.believe_shares(graph), strict=True):
        assert share.mean == pytest.approx(other.mean, abs=1e-6)
        assert share.sd == pytest.approx(other.sd, abs=1e-6)


def believe_shares(*shares: ShareBelief) -> PartialGraph:
    """Return the office where the rooms hide these shares."""
    rooms = tuple(
        replace(room, hidden_share=share.mean, hidden_share_sd=share.sd)
        for room, share in zip(OFFICE.rooms, shares, strict=True)
    )
    return replace(OFFICE, rooms=rooms, hidden_share=float(np.mean([s.mean for s in shares])))


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
