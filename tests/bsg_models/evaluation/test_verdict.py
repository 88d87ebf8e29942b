"""Verdicts by hand: paired, in the right direction, and silent about what is not known."""

from __future__ import annotations

import numpy as np

from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.evaluation.catalogue import list_values
from bsg_models.evaluation.verdict import HEADLINES, _judge, explain, judge_all, list_headlines

NOISE = np.linspace(-1, 1, 41)
LESS, MORE = "rooms/hidden_nll", "rooms/presence_auroc_macro/all"


def measured(value: float, *, noise: np.ndarray = NOISE, **others: float) -> Bootstrap:
    """Return a model of which every metric is one number with some noise, but for a few."""
    point = dict.fromkeys(list_values(), value) | {
        k.replace("__", "/"): v for k, v in others.items()
    }
    return Bootstrap(
        point=point,
        resampled={name: number + noise for name, number in point.items()},
        nodes=dict.fromkeys(point, 9),
    )


def headlines(models: dict[str, Bootstrap]) -> list[str]:
    return list_headlines(one.point for one in models.values())


def test_a_verdict_is_that_of_the_paired_difference() -> None:
    """The intervals of both overlap by far, and yet one is better in every resample."""
    ours, other = measured(1.0), measured(1.1)
    assert ours.estimate(LESS).high > other.estimate(LESS).low
    assert _judge(ours, other, LESS) == "better"
    assert _judge(other, ours, LESS) == "worse"
    assert _judge(ours, other, MORE) == "worse"
    assert _judge(other, ours, MORE) == "better"


def test_a_difference_that_resamples_turn_round_is_no_verdict() -> None:
    ours, other = measured(1.0), measured(1.1, noise=-NOISE)  # they differ by 0.1, give or take 2
    assert _judge(ours, other, LESS) == _judge(ours, other, MORE) == "not distinguishable"
    far = measured(4.0, noise=-NOISE)
    assert _judge(ours, far, LESS) == "better"


def test_without_resamples_values_decide_and_twins_are_alike() -> None:
    nothing = np.array([])
    ours, other = measured(1.0, noise=nothing), measured(1.1, noise=nothing)
    assert _judge(ours, other, LESS) == "better"
    assert _judge(ours, ours, LESS) == "not distinguishable"
    skewed = np.append(np.zeros(99), -100.0)  # its quantiles lie above its mean
    one, twin = measured(1.0, noise=skewed), measured(1.0, noise=0 * skewed)
    assert _judge(one, twin, LESS) == "not distinguishable"


def test_runs_are_judged_beside_doubling_where_both_are_known() -> None:
    unvisited = dict.fromkeys(
        (name.replace("/", "__") for name in HEADLINES["unvisited rooms"]), float("nan")
    )
    both = {"ours": measured(1.0, **unvisited), "doubled": measured(1.5, **unvisited)}
    assert not set(headlines(both)) & set(HEADLINES["unvisited rooms"])
    (verdicts,) = judge_all(both, runs=["ours"]).values()
    assert set(verdicts) == {"better", "worse"}
    assert verdicts["better"][0] == "NLL, rooms"
    assert "AUROC macro" in verdicts["worse"]
    assert sum(map(len, verdicts.values())) == len(headlines(both))
    lines = explain(both, runs=["ours"])
    assert lines[0].startswith("ours, compared with doubling what was seen")
    assert lines[1] == "  better: NLL, rooms"
    assert len(lines) == 1 + len(headlines(both))
