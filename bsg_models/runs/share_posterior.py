"""What was seen of a room says how much of it is hidden: the posterior of its hidden share.

    P(s | V) ∝ P(s) Π_c P(V_c | s)^τ

V_c are the objects of class c that were seen there. P(V_c | s) is what the model believes to be in
such a room when nothing of it was seen, with a share s of it hidden (`bsg_models.belief.thinning`):
few objects, where the model expects many, mean that many are hidden. P(s) is what the robot
believed before, a Beta distribution.

Counts of different classes rise and fall together, with how much is in a room and how closely it
was annotated, so that C classes tell less than C independent ones would. τ says how much less; it
is measured (docs/hidden-share.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.special import roots_legendre, softmax

from bsg_data.arrays import Floats
from bsg_data.observation.hidden_share import ShareBelief
from bsg_data.observation.observation import Observation, stack
from bsg_data.observation.partial_graph import PartialGraph
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.thinning import log_seen
from bsg_models.inputs.share_levels import find_quantiles

EVIDENCE = 0.5  # τ
_LEVELS = 32
_MOST = 1 - 1e-6  # where all is hidden, nothing could have been seen


def update_shares(
    graph: PartialGraph, seen: Observation, *, expect: Callable[[Observation], Expectation]
) -> PartialGraph:
    """Return a graph whose uncertain hidden shares are what they are after what was seen.

    Args:
        graph: what a robot knows of R rooms; those of certain shares stay as they are.
        seen: the same as arrays. Withheld classes are no evidence.
        expect: of a model.
    """
    unsure = [number for number, room in enumerate(graph.rooms, 1) if not room.share.is_certain]
    if not unsure:
        return graph
    copies = [_forget(graph, seen, number) for number in unsure]
    nodes = np.arange(len(unsure)) * len(seen.inputs) + unsure
    true = expect(stack(copies)).hidden_counts.take(nodes)
    levels, weights = roots_legendre(_LEVELS)
    before = find_quantiles([graph.rooms[number - 1].share for number in unsure], (1 + levels) / 2)
    shares = np.minimum(before, _MOST)
    told = log_seen(true, seen.inputs[unsure], shares) * ~seen.withheld[unsure]
    posterior = softmax(EVIDENCE * told.sum(axis=2) + np.log(weights)[:, None], axis=0)
    rooms = list(graph.rooms)
    for place, number in enumerate(unsure):
        after = _moments(shares[:, place], posterior[:, place])
        rooms[number - 1] = replace(
            graph.rooms[number - 1], hidden_share=after.mean, hidden_share_sd=after.sd
        )
    share = graph.share_with([room.hidden_share for room in rooms])
    return replace(graph, rooms=tuple(rooms), hidden_share=share)


def _forget(graph: PartialGraph, seen: Observation, number: int) -> Observation:
    """Return what was seen without one room, of which nothing was seen and all is hidden."""
    inputs, others, told = seen.inputs.copy(), seen.others.copy(), seen.hidden_share.copy()
    for counts in (inputs, others):
        counts[0] -= counts[number]
        counts[number] = 0
    shares = [room.hidden_share for room in graph.rooms]
    shares[number - 1] = 1.0
    told[0], told[number] = graph.share_with(shares), 1.0
    visited = seen.visited & (np.arange(len(inputs)) != number)
    return replace(seen, inputs=inputs, others=others, hidden_share=told, visited=visited)


def _moments(shares: Floats, weights: Floats) -> ShareBelief:
    """Return mean and standard deviation of weighted shares, both `[K]`."""
    mean = float(weights @ shares)
    return ShareBelief(mean, float(np.sqrt(weights @ (shares - mean) ** 2)))
