"""Order rooms so that the expected cost of a search is least.

A plan is an order v₁ … vₙ of the unexplored rooms, from the robot's position. Leg k costs d(vₖ₋₁,
vₖ), the way and the look at its end, and is walked only if the search is still running, so

    expected cost = Σₖ d(vₖ₋₁, vₖ) · w(v₁ … vₖ₋₁)

with w the probability that the search continues after these rooms. With q the probability that a
look in a room finds no instance of a class, because there is none or because it is missed, rooms
being independent:

    all       w = 1 − Π_{unvisited} Π_classes q                       something is left
    single    w = 1 − Π_classes (1 − u),                              a class is still to be found
              u = (Π_visited q − Π_all q) / (1 − Π_all q)             given that the plan finds it

Up to `EXACT` rooms, dynamic programming over sets of rooms (Held and Karp 1962) finds the best
order. Beyond, rooms are inserted one by one where they cost least; then each is taken out and
inserted again until nothing improves. The best of several such orders counts. They begin with the
likeliest room, the nearest, the likeliest for what it costs, or at random. Of more than 100 rooms,
only the best of these orders is improved: that costs about 1 % more in the mean (8 % at most, of
96 cases), in a fifth of the time.

Passing through an unexplored room on the way to another explores it. Such a plan costs the same as
one that names the room, so orders with the cheapest ways between rooms miss nothing.

Arrays are of B searches at once:

    ways     [B, n + 1, n + 1] costs of legs between rooms; the last row is the robot's position
    miss     [B, n, A] q of each class; 1 for one that is found
    order    [B, n] rooms
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.arrays import accumulate

EXACT = 10  # rooms; each further room doubles time and memory
CHANCES = 5  # orders that begin at random; more are better and take longer
_EXACT_TOUR, _TOUR_CHANCES = 12, 60  # a tour is planned once in a search
LEAST = 1e-6  # least presence: a wrong belief must not end a search
_CELLS = 1 << 19  # of tables; more searches are ordered in turns
_LEAST_COST = 1e-9  # that a room's likelihood is divided by
_LEAST_SHARE = 1e-9  # least relative improvement
# Of more rooms, only the order that costs least at first is improved, as long as it gains more.
_SEVERAL, _LEAST_OF_MANY = 100, 1e-3
_ROOMS = 1000  # of all orders that begin at random, so that many rooms have fewer


def choose_rooms(
    costs: Floats, here: Ints, rooms: Bools, presence: Floats, *, wanted: Bools, single: bool
) -> Ints:
    """Return the first room of the best order of each of E searches, `[E]`; −1 without rooms.

    Args:
        costs: `[E, N, N]` of the cheapest ways, with the looks at their ends.
        here: `[E]` node of the robot.
        rooms: `[E, N]` to be visited.
        presence: `[E, N, A]` P(a look finds at least one instance) of A classes.
        wanted: `[E, A]` classes still to be found.
        single: whether one instance of each class is enough.
    """
    miss = np.where(wanted[:, None], 1 - np.clip(presence, LEAST, 1), 1.0)
    first = np.full(len(here), -1)
    for some, which in _by_number(rooms):
        ways, part = _take(costs, here, some, which), miss[some[:, None], which]
        order = order_rooms(ways, part, single=single)
        first[some] = which[np.arange(len(some)), order[:, 0]]
    return first


def order_search(costs: Floats, here: int, rooms: Bools, presence: Floats, *, single: bool) -> Ints:
    """Return the best order of one search, `[n]` nodes; its first is that of `choose_rooms`.

    Args:
        costs: `[N, N]` of the cheapest ways, with the looks at their ends.
        here: node of the robot.
        rooms: `[N]` to be visited.
        presence: `[N, A]` P(a look finds at least one instance) of what is still to be found.
        single: whether one instance of each class is enough.
    """
    which = np.flatnonzero(rooms)
    if not len(which):
        return which
    ways = _take(costs[None], np.array([here]), np.array([0]), which[None])
    miss = 1 - np.clip(presence[which], LEAST, 1)
    return np.asarray(which[order_rooms(ways, miss[None], single=single)[0]])


def plan_tours(costs: Floats, here: Ints, holds: Bools) -> Ints:
    """Return the position of each room in a shortest way through some rooms, `[E, N]`.

    Args:
        costs: `[E, N, N]` of the cheapest ways.
        here: `[E]` node of the robot.
        holds: `[E, N]` rooms to be visited; other rooms come last.
    """
    places = np.full(holds.shape, holds.shape[1])
    for some, which in _by_number(holds):
        certain = np.full((*which.shape, 1), LEAST)
        ways = _take(costs, here, some, which)
        order = order_rooms(ways, certain, single=False, exact=_EXACT_TOUR, chances=_TOUR_CHANCES)
        rooms = np.take_along_axis(which, order, axis=1)
        places[some[:, None], rooms] = np.arange(which.shape[1])
    return places


def order_rooms(
    ways: Floats, miss: Floats, *, single: bool, exact: int = EXACT, chances: int = CHANCES
) -> Ints:
    """Return a best order of n rooms in each of B searches, `[B, n]`.

    Args:
        ways: `[B, n + 1, n + 1]` costs; the last row is from the robot's position.
        miss: `[B, n, A]` q, of the classes that are still to be found; 1 of others.
        single: whether one instance of each class is enough.
        exact: largest number of rooms that is ordered exactly.
        chances: number of further orders that begin at random, for more rooms.
    """
    if not single:
        miss = miss.prod(axis=2, keepdims=True)
    searches, rooms = miss.shape[:2]
    if rooms <= exact:
        cells, order = rooms << rooms, _order_exactly
    else:
        cells, order = (3 + chances) * rooms**2, partial(_order_many, chances=chances)
    together = max(1, _CELLS // cells)
    parts = [slice(i, i + together) for i in range(0, searches, together)]
    return np.concatenate([order(ways[part], miss[part], single) for part in parts])


def expected_costs(ways: Floats, miss: Floats, order: Ints, *, single: bool) -> Floats:
    """Return the expected cost of an order of each search, `[B]`; arguments as in `order_rooms`."""
    if not single:
        miss = miss.prod(axis=2, keepdims=True)
    return _Orders.of(ways, miss, single=single).expect(order.T)


def _by_number(rooms: Bools) -> Iterator[tuple[Ints, Ints]]:
    """Yield the searches `[B]` that have equally many rooms, and these `[B, n]`."""
    numbers = rooms.sum(axis=1)
    for number in np.unique(numbers[numbers > 0]).tolist():
        some = np.flatnonzero(numbers == number)
        yield some, np.nonzero(rooms[some])[1].reshape(-1, number)


def _take(costs: Floats, here: Ints, some: Ints, which: Ints) -> Floats:
    """Return the costs between rooms `[B, n]` of some searches, and from the robot's position."""
    nodes = np.concatenate([which, here[some, None]], axis=1)
    return np.asarray(costs[some[:, None, None], nodes[:, :, None], nodes[:, None]])


def _goes_on(before: Floats, after: Floats, every: Floats, single: bool) -> Floats:
    """Return w, given the products of q over the rooms before, from then on, and all `[…, A]`."""
    if not single:
        return np.asarray(1 - after[..., 0])
    somewhere = np.broadcast_to(1 - every, np.broadcast_shapes(before.shape, every.shape))
    left = np.divide(before - every, somewhere, out=np.zeros(somewhere.shape), where=somewhere > 0)
    return np.asarray(1 - (1 - left).prod(axis=-1))


def _order_exactly(ways: Floats, miss: Floats, single: bool) -> Ints:
    """Return the best order, from the least cost that remains after a set, in its last room."""
    ways, rooms = ways.transpose(1, 2, 0), miss.shape[1]  # searches last: they are contiguous
    visited = np.ones((1, *miss[:, 0].shape))
    for room in range(rooms):
        visited = np.concatenate([visited, visited * miss[:, room]])
    left = _goes_on(visited, visited[::-1], visited[-1], single)
    remaining = np.zeros((1 << rooms, rooms, len(miss)))
    for sets, inside, outside in _layers(rooms):
        legs = ways[inside[:, :, None], outside[:, None]] * left[sets][:, None, None]
        legs += remaining[sets[:, None] | 1 << outside, outside][:, None]
        remaining[sets[:, None], inside] = legs.min(axis=2)
    every, each = np.arange(len(miss)), np.arange(rooms)[:, None]
    order = np.empty((rooms, len(miss)), dtype=np.int64)
    done, legs = np.zeros(len(miss), dtype=np.int64), ways[rooms, :rooms]
    for place in range(rooms):
        total = legs * left[done, every] + remaining[done | 1 << each, each, every]
        order[place] = np.where(done >> each & 1, np.inf, total).argmin(axis=0)
        done = done | 1 << order[place]
        legs = ways[order[place], :rooms, every].T
    return order.T


@lru_cache(maxsize=16)
def _layers(rooms: int) -> tuple[tuple[Ints, Ints, Ints], ...]:
    """Return sets of rooms of one size, the rooms inside and outside; the largest sets first."""
    sets = np.arange(1 << rooms)
    inside = (sets[:, None] >> np.arange(rooms) & 1).astype(bool)
    layers = []
    for size in range(rooms - 1, 0, -1):
        some = sets[inside.sum(axis=1) == size]
        parts = (
            np.nonzero(part)[1].reshape(len(some), -1) for part in (inside[some], ~inside[some])
        )
        layers.append((some, *parts))
    return tuple(layers)


def _order_many(ways: Floats, miss: Floats, single: bool, *, chances: int) -> Ints:
    """Return the best of 3 + `chances` improved orders, into which rooms were inserted in turn."""
    searches, rooms = miss.shape[:2]
    many = rooms > _SEVERAL
    chances = min(chances, _ROOMS // rooms) if many else chances
    likely, near = 1 - miss.min(axis=2), ways[:, rooms, :rooms]
    lots = np.repeat(np.random.default_rng(0).random((chances, rooms)), searches, axis=0)
    ranks = np.concatenate([-likely, near, -likely / (near + _LEAST_COST), lots])
    turns = np.argsort(ranks, axis=1, kind="stable").T
    orders = _Orders.of(ways, miss, single=single, copies=3 + chances)
    order = turns[:0]
    for room in turns:
        order = _put(order, room, orders.find_place(order, room))
    costs, least = orders.expect(order), _LEAST_SHARE
    if many:
        best, least = _best_of(costs, searches), _LEAST_OF_MANY
        orders, order, costs = orders.take(best), order[:, best], costs[best]
    _improve(orders, order, costs, least=least)
    return np.asarray(order[:, _best_of(costs, searches)].T)


def _best_of(costs: Floats, searches: int) -> Ints:
    """Return the number of each search's cheapest order, `[S]`."""
    return np.asarray(costs.reshape(-1, searches).argmin(axis=0) * searches + np.arange(searches))


def _improve(orders: _Orders, order: Ints, cost: Floats, *, least: float) -> None:
    """Take out each room and insert it again, as long as that improves an order `[n, B]`."""
    at, going = np.arange(len(order))[:, None], np.arange(order.shape[1])
    while len(going):
        some, own = order[:, going], orders.take(going)
        for room in range(len(order)):
            place = (some == room).argmax(axis=0)
            rest = np.where(at[:-1] < place, some[:-1], some[1:])
            new = own.find_place(rest, room)
            moved = np.flatnonzero(new != place)
            if len(moved):
                some[:, moved] = _put(rest[:, moved], room, new[moved])
        now = own.expect(some)
        better = now < cost[going] * (1 - least)
        going, some, now = going[better], some[:, better], now[better]
        order[:, going], cost[going] = some, now


def _put(order: Ints, room: Ints | int, place: Ints) -> Ints:
    """Return orders `[m + 1, B]` of m rooms and another one each, at a place `[B]`."""
    gap = np.empty((1, order.shape[1]), dtype=order.dtype)
    at = np.arange(len(order) + 1)[:, None]
    new = np.where(at < place, np.concatenate([order, gap]), np.concatenate([gap, order]))
    new[place, np.arange(len(place))] = room
    return new


@dataclass(frozen=True, eq=False)
class _Orders:
    """What B orders cost: each is of one of S searches, and of rooms among its W = n + 1 places."""

    ways: Floats  # `[S, W, W]` from a place to others
    miss: Floats  # `[S, W, A]` q of places; 1 at the robot's
    first: Ints  # `[B]` number of the first place of the order's search, among all S · W
    every: Floats  # `[B, A]` product of q over all rooms
    given: Floats  # `[B, A]` 1 / P(it is somewhere); 0 if it is nowhere
    single: bool

    @classmethod
    def of(cls, ways: Floats, miss: Floats, *, single: bool, copies: int = 1) -> _Orders:
        """Return what some orders of each search cost; arguments as in `order_rooms`."""
        every = np.tile(miss.prod(axis=1), (copies, 1))
        given = np.divide(1, 1 - every, out=np.zeros_like(every), where=every < 1)
        places = np.concatenate([miss, np.ones_like(miss[:, :1])], axis=1)
        first = np.tile(np.arange(len(miss)) * places.shape[1], copies)
        return cls(np.ascontiguousarray(ways), places, first, every, given, single)

    def take(self, some: Ints) -> _Orders:
        """Return what some of the orders cost."""
        every, given = self.every[some], self.given[some]
        return replace(self, first=self.first[some], every=every, given=given)

    def expect(self, order: Ints) -> Floats:
        """Return the expected costs of orders `[n, B]`, `[B]`."""
        path = self._begin(order)
        legs = self.ways.take(self._rows(path[:-1]) + path[1:])
        return np.asarray((legs * self._goes_on(self._multiply(path))[:-1]).sum(axis=0))

    def find_place(self, order: Ints, room: Ints | int) -> Ints:
        """Return where a room costs least in orders `[m, B]` of others, `[B]`.

        Legs before it are walked as if it were unvisited, later ones as if it were visited. Costs
        are compared with those of visiting it first, by a way that costs nothing.
        """
        path = self._begin(order)
        products, q = self._multiply(path), self._miss(room)
        parts = (products, products * q) if self.single else (products * q, products)
        unvisited, visited = (self._goes_on(part) for part in parts)
        rows, after = self._rows(path), path[1:]
        legs, onwards = self.ways.take(rows[:-1] + after), self.ways.take(self._rows(room) + after)
        costs = self.ways.take(rows + room) * unvisited
        costs[:-1] += (onwards - legs) * visited[:-1]
        costs[1:] += accumulate(np.add, legs * (unvisited - visited)[:-1])
        return np.asarray(costs.argmin(axis=0))

    def _begin(self, order: Ints) -> Ints:
        """Return orders `[m, B]` with the robot's place before them."""
        start = np.full_like(order, self.ways.shape[1] - 1, shape=(1, order.shape[1]))
        return np.concatenate([start, order])

    def _rows(self, places: Ints | int) -> Ints:
        """Return where the costs from places `[m, B]` begin among all `ways`."""
        return np.asarray((self.first + places) * self.ways.shape[1])

    def _miss(self, places: Ints | int) -> Floats:
        """Return q of places `[m, B]`, `[m, B, A]`."""
        return self.miss.reshape(-1, self.miss.shape[2]).take(self.first + places, axis=0)

    def _multiply(self, path: Ints) -> Floats:
        """Return the products of q over the rooms before each leg of paths `[m + 1, B]`.

        For `all`, over those from it on; `[m + 1, B, A]`, with all rooms at the end.
        """
        rooms = path[1:] if self.single else path[:0:-1]
        one = np.ones((1, path.shape[1], self.miss.shape[2]))
        products = accumulate(np.multiply, np.concatenate([one, self._miss(rooms)]))
        return products if self.single else products[::-1]

    def _goes_on(self, products: Floats) -> Floats:
        """Return w of products, `[m + 1, B]`."""
        if not self.single:
            return np.asarray(1 - products[..., 0])
        left = (products - self.every) * self.given
        return left[..., 0] if left.shape[2] == 1 else np.asarray(1 - (1 - left).prod(axis=2))
