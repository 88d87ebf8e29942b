"""What is believed of a building, by all that a robot has said of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from bsg_data.arrays import Floats
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_robot.answers.destinations import Spot, is_there, leave_rest, list_spots
from bsg_robot.answers.dictionary import Dictionary
from bsg_robot.answers.evidence import (
    TRUSTED,
    Chances,
    missed_by,
    remember_stays,
    sum_looks,
    weigh_evidence,
)
from bsg_robot.answers.kind_table import read_kinds
from bsg_robot.answers.kinds import RoomKinds, infer_kinds
from bsg_robot.answers.nouns import read_nouns
from bsg_robot.answers.place import NOT_SEEN, Piece
from bsg_robot.answers.thing_belief import (
    SHARE_OF_KIND,
    ThingBelief,
    after_looks,
    believe_kind,
    believe_noun,
    believe_rates,
    believe_usual,
    count_rooms,
    lift,
)
from bsg_robot.answers.unknown_rooms import Apart, expect_apart, log_odds
from bsg_robot.answers.usual_places import (
    IN_SIGHT,
    OF_HOMES,
    Things,
    find_things,
    hide,
    rate_things,
)
from bsg_robot.answers.words import Asked, Meaning, require_word
from bsg_robot.graph import reports
from bsg_robot.graph.reports import reclassify
from bsg_robot.things.pieces import TIDY, Furniture, SeenPieces, find_pieces, furnish
from bsg_robot.things.things import Thing, find_thing, list_narrower

if TYPE_CHECKING:
    from bsg_robot.answers.habits import Usual
    from bsg_robot.answers.home import Home

_SURELY = 1 - 1e-9
_SLOW = 43_800.0  # hours after which half of the furniture is elsewhere
_TINY = 1e-12  # a smaller number is not divided by
_LEAST = 0.05  # hidden share of a room that was searched some time ago, as models read it
_MOST_SOUGHT = 32  # things of which the belief is remembered
# Buildings of HM3D's train split (145) by their number of rooms, from 0 on.
# fmt: off
_BUILDINGS = (
    0, 0, 0, 0, 2, 0, 4, 2, 10, 11, 6, 14, 14, 16, 11, 9, 6, 4, 5, 7, 2, 5, 2, 4, 2, 2, 2, 2, 1, 0,
    1, 0, 1,
)
# fmt: on


@dataclass(frozen=True, eq=False)
class Sought:
    """A thing that is sought."""

    meaning: Meaning
    belief: ThingBelief
    looks: Mapping[int, Chances]  # for it, by node


class Posterior:
    """What is believed of a building after all that a robot has said; nothing of it changes.

    Attributes:
        reported: the graph as the robot said it.
        graph: the same without what looks exclude, and with the rooms that are not found yet.
        misses: looks that missed, of which the thing is known.
        kinds: those of the rooms of `graph`.
        nodes: number of the building, its rooms, and those that are not found yet.
    """

    def __init__(
        self, reported: PartialGraph, words: Dictionary, *, before: Posterior | None = None
    ) -> None:
        """Weigh the looks; what was believed `before` stays if no evidence of models differs."""
        self.reported, self._words = reported, words
        self.misses, left = weigh_evidence(reported, words)
        # Models count the objects of a room, wherever they are there, and whoever they are.
        seen = [
            (obj.room_index, obj.raw_category, obj.category, obj.class_index)
            for obj in left.objects
            if obj.is_evidence
        ]
        aged = _age(left)
        layout = replace(aged, looks=(), objects=(), memory=(), customs=(), now=None)
        self._evidence = layout, layout.more_rooms is True, Counter(seen)  # True is not 1
        self._asked: dict[Asked, Apart] = {}
        self._found: dict[tuple[int, ...], CountDistribution] = {}  # by columns
        self._pieces: dict[int, SeenPieces] = {}
        self.kinds: RoomKinds
        if before is not None and before._evidence == self._evidence:
            self._asked, self._found = before._asked, before._found
            self.kinds = before.kinds
        else:
            found = infer_kinds(left, read_kinds())
            self.kinds = found.with_unknown(_count_undiscovered(left, found))
        more = len(self.kinds.rooms) - len(left.rooms)
        self.graph = _add_undiscovered(left, more)
        self.nodes = 1 + len(self.graph.rooms)
        self._aged = self.graph if aged is left else _add_undiscovered(aged, more)
        self._objects: list[list[SeenObject]] = [[] for _ in range(self.nodes)]
        for obj in self.graph.objects:
            self._objects[obj.room_index].append(obj)
        self._sought: dict[str, Sought] = {}
        self._usual: dict[str, Usual | None] = {}

    def _ask(self, asked: Asked) -> Apart:
        """Return what a model believes, of known rooms and of the others."""
        if asked not in self._asked:
            graph = self._aged
            if asked != Asked.OWN:
                graph = reclassify(graph, self._words.class_map(asked))
            self._asked[asked] = expect_apart(graph, self.kinds.known, self._words.model(asked))
        return self._asked[asked]

    def _find(self, *columns: int) -> CountDistribution:
        """Return what a person would find of A classes, by the model and the table, `[N, A]`."""
        if columns not in self._found:
            asked = self._ask(Asked.OWN).take_classes(np.array(columns))
            classes = find_things(tuple(self._words.own.classes[column] for column in columns))
            rates = rate_things(classes.things, self.kinds, self._aged)
            own, parts = rates[: len(classes.own)], rates[len(classes.own) :]
            least, homes = np.zeros((2, self.nodes, len(columns)))
            homes[:, classes.own] = own.T
            parts[classes.in_sight, 1:] *= self.kinds.strange
            parts[:, 0] = parts[:, 1:].sum(axis=1)
            np.maximum.at(least.T, classes.whole, -np.expm1(-parts))
            weight = np.zeros(len(columns))
            is_new = asked.every.inputs.sum(axis=0) == 0  # few know how many have a second
            weight[classes.own] = OF_HOMES * is_new[classes.own]
            self._found[columns] = lift(asked, homes, weight=weight, least=least)
        return self._grow_old(self._found[columns], columns)

    def _grow_old(self, hidden: CountDistribution, columns: tuple[int, ...]) -> CountDistribution:
        """Return hidden counts of which rooms have more, of what moves, than when they were seen.

        An object is unseen in proportion to the share of its kind that is.
        """
        if self._aged is self.graph:
            return hidden
        classes = [self._words.own.classes[column] for column in columns]
        stays = np.array([self._words.stays(self._words.look_up(name)) for name in classes])
        still = self.graph.still_so(stays)
        then = np.array([room.hidden_share for room in self._aged.rooms])
        now = 1 - (1 - np.array([room.hidden_share for room in self.graph.rooms])) * still
        more = now / then.clip(min=_LEAST)
        none = np.log1p(-hidden.presence.clip(max=_SURELY))
        after = none.copy()
        after[1:] *= more.T
        after[0] += (after - none)[1:].sum(axis=0)
        odds = log_odds(np.exp(after)) - log_odds(np.exp(none))
        return hidden.with_none_likelier(np.where(hidden.presence > 0, odds, 0.0))

    @cached_property
    def _stayed(self) -> Callable[[SeenObject], float]:
        return remember_stays(self.reported, self._words)

    @cached_property
    def _counted(self) -> Expectation:
        found = self._find(*range(len(self._words.own.classes)))
        return replace(self._ask(Asked.OWN).every, hidden_counts=count_rooms(found))

    def expectation(self) -> Expectation:
        """Return what is believed of the nodes that the robot said, by the building's model."""
        belief, rooms = self._counted, np.arange(1 + len(self.reported.rooms))
        chances = np.zeros(belief.inputs.shape)
        words = {miss.meaning.word: miss.meaning for miss in self.misses}.values()
        own = {m.class_index: m for m in words if m.is_class}
        for index, meaning in own.items():
            chances[:, index] = 1 - self._overlook(meaning)
        if chances.any():
            belief = replace(belief, hidden_counts=after_looks(belief.hidden_counts, chances))
        # A doubted object is no evidence, and is one of those that were seen all the same.
        seen = self.reported.histograms().astype(np.float64)
        return replace(belief.take(rooms), inputs=seen)

    def seek(self, word: str) -> Sought:
        """Return what is known of a thing; a question asks several times."""
        require_word(word)
        found = self._sought.get(word)
        if found is None:
            meaning = self._words.understand(word)
            found = Sought(meaning, self._look_up(meaning), sum_looks(self.misses, meaning))
            if len(self._sought) >= _MOST_SOUGHT:
                self._sought.clear()
            self._sought[word] = found
        return found

    def _look_up(self, meaning: Meaning) -> ThingBelief:
        """Return what is believed of a thing, after looks and with what this home has taught."""
        hidden, none = self._expect_hidden(meaning)
        searched = np.array([True, *(self._hidden_now(meaning) == 0)])
        usual, new = self._find_usual(meaning, hidden), np.ones(self.nodes)
        if usual is not None:
            hidden, none = believe_usual(hidden, none, usual, is_class=meaning.is_class)
            searched &= usual.none == 1
            new = (1 - usual.new) / (1 - usual.none).clip(min=_TINY)
        seen = self._list_seen(meaning, usual.names if usual else ())
        return ThingBelief(seen, hidden, none, searched, new).after(1 - self._overlook(meaning))

    def _list_seen(
        self, meaning: Meaning, moved: Collection[str]
    ) -> tuple[tuple[SeenObject, ...], ...]:
        """Return the objects of each node that are such things.

        Of those that may have `moved`, it is one of their places, and counted there.
        """
        seen: list[list[SeenObject]] = [[] for _ in range(self.nodes)]
        is_sought = self._words.names(meaning)
        overlaps = self._words.judge != Asked.OWN  # mugs have a class, and are tableware, too
        for obj in self.graph.objects:
            is_own = meaning.is_class and obj.class_index == meaning.class_index
            may_be = not meaning.is_class or overlaps or obj.class_index is None
            if is_own or (may_be and is_sought(obj.raw_category)):
                seen[obj.room_index].append(replace(obj, score=0.0) if obj.name in moved else obj)
        return tuple(map(tuple, seen))

    def _hidden_now(self, meaning: Meaning) -> Floats:
        """Return the share of such things of each room that is not seen, `[R]`."""
        then = np.array([room.hidden_share for room in self.graph.rooms])
        return 1 - (1 - then) * self.graph.still_so(np.array(self._words.stays(meaning)))

    @property
    def is_taught(self) -> bool:
        """Whether there is anything that this home has taught."""
        return self.reported.now is not None or bool(self.reported.customs)

    @cached_property
    def home(self) -> Home:
        """What this home has taught."""
        from bsg_robot.answers.home import Home  # most homes have taught nothing

        after = {obj.name: obj.probability for obj in self.graph.objects}
        still = {}
        for obj in self.reported.objects:
            stayed = self._stayed(obj)
            is_doubted = obj.score is None and after.get(obj.name, 0.0) < stayed
            seen = TRUSTED if is_doubted else obj.probability
            still[obj.name] = seen, seen * stayed
        return Home(self.reported, still, self._words, pieces=self.pieces_of)

    def _find_usual(
        self, meaning: Meaning, hidden: CountDistribution | None = None
    ) -> Usual | None:
        """Return where such things usually are; None if this home has taught nothing of them.

        Their hidden counts without it may be given.
        """
        if not self.is_taught:
            return None
        if meaning.word not in self._usual:
            if len(self._usual) >= _MOST_SOUGHT:
                self._usual.clear()
            presence = (hidden or self._expect_hidden(meaning)[0]).presence[:, 0]
            prior = -np.log1p(-presence.clip(max=_SURELY))
            self._usual[meaning.word] = self.home.learn(meaning, prior, self._hide(meaning))
        return self._usual[meaning.word]

    def _hide(self, meaning: Meaning) -> Floats:
        """Return P(a thing that is at a node was not seen there), `[N]`.

        Who does not say when a room was seen says nothing of what moves.
        """
        thing = self._words.thing_of(meaning)
        if thing is None:
            hidden = self._hidden_now(meaning)
        else:
            hidden = hide(Things.of([thing], self.kinds.table), self.graph)[0]
        if self.reported.now is not None:
            is_dated = [room.time is not None for room in self.graph.rooms]
            hidden = np.where(is_dated, hidden, 1.0)
        return np.array([1.0, *hidden])

    def _expect_hidden(self, meaning: Meaning) -> tuple[CountDistribution, float]:
        """Return the hidden counts of a thing, and P(the building hides none)."""
        if meaning.thing is not None:
            rates = self._rate(meaning, meaning.thing)
            return believe_rates(rates, part=SHARE_OF_KIND if meaning.kind else 1.0)
        judged = counted = None
        if meaning.noun is not None:
            judged = believe_noun(meaning.noun, self._ask(self._words.judge).every, read_nouns())
        if meaning.class_index is not None:
            found = self._find(meaning.class_index)
            # The building is never less likely to hide one than its likeliest room.
            counted = found, float(1 - found.presence.max())
            if meaning.owner and meaning.owner in self.kinds.owners:  # which no model reads
                theirs = find_thing(str(meaning.class_name))
                if theirs is not None:
                    hidden, none = believe_rates(self._rate(meaning, theirs))
                    counted = hidden, max(none, counted[1])
        both = [counts for counts in (counted, judged) if counts is not None]
        return believe_kind(both[0][0], both[1][0]) if len(both) > 1 else both[0]

    def _rate(self, meaning: Meaning, thing: Thing) -> Floats:
        """Return the mean numbers of an everyday thing at every node, `[N]`."""
        parts = () if meaning.kind else list_narrower(thing)
        things = Things.of([thing, *parts], self.kinds.table)
        rates = rate_things(things, self.kinds, self.graph, owner=meaning.owner).max(axis=0)
        classes, whole = self._words.own.classes, thing.wider
        if whole in (None, *thing.names) or whole not in classes or thing.sight < IN_SIGHT:
            return np.asarray(rates)
        present = self._find(classes.index(whole)).presence[:, 0]
        return np.asarray(np.minimum(rates, -np.log1p(-present.clip(max=_SURELY))))

    def _overlook(self, meaning: Meaning) -> Floats:
        """Return P(all looks miss a thing that is in the room), `[N]`: at its pieces, too."""
        missed = np.ones(self.nodes)
        for node, chances in sum_looks(self.misses, meaning).items():
            some = missed_by(chances)
            missed[node] = some.pop(None, 1.0)
            if some and (furniture := self._furnish(meaning, node)) is not None:
                missed[node] *= furniture.overlooked(some)
        return missed

    def pieces_of(self, node: int) -> SeenPieces:
        """Return the furniture of a room."""
        if node not in self._pieces:
            self._pieces[node] = find_pieces(self._objects[node])
        return self._pieces[node]

    def _furnish(self, meaning: Meaning, node: int, tidy: float = TIDY) -> Furniture | None:
        """Return where in a room a thing may be; None if it stands by itself."""
        belief = self._ask(Asked.OWN).every
        room = self.graph.rooms[node - 1]
        if room.time is not None:
            room = replace(room, hidden_share=float(self._hidden_now(meaning)[node - 1]))
        found = furnish(
            meaning.kept_as,
            room,
            self.pieces_of(node),
            classes=self._words.own.classes,
            unseen=belief.presence[node],
            tidy=tidy,
            kinds=self.kinds.said[node - 1],
        )
        usual = self._find_usual(meaning)
        return found if usual is None else usual.furnish(found, node, self._objects[node])

    def list_pieces(self, sought: Sought, node: int, tidy: float) -> tuple[Piece, ...]:
        """Return the pieces of a room, the likeliest first; then any that was not seen yet."""
        pieces = [
            Piece(
                piece=spot.name,
                name=spot.piece.raw_category if spot.piece else NOT_SEEN,
                probability=spot.holds(float(sought.belief.unseen[spot.node])),
                if_there=spot.share,
                seen=spot.seen,
            )
            for spot in self._list_spots(sought, node, tidy)
        ]
        return tuple(sorted(pieces, key=lambda piece: (piece.piece is None, -piece.probability)))

    def list_places(self, sought: Sought) -> list[Spot]:
        """Return where to look in all rooms: their pieces, each followed by the rest."""
        places: list[Spot] = []
        for node, room in enumerate(self.graph.rooms, 1):
            spots = self._list_spots(sought, node)
            if not spots:
                looked = sought.looks.get(node, {}).get(None, ())
                seen = is_there(sought.belief.seen[node])
                spots = [Spot(node=node, sure=seen, looked=looked)]
            elif room.visited:
                spots = leave_rest(spots)
            places += spots
        return places

    def _list_spots(self, sought: Sought, node: int, tidy: float = TIDY) -> list[Spot]:
        """Return the pieces of a room where a thing may be, then its rest; none if it stands."""
        furniture = self._furnish(sought.meaning, node, tidy)
        if furniture is None:
            return []
        return list_spots(
            furniture,
            sought.belief.seen[node],
            node=node,
            on=self.pieces_of(node).on,
            looked=sought.looks.get(node, {}),
        )

    def keep_looks(self, graph: PartialGraph) -> PartialGraph:
        """Return a later graph in which looks at a piece that is gone are looks into its room.

        They have the chance that the piece had its share of.
        """
        room_of = {obj.name: obj.room_index for obj in graph.objects}
        left: dict[str, dict[str, float | None]] = {}  # a piece that is gone → scores in its room
        for look in graph.looks:
            meaning = self._words.look_up(look.thing)
            if look.at is None or room_of.get(look.at) == look.room_index or meaning is None:
                continue
            furniture = self._furnish(meaning, look.room_index)
            if furniture is not None and look.at in furniture.names:
                missed = 1 - furniture.overlooked({look.at: 1 - look.chance})
                stays = self._words.staying(graph.stays)
                moved = replace(look, at=None, chance=missed)
                graph = reports.look(graph, moved, stays=stays)
                scores = {obj.name: self._score(obj) for obj in self._objects[look.room_index]}
                left.setdefault(look.at, scores)
        if not left:
            return graph
        objects = tuple(
            replace(obj, score=left[obj.on].get(obj.name, 0.0)) if obj.on in left else obj
            for obj in graph.objects
        )
        return replace(graph, objects=objects)

    def _score(self, obj: SeenObject) -> float | None:
        """Return the score that looks leave of an object, without what time does."""
        return None if obj.score is None else min(1.0, obj.score / self._stayed(obj))


def _age(graph: PartialGraph) -> PartialGraph:
    """Return a graph as models read it: of rooms that were seen before, something is unseen."""
    now = graph.now
    if now is None or not any(room.time is not None and room.time < now for room in graph.rooms):
        return graph
    then = np.array([room.hidden_share for room in graph.rooms])
    still = replace(graph, stays=None).still_so(np.array(_SLOW))
    slow = (1 - (1 - then) * still).clip(min=_LEAST).tolist()
    rooms = tuple(
        replace(room, time=None)
        if room.time is None or room.time >= now
        else replace(
            room, hidden_share=share, hidden_share_sd=room.hidden_share_sd * stayed, time=None
        )
        for room, share, stayed in zip(graph.rooms, slow, still.tolist(), strict=True)
    )
    return reports.follow_rooms(graph, replace(graph, rooms=rooms))


def _count_undiscovered(graph: PartialGraph, kinds: RoomKinds) -> int:
    """Return how many rooms are not found yet.

    If the graph says only that there are more, it is the mean of the homes that have more rooms
    than were found, and at least 1. If it says nothing, and a home has rooms that are not among the
    known, the rooms of which nothing is known are some of them.
    """
    rooms, known = len(graph.rooms), int(kinds.known.sum())
    if graph.more_rooms is None:
        return max(0, known + _expect_more(known) - rooms) if kinds.lacks else 0
    return _expect_more(rooms) if graph.more_rooms is True else graph.more_rooms


def _expect_more(found: int) -> int:
    larger = [(rooms - found, homes) for rooms, homes in enumerate(_BUILDINGS) if rooms > found]
    homes = sum(number for _, number in larger)
    return max(1, round(sum(more * number for more, number in larger) / homes)) if homes else 1


def _add_undiscovered(graph: PartialGraph, more: int) -> PartialGraph:
    """Return the graph with the rooms that are not found yet, last, of which nothing is known."""
    for number in range(1, more + 1):
        unknown = KnownRoom(f"(not found yet: {number})", 1.0, visited=False)
        graph = reports.discover(graph, unknown)
    return graph
