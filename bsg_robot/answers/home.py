"""What one home has taught a robot: its things, what people say of them, and the habits of both."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.words.normal import normalise_name
from bsg_models.belief.clock import show_time
from bsg_models.belief.partial_graph import Custom, PartialGraph, Remembered, SeenObject, Sighting
from bsg_robot.answers.dictionary import Dictionary
from bsg_robot.answers.habits import (
    AGAIN,
    ALIKE,
    EXISTS,
    KEPT,
    NEVER,
    OTHERS,
    PRIOR,
    SEEN_THERE,
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
from bsg_robot.things.pieces import SeenPieces
from bsg_robot.things.things import find_group, find_receptacle, keeps_together, uses_up

_REAL = 0.5  # P of other things that tell something
_MOST_ALIKE = 20  # things of a kind of which each has habits of its own
_MOST_PLACES = 20  # of an answer
_ITSELF, _ITS_GROUP = 2, 1  # ranks of what people say of a thing


@dataclass(frozen=True, eq=False)
class Track:
    """One thing of this home, with all that is known of where it was.

    Attributes:
        name: its id.
        word: for it.
        sightings: all that are remembered, and the last.
        real: P(there is such a thing): its detector may have erred.
        stayed: P(it is where it was seen last), before looks.
        moved: P(it is elsewhere in this home).
    """

    name: str
    word: str
    sightings: tuple[Sighting, ...]
    real: float
    stayed: float
    moved: float


@dataclass(frozen=True)
class _Advice:
    """What people say of where a thing is: weights of places, and what is left of the prior."""

    weights: Places
    left: Places
    is_own: bool  # whether they say it of the thing itself, not of its group or kin


class Home:
    """What is known of the habits of a home."""

    def __init__(
        self,
        graph: PartialGraph,
        still: Mapping[str, tuple[float, float]],
        words: Dictionary,
        *,
        pieces: Callable[[int], SeenPieces],
    ) -> None:
        """Begin with nothing learned.

        Args:
            graph: as the robot reported it.
            still: object → P(it was there when it was seen), P(it still is), before looks.
            words: what words mean.
            pieces: node → its furniture.
        """
        self._graph, self._still, self._words, self._pieces = graph, still, words, pieces
        self._nodes = range(1, 1 + len(graph.rooms))

    @cached_property
    def _tracks(self) -> tuple[Track, ...]:
        """The things of which it is known when they were seen."""
        before = {track.name: track for track in self._graph.memory}
        known = [self._follow(obj, before.pop(obj.name, None)) for obj in self._graph.objects]
        gone = [self._seek(track) for track in before.values()]
        return tuple(track for track in (*known, *gone) if track is not None)

    def _follow(self, obj: SeenObject, before: Remembered | None) -> Track | None:
        """Return the track of an object; None if nobody says when it was seen."""
        if obj.time is None and before is None:
            return None
        last = [] if obj.time is None else [Sighting(obj.time, obj.room_index, obj.on)]
        sightings = self._place([*(before.sightings if before else ()), *last])
        seen, stayed = self._still[obj.name]
        # A sighting that was wrong is of no object that may be elsewhere.
        real = max(seen, _believe(before) if before else 0.0)
        moved = EXISTS * (real - stayed)
        return Track(obj.name, obj.raw_category, sightings, real, stayed, moved)

    def _seek(self, gone: Remembered) -> Track:
        """Return the track of a thing of which nobody knows where it is; food is used up."""
        groups = self._words.groups(self._words.look_up(gone.raw_category))
        real = _believe(gone)
        moved = 0.0 if any(map(uses_up, groups)) else EXISTS * real
        sightings = self._place(gone.sightings)
        return Track(gone.name, gone.raw_category, sightings, real, 0.0, moved)

    def _place(self, sightings: Iterable[Sighting]) -> tuple[Sighting, ...]:
        """Return sightings with the piece of furniture on which all that lies: a tray's table.

        Furniture that was moved takes its habits along; what is gone leaves them to its room.
        """
        placed = []
        for seen in sightings:
            node = self._rooms.get(seen.on or "")
            if seen.on is None or node is None:
                placed.append(seen._replace(on=None))
            else:
                piece = self._pieces(node).on.get(seen.on, seen.on)
                placed.append(Sighting(seen.time, node, piece))
        return tuple(placed)

    @cached_property
    def _rooms(self) -> Mapping[str, int]:
        """Id of an object → its room."""
        return {obj.name: obj.room_index for obj in self._graph.objects}

    def _tracks_of(self, meaning: Meaning) -> list[Track]:
        """Return the tracks of things of a meaning, the latest first."""
        tracks = self._select(self._words.names(meaning))
        return sorted(tracks, key=lambda track: -track.sightings[-1].time)

    def _select(self, is_such: Callable[[str], bool]) -> list[Track]:
        return [track for word, some in self._by_word.items() if is_such(word) for track in some]

    @cached_property
    def _by_word(self) -> Mapping[str, list[Track]]:
        found = defaultdict(list)
        for track in self._tracks:
            found[track.word].append(track)
        return found

    def learn(self, meaning: Meaning, prior: Floats, unseen: Floats) -> Usual | None:
        """Return where such things usually are; None if this home has taught nothing of them.

        Args:
            meaning: of the things.
            prior: `[N]` expected number of unseen ones, without this home.
            unseen: `[N]` P(one that is at a node was not seen there).
        """
        own = self._tracks_of(meaning)
        kin, advice = self._weigh_kin(meaning, own), self._hear(meaning)
        if not (own or kin or advice.weights or advice.left):
            return None
        pieces = [1 + len(self._pieces(node).pieces) for node in range(1, len(prior))]
        usual = Usual(prior, advice.left, unseen, np.array([0, *pieces]))
        now = self._graph.now or 0.0
        each = {
            track.name: leave(weigh_sightings(track.sightings, now), advice.left, least=SEEN_THERE)
            for track in own
        }
        # What may be an error tells little of others.
        every = join(*((each[track.name], track.real**2) for track in own))
        others = leave(join((kin, 1.0), (advice.weights, 1.0)), advice.left)
        # What is sure, and what is in no room, is counted as seen.
        moved = [track for track in own if track.stayed < 1 and track.sightings[-1].room_index]
        for track in moved[:_MOST_ALIKE]:
            weights = join((every, ALIKE), (each[track.name], 1 - ALIKE), (others, 1.0))
            usual.add(
                track.moved, weights, name=track.name, last=track.sightings[-1], stayed=track.stayed
            )
        more = sum(track.moved for track in moved[_MOST_ALIKE:])
        usual.add_others(more, join((every, ALIKE), (others, 1.0)))
        left = [track for track in own if track.stayed or track.moved]  # all but what was used up
        unknown = prior * self._expect_others(left, len(prior))
        if meaning.is_class and not advice.weights:  # models count the others where they saw none
            usual.add_counted(unknown)
            return usual
        part = 1.0 if meaning.is_class else self._expect_second(left, advice)
        usual.add_others(part * float(unknown[1:].sum()), join((every, 1.0), (others, 1.0)))
        if advice.is_own and not left and not self._knows(meaning):
            usual.add_others(KEPT, others)
        return usual

    def _expect_second(self, own: Sequence[Track], advice: _Advice) -> float:
        """Return the share of a home's number of a thing that is left, if it has one already."""
        real = 1 - float(np.prod([1 - track.real for track in own]))
        return 1 - (1 - OTHERS) * max(real, float(advice.is_own))

    def _knows(self, meaning: Meaning) -> bool:
        """Return whether such a thing is known, whenever it was seen."""
        names = self._words.names(meaning)
        return any(map(names, {obj.raw_category for obj in self._graph.objects}))

    def _expect_others(self, own: Sequence[Track], nodes: int) -> Floats:
        """Return the share of unseen others that is left at each node, `[N]`.

        Who sees the same chairs again and again has seen all, in the rooms where he was.
        """
        again = sum(track.real * (len(track.sightings) - 1) for track in own)
        left = np.ones(nodes)
        for node, room in enumerate(self._graph.rooms, 1):
            left[node] = AGAIN / (AGAIN + again) if room.visited else 1.0
        return left

    def list_habits(self, meaning: Meaning) -> tuple[Habit, ...]:
        """Return the places that such things have in this home, the likeliest first."""
        own = self._tracks_of(meaning)
        advice, now = self._hear(meaning), self._graph.now or 0.0
        seen = [sight for one in own for sight in one.sightings]
        others = join((self._weigh_kin(meaning, own), 1.0), (advice.weights, 1.0))
        weights = join(
            (leave(weigh_sightings(seen, now), advice.left, least=SEEN_THERE), 1.0),
            (leave(others, advice.left), 1.0),
            ({(0, None): PRIOR}, 1.0),
        )
        if len(weights) == 1:
            return ()  # nothing but what is known of all homes
        total, rooms = sum(weights.values()), [None, *(room.name for room in self._graph.rooms)]
        times = Counter(sight[1:] for sight in seen)
        last = {sight[1:]: sight.time for sight in sorted(seen, key=lambda one: one.time)}
        habits = [
            Habit(
                rooms[place[0]],
                place[1],
                weight / total,
                times[place],
                show_time(last.get(place)),
                place in advice.weights,
            )
            for place, weight in weights.items()
        ]
        *places, anywhere = sorted(habits, key=lambda one: (one.room is None, -one.share))
        shown, unlisted = places[:_MOST_PLACES], [*places[_MOST_PLACES:], anywhere]
        share = sum(one.share for one in unlisted)
        number = sum(one.sightings for one in unlisted)
        return (*shown, replace(anywhere, share=share, sightings=number))

    def _weigh_kin(self, meaning: Meaning, own: Sequence[Track]) -> Places:
        """Return the weights of places of other things of the groups that are kept together."""
        groups = self._kept_with(meaning)
        names = {track.name for track in own}
        kin = self._select(lambda word: bool(groups & self._kept_with(self._words.look_up(word))))
        return weigh_kin(
            track.sightings for track in kin if track.name not in names and track.real >= _REAL
        )

    def _kept_with(self, meaning: Meaning | None) -> frozenset[str]:
        return frozenset(filter(keeps_together, self._words.groups(meaning)))

    def _hear(self, meaning: Meaning) -> _Advice:
        """Return what people say of a thing; what they say of its group or kin counts after it."""
        customs = [(self._rank(custom, meaning), custom) for custom in self._graph.customs]
        best = max((rank for rank, custom in customs if not custom.never), default=0.0)
        positive: list[tuple[Places, float]] = []
        left: dict[tuple[int, str | None], float] = {}
        for rank, custom in customs:
            if custom.never and rank >= max(best, _ITS_GROUP):
                left |= dict.fromkeys(self._places_of(custom), NEVER)
            elif not custom.never and rank == best > 0 and (places := self._places_of(custom)):
                positive.append((dict.fromkeys(places, TOLD / len(places)), min(1.0, rank)))
        return _Advice(join(*positive), left, best == _ITSELF)

    def _rank(self, custom: Custom, meaning: Meaning) -> float:
        """Return how much a custom says: 2 of the thing, 1 of its group, less of its kin."""
        named = find_group(custom.thing)
        if named is not None:
            return _ITS_GROUP if named in self._words.groups(meaning) else 0.0
        known = self._words.look_up(custom.thing)
        if known is not None and self._words.names(known)(meaning.word):
            others = known.owner and meaning.owner and known.owner != meaning.owner
            return 0.0 if others else _ITSELF
        is_kin = bool(self._kept_with(known) & self._kept_with(meaning))
        return TOLD_KIN if is_kin and not custom.never else 0.0

    def _places_of(self, custom: Custom) -> list[tuple[int, str | None]]:
        """Return the places that a custom names: pieces of a word, in its room or in any."""
        if custom.at is None:
            nodes = self._nodes if custom.room_index is None else [custom.room_index]
            return [(node, None) for node in nodes]
        found = self.find_pieces(custom, custom.at)
        if found or custom.never or custom.room_index is None:
            return found
        return [(custom.room_index, None)]

    def find_pieces(self, custom: Custom, at: str) -> list[tuple[int, str | None]]:
        """Return the pieces of furniture that a custom may mean: of an id, a word, or a kind."""
        for called in (("id", at), normalise_name(at), find_receptacle(at)):
            places = self._called.get(called, ())
            if found := [place for place in places if custom.room_index in (None, place[0])]:
                return found
        return []

    @cached_property
    def _called(self) -> Mapping[object, list[tuple[int, str | None]]]:
        """The places of the furniture of an id, a word, or a kind."""
        called: dict[object, list[tuple[int, str | None]]] = defaultdict(list)
        for node in self._nodes:
            seen = self._pieces(node)
            for piece, kind in zip(seen.pieces, seen.kinds, strict=True):
                for name in (("id", piece.name), normalise_name(piece.raw_category), kind):
                    called[name].append((node, piece.name))
        return called


def _believe(known: Remembered) -> float:
    return 1.0 if known.score is None else known.score
