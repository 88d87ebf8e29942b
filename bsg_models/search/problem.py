"""Define a search: where robots may look, what that costs, and where the things are.

**The law.** f is the probability that a look finds a thing, and no look before it in the same room
did. Looks into one room exclude each other: one thing is in one place, and found once. Rooms are
independent, under the tilt of the building (`bsg_models.zoo.building_tilt`), which divides all that
implies a thing by Z. So after a set V of looks, with Q(V) = Π_rooms (1 − Z Σ_{V in the room} f),

    P(found) = (1 − Q(V)) / Z

**The objective** is the expected cost until the task is done, of the looks that a plan has. After
looks that found nothing, it goes on with the probability w:

    single    w = 1 − Π_things (1 − u)      a thing is still to be found, given that the plan
              u = (Q(V) − Q(all)) / (1 − Q(all))       finds it
    all       w = 1 − Π_things (1 − (1 − Q(all others)) / Z)          something is left

A look that a robot ends at the time t, when it has gone there and looked, is worth it if the search
still runs. With all looks t₁ ≤ t₂ ≤ … of a plan, the cost is Σₖ (tₖ − tₖ₋₁) w(looks until tₖ₋₁); of
one robot, that is the sum of its legs, each times w.

A plan of n looks by K robots is a permutation of n + K − 1 numbers: the looks of the first robot in
their order; n + 1 and those of the second; and so on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.arrays import accumulate

EXACT = 10  # places whose order is the best of all
MORE_LOOKS = 2  # second looks that are weighed, however many places there are
LEAST_AGAIN = 0.01  # of what the likeliest look finds of a thing: what such a look finds at least
LEAST = 1e-6  # least presence: a wrong belief must not end a search
LEAST_FIND = 1e-9  # least P(a look finds a thing): others are lost in rounding
_FAR = 1e9  # cost of a way that is closed to one of several robots
_SURER = 1e6  # what P(found within a budget) counts beside the cost, in costs of a whole plan


@dataclass(frozen=True, eq=False)
class SearchProblem:
    """S searches, each of n looks by K robots for A things.

    Attributes:
        legs: `[S, n + K, n]` from the place of each look, then from each robot: the cost of going
            to the place of a look, and of looking.
        finds: `[S, n, A]` Z f, see above.
        room: `[S, n]` of each look, those of one room side by side; None if no two share one.
        scale: `[S, A]` Z; None if all are 1.
        delay: `[S, K]` when each robot is where it starts from.
        single: whether one of each thing is enough; else all are looked for.
        in_turn: looks into the place of the look before them, in every search.
        budget: cost within which things are to be found as surely as can be; None: cost is all.
    """

    legs: Floats
    finds: Floats
    single: bool
    delay: Floats
    room: Ints | Floats | None = None
    scale: Floats | None = None
    in_turn: tuple[int, ...] = ()
    budget: float | None = None

    @property
    def looks(self) -> int:
        """Number n of looks."""
        return int(self.finds.shape[1])

    @property
    def robots(self) -> int:
        """Number K of robots."""
        return int(self.delay.shape[1])

    def take(self, some: slice) -> SearchProblem:
        """Return some of the searches."""
        room = None if self.room is None else self.room[some]
        scale = None if self.scale is None else self.scale[some]
        legs, finds, delay = self.legs[some], self.finds[some], self.delay[some]
        return replace(self, legs=legs, finds=finds, delay=delay, room=room, scale=scale)

    @cached_property
    def joint(self) -> SearchProblem:
        """The same for one thing that stands for all, if that does not matter to the cost."""
        if self.single or self.room is not None or self.scale is not None:
            return self
        return replace(self, finds=1 - (1 - self.finds).prod(axis=2, keepdims=True))

    def expect(self, plans: Ints) -> Floats:
        """Return the expected cost of a plan of each search, `[S]` of `[S, n + K − 1]`."""
        return Plans.of(self.joint).expect(plans.T)

    def found(self, looks: Sequence[int]) -> Floats:
        """Return P(each thing is found by then) of m looks of the first search, `[m, A]`."""
        left = Plans.of(replace(self, single=True)).left(np.array(looks, dtype=np.int64)[:, None])
        return np.asarray((1 - left[1:, 0]) / (1.0 if self.scale is None else self.scale[0]))

    def cut(self, looks: list[int], *, robot: int) -> list[int]:
        """Return the looks of a robot of the first search that end within the budget."""
        if self.budget is None:
            return looks
        path = [self.looks + robot, *looks]
        ends = self.delay[0, robot] + self.legs[0, path[:-1], path[1:]].cumsum()
        return looks[: int((ends <= self.budget).sum())]


@dataclass(frozen=True, eq=False)
class Plans:
    """What B plans cost: each is of one of S searches, of some of its W = n + K numbers.

    Number n is the first robot's place, with which every path begins.
    """

    legs: Floats  # `[S, W, W]`
    finds: Floats  # `[S · W, A]`, 0 at robots' places
    room: Ints | Floats | None  # `[S · W]`; those of robots are of no look
    problem: SearchProblem
    first: Ints  # `[B]` where the numbers of each plan's search begin, among all S · W
    every: Floats  # `[B, A]` Q(all)
    given: Floats  # `[B, A]` 1 / (1 − Q(all)); 0 if it is nowhere

    @classmethod
    def of(cls, problem: SearchProblem, *, copies: int = 1) -> Plans:
        """Return the cost of some plans of each search."""
        searches, robots, looks = len(problem.finds), problem.robots, problem.looks
        legs = np.zeros((searches, looks + robots, looks + robots))
        legs[:, :, :looks] = problem.legs if robots == 1 else np.minimum(problem.legs, _FAR)
        finds = np.pad(problem.finds, ((0, 0), (0, robots), (0, 0)))
        room = problem.room
        if room is not None:
            apart = np.arange(-robots, 0) + room.min(axis=1, keepdims=True)
            room = np.concatenate([room, apart], axis=1).ravel()
        things = finds.shape[2]
        finds = finds.reshape(-1, things)
        first = np.arange(searches) * (looks + robots)
        none = np.zeros((searches, things))
        plans = cls(legs, finds, room, problem, first, none, none)
        order = np.tile(np.arange(looks)[:, None], searches)
        every = plans.left(order, whole=True)[-1]
        given = np.divide(1, 1 - every, out=np.zeros_like(every), where=every < 1)
        return replace(plans, every=every, given=given).take(np.tile(np.arange(searches), copies))

    def take(self, some: Ints | Bools) -> Plans:
        """Return the cost of some of the plans."""
        first, every, given = self.first[some], self.every[some], self.given[some]
        return replace(self, first=first, every=every, given=given)

    @property
    def robots(self) -> int:
        """Number K of robots."""
        return self.problem.robots

    @property
    def is_by_turns(self) -> bool:
        """Whether it counts when looks end, and not only in which order they come."""
        return self.robots > 1 or self.problem.budget is not None

    @cached_property
    def _each(self) -> Ints:
        return np.arange(len(self.first))

    @property
    def search(self) -> Ints:
        """Number of the search of each plan, `[B]`."""
        return np.asarray(self.first // self.legs.shape[1])

    # Q along paths

    def left(self, order: Ints, *, whole: bool = False) -> Floats:
        """Return Q of the looks before each place of orders `[m, B]`, and of all, `[m + 1, B, A]`.

        For `all`, of those from the place on, and at the end 1; but with `whole`.
        """
        backwards = not self.problem.single and not whole
        path = order[::-1] if backwards else order
        whole_q = np.ones((1, path.shape[1], self.finds.shape[-1]))
        left = accumulate(np.multiply, np.concatenate([whole_q, self._factors(path)]))
        return left[::-1] if backwards else left

    def _factors(self, path: Ints) -> Floats:
        """Return what each look leaves of Q, `[m, B, A]`."""
        finds = self.finds.take(self.first + path, axis=0)
        if self.room is None:
            return 1 - finds
        before = self._before(path, finds)
        return _divide(1 - before - finds, 1 - before)

    def _before(self, path: Ints, finds: Floats) -> Floats:
        """Return Σ f over the looks before each one, in its room, `[m, B, A]`."""
        room = self.room[self.first + path]  # type: ignore[index]
        turn = np.argsort(room, axis=0, kind="stable")
        room, finds = (
            np.take_along_axis(room, turn, 0),
            np.take_along_axis(finds, turn[..., None], 0),
        )
        total = accumulate(np.add, np.concatenate([np.zeros_like(finds[:1]), finds]))[:-1]
        begins = np.ones(room.shape, dtype=bool)
        begins[1:] = room[1:] != room[:-1]
        first = np.maximum.accumulate(np.where(begins, np.arange(len(path))[:, None], 0), axis=0)
        before = np.empty_like(finds)
        own = total - np.take_along_axis(total, first[..., None], 0)
        np.put_along_axis(before, turn[..., None], own, 0)
        return before

    def goes_on(self, left: Floats) -> Floats:
        """Return w of Q of looks that were made, or for `all` of those that are left, `[…, B]`."""
        if self.problem.single:
            u = ((left - self.every) * self.given).clip(min=0.0)
            return u[..., 0] if u.shape[-1] == 1 else np.asarray(1 - (1 - u).prod(axis=-1))
        if self.problem.scale is None:
            return 1 - (left[..., 0] if left.shape[-1] == 1 else left.prod(axis=-1))
        return np.asarray(1 - (1 - (1 - left) / self.problem.scale[self.search]).prod(axis=-1))

    # Costs

    def expect(self, order: Ints) -> Floats:
        """Return the expected costs of plans `[m, B]`, `[B]`; in a budget, what is minimised."""
        return self.expect_path(np.concatenate([self.begin()[:1], order]))

    def begin(self) -> Ints:
        """Return paths without looks, `[K, B]`."""
        robots = np.arange(self.robots) + self.problem.looks
        return np.repeat(robots[:, None], len(self.first), axis=1)

    def expect_path(self, path: Ints) -> Floats:
        """Return what `expect` does, of paths `[m, B]`: the first robot's place, and an order."""
        if self.is_by_turns:
            return self._expect_times(path)
        legs = self._legs(path[:-1], path[1:])
        return np.asarray((legs * self.goes_on(self.left(path))[1:-1]).sum(axis=0))

    def _expect_times(self, path: Ints) -> Floats:
        """Return what `expect_path` does, by the times at which looks end."""
        _, turn, times = self._turns(path)
        w = self.goes_on(self.left(path[turn, self._each]))
        steps = np.diff(times, axis=0, prepend=0.0)
        budget = self.problem.budget
        if budget is None:
            return np.asarray((steps * w[:-1]).sum(axis=0))
        within = times <= budget
        steps = np.where(within, steps, 0.0)
        done = w[within.sum(axis=0), self._each]
        far = _SURER * (1.0 + self.legs.max(initial=0.0, where=np.isfinite(self.legs)))
        return np.asarray((steps * w[:-1]).sum(axis=0) + far * done)

    def _turns(self, path: Ints) -> tuple[Floats, Ints, Floats]:
        """Return `times`, which looks of paths come in turn, `[m − K, B]`, and when they end."""
        times = self.times(path)
        turn = np.argsort(np.where(path < self.problem.looks, times, np.inf), axis=0, kind="stable")
        turn = turn[: len(path) - self.robots]
        return times, turn, times[turn, self._each]

    def take_turns(self, path: Ints) -> Ints:
        """Return the looks of paths `[m, B]` in turn, `[m − K, B]`."""
        return np.asarray(path[self._turns(path)[1], self._each])

    def times(self, path: Ints) -> Floats:
        """Return when each look of paths ends, `[m + K, B]`; of a robot, when it starts."""
        looks, legs = self.problem.looks, np.zeros(path.shape)
        legs[1:] = self._legs(path[:-1], path[1:])
        clock, is_robot = accumulate(np.add, legs), path >= looks
        since = np.maximum.accumulate(np.where(is_robot, clock, 0.0), axis=0)
        later = self.problem.delay[self.search, np.where(is_robot, path - looks, 0)]
        starts = np.maximum.accumulate(np.where(is_robot, np.arange(len(path))[:, None], 0), axis=0)
        return np.asarray(clock - since + later[starts, self._each])

    def _legs(self, here: Ints | int, goal: Ints | int) -> Floats:
        return np.asarray(self.legs.take((self.first + here) * self.legs.shape[1] + goal))

    # Where one more look costs least

    def find_place(self, path: Ints, look: Ints | int) -> Ints:
        """Return where a look costs least in paths `[m, B]` of others, `[B]`.

        Of many looks by several robots, it is an estimate: as if looks stayed in turn when one of
        them comes later.
        """
        if self.is_by_turns:
            exact = self.problem.looks <= EXACT or self.problem.budget is not None
            find = self._try_places if exact else self._estimate_places
            return find(path, look)
        unvisited, visited = self._weigh(path[1:], look)
        rows, after = (self.first + path) * self.legs.shape[1], path[1:]
        legs, onwards = self.legs.take(rows[:-1] + after), self._legs(look, after)
        costs = self.legs.take(rows + look) * unvisited
        costs[:-1] += (onwards - legs) * visited[:-1]
        # Legs before it are walked as if it were unvisited, later ones as if it were visited.
        costs[1:] += accumulate(np.add, legs * (unvisited - visited)[:-1])
        return np.asarray(costs.argmin(axis=0) + 1)

    def _weigh(self, order: Ints, look: Ints | int) -> tuple[Floats, Floats]:
        """Return w before each place of orders `[m, B]`, without one more look, and after it."""
        order = order if self.problem.single else order[::-1]
        left = np.ones((len(order) + 1, *self.every.shape))
        left[1:] = self._factors(order)
        more = 1 - self.finds[self.first + look] if self.room is None else self._leave(order, look)
        left = accumulate(np.multiply, left)
        parts = (left, left * more) if self.problem.single else ((left * more)[::-1], left[::-1])
        return self.goes_on(parts[0]), self.goes_on(parts[1])

    def _leave(self, order: Ints, look: Ints | int) -> Floats:
        """Return what a look would leave of Q after those before each place, `[m + 1, B, A]`."""
        at, own = self.first + order, self.first + look
        same = self.room[at] == self.room[own]  # type: ignore[index]
        left = np.ones((len(order) + 1, *self.every.shape))
        np.multiply(same[..., None], -self.finds.take(at, axis=0), out=left[1:])
        left = accumulate(np.add, left)
        return _divide(left - self.finds[own], left)

    def _estimate_places(self, path: Ints, look: Ints | int) -> Ints:
        """Return what `find_place` does, from Σ t p, with p = P(the search ends by a look at t).

        Looks before it end the search as if it were unvisited, those behind it as if it were
        visited; and those of its robot come later by the detour.
        """
        times, turn, ends = self._turns(path)
        unvisited, visited = self._weigh(path[turn, self._each], look)
        share = visited[:-1] - visited[1:]
        more, place = np.zeros(unvisited.shape), np.full(path.shape, len(turn))
        more[1:] = accumulate(np.add, ends * (unvisited[:-1] - unvisited[1:] - share))
        end = times + self._legs(path, look)
        apart = self._each * (1.0 + end.max() + times.max())
        behind = np.searchsorted((ends + apart).T.ravel(), end + apart, side="right")
        behind -= self._each * len(turn)
        place[turn, self._each] = np.arange(len(turn))[:, None]
        behind[:-1] = np.minimum(behind[:-1], place[1:])  # before the robot's next look
        costs = more[behind, self._each] + end * (unvisited - visited)[behind, self._each]
        shares = np.zeros(path.shape)
        shares[turn, self._each] = share
        shares, after = accumulate(np.add, shares), path[1:]
        until = np.where(after < self.problem.looks, shares[-1], shares[1:])  # of its robot
        until = np.minimum.accumulate(until[::-1], axis=0)[::-1]
        detour = self._legs(path, look)[:-1] + self._legs(look, after)
        detour -= self._legs(path[:-1], after)
        costs[:-1] += detour * (until - shares[:-1])
        return np.asarray(costs.argmin(axis=0) + 1)

    def _try_places(self, path: Ints, look: Ints | int) -> Ints:
        """Return what `find_place` does, from the costs of all plans; the last of equal ones.

        What comes after a budget may as well be last.
        """
        budget, plans = self.problem.budget, path.shape[1]
        places = np.arange(len(path), 0, -1)
        if budget is not None:
            in_time = (self.times(path)[places - 1] <= budget).any(axis=1)
            places = places[in_time | (places == len(path))]
        at = np.repeat(places, plans)
        every = put(np.tile(path, len(places)), np.tile(look, len(at) // np.size(look)), at)
        costs = self.take(np.tile(np.arange(plans), len(places))).expect_path(every)
        return np.asarray(places[costs.reshape(-1, plans).argmin(axis=0)])


def put(order: Ints, look: Ints | int, place: Ints) -> Ints:
    """Return plans `[m + 1, B]` of plans `[m, B]` and one more look each, at a place `[B]`."""
    gap = np.empty((1, order.shape[1]), dtype=order.dtype)
    at = np.arange(len(order) + 1)[:, None]
    new = np.where(at < place, np.concatenate([order, gap]), np.concatenate([gap, order]))
    new[place, np.arange(len(place))] = look
    return new


def share_rooms(room: Ints | Floats) -> Bools:
    """Return whether another look is into the room of each, of rooms `[…, n]` side by side."""
    same = np.zeros(room.shape, dtype=bool)
    same[..., 1:] = room[..., 1:] == room[..., :-1]
    same[..., :-1] |= same[..., 1:]
    return same


def _divide(some: Floats, whole: Floats) -> Floats:
    """Return some / whole; 0 where nothing is left."""
    return np.divide(some, whole, out=np.zeros_like(some), where=whole > 0).clip(0.0, 1.0)


def pose_search(
    ways: Floats,
    finds: Floats,
    *,
    look: Floats | float = 0.0,
    single: bool,
    rooms: Floats | None = None,
    scale: Floats | None = None,
    delay: Floats | None = None,
    budget: float | None = None,
) -> tuple[SearchProblem, Ints]:
    """Return S searches of n places as problems of looks, and the place of each look, `[S, m]`.

    Of further looks into places, the likeliest to find something are weighed: up to `EXACT` looks
    in all, and at least `MORE_LOOKS`.

    Args:
        ways: `[S, n + K, n]` costs of the ways from each place, then from each robot.
        finds: `[S, L, n, A]` f of the first look into a place, of the second, and so on.
        look: `[S, n]` cost of a look.
        single: of `SearchProblem`.
        rooms: `[n]` number of the room of each place; None if each is of its own.
        scale: of `SearchProblem`.
        delay: of `SearchProblem`; None: all robots are where they start from now.
        budget: of `SearchProblem`.
    """
    searches, repeats, places, things = finds.shape
    robots = np.broadcast_to(np.arange(places, ways.shape[1]), (searches, ways.shape[1] - places))
    row = np.broadcast_to(np.arange(places), (searches, places))  # of each look, among all L · n
    likely = finds[:, 0].max(axis=1, initial=LEAST_FIND)[:, None, None]
    again = (finds[:, 1:] / likely).max(axis=3).reshape(searches, -1)
    worth = int((again >= LEAST_AGAIN).sum(axis=1).max(initial=0))
    more = min(max(EXACT - places, MORE_LOOKS), worth)
    if more:
        likeliest = np.argsort(-again, axis=1, kind="stable")[:, :more]
        row = np.concatenate([row, places + likeliest], axis=1)
    room = None
    if more or rooms is not None:
        number = np.arange(places) if rooms is None else rooms
        row = np.take_along_axis(
            row, np.lexsort((row // places, row % places, number[row % places])), 1
        )
        room = number[row % places]
    place = row % places
    every = finds.reshape(searches, repeats * places, things)
    found = np.take_along_axis(every, row[:, :, None], axis=1)
    begin = np.concatenate([place, robots], axis=1)
    search = np.arange(searches)[:, None]
    legs = ways[search[..., None], begin[:, :, None], place[:, None]]
    legs = legs + np.broadcast_to(look, (searches, places))[search, place][:, None]
    later = np.zeros(robots.shape) if delay is None else delay
    in_turn = tuple((1 + np.flatnonzero((place[:, 1:] == place[:, :-1]).all(axis=0))).tolist())
    return SearchProblem(legs, found, single, later, room, scale, in_turn, budget), place
