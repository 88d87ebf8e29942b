"""Improve an order of rooms by moves, each priced by a walk along the places that it changes.

This is slow in many rooms. But it is exact for any number of classes, however unlikely they are,
which `order_moves` is not: `orders` chooses between the two.
"""

from __future__ import annotations

import numpy as np

from bsg_models.compilation import compiled

LONGEST = 3  # most rooms moved together


@compiled()
def improve_slowly(ways, miss, single, order):  # type: ignore[no-untyped-def]
    """Improve an order in place until no move helps; return its cost.

    A move changes only the places from `low` to `high`. The rooms visited before and after stay the
    same, so only the legs into these places and into the next one are compared.
    """
    n = len(order)
    products, legs = np.ones((n + 1, miss.shape[1])), np.zeros(n + 1)
    sum_legs(ways, miss, single, order, products, legs)
    trial = order.copy()
    improved = True
    while improved:
        improved = False
        for length in range(min(LONGEST, n - 1) + 1):
            for i in range(n):
                for j in range(n):
                    if length == 0:  # reverse a part in place
                        low, high = i, j
                        if i >= j:
                            continue
                        for k in range(low, high + 1):
                            trial[k] = order[low + high - k]
                    else:  # move a part from i to j
                        low, high = min(i, j), max(i, j) + length - 1
                        if i == j or high >= n:
                            continue
                        for k in range(i, j):
                            trial[k] = order[k + length]
                        for k in range(j, i):
                            trial[k + length] = order[k]
                        for k in range(length):
                            trial[j + k] = order[i + k]
                    limit = legs[min(high + 2, n)] - legs[low] - 1e-9 * legs[n]
                    cost = _window(ways, miss, single, trial, products, low, high, limit)
                    if cost < limit:
                        order[low : high + 1] = trial[low : high + 1]
                        sum_legs(ways, miss, single, order, products, legs)
                        improved = True
                    else:
                        trial[low : high + 1] = order[low : high + 1]
    return legs[n]


@compiled()
def _window(ways, miss, single, trial, products, low, high, limit):  # type: ignore[no-untyped-def]
    """Return the cost of the legs into the places from low to high + 1, or a value above limit.

    `products` and the places outside the window are those before the move. The last row of `ways`
    is the robot's position.
    """
    n, classes = miss.shape
    total, last = 0.0, min(high + 1, n - 1)
    if not single:  # from the end: the part after the window stays the same
        left = products[last + 1, 0]
        for k in range(last, low - 1, -1):
            left *= miss[trial[k], 0]
            before = trial[k - 1] if k else n
            total += ways[before, trial[k]] * (1.0 - left)
            if total >= limit:
                return total
        return total
    product = products[low].copy()
    place = trial[low - 1] if low else n
    for k in range(low, last + 1):
        room = trial[k]
        over = 1.0
        for a in range(classes):
            over *= 1.0 - (product[a] - products[n, a]) / (1.0 - products[n, a])
            product[a] *= miss[trial[k], a]
        total += ways[place, room] * (1.0 - over)
        if total >= limit:
            return total
        place = room
    return total


@compiled()
def sum_legs(ways, miss, single, order, products, legs):  # type: ignore[no-untyped-def]
    """Write products of q `[n + 1, A]` and sums of the costs of legs `[n + 1]` of an order.

    The products are over the places before each (`single`), or from each place on (`all`).
    """
    n, classes = miss.shape
    if single:
        for k in range(n):
            for a in range(classes):
                products[k + 1, a] = products[k, a] * miss[order[k], a]
    else:
        for k in range(n - 1, -1, -1):
            products[k, 0] = products[k + 1, 0] * miss[order[k], 0]
    place = n
    for k in range(n):
        room = order[k]
        over = 1.0
        if single:
            for a in range(classes):
                over *= 1.0 - (products[k, a] - products[n, a]) / (1.0 - products[n, a])
        else:
            over = products[k, 0]
        legs[k + 1] = legs[k] + ways[place, room] * (1.0 - over)
        place = room
