"""Infer the kinds of rooms, once, from everything that is said of a building.

A room of kind k in a building of kind b, with the seen share v of its objects, has

    log P(k | seen) = log n_bk + τ Σ log d p_kt + τ′ Σ log (1 − d v p_kt) + log P(area, doors | k)

n_bk: how many rooms of the kind such a building has, by hand (`tables/kinds-v1.csv`); p_kt: P(a
room of kind k has a thing t), the first sum over things that were seen, the second over classes
that were not; d: share of what is in view of which the robot takes notice, summed over, as all its
rooms tell. τ, τ′ < 1, because things of a room are not independent: τ falls with their number. The
kind of the building follows from all its rooms, if nobody says it. A label that is read is right in
all but one of `_WRONG` cases. A room of which nothing is known is of a kind that the building still
lacks.

p_kt is by hand, too: classes have the presence of `hand-prior-v1`, other things the rates of
`things-v1`. So every model may read kinds. `scripts/measure/kinds.py` at commit
c62923b7 measured them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from operator import attrgetter

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.scene.room_label import normalise_room, owner_of, weigh_labels
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph
from bsg_models.zoo.model import one_thread
from bsg_robot.answers.kind_table import KindTable, log_presence_of
from bsg_robot.answers.words import find_everyday, find_wider
from bsg_robot.things.things import Thing
from bsg_robot.things.uses import move_thing

_UNSEEN = 0.6  # weight of what was not seen
# Shares of what is in view of which a robot may take notice, and P(each).
_NOTICE = ((0.2, 0.25), (0.95, 0.75))
_ALIKE = 6.0  # things of a room, beyond which more of them say less
_SHAPE = 0.5  # weight of area and doors, which differ for other reasons, too
_WRONG = 50.0  # labels that are right, for one that is wrong
_UNLIKE = 0.05  # a label is doubted if its things are less likely to be of its kind
_HOME = 0.93  # P(home), before anything is known
_AGAIN = 0.4  # of a kind of which a building has all, how many more rooms it has
_NEEDED = (("kitchen",), ("bathroom", "toilet"), ("bedroom", "child's bedroom"))
_LACKING = 0.8  # P(no room is of a kind that every home has)
_SAID = 0.01  # kinds that are less likely are not said
SURE = 0.5  # a kind that is likelier than this is said alone


@dataclass(frozen=True, eq=False)
class RoomKinds:
    """The kinds of R rooms, as far as they are known.

    Attributes:
        table: what is known of kinds.
        rooms: `[R, K]` P(kind).
        building: `[B]` P(kind of the building).
        known: `[R]` whether anything is known of the room.
        by_things: `[R]` whether nobody says its kind.
        doubted: label and the kind of its things, if they contradict it, by room number.
        named: `[R]` the things that the name of a room has: the bicycle of a bicycle store.
        owners: `[R]` whose a room is, by its name.
    """

    table: KindTable
    rooms: Floats
    building: Floats
    known: Bools
    by_things: Bools
    doubted: dict[int, tuple[str, str]]
    named: tuple[frozenset[str], ...]
    owners: tuple[str | None, ...]

    @cached_property
    def said(self) -> tuple[tuple[tuple[str, float], ...], ...]:
        """The kinds of each room, the likeliest first, in whole percents."""
        names, order = self.table.kinds, np.argsort(-self.rooms, axis=1, kind="stable")
        return tuple(
            tuple((names[k], round(float(row[k]), 2)) for k in ranked if row[k] >= _SAID)
            for row, ranked in zip(self.rooms, order, strict=True)
        )

    def taken_for(self, number: int) -> str | None:
        """Return the kind of a room that is likelier than all others, if there is one."""
        likely = self.rooms[number].argmax()
        return self.table.kinds[likely] if self.rooms[number, likely] > SURE else None

    @cached_property
    def at_home(self) -> float:
        """P(the building is a home)."""
        return float(self.building[0])

    @cached_property
    def strange(self) -> Floats:
        """P(a room is of a kind that models read as another one), `[R]`: an attic, a patio."""
        return np.asarray(1 - self.rooms[:, self.table.is_known].sum(axis=1)).clip(min=0.0)

    @property
    def lacks(self) -> bool:
        """Whether a home surely has rooms that are not among the known: kitchen, bath, bedroom."""
        groups = ([self.table.column[kind] for kind in group] for group in _NEEDED)
        known = self.rooms[self.known]
        none = (float((1 - known[:, columns].sum(axis=1)).clip(min=0).prod()) for columns in groups)
        return self.at_home > SURE and max(none) > _LACKING

    def with_unknown(self, more: int) -> RoomKinds:
        """Return the kinds of these rooms, and of some more of which nothing is known."""
        if not more:
            return self
        left = _missing(self.table, self.building, self.rooms[self.known].sum(axis=0))
        rooms = np.vstack([self.rooms, np.tile(left / left.sum(), (more, 1))])
        known, by_things = (
            np.concatenate([flags, np.zeros(more, dtype=bool)])
            for flags in (self.known, self.by_things)
        )
        return replace(
            self,
            rooms=rooms,
            known=known,
            by_things=by_things,
            named=self.named + (frozenset[str](),) * more,
            owners=self.owners + (None,) * more,
        )


@one_thread()
def infer_kinds(graph: PartialGraph, table: KindTable) -> RoomKinds:
    """Return the kinds of the rooms of a graph."""
    seen, misses = _list_seen(graph), _Misses(graph, table)
    labels, found = (np.zeros((len(graph.rooms), len(table.kinds))) for _ in range(2))
    unseen = np.zeros((len(_NOTICE), *labels.shape))
    entered = np.zeros(len(graph.rooms), dtype=bool)
    for number, (room, things) in enumerate(zip(graph.rooms, seen, strict=True)):
        if room.room_type is not None:
            labels[number] = _read_label(room, table)
        if things:
            found[number] = _weigh_seen(things, table)
        if room.visited or things:
            unseen[:, number] = misses.weigh(room, things)
        entered[number] = bool(things) or room.visited or room.area is not None
    is_told = np.asarray(labels.any(axis=1))
    known = entered | is_told
    usual = _expect_building(graph, table)
    trust = _trust_labels(labels, usual @ table.chances)
    shapes = _SHAPE * _weigh_shapes(graph, table)
    # What a room lacks is no reason to doubt its label.
    lacks = _sum_over_notice(unseen, found + np.log(trust * (usual @ table.chances)))
    logs = found + np.where(is_told[:, None], 0.0, lacks + shapes)
    likely = np.exp(logs - logs.max(axis=1, keepdims=True, initial=-np.inf))
    both = likely * trust
    building = _infer_building(usual, table, both[known])
    prior = building @ table.chances
    rooms = _normalise(prior * both)
    rooms = _normalise(prior * both * _leave_taken(table, building, rooms, known))
    silent = _normalise(prior * likely)
    left = _missing(table, building, rooms[known].sum(axis=0))
    rooms[~known] = _normalise(left * likely[~known])
    return RoomKinds(
        table=table,
        rooms=rooms,
        building=building,
        known=known,
        by_things=~is_told,
        doubted=_doubt_labels(labels, silent, table),
        named=tuple(
            frozenset(
                thing.name
                for name in (room.name, room.label)
                if name and (thing := _name_thing(name))
            )
            for room in graph.rooms
        ),
        owners=tuple(owner_of(room.name) or owner_of(room.label or "") for room in graph.rooms),
    )


def _trust_labels(labels: Floats, usual: Floats) -> Floats:
    """Return P(what is said of a room, if it is of a kind), `[R, K]`, up to a factor.

    Who says .6 kitchen means just that, if no thing tells more; so it is divided by how `usual`
    kitchens are, `[K]`. What the probabilities of labels leave is as usual.
    """
    right = 1 - 1 / _WRONG
    return np.asarray(right * labels / usual + 1 - right * labels.sum(axis=1, keepdims=True))


def _leave_taken(table: KindTable, building: Floats, rooms: Floats, known: Bools) -> Floats:
    """Return how much less likely kinds are that other rooms are, `[R, K]`: one has one kitchen."""
    numbers = building @ table.smoothed
    numbers = numbers * max(1.0, known.sum() / numbers.sum())
    others = rooms[known].sum(axis=0) - rooms * known[:, None]
    return np.asarray(np.maximum(numbers - others, _AGAIN * numbers) / numbers)


def _doubt_labels(labels: Floats, silent: Floats, table: KindTable) -> dict[int, tuple[str, str]]:
    """Return the labels that things contradict, and the kind that these are of, by room number."""
    doubted = {}
    for number, (row, things) in enumerate(zip(labels, silent, strict=True)):
        label, kind = int(row.argmax()), int(things.argmax())
        if row[label] > SURE and things[label] < _UNLIKE and things[kind] > SURE:
            doubted[number] = table.kinds[label], table.kinds[kind]
    return doubted


@lru_cache(maxsize=4096)
def _name_thing(name: str) -> Thing | None:
    """Return the thing that stands before the last word of a room's name."""
    return find_everyday(" ".join(normalise_room(name).split()[:-1]))


def _normalise(rows: Floats) -> Floats:
    return np.asarray(rows / rows.sum(axis=1, keepdims=True).clip(min=1e-300))


def _missing(table: KindTable, building: Floats, times: Floats) -> Floats:
    numbers = building @ table.smoothed
    return np.asarray(np.maximum(numbers - times, _AGAIN * numbers))


def _list_seen(graph: PartialGraph) -> list[tuple[Thing, ...]]:
    """Return the kinds of things that were seen in each room, in one order."""
    seen: list[set[Thing]] = [set() for _ in range(1 + len(graph.rooms))]
    for obj in graph.objects:
        thing = _read_thing(obj.raw_category) or (obj.category and _read_thing(obj.category))
        if thing and obj.is_evidence:
            seen[obj.room_index].add(thing)
    return [tuple(sorted(things, key=attrgetter("name", "rooms"))) for things in seen[1:]]


@lru_cache(maxsize=2**16)  # the objects of a map are asked again and again
def _read_thing(word: str) -> Thing | None:
    """Return the everyday thing that a word names, in the rooms that its first words tell."""
    if listed := find_everyday(word):
        return listed
    thing, words = find_wider(word)
    return thing and move_thing(thing, words)


def _read_label(room: KnownRoom, table: KindTable) -> Floats:
    """Return what is said of the kind of a room, `[K]`; sums to 1 or less."""
    row = np.zeros(len(table.kinds))
    for label, likely in weigh_labels(room.room_type).items():
        if (column := table.column.get(label)) is not None:
            row[column] += likely
    return row


def _weigh_seen(seen: Sequence[Thing], table: KindTable) -> Floats:
    """Return the log likelihoods of what was seen in a room, `[K]`."""
    rows = [table.row[thing.name] for thing in seen]
    found = np.array(table.log_presence[:, rows].sum(axis=1))
    for row, thing in zip(rows, seen, strict=True):
        if table.things[row] is not thing:  # a word has moved it
            found += log_presence_of(thing, table) - table.log_presence[:, row]
    return np.asarray(found / (1 + len(seen) / _ALIKE))


class _Misses:
    """What it tells not to see the things of which a robot takes notice; rooms share it."""

    def __init__(self, graph: PartialGraph, table: KindTable) -> None:
        heard = table.is_class  # or those of them that the robot's detector knows
        if graph.detector is not None:
            known = {thing.name for word, _ in graph.detector if (thing := find_everyday(word))}
            heard = heard & [thing.name in known for thing in table.things]
        rows = np.flatnonzero(heard)
        self._presence = table.presence[:, rows]
        self._column = {table.things[row].name: column for column, row in enumerate(rows)}
        self._known: dict[float, Floats] = {}

    def weigh(self, room: KnownRoom, seen: Sequence[Thing]) -> Floats:
        """Return the log likelihoods of how much was seen in a room, and what was not, `[D, K]`."""
        share = max(0.0, 1 - room.share.mean - room.share.sd)  # that was surely seen
        if share not in self._known:
            shares = share * np.array([[[notice]] for notice, _ in _NOTICE])
            self._known[share] = np.log1p(-shares * self._presence)
        each = self._known[share]  # [D, K, H]
        names = dict.fromkeys(thing.name for thing in seen)
        columns = [self._column[name] for name in names if name in self._column]
        missed = each.sum(axis=2) - each[:, :, columns].sum(axis=2)
        noticed = np.log([[notice] for notice, _ in _NOTICE]) * len(seen) / (1 + len(seen) / _ALIKE)
        return np.asarray(noticed + _UNSEEN * missed)


def _sum_over_notice(unseen: Floats, others: Floats) -> Floats:
    """Return log likelihoods `[R, K]` from those by how much a robot takes notice, `[D, R, K]`.

    All rooms tell how much it does; `rest` `[R, K]` has what else they tell.
    """
    rooms = np.logaddexp.reduce(unseen + others, axis=2).sum(axis=1)
    likely = np.log([chance for _, chance in _NOTICE]) + rooms
    likely -= np.logaddexp.reduce(likely)
    return np.asarray(np.logaddexp.reduce(likely[:, None, None] + unseen, axis=0))


def _weigh_shapes(graph: PartialGraph, table: KindTable) -> Floats:
    """Return the log likelihoods of areas, and of how many rooms are beside one, `[R, K]`."""
    logs = np.zeros((len(graph.rooms), len(table.kinds)))
    beside = np.zeros(1 + len(graph.rooms))
    for pair in graph.adjacency:
        beside[[*pair]] += 1
    for row, room in zip(logs, graph.rooms, strict=True):
        if area := room.area:
            off = (np.log(area) - np.log(table.floor_area)) / table.spread
            row -= np.minimum(off**2 / 2, 8.0) + np.log(table.spread)
    visited = np.array([room.visited for room in graph.rooms], dtype=bool)
    doors = beside[1:, None].clip(max=6)
    logs += np.where(
        (visited & (beside[1:] > 0))[:, None],
        doors * np.log(table.neighbours) - table.neighbours,
        0.0,
    )
    return logs


def _expect_building(graph: PartialGraph, table: KindTable) -> Floats:
    """Return P(kind of the building), `[B]`, before anything is known of its rooms."""
    if graph.building_kind in table.buildings:
        index = table.buildings.index(str(graph.building_kind))
        return np.asarray(np.eye(len(table.buildings))[index])
    others = len(table.buildings) - 1
    prior = np.array([_HOME, *[(1 - _HOME) / others] * others])
    if graph.building_kind is not None:  # of another kind
        prior[0] = 0.0
    return np.asarray(prior / prior.sum())


def _infer_building(usual: Floats, table: KindTable, likely: Floats) -> Floats:
    """Return P(kind of the building), `[B]`, from `likely` `[n, K]` of its known rooms."""
    logs = np.log(likely @ table.chances.T + 1e-300).sum(axis=0)
    weights = usual * np.exp(logs - logs.max(initial=-np.inf)) if len(likely) else usual
    return np.asarray(weights / weights.sum())
