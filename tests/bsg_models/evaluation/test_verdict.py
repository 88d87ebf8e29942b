"""Verdicts by hand: paired, in the right direction, and silent about what is not known."""

from __future__ import annotations

import numpy as np
import pytest

from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.evaluation.catalogue import list_values
from bsg_models.evaluation.verdict import HEADLINES, explain, judge_all, list_headlines

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


NOTHING = np.array([])
SKEWED = np.append(np.zeros(99), -100.0)  # its quantiles lie above its mean


@pytest.mark.parametrize(
    ("ours", "other", "verdict"),
    [
        (measured(1.0), measured(1.1), "better"),  # their intervals overlap by far
        (measured(1.1), measured(1.0), "worse"),
        (measured(1.0), measured(1.1, noise=-NOISE), "not distinguishable"),  # .1, give or take 2
        (measured(1.0), measured(4.0, noise=-NOISE), "better"),
        (measured(1.0, noise=NOTHING), measured(1.1, noise=NOTHING), "better"),
        (measured(1.0, noise=NOTHING), measured(1.0, noise=NOTHING), "not distinguishable"),
        (measured(1.0, noise=SKEWED), measured(1.0, noise=0 * SKEWED), "not distinguishable"),
    ],
)
def test_a_verdict_is_that_of_the_paired_difference(
    ours: Bootstrap, other: Bootstrap, verdict: str
) -> None:
    """Of a metric that is better if less; one that is better if more has the other side."""
    (verdicts,) = judge_all({"ours": ours, "doubled": other}, runs=["ours"]).values()
    sides = {"better": "worse", "worse": "better"}
    for label, expected in (("NLL, rooms", verdict), ("AUROC macro", sides.get(verdict, verdict))):
        assert [name for name in verdicts if label in verdicts[name]] == [expected]


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
