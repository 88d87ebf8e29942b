"""Compute exactly the best orders of few rooms, by dynamic programming over sets."""

from __future__ import annotations

import numpy as np

from bsg_models.compilation import compiled


@compiled()
def order_exactly(ways, miss, single):  # type: ignore[no-untyped-def]
    """Return the best order of n rooms; the last row of `ways` is the robot's position."""
    n, classes = miss.shape
    sets = 1 << n
    product = np.ones((sets, classes))
    for s in range(1, sets):
        lowest = 0
        while not s >> lowest & 1:
            lowest += 1
        product[s] = product[s & (s - 1)] * miss[lowest]
    goes_on = np.empty(sets)
    for s in range(sets):
        over = 1.0
        for a in range(classes):
            every = product[sets - 1, a]
            if single:
                over *= 1.0 - (product[s, a] - every) / (1.0 - every)
            else:
                over *= product[sets - 1 - s, a]
        goes_on[s] = 1.0 - over
    value = np.zeros((sets, n))  # least remaining cost after a set, with its last room
    following = np.zeros((sets, n), dtype=np.int64)
    for s in range(sets - 2, 0, -1):
        for last in range(n):
            if not s >> last & 1:
                continue
            best = np.inf
            for room in range(n):
                if s >> room & 1:
                    continue
                cost = ways[last, room] * goes_on[s] + value[s | 1 << room, room]
                if cost < best:
                    best, following[s, last] = cost, room
            value[s, last] = best
    order = np.empty(n, dtype=np.int64)
    best = np.inf
    for room in range(n):
        cost = ways[n, room] * goes_on[0] + value[1 << room, room]
        if cost < best:
            best, order[0] = cost, room
    s = 1 << order[0]
    for k in range(1, n):
        order[k] = following[s, order[k - 1]]
        s |= 1 << order[k]
    return order


@compiled()
def pass_all_classes(costs, here, holds, wanted):  # type: ignore[no-untyped-def]
    """Return the first room of the cheapest way past each class; see `orders.choose_cover`."""
    target = np.full(len(here), -1)
    for e in range(len(here)):
        classes = np.flatnonzero(wanted[e])
        nodes, sets = holds.shape[1], 1 << len(classes)
        finds = np.zeros(nodes, dtype=np.int64)  # the set of classes that a room holds
        for n in range(nodes):
            for i in range(len(classes)):
                if holds[e, n, classes[i]]:
                    finds[n] |= 1 << i
        cost = np.full((sets, nodes), np.inf)  # of having found a set, and being in a room
        first = np.full((sets, nodes), -1)
        for n in range(nodes):
            if finds[n]:
                cost[finds[n], n], first[finds[n], n] = costs[e, here[e], n], n
        for s in range(1, sets):  # a leg that finds something leads to a larger set
            for n in range(nodes):
                if cost[s, n] == np.inf:
                    continue
                for m in range(nodes):
                    after = s | finds[m]
                    if after != s and cost[s, n] + costs[e, n, m] < cost[after, m]:
                        cost[after, m] = cost[s, n] + costs[e, n, m]
                        first[after, m] = first[s, n]
        best = np.inf
        for n in range(nodes):
            if cost[sets - 1, n] < best:
                best, target[e] = cost[sets - 1, n], first[sets - 1, n]
    return target
