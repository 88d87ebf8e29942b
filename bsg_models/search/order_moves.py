"""Improve an order of rooms by moves, each priced at once from parts that compose.

The expected cost of a part of an order is the sum of its legs' costs, each times the probability w
that the search is still running. That probability is a sum of products of q over the rooms before
(`single`) or from there on (`all`). So a part is described by a few terms, each with

    sum      Σ of its legs, each times the product of q over the part's rooms before (or after) it
    product  Π of q over its rooms

and two parts compose in one step. So the price of a move needs no walk along the order, as for the
minimum latency problem (Silva, Subramanian, Vidal and Ochi 2012). The terms are

    all      w = 1 − q                                           two terms
    single   w = 1 − Π_classes (1 − q) / Π_classes (1 − q_all)   one for each subset of the classes

The first term is always the way itself, with q = 1. Arrays are:

    ways      [n + 1, n + 1] costs between rooms; the last row is the robot's position
    weights   [K] of the terms
    factors   [n, K] of each room in each term
    order     [n] rooms
    around    [n + 1, K] products over the places before each (`single`), or from it on (`all`)
    legs      [n + 1] expected cost of the way to each place
    sums, products   of parts of the order, [K] or [parts, K]
"""

from __future__ import annotations

import numpy as np

from bsg_models.compilation import compiled
from bsg_models.search.order_walks import LONGEST, sum_legs

_LEAST_SHARE = 1e-9  # least relative improvement of a move


@compiled()
def improve(ways, miss, single, order):  # type: ignore[no-untyped-def]
    """Improve an order in place until no move helps; return its cost.

    A move reverses a part in place, or moves a short part elsewhere. The first helpful move is
    made.
    """
    n, classes = miss.shape
    weights, factors = _expand(miss, single)
    around, legs = np.ones((n + 1, len(weights))), np.zeros(n + 1)
    products = np.ones((n + 1, classes))
    sum_legs(ways, miss, single, order, products, legs)
    _sum_terms(factors, single, order, around)
    facts = ways, weights, factors, order, around, legs, single
    improved = True
    while improved:
        improved = False
        for length in range(min(LONGEST, n - 1) + 1):
            for i in range(n - max(length, 1) + 1):
                j = -1
                while j < n:  # the next move of place i that helps; none after the last
                    j, low, high = _find_move(facts, length, i, j + 1)
                    if j == n:
                        continue
                    trial = order.copy()
                    _move(order, trial, length, i, j)
                    cost = legs[n]
                    sum_legs(ways, miss, single, trial, products, legs)
                    if legs[n] < cost:
                        order[low : high + 1] = trial[low : high + 1]
                        improved = True
                    else:  # it only seemed better, by rounding
                        sum_legs(ways, miss, single, order, products, legs)
                    _sum_terms(factors, single, order, around)
    return legs[n]


@compiled()
def _move(order, trial, length, i, j):  # type: ignore[no-untyped-def]
    """Write the order after a move: the part at i now starts at j, or is reversed from i to j."""
    if length == 0:
        for k in range(i, j + 1):
            trial[k] = order[i + j - k]
        return
    for k in range(i, j):
        trial[k] = order[k + length]
    for k in range(j, i):
        trial[k + length] = order[k]
    for k in range(length):
        trial[j + k] = order[i + k]


@compiled()
def _find_move(facts, length, i, least):  # type: ignore[no-untyped-def]
    """Return the first j from `least` on for which a move helps, and its gain; n if none."""
    if length == 0:
        j = _find_turn(facts, i, max(least, i + 1))
        return j, i, j
    if least < i:
        j = _find_earlier(facts, length, i, least)
        if j < i:
            return j, j, i + length - 1
    j = _find_later(facts, length, i, max(least, i + 1))
    return j, i, j + length - 1


@compiled()
def _expand(miss, single):  # type: ignore[no-untyped-def]
    """Return the weight of each term `[K]`, and each room's factor in it `[n, K]`."""
    n, classes = miss.shape
    if not single:
        factors = np.ones((n, 2))
        factors[:, 1] = miss[:, 0]
        return np.array([1.0, -1.0]), factors
    weights, factors = np.ones(1 << classes), np.ones((n, 1 << classes))
    somewhere = 1.0  # P(each class is somewhere)
    for a in range(classes):
        every = 1.0
        for i in range(n):
            every *= miss[i, a]
        somewhere *= 1.0 - every
        for s in range(1 << classes):
            if s >> a & 1:
                weights[s] = -weights[s]
                factors[:, s] *= miss[:, a]
    weights /= -somewhere
    weights[0] += 1.0
    return weights, factors


@compiled()
def _sum_terms(factors, single, order, around):  # type: ignore[no-untyped-def]
    """Write the products of the terms over the places before each, or from it on."""
    n = len(order)
    for k in range(n):
        for t in range(factors.shape[1]):
            if single:
                around[k + 1, t] = around[k, t] * factors[order[k], t]
            else:
                around[n - 1 - k, t] = around[n - k, t] * factors[order[n - 1 - k], t]


@compiled()
def _find_turn(facts, i, least):  # type: ignore[no-untyped-def]
    """Return the first j from `least` on for which reversing places i to j helps, or n."""
    ways, weights, factors, order, around, legs, single = facts
    n, terms = len(order), len(weights)
    margin = legs[i] + _LEAST_SHARE * legs[n]
    before, first = order[i - 1] if i else n, order[i]
    sums, products = np.zeros(terms), factors[first].copy()  # of the part reversed so far
    for j in range(i + 1, n):
        room = order[j]
        middle = ways[room, order[j - 1]]
        if j >= least:
            enter = ways[before, room]
            leave = ways[first, order[j + 1]] if j + 1 < n else 0.0
            total = 0.0
            for t in range(terms):
                if single:
                    cost = middle + sums[t] + products[t] * leave
                    cost = around[i, t] * (enter + factors[room, t] * cost)
                else:
                    cost = sums[t] + products[t] * (middle + factors[room, t] * enter)
                    cost = around[j + 1, t] * (leave + cost)
                total += weights[t] * cost
            if total < legs[min(j + 2, n)] - margin:
                return j
        for t in range(terms):
            if single:
                sums[t] = factors[room, t] * (middle + sums[t])
            else:
                sums[t] += middle * products[t]
            products[t] *= factors[room, t]
    return n


@compiled()
def _find_earlier(facts, length, i, least):  # type: ignore[no-untyped-def]
    """Return the first j from `least` on for which the part at i is better before j; i if none."""
    ways, weights, _, order, around, legs, single = facts
    n, terms = len(order), len(weights)
    end = i + length
    sums, products = _read_part(facts, i, end)
    past_sums, past_products = _read_parts_before(facts, i, least)
    first, last, beyond = order[i], order[end - 1], order[i - 1]
    leave = ways[beyond, order[end]] if end < n else 0.0
    upper = legs[min(end + 1, n)] - _LEAST_SHARE * legs[n]
    for j in range(least, i):
        enter, middle = ways[order[j - 1] if j else n, first], ways[last, order[j]]
        total = 0.0
        for t in range(terms):
            if single:
                cost = middle + past_sums[j, t] + past_products[j, t] * leave
                cost = around[j, t] * (enter + sums[t] + products[t] * cost)
            else:
                cost = middle + sums[t] + products[t] * enter
                cost = around[end, t] * (leave + past_sums[j, t] + past_products[j, t] * cost)
            total += weights[t] * cost
        if total < upper - legs[j]:
            return j
    return i


@compiled()
def _find_later(facts, length, i, least):  # type: ignore[no-untyped-def]
    """Return the first j from `least` on for which the part at i is better starting at j, or n."""
    ways, weights, factors, order, around, legs, single = facts
    n, terms = len(order), len(weights)
    if i + length >= n:
        return n
    sums, products = _read_part(facts, i, i + length)
    past_sums, past_products = _read_part(facts, i + length, i + length + 1)
    first, last = order[i], order[i + length - 1]
    enter = ways[order[i - 1] if i else n, order[i + length]]
    margin = legs[i] + _LEAST_SHARE * legs[n]
    for end in range(i + length + 1, n + 1):
        room = order[end - 1]  # the last room that the part moves past
        if end > i + length + 1:
            between = ways[order[end - 2], room]
            for t in range(terms):
                if single:
                    past_sums[t] += past_products[t] * between
                else:
                    past_sums[t] = (past_sums[t] + between) * factors[room, t]
                past_products[t] *= factors[room, t]
        if end - length < least:
            continue
        middle = ways[room, first]
        leave = ways[last, order[end]] if end < n else 0.0
        total = 0.0
        for t in range(terms):
            if single:
                cost = middle + sums[t] + products[t] * leave
                cost = around[i, t] * (enter + past_sums[t] + past_products[t] * cost)
            else:
                cost = middle + past_sums[t] + past_products[t] * enter
                cost = around[end, t] * (leave + sums[t] + products[t] * cost)
            total += weights[t] * cost
        if total < legs[min(end + 1, n)] - margin:
            return end - length
    return n


@compiled()
def _read_part(facts, start, end):  # type: ignore[no-untyped-def]
    """Return the terms of the part of the places from start to before end."""
    ways, weights, factors, order, _, _, single = facts
    sums, products = np.zeros(len(weights)), factors[order[start]].copy()
    for k in range(start + 1, end):
        between = ways[order[k - 1], order[k]]
        for t in range(len(weights)):
            if single:
                sums[t] += products[t] * between
            else:
                sums[t] = (sums[t] + between) * factors[order[k], t]
            products[t] *= factors[order[k], t]
    return sums, products


@compiled()
def _read_parts_before(facts, end, least):  # type: ignore[no-untyped-def]
    """Return the terms of the parts from each k, from `least` on, to before end."""
    ways, weights, factors, order, _, _, single = facts
    sums, products = np.zeros((end, len(weights))), np.empty((end, len(weights)))
    products[end - 1] = factors[order[end - 1]]
    for k in range(end - 2, least - 1, -1):
        between = ways[order[k], order[k + 1]]
        for t in range(len(weights)):
            factor = factors[order[k], t]
            if single:
                sums[k, t] = factor * (between + sums[k + 1, t])
            else:
                sums[k, t] = between * products[k + 1, t] + sums[k + 1, t]
            products[k, t] = factor * products[k + 1, t]
    return sums, products
