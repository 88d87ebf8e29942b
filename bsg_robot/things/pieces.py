"""Say on or in which piece of furniture of a room a thing is.

A piece of kind k in a room of kind r holds a thing at the rate

    (t · belongs + (1 − t) · untidy) · (w + e)^0.8 · (1 − (1 − c) · (1 − h) / 2)

    belongs, untidy   shares of people who say that things belong there, or lie there in an untidy
                      home (`bsg_robot.things.things`); t is `tidy`
    w                 where a person would look for such a thing, by hand, per cent; e is 3, and 0.3
                      for a piece that holds one kind of things, such as a shoe rack
    c                 share of the piece that is not seen until it is opened
    h                 hidden share of the room: in the rest, half of all things would have been in
                      sight, where they are not in closed furniture

Several pieces of a kind share its rate: people were asked about kinds. A piece that is not listed
has the mean rate of those that it is like. Pieces that are expected and not seen yet have the rates
of their classes, or a fifth, once a robot was inside and saw furniture. Given that the thing is in
the room, P(it is at a piece) is the piece's share of all rates. Looks at a piece change it by
Bayes' rule.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.scene.room_label import known_label, weigh_labels
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_robot.tables.table import read_table
from bsg_robot.things.things import (
    Receptacle,
    find_keeping,
    find_receptacle,
    read_shares,
)

TIDY = 0.5  # half of what is sought lies where it belongs
_IN_SIGHT = 0.5  # share of things on open furniture that a robot sees as it looks about
_OVERLOOKED = 0.2  # of the furniture that models expect, once a robot was inside: it is large
_KEEPING = 0.8  # how far the table of keeping is trusted
_EVERYWHERE = 3.0  # weight of every piece besides those where a person would look, per cent
_ELSEWHERE = 0.3  # the same of a piece that holds one kind of things, such as a shoe rack


Labels = tuple[tuple[str, float], ...]  # of a room, with their probabilities


@dataclass(frozen=True, eq=False)
class Furniture:
    """The pieces of a room where one thing may be.

    Attributes:
        pieces: the n that were seen.
        rates: `[n + 1]` of holding the thing; the last is that of all pieces not seen yet.
    """

    pieces: tuple[SeenObject, ...]
    rates: Floats

    @property
    def names(self) -> frozenset[str]:
        """Ids of the pieces."""
        return frozenset(piece.name for piece in self.pieces)

    def shares(self, missed: Mapping[str | None, float]) -> Floats:
        """Return P(at each piece, if it is in the room), `[n + 1]`, after looks.

        `missed` has, of the pieces with a look, P(all looks miss it, if it is there).
        """
        rates = self._after(missed)
        total = float(rates.sum())
        return rates / total if total else np.eye(len(rates))[-1]

    def overlooked(self, missed: Mapping[str | None, float]) -> float:
        """Return P(the looks miss it, if it is in the room)."""
        before = float(self.rates.sum())
        return float(self._after(missed).sum()) / before if before else 1.0

    def _after(self, missed: Mapping[str | None, float]) -> Floats:
        factors = [*(missed.get(piece.name, 1.0) for piece in self.pieces), 1.0]
        return np.asarray(self.rates * factors)


def kind_of(obj: SeenObject) -> Receptacle | None:
    """Return the kind of furniture of an object, by its word or by what the class map reads."""
    return find_receptacle(obj.raw_category) or (
        find_receptacle(obj.category) if obj.category else None
    )


@dataclass(frozen=True, eq=False)
class SeenPieces:
    """The furniture that was seen in a room, whatever is sought there.

    Attributes:
        pieces: that are probably there.
        kinds: of these.
        on: id of an object → that of the piece on which it is. A mug on a tray on a table is on the
            table; what is on no piece that was seen is left out.
        is_furnished: whether any furniture was seen, however doubted.
    """

    pieces: tuple[SeenObject, ...]
    kinds: tuple[Receptacle, ...]
    on: Mapping[str, str]
    is_furnished: bool


def find_pieces(objects: Iterable[SeenObject]) -> SeenPieces:
    """Return the furniture among the objects of a room, and what is on it."""
    by_name = {obj.name: obj for obj in objects}
    furniture = [(obj, kind) for obj in by_name.values() if (kind := kind_of(obj))]
    known = [(obj, kind) for obj, kind in furniture if obj.is_evidence]
    pieces, kinds = tuple(obj for obj, _ in known), tuple(kind for _, kind in known)
    return SeenPieces(pieces, kinds, _find_supports(by_name, pieces), bool(furniture))


def _find_supports(
    by_name: Mapping[str, SeenObject], pieces: Iterable[SeenObject]
) -> dict[str, str]:
    """Return the id of an object → that of the piece on which it is; each is followed once."""
    names = {piece.name for piece in pieces}
    found: dict[str, str | None] = {}  # None of what is on no piece
    for first in by_name:
        path, below = [], first
        while below in by_name and below not in found:
            found[below] = None
            path.append(below)
            below = by_name[below].on or ""
            if below in names:
                break
        piece = below if path and below in names else found.get(below)
        found |= dict.fromkeys(path, piece)
    return {name: piece for name, piece in found.items() if piece is not None}


def furnish(
    thing: str,
    room: KnownRoom,
    seen: SeenPieces,
    *,
    classes: tuple[str, ...],
    unseen: Floats,
    tidy: float = TIDY,
    kinds: Labels | None = None,
) -> Furniture | None:
    """Return where in a room a thing may be; None if it stands by itself, as a wardrobe does.

    Args:
        thing: any word.
        room: where it may be.
        seen: the furniture of the room (`find_pieces`).
        classes: C names.
        unseen: `[C]` P(the room has an unseen object of each class).
        tidy: share of things that lie where they belong, 0 to 1.
        kinds: that the room may be of, with their probabilities; None for its own type.
    """
    keeping = find_keeping(thing)
    if keeping is not None and not keeping.weights:
        return None
    room_kinds = tuple(weigh_labels(room.room_type).items()) if kinds is None else kinds
    times = Counter(seen.kinds)
    each = {k: _rate(k, thing, room_kinds, tidy, room.hidden_share) / n for k, n in times.items()}
    more = [
        float(unseen[row]) * rate / (1 + times.get(kind, 0))
        for row, kind, rate in _furniture_of(classes, thing, room_kinds, tidy)
    ]
    left = _OVERLOOKED if room.visited and seen.pieces else 1.0
    rates = [each[kind] for kind in seen.kinds]
    return Furniture(seen.pieces, np.array([*rates, left * sum(more)]))


@lru_cache(maxsize=4096)  # rooms of a kind are furnished alike
def _rate(kind: Receptacle, thing: str, room: Labels, tidy: float, hidden: float) -> float:
    """Return the rate of all pieces of a kind together: of that people were asked."""
    rates, keeping = _weigh_pieces(room, tidy)[[*kind.like]], find_keeping(thing)
    if keeping is not None:
        own = keeping.weigh(kind)
        names = (read_shares().pieces[number] for number in kind.like)
        weights = np.array(
            [keeping.weights.get(name, 0.0) if own is None else own for name in names]
        )
        rates = rates * (weights + (_ELSEWHERE if kind.only else _EVERYWHERE)) ** _KEEPING
    return float(rates.mean()) * (1 - _IN_SIGHT * (1 - kind.closed) * (1 - hidden))


@lru_cache(maxsize=64)
def _weigh_pieces(room: Labels, tidy: float) -> Floats:
    """Return the shares of people for each listed piece in a room of these labels.

    Of a room that is like none of those that people were asked about, the mean of all.
    """
    shares, table = read_shares(), read_table("kinds-v1.csv")
    labels, alike = shares.rooms, dict(zip(table["kind"], table["furnished_like"], strict=True))
    weights = np.zeros(len(labels))
    for label, likely in room:
        known = known_label(label)
        near = (label, alike.get(label), known, alike.get(known))
        asked = next((name for name in near if name in labels), None)
        if asked is not None:
            weights[labels.index(asked)] += likely
    weights = weights / weights.sum() if weights.any() else np.full(len(labels), 1 / len(labels))
    return np.asarray(weights @ (tidy * shares.belongs + (1 - tidy) * shares.untidy))


@lru_cache(maxsize=1024)
def _furniture_of(
    classes: tuple[str, ...], thing: str, room: Labels, tidy: float
) -> tuple[tuple[int, Receptacle, float], ...]:
    """Return the classes that are furniture, by their numbers, with their rates if not seen yet."""
    found = ((row, find_receptacle(name)) for row, name in enumerate(classes))
    return tuple((n, kind, _rate(kind, thing, room, tidy, 1.0)) for n, kind in found if kind)


def find_pieces_of(
    graph: PartialGraph, presence: Floats, kinds: Sequence[Labels] = ()
) -> Callable[[int, int], str | None]:
    """Return room, class → id of the piece where such a thing is likelier than at any not seen yet.

    Args:
        graph: with R rooms.
        presence: P(a room has a hidden object of a class), `[1 + R, C]`.
        kinds: `[R]` that rooms may be of, with their probabilities; none for their own types.
    """
    classes = graph.class_space.classes
    objects: dict[int, list[SeenObject]] = {}
    for obj in graph.objects:
        objects.setdefault(obj.room_index, []).append(obj)

    @cache
    def seen(room: int) -> SeenPieces:
        return find_pieces(objects.get(room, ()))

    @cache
    def find(room: int, index: int) -> str | None:
        known = furnish(
            classes[index],
            graph.rooms[room - 1],
            seen(room),
            classes=classes,
            unseen=presence[room],
            kinds=kinds[room - 1] if kinds else None,
        )
        if known is None or not known.pieces:
            return None
        best = int(known.rates[:-1].argmax())
        return known.pieces[best].name if known.rates[best] >= known.rates[-1] else None

    return find
