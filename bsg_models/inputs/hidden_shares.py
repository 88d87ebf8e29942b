"""Handle uncertain hidden shares: integrate over them, and narrow them by what was seen.

The hidden counts of a room with uncertain share S are the mixture, over S, of those at each share.
The K levels, with probabilities u_k and weights w_k, are Gauss-Legendre nodes on (0, 1). At a
level, every uncertain room hides the u_k-quantile of its own Beta distribution:

    P(H) = ∫ P(H | S = F⁻¹(u)) du ≈ Σ_k w_k P(H | S = F⁻¹(u_k))

So a building takes K copies in one pass of a model, however many of its rooms are uncertain. The
rooms are coupled: a robot that overlooked more than it thinks did so everywhere.
Presences differ by .011 at most from those at 128 levels.

What was seen of a room narrows its share:

    P(s | V) ∝ P(s) Π_c P(V_c | s)^τ

V_c are the seen objects of class c. P(s) is the robot's prior, a Beta distribution. P(V_c | s)
follows from what the model expects in such a room when nothing of it was seen, thinned to the
visible share 1 − s (`CountDistribution.log_seen`). Few objects in a room where the model expects
many mean that many are hidden.

Counts of different classes are correlated, through the fullness of a room and the care of its
annotation. So C classes carry less evidence than C independent ones. τ is the correction that was
best in 437 half-seen rooms of HM3D.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import islice

import numpy as np

from bsg_data.arrays import Bools, Counts, Floats, Ints
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.hidden_share import ShareBelief
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph
from bsg_models.special_functions import beta_quantiles, gauss_legendre, log_sum_exp

_LEVELS = 8  # the error of a presence is then .0004 on average, and .011 at most
EVIDENCE = 0.5  # τ
_POSTERIOR_LEVELS = 32
_MOST = 1 - 1e-6  # at share 1 nothing could have been seen
_GROUPS = 16  # groups in which uncertain rooms are forgotten; up to 16 rooms are forgotten alone
_NODES = 1 << 12  # in copies of a building, in one call of the model
_CELLS = 1 << 15  # of a table of likelihoods, so that it stays in a fast cache


def spread_shares(graphs: Sequence[PartialGraph], seen: Observation) -> tuple[Observation, Floats]:
    """Return the observation at several levels of the hidden shares, and the weight of each level.

    Args:
        graphs: what a robot knows of B buildings.
        seen: the same as arrays.

    Returns:
        K copies of all buildings, one per level, and weights `[K]` that sum to 1. If every share is
        certain, the observation itself and the weight 1.
    """
    beliefs = [room.share for graph in graphs for room in graph.rooms]
    if all(belief.is_certain for belief in beliefs):
        return seen, np.ones(1)
    nodes, weights = gauss_legendre(_LEVELS)
    hidden_shares: list[float] = []
    for shares in _find_quantiles(beliefs, (1 + nodes) / 2).tolist():
        of_room = iter(shares)
        for graph in graphs:
            own = [*islice(of_room, len(graph.rooms))]
            hidden_shares += graph.share_with(own), *own
    copies = seen.take(np.tile(np.arange(len(seen)), _LEVELS))
    return replace(copies, hidden_share=np.array(hidden_shares, dtype=np.float32)), weights / 2


def _find_quantiles(beliefs: Sequence[ShareBelief], probabilities: Floats) -> Floats:
    """Return the quantiles `[K, R]` of R shares at K probabilities."""
    quantiles = np.tile([belief.mean for belief in beliefs], (len(probabilities), 1))
    unsure = [room for room, belief in enumerate(beliefs) if not belief.is_certain]
    if unsure:
        parameters = [beliefs[room].beta for room in unsure]
        number = {pair: place for place, pair in enumerate(dict.fromkeys(parameters))}
        found = _find_each(tuple(number), tuple(probabilities.tolist()))
        quantiles[:, unsure] = found[:, [number[pair] for pair in parameters]]
    return quantiles


@lru_cache(maxsize=32)
def _find_each(
    parameters: tuple[tuple[float, float], ...], probabilities: tuple[float, ...]
) -> Floats:
    """Return the quantiles of some Beta distributions; most rooms begin with the same one."""
    return beta_quantiles(*np.array(parameters).T, probabilities=np.array(probabilities))


def update_shares(
    graphs: Sequence[PartialGraph],
    seen: Observation,
    *,
    expect_rooms: Callable[[Observation, Ints], CountDistribution],
) -> list[PartialGraph]:
    """Return graphs whose uncertain hidden shares are updated by what was seen.

    The model is asked about a copy of the building in which the room is forgotten. Beyond sixteen
    uncertain rooms, sixteen groups of rooms are forgotten in turn, because one copy per room would
    take time and memory that grow with the square of the rooms.

    Args:
        graphs: what a robot knows of B buildings; certain shares stay.
        seen: the same as arrays. Withheld classes are no evidence.
        expect_rooms: of a model.
    """
    rooms = {
        first + number: room
        for first, graph in zip(seen.starts.tolist(), graphs, strict=False)
        for number, room in enumerate(graph.rooms, 1)
    }
    after = dict(rooms)
    groups = _group_unsure(rooms, seen)
    size = max(1, _NODES // int(np.diff(seen.starts).max()))
    for first in range(0, len(groups), size):
        some = groups[first : first + size]
        rows = np.concatenate(some)
        beliefs = [rooms[row].share for row in rows.tolist()]
        true = expect_rooms(*_forget(graphs, seen, some))
        moments = _weigh(beliefs, true, seen.inputs[rows], withheld=seen.withheld[rows])
        for row, mean, sd in zip(rows.tolist(), *moments.tolist(), strict=True):
            share = ShareBelief(mean, sd)
            after[row] = replace(rooms[row], hidden_share=share.mean, hidden_share_sd=share.sd)
    left = iter(after.values())
    return [_with_rooms(graph, tuple(islice(left, len(graph.rooms)))) for graph in graphs]


def _group_unsure(rooms: Mapping[int, KnownRoom], seen: Observation) -> list[Ints]:
    """Return the rows of the uncertain of some rooms, by row, in groups of each building."""
    unsure = np.array([row for row, room in rooms.items() if not room.share.is_certain], np.int64)
    groups: list[Ints] = []
    for own in np.split(unsure, np.searchsorted(unsure, seen.starts[1:-1])):
        number = min(len(own), _GROUPS)
        groups += [own[first::number] for first in range(number)]
    return groups


def _with_rooms(graph: PartialGraph, rooms: tuple[KnownRoom, ...]) -> PartialGraph:
    """Return a graph with other shares of its rooms; itself if none differs."""
    if rooms == graph.rooms:
        return graph
    share_of_all = graph.share_with([room.hidden_share for room in rooms])
    return replace(graph, rooms=rooms, hidden_share=share_of_all)


def _weigh(
    beliefs: Sequence[ShareBelief], true: CountDistribution, seen: Counts, *, withheld: Bools
) -> Floats:
    """Return mean and standard deviation `[2, M]` of the shares of M rooms, given what was seen.

    Args:
        beliefs: `[M]` priors.
        true: distribution of all objects there, by a model that saw nothing of the room.
        seen: `[M, C]`.
        withheld: `[M, C]` cells that are no evidence.
    """
    levels, weights = gauss_legendre(_POSTERIOR_LEVELS)
    shares = np.minimum(_find_quantiles(beliefs, (1 + levels) / 2), _MOST)
    log_evidence = np.empty(shares.shape)
    size = max(1, _CELLS // (_POSTERIOR_LEVELS * len(true.means) * seen.shape[1]))
    for first in range(0, len(beliefs), size):
        rooms = np.arange(first, min(first + size, len(beliefs)))
        log_p = true.take(rooms).log_seen(seen[rooms], shares[:, rooms])
        log_evidence[:, rooms] = (log_p * ~withheld[rooms]).sum(axis=2)
    log_posterior = EVIDENCE * log_evidence + np.log(weights)[:, None]
    posterior = np.exp(log_posterior - log_sum_exp(log_posterior, axis=0))
    mean = (posterior * shares).sum(axis=0)
    return np.stack([mean, np.sqrt((posterior * (shares - mean) ** 2).sum(axis=0))])


def _forget(
    graphs: Sequence[PartialGraph], seen: Observation, groups: Sequence[Ints]
) -> tuple[Observation, Ints]:
    """Return a copy of a building for each group of its rooms that it forgets, and their rows.

    Nothing of them was seen, everything is hidden.
    """
    building = seen.building[[rows[0] for rows in groups]]
    copies = seen.take(building)
    copy, known = np.repeat(np.arange(len(groups)), [*map(len, groups)]), np.concatenate(groups)
    first = copies.starts[copy]
    rows = known + first - seen.starts[building[copy]]
    for counts in (copies.inputs, copies.unclassified):
        np.subtract.at(counts, first, counts[rows])
        counts[rows] = 0
    copies.hidden_share[copies.starts[:-1]] = [
        _share_without(graphs[number], own - seen.starts[number])
        for number, own in zip(building.tolist(), groups, strict=True)
    ]
    copies.hidden_share[rows] = 1.0
    copies.visited[rows] = False
    return copies, rows


def _share_without(graph: PartialGraph, numbers: Ints) -> float:
    """Return the hidden share of a building that forgets some rooms."""
    shares = np.array([1.0, *(room.hidden_share for room in graph.rooms)])
    shares[numbers] = 1.0
    return graph.share_with(shares[1:].tolist())
