"""Infer the kinds of rooms, once, from everything that is said of a building.

A room of kind k in a building of kind b, with the seen share v of its objects, has

    log P(k | seen) = log n_bk + τ (Σ log v p_kt + Σ log (1 − v p_kt)) + log P(area, doors | k)

n_bk: how many rooms of the kind such a building has, by hand (`mappings/kinds-v1.csv`); p_kt: P(a
room of kind k has a thing t), the first sum over things that were seen, the second over classes
that were not. τ < 1, because things of a room are not independent. The kind of the building follows
from all its rooms, if nobody says it. A label that is read is right in all but one of `_WRONG`
cases. A room of which nothing is known is of a kind that the building still lacks.

p_kt is by hand, too: classes have the presence of `hand-prior-v2`, other things the rates of
`things-v1`. So every model may read kinds. `scripts/measure/kinds.py` measures them.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph
from bsg_data.scene.class_space import read_published, read_rows
from bsg_data.scene.room_label import known_label, normalise_room
from bsg_data.scene.surroundings import area_of
from bsg_data.scene.things import Thing, find_thing, is_narrow, list_things
from bsg_data.scene.uses import move_thing
from bsg_models.robot.words import find_everyday, find_wider

_KINDS, _PRESENCE = "kinds-v1.csv", "hand-prior-v2.json"
_FACTS = ("floor_area", "spread", "neighbours", "passage")
_HOME = "home"
_UNSEEN = 0.65  # weight of what was not seen
_ALIKE = 8.0  # things of a room, beyond which more of them say less
_WRONG = 100.0  # labels that are right, for one that is wrong
# A label is doubted if its kind has less of the likelihood than this, another kind more, and so
# many things were seen.
_UNLIKE, _ALIKE_ENOUGH, _TELLING = 0.05, 0.3, 3
_LEAST, _MOST = 0.01, 0.98  # P(a room has a thing); nothing is impossible
# Other buildings surely have what people search for, with this share, in rooms that homes lack.
_OURS, _ELSEWHERE = 0.15, 0.95
_FOREIGN = 0.4  # of the things of the nearest kind of a home, in a kind that homes lack
_OFTEN = 0.1  # rooms of a kind that a building other than a home has, if people search there
_RARE = 0.01  # rooms of a kind that a building has at least
_HARDLY = 0.15  # kinds of rooms that are less alike have nothing in common
_TAKEN = 0.5  # how far a room of a kind that a building has is taken for another one
_SHAPE = 0.5  # weight of area and doors, which differ for other reasons, too
_MOST_HOME = 0.93  # P(home), before anything is known
_AGAIN = 0.15  # of a kind of which a building has all, how many more rooms it has
_NEEDED = (("kitchen",), ("bathroom", "toilet"), ("bedroom", "child's bedroom"))
_LACKING = 0.9  # P(no room is of a kind that every home has)
SURE = 0.5  # a kind that is likelier than this is said


@dataclass(frozen=True, eq=False)
class KindTable:
    """What is known of K kinds of rooms, B kinds of buildings and T everyday things.

    Attributes:
        kinds: labels of rooms.
        buildings: the home is the first.
        numbers: `[B, K]` expected number of rooms.
        floor_area: `[K]` median, square metres.
        spread: `[K]` standard deviation of its logarithm.
        neighbours: `[K]` expected number of rooms beside it.
        passages: `[K]` whether people only pass through, such as a lift.
        things: the rows of the table of things.
        shares: `[T, K]` P(a search for it begins in rooms of this kind).
        presence: `[K, T]` p, P(a room of this kind has one).
        is_class: `[T]` things of which everybody who looks takes notice.
    """

    kinds: tuple[str, ...]
    buildings: tuple[str, ...]
    numbers: Floats
    floor_area: Floats
    spread: Floats
    neighbours: Floats
    passages: Bools
    things: tuple[Thing, ...]
    shares: Floats
    presence: Floats
    is_class: Bools

    @cached_property
    def usual(self) -> Bools:
        """Kinds in which people search, if a building has them, `[B, K]`; others come on top."""
        own = np.array([known_label(kind) == kind for kind in self.kinds])
        return np.vstack([(self.numbers[0] > 0) & own, self.numbers[1:] >= _OFTEN])

    @cached_property
    def chances(self) -> Floats:
        """P(a room of a building is of a kind), `[B, K]`."""
        numbers = self.numbers.clip(min=_RARE)
        return np.asarray(numbers / numbers.sum(axis=1, keepdims=True))

    @cached_property
    def row(self) -> dict[str, int]:
        """Name of a thing → its row."""
        return {thing.name: number for number, thing in enumerate(self.things)}

    @cached_property
    def column(self) -> dict[str, int]:
        """Kind → its column."""
        return {kind: number for number, kind in enumerate(self.kinds)}

    def shares_of(self, thing: Thing) -> Floats:
        """Return P(a search for a thing begins in rooms of each kind), `[K]`."""
        row = self.row.get(thing.name)
        if row is not None and self.things[row] is thing:
            return np.asarray(self.shares[row])
        return np.asarray(_share([thing], self.kinds)[0])

    def presence_of(self, thing: Thing) -> Floats:
        """Return P(a room of each kind has a thing), `[K]`."""
        row = self.row[thing.name]
        if self.things[row] is thing:
            return np.asarray(self.presence[:, row])
        shares = self.shares_of(thing)[None]
        return np.asarray(_be_present([thing], shares, self.numbers, self.kinds)[:, 0])

    @cached_property
    def parts(self) -> dict[str, tuple[Thing, ...]]:
        """Name of a thing → those that are such things: mugs of tableware."""
        found: dict[str, list[Thing]] = {}
        for thing in self.things:
            if thing.wider is not None and thing.wider not in thing.names:
                found.setdefault(thing.wider, []).append(thing)
        return {name: tuple(parts) for name, parts in found.items()}

    def parts_of(self, thing: Thing) -> tuple[Thing, ...]:
        """Return the things of which each is also such a thing."""
        return tuple([part for name in thing.names for part in self.parts.get(name, ())])

    @cached_property
    def alike(self) -> Floats:
        """How far people search in one kind of room for what is in another, `[K, K]`, 0 to 1."""
        length = np.linalg.norm(self.shares, axis=0).clip(min=1e-9)
        alike: Floats = self.shares.T @ self.shares / np.outer(length, length)
        np.fill_diagonal(alike, 0.0)
        alike[:, [is_narrow(kind) for kind in self.kinds]] = 0.0
        return np.asarray(np.where(alike < _HARDLY, 0.0, alike))


@cache
def read_kinds() -> KindTable:
    """Read the tables."""
    data = read_published(_KINDS)
    header = tuple(data.partition(b"\n")[0].decode().split(","))
    rows = [row for _, row in read_rows(_KINDS, data, header)]
    buildings = header[1 : -len(_FACTS)]
    kinds = tuple(row[0] for row in rows)
    numbers = np.array([[float(x) for x in row[1:-1]] for row in rows]).T
    things = list_things()
    shares = _share(things, kinds)
    presence = _be_present(things, shares, numbers, kinds)
    said, is_class = _read_presence(kinds, things)
    presence = np.where(np.isnan(said), presence, said)
    return KindTable(
        kinds=kinds,
        buildings=buildings,
        numbers=numbers[: len(buildings)],
        floor_area=numbers[-3],
        spread=numbers[-2],
        neighbours=numbers[-1],
        passages=np.array([row[-1] == "yes" for row in rows]),
        things=things,
        shares=shares,
        presence=presence,
        is_class=is_class,
    )


def _be_present(
    things: Sequence[Thing], shares: Floats, numbers: Floats, kinds: Sequence[str]
) -> Floats:
    """Return P(a room of a kind has a thing) from shares `[T, K]`, `[K, T]`."""
    homes = np.array([[thing.home] for thing in things]).clip(max=_MOST)
    named = [{kind for kind, _ in thing.rooms} for thing in things]
    foreign = np.array([[kind in one for kind in kinds] for one in named]) & (numbers[0] == 0)
    others = be_elsewhere((shares * foreign).sum(axis=1, keepdims=True))
    there = np.where(foreign, np.maximum(homes, others), homes)
    each = shares / numbers[0].clip(min=1.0)  # the rooms of a kind share what is there
    return np.asarray((1 - (1 - there) ** each).T.clip(_LEAST, _MOST))


def be_elsewhere(shares: Floats) -> Floats:
    """Return P(another building has a thing), of shares in kinds of rooms that homes lack."""
    return np.asarray(_ELSEWHERE * (shares / _OURS).clip(max=1.0))


def _read_presence(kinds: Sequence[str], things: Sequence[Thing]) -> tuple[Floats, Bools]:
    """Return P(a room has a class) by hand, `[K, T]`, NaN for other things; which are classes."""
    tables = json.loads(read_published(_PRESENCE))["room_types"]
    row = {thing.name: number for number, thing in enumerate(things)}
    names = {name for table in tables.values() for name in table["presence"]}
    columns = {name: row[thing.name] for name in sorted(names) if (thing := find_thing(name))}
    said, is_class = np.full((len(kinds), len(things)), np.nan), np.zeros(len(things), dtype=bool)
    is_class[[*columns.values()]] = True
    for number, kind in enumerate(kinds):
        table = tables.get(kind, tables.get(known_label(kind)))
        if table is not None:
            for name, column in columns.items():
                likely = table["presence"].get(name, 0.0)
                said[number, column] = np.clip(
                    np.nanmax([likely, said[number, column], _LEAST]), _LEAST, _MOST
                )
    return said, is_class


def _share(things: Sequence[Thing], kinds: Sequence[str]) -> Floats:
    """Return the shares of kinds `[T, K]`; those of kinds that homes have sum to 1."""
    shares = np.zeros((len(things), len(kinds)))
    column = {kind: number for number, kind in enumerate(kinds)}
    others = [(number, kind) for number, kind in enumerate(kinds) if known_label(kind) != kind]
    for row, thing in zip(shares, things, strict=True):
        said = dict(thing.rooms)
        for kind, share in said.items():
            if kind in column:
                row[column[kind]] = share
        for number, kind in others:
            if kind not in said:
                row[number] = _FOREIGN * thing.probability_in(kind)
    return shares


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
        named: `[R]` things that the name of a room has: the bicycles of a bicycle store.
    """

    table: KindTable
    rooms: Floats
    building: Floats
    known: Bools
    by_things: Bools
    doubted: dict[int, tuple[str, str]]
    named: tuple[frozenset[str], ...]

    def of(self, number: int) -> tuple[tuple[str, float], ...]:
        """Return the kinds of a room, 0..R−1, the likeliest first; those below a percent are none.

        Their probabilities are rounded to nothing.
        """
        row = self.rooms[number]
        order = np.argsort(-row, kind="stable")
        return tuple((self.table.kinds[k], float(row[k])) for k in order if row[k] >= 0.01)

    @cached_property
    def at_home(self) -> float:
        """P(the building is a home)."""
        return float(self.building[0])

    @cached_property
    def strange(self) -> Floats:
        """P(a room is of a kind that models of classes read as another), `[R]`: an attic, a lobby."""
        own = [known_label(kind) == kind for kind in self.table.kinds]
        return np.asarray(1 - self.rooms[:, own].sum(axis=1)).clip(min=0.0)

    @property
    def lacks(self) -> bool:
        """Whether a home surely has rooms that are not among these: a kitchen, a bath, a bed."""
        groups = ([self.table.column[kind] for kind in group] for group in _NEEDED)
        none = (float((1 - self.rooms[:, one].sum(axis=1)).clip(min=0).prod()) for one in groups)
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
        named = (*self.named, *[frozenset[str]()] * more)
        return replace(self, rooms=rooms, known=known, by_things=by_things, named=named)


def infer_kinds(graph: PartialGraph, table: KindTable) -> RoomKinds:
    """Return the kinds of the rooms of a graph."""
    seen, heard = _list_seen(graph), _list_heard(graph, table)
    told, logs = (np.zeros((len(graph.rooms), len(table.kinds))) for _ in range(2))
    known = np.zeros(len(graph.rooms), dtype=bool)
    shapes = _SHAPE * _weigh_shapes(graph, table)
    for number, (room, things) in enumerate(zip(graph.rooms, seen, strict=True)):
        told[number] = _read_label(room, table)
        logs[number] = _weigh_seen(things, table)
        if not told[number].any():  # what a room lacks is no reason to doubt its label
            logs[number] += _weigh_unseen(room, things, heard, table) + shapes[number]
        area = area_of(room)
        known[number] = told[number].any() or bool(things) or room.visited or area is not None
    likely = np.exp(logs - logs.max(axis=1, keepdims=True, initial=-np.inf))
    both = likely * _trust_labels(told)
    building = _infer_building(graph, table, both[known])
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
        by_things=np.asarray(~told.any(axis=1)),
        doubted=_doubt_labels(told, silent, seen, table),
        named=tuple(_list_named(room) for room in graph.rooms),
    )


def _trust_labels(told: Floats) -> Floats:
    """Return P(what is said of a room, if it is of a kind), `[R, K]`, up to a factor.

    What the probabilities of labels leave is left to the things.
    """
    right = 1 - 1 / _WRONG
    kinds = told.shape[1]
    return np.asarray(kinds * right * told + 1 - right * told.sum(axis=1, keepdims=True))


def _leave_taken(table: KindTable, building: Floats, rooms: Floats, known: Bools) -> Floats:
    """Return how much less likely kinds are that other rooms are, `[R, K]`: one has one kitchen."""
    numbers = building @ table.numbers.clip(min=_RARE)
    numbers = numbers * max(1.0, known.sum() / numbers.sum())
    others = rooms[known].sum(axis=0) - rooms * known[:, None]
    left = np.maximum(numbers - others, _AGAIN * numbers) / numbers
    return np.asarray(left**_TAKEN)


def _doubt_labels(
    told: Floats, silent: Floats, seen: Sequence[Sequence[Thing]], table: KindTable
) -> dict[int, tuple[str, str]]:
    """Return the labels that things contradict, and the kind that these are of, by room number."""
    doubted = {}
    for number, (row, things) in enumerate(zip(told, silent, strict=True)):
        label, kind = int(row.argmax()), int(things.argmax())
        is_other = things[label] < _UNLIKE < _ALIKE_ENOUGH < things[kind]
        if row[label] > SURE and is_other and len(seen[number]) >= _TELLING:
            doubted[number] = table.kinds[label], table.kinds[kind]
    return doubted


def _list_named(room: KnownRoom) -> frozenset[str]:
    """Return the things that stand before the last word of a room's name."""
    words = (normalise_room(name).split()[:-1] for name in (room.name, room.label or ""))
    things = (find_everyday(" ".join(some)) for some in words if some)
    return frozenset(thing.name for thing in things if thing)


def _normalise(rows: Floats) -> Floats:
    return np.asarray(rows / rows.sum(axis=1, keepdims=True).clip(min=1e-300))


def _missing(table: KindTable, building: Floats, times: Floats) -> Floats:
    numbers = building @ table.numbers.clip(min=_RARE)
    return np.asarray(np.maximum(numbers - times, _AGAIN * numbers))


def _list_seen(graph: PartialGraph) -> list[tuple[Thing, ...]]:
    """Return the kinds of things that were seen in each room."""
    seen: list[dict[str, Thing]] = [{} for _ in range(1 + len(graph.rooms))]
    for obj in graph.objects:
        thing = _read_thing(obj.raw_category) or (obj.category and _read_thing(obj.category))
        if thing and obj.is_evidence:
            seen[obj.room_index][thing.name] = thing
    return [tuple(things.values()) for things in seen[1:]]


@lru_cache(maxsize=2**16)  # the objects of a map are asked again and again
def _read_thing(word: str) -> Thing | None:
    """Return the everyday thing that a word names, in the rooms that its first words tell."""
    if listed := find_everyday(word):
        return listed
    thing, told = find_wider(word)
    return thing and move_thing(thing, told)


def _read_label(room: KnownRoom, table: KindTable) -> Floats:
    """Return what is said of the kind of a room, `[K]`; sums to 1 or less."""
    said, row = room.room_type, np.zeros(len(table.kinds))
    for label, likely in ({said: 1.0} if isinstance(said, str) else dict(said or {})).items():
        if (column := table.column.get(label)) is not None:
            row[column] += likely
    return row


def _weigh_seen(seen: Sequence[Thing], table: KindTable) -> Floats:
    """Return the log likelihoods of what was seen in a room, `[K]`."""
    found = sum((np.log(table.presence_of(thing)) for thing in seen), np.zeros(len(table.kinds)))
    return np.asarray(found / (1 + len(seen) / _ALIKE))


def _weigh_unseen(room: KnownRoom, seen: Sequence[Thing], heard: Bools, table: KindTable) -> Floats:
    """Return the log likelihoods of what was not seen in a room, `[K]`.

    `heard` `[T]` has the things of which the robot would have taken notice.
    """
    share = max(0.0, 1 - room.share.mean - room.share.sd)  # that was surely seen
    absent = heard.copy()
    absent[[table.row[thing.name] for thing in seen]] = False
    misses = np.log1p(-share * table.presence[:, absent]).sum(axis=1)
    return np.asarray(_UNSEEN * misses)


def _list_heard(graph: PartialGraph, table: KindTable) -> Bools:
    """Return the classes, or those that the robot's detector knows, `[T]`."""
    if graph.detector is None:
        return table.is_class
    heard = {thing.name for word, _ in graph.detector if (thing := find_everyday(word))}
    return np.asarray(table.is_class & [thing.name in heard for thing in table.things])


def _weigh_shapes(graph: PartialGraph, table: KindTable) -> Floats:
    """Return the log likelihoods of areas, and of how many rooms are beside one, `[R, K]`."""
    logs = np.zeros((len(graph.rooms), len(table.kinds)))
    beside = np.zeros(1 + len(graph.rooms))
    for one, two in graph.adjacency:
        beside[one] += 1
        beside[two] += 1
    for row, room in zip(logs, graph.rooms, strict=True):
        if area := area_of(room):
            off = np.log(area / table.floor_area) / table.spread
            row -= np.minimum(off**2 / 2, 8.0) + np.log(table.spread)
    visited = np.array([room.visited for room in graph.rooms], dtype=bool)
    doors = beside[1:, None].clip(max=6)
    logs += np.where(
        (visited & (beside[1:] > 0))[:, None],
        doors * np.log(table.neighbours) - table.neighbours,
        0.0,
    )
    return logs


def _infer_building(graph: PartialGraph, table: KindTable, likely: Floats) -> Floats:
    """Return P(kind of the building), `[B]`, from `likely` `[n, K]` of its known rooms."""
    if graph.building_kind in table.buildings:
        index = table.buildings.index(str(graph.building_kind))
        return np.asarray(np.eye(len(table.buildings))[index])
    others = len(table.buildings) - 1
    prior = np.array([_MOST_HOME, *[(1 - _MOST_HOME) / others] * others])
    if graph.building_kind is not None:  # of another kind
        prior[0] = 0.0
    logs = np.log(likely @ table.chances.T + 1e-300).sum(axis=0)
    weights = prior * np.exp(logs - logs.max(initial=-np.inf)) if len(likely) else prior
    return np.asarray(weights / weights.sum())
