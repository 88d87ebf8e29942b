"""What one home has taught a robot: its things, what people say of them, and the habits of both."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from bsg_data.arrays import Floats
from bsg_data.words.normal import normalise_name
from bsg_models.belief.clock import show_time
from bsg_models.belief.partial_graph import Custom, PartialGraph, Sighting
from bsg_robot.answers.dictionary import Dictionary
from bsg_robot.answers.habits import (
    ALIKE,
    EXISTS,
    KEPT,
    NEVER,
    OTHERS,
    PRIOR,
    TOLD,
    TOLD_KIN,
    Places,
    Usual,
    join,
    leave,
    weigh_kin,
    weigh_sightings,
)
from bsg_robot.answers.place import Habit
from bsg_robot.answers.words import Meaning
from bsg_robot.things.pieces import SeenPieces, kind_of
from bsg_robot.things.things import find_group, find_receptacle, keeps_together

_MOST_PLACES = 20  # of an answer
_ITSELF, _ITS_GROUP = 2, 1  # ranks of what people say of a thing


@dataclass(frozen=True, eq=False)
class Track:
    """One thing of this home, with all that is known of where it was.

    Attributes:
        name: its id.
        word: for it.
        sightings: all that are remembered, and the last.
        there: P(it is where it was seen last), before looks.
        moved: P(it is elsewhere in this home).
    """

    name: str
    word: str
    sightings: tuple[Sighting, ...]
    there: float
    moved: float


@dataclass(frozen=True)
class _Told:
    """What people say of where a thing is: weights of places, and what is left of the prior."""

    weights: Places
    left: Places
    is_own: bool  # whether they say it of the thing itself, not of its group or kin


class Home:
    """What is known of the habits of a home.

    Args of `__init__`:
        said: the graph as the robot said it.
        still: object → P(it is where it was seen), before looks.
        words: what words mean.
        pieces: node → its furniture.
    """

    def __init__(
        self,
        said: PartialGraph,
        still: Mapping[str, float],
        words: Dictionary,
        *,
        pieces: Callable[[int], SeenPieces],
    ) -> None:
        self._said, self._still, self._words, self._pieces = said, still, words, pieces
        self._nodes = range(1, 1 + len(said.rooms))

    @property
    def teaches(self) -> bool:
        """Whether there is anything to learn from."""
        return self._said.now is not None or bool(self._said.customs)

    @cached_property
    def tracks(self) -> tuple[Track, ...]:
        """The things of which it is known when they were seen."""
        before = {one.name: one for one in self._said.memory}
        tracks = []
        for obj in self._said.objects:
            known = before.pop(obj.name, None)
            if obj.time is None and known is None:
                continue
            last = [] if obj.time is None else [Sighting(obj.time, obj.room_index, obj.on)]
            sightings = self._place([*(known.sightings if known else ()), *last])
            still = self._still[obj.name]
            # A sighting that was wrong is of no object that may be elsewhere.
            moved = EXISTS * (obj.probability - still)
            tracks.append(Track(obj.name, obj.raw_category, sightings, still, moved))
        gone = (
            Track(one.name, one.raw_category, self._place(one.sightings), 0.0, EXISTS)
            for one in before.values()
        )
        return (*tracks, *gone)

    def _place(self, sightings: Iterable[Sighting]) -> tuple[Sighting, ...]:
        """Return sightings with the piece of furniture on which all that lies: a tray's table."""
        return tuple(
            one._replace(on=self._pieces(one.room_index).on.get(one.on, one.on) if one.on else None)
            for one in sightings
        )

    def tracks_of(self, meaning: Meaning) -> list[Track]:
        """Return the tracks of things of a meaning."""
        return self._select(self._words.names(meaning))

    def _select(self, is_such: Callable[[str], bool]) -> list[Track]:
        words = {word for word in {one.word for one in self.tracks} if is_such(word)}
        return [one for one in self.tracks if one.word in words]

    def learn(self, meaning: Meaning, prior: Floats, unseen: Floats) -> Usual | None:
        """Return where such things usually are; None if this home has taught nothing of them.

        Args:
            meaning: of the things.
            prior: `[N]` expected number of unseen ones, without this home.
            unseen: `[N]` P(one that is at a node was not seen there).
        """
        own = self.tracks_of(meaning)
        kin, told = self._weigh_kin(meaning, own), self._hear(meaning)
        if not (own or kin or told.weights or told.left):
            return None
        usual, now = Usual(prior, told.left, unseen), self._said.now or 0.0
        each = {one.name: weigh_sightings(one.sightings, now) for one in own}
        every = join(*((places, 1.0) for places in each.values()))
        others = leave(join((kin, 1.0), (told.weights, 1.0)), told.left)
        for one in own:
            if one.there == 1:  # nobody doubts it, and it is counted as seen
                continue
            weights = join((every, ALIKE), (each[one.name], 1 - ALIKE), (others, 1.0))
            usual.add(one.moved, weights, name=one.name, last=one.sightings[-1], there=one.there)
        number = float(prior[1:].sum())
        if meaning.is_class:  # models count the others where they saw none
            usual.add_others(number, leave(told.weights, told.left))
        else:
            part = OTHERS if own or told.is_own else 1.0
            usual.add_others(part * number, join((every, 1.0), (others, 1.0)))
        if told.is_own and not own:
            usual.add_others(KEPT, others)
        return usual

    def list_habits(self, meaning: Meaning) -> tuple[Habit, ...]:
        """Return the places that such things have in this home, the likeliest first."""
        own = self.tracks_of(meaning)
        told, now = self._hear(meaning), self._said.now or 0.0
        seen = [sight for one in own for sight in one.sightings]
        others = join((self._weigh_kin(meaning, own), 1.0), (told.weights, 1.0))
        weights = join(
            (weigh_sightings(seen, now), 1.0),
            (leave(others, told.left), 1.0),
            ({(0, None): PRIOR}, 1.0),
        )
        if len(weights) == 1:
            return ()  # nothing but what is known of all homes
        total, rooms = sum(weights.values()), [None, *(room.name for room in self._said.rooms)]
        at: dict[tuple[int, str | None], list[float]] = defaultdict(list)
        for sight in seen:
            at[sight.room_index, sight.on].append(sight.time)
        habits = []
        for (node, piece), weight in weights.items():
            times = at[node, piece]
            last = show_time(max(times, default=None))
            is_told = (node, piece) in told.weights
            habits.append(Habit(rooms[node], piece, weight / total, len(times), last, is_told))
        *places, anywhere = sorted(habits, key=lambda one: (one.room is None, -one.share))
        return (*places[:_MOST_PLACES], anywhere)

    def _weigh_kin(self, meaning: Meaning, own: Sequence[Track]) -> Places:
        """Return the weights of places of other things of the groups that are kept together."""
        groups = self._kept_with(meaning)
        names = {one.name for one in own}
        kin = self._select(lambda word: bool(groups & self._kept_with(self._words.look_up(word))))
        seen = (sight for one in kin if one.name not in names for sight in one.sightings)
        return weigh_kin(Counter((one.room_index, one.on) for one in seen))

    def _kept_with(self, meaning: Meaning | None) -> frozenset[str]:
        return frozenset(filter(keeps_together, self._words.groups(meaning)))

    def _hear(self, meaning: Meaning) -> _Told:
        """Return what people say of a thing; what they say of its group or kin counts after it."""
        customs = [(self._rank(one, meaning), one) for one in self._said.customs]
        best = max((rank for rank, one in customs if not one.never), default=0.0)
        weights: list[tuple[Places, float]] = []
        left: dict[tuple[int, str | None], float] = {}
        for rank, one in customs:
            places = self._places_of(one) if rank else []
            if one.never and rank >= max(best, _ITS_GROUP):
                left |= dict.fromkeys(places, NEVER)
            elif places and not one.never and rank == best > 0:
                weights.append((dict.fromkeys(places, 1 / len(places)), min(1.0, rank) * TOLD))
        return _Told(join(*weights), left, best == _ITSELF)

    def _rank(self, custom: Custom, meaning: Meaning) -> float:
        """Return how much a custom says: 2 of the thing, 1 of its group, less of its kin."""
        named = find_group(custom.thing)
        if named is not None:
            return _ITS_GROUP if named in self._words.groups(meaning) else 0.0
        known = self._words.look_up(custom.thing)
        if known is not None and self._words.names(known)(meaning.word):
            return _ITSELF
        is_kin = bool(self._kept_with(known) & self._kept_with(meaning))
        return TOLD_KIN if is_kin and not custom.never else 0.0

    def _places_of(self, custom: Custom) -> list[tuple[int, str | None]]:
        """Return the places that a custom names: pieces of a word, in its room or in any."""
        found = [] if custom.at is None else self.find_pieces(custom, custom.at)
        if custom.at is None or (custom.room_index and not found):
            return [(node, None) for node in self._nodes_of(custom)]
        return found

    def _nodes_of(self, custom: Custom) -> Sequence[int]:
        return self._nodes if custom.room_index is None else [custom.room_index]

    def find_pieces(self, custom: Custom, at: str) -> list[tuple[int, str | None]]:
        """Return the pieces of furniture that a custom may mean."""
        nodes = self._nodes_of(custom)
        keys = at, normalise_name(at), find_receptacle(at)
        for places, key in zip(self._furniture, keys, strict=True):
            if found := [place for place in places.get(key, ()) if place[0] in nodes]:
                return found
        return []

    @cached_property
    def _furniture(self) -> tuple[Mapping[object, list[tuple[int, str | None]]], ...]:
        """Id, word and kind → the pieces of furniture."""
        by_name: dict[object, list[tuple[int, str | None]]] = defaultdict(list)
        by_word, by_kind = by_name.copy(), by_name.copy()
        for node in self._nodes:
            for piece in self._pieces(node).pieces:
                place = node, piece.name
                by_name[piece.name].append(place)
                by_word[normalise_name(piece.raw_category)].append(place)
                by_kind[kind_of(piece)].append(place)
        by_kind.pop(None, None)
        return by_name, by_word, by_kind
