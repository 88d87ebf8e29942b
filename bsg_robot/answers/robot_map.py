"""Keep a robot's map of one building, as the robot reports it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import replace
from datetime import datetime
from functools import partial, wraps
from itertools import count
from threading import RLock
from typing import Any, Concatenate, ParamSpec, TypeVar

from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounds import MAX_ROBOT_CUSTOMS
from bsg_data.records import read_number
from bsg_data.scene.room_label import RoomType, read_room_type
from bsg_data.words.nearest import ask_if_meant
from bsg_data.words.normal import normalise_name
from bsg_data.words.shown import SHOWN
from bsg_models.belief.clock import HOUR, read_now, read_time, show_time
from bsg_models.belief.hidden_share import ShareBelief, estimate_hidden_share
from bsg_models.belief.partial_graph import (
    LOOK_CHANCE,
    Custom,
    KnownRoom,
    Look,
    PartialGraph,
    SeenObject,
    check_more_rooms,
    check_report,
    spell_id,
)
from bsg_models.runs.found_model import DEFAULT_MODEL
from bsg_models.runs.predictor import Predictor
from bsg_robot.answers.dictionary import Dictionary
from bsg_robot.answers.evidence import weigh_evidence
from bsg_robot.answers.notes import note_graph, note_words
from bsg_robot.answers.place import EXPLORE
from bsg_robot.answers.posterior import Posterior
from bsg_robot.answers.words import find_room, require_word
from bsg_robot.graph import memory, reports
from bsg_robot.graph.room_kinds import room_reader, understand_rooms
from bsg_robot.things.pieces import kind_of
from bsg_robot.things.things import classify_seen, find_group, find_receptacle

_MOST_HOURS = 1e6
AnyTime = float | str | datetime  # seconds, or ISO 8601 with a zone
_LISTED = 8  # objects in an error
_P = ParamSpec("_P")
_R = TypeVar("_R")
_B = TypeVar("_B", bound="RobotMap")


def alone(
    method: Callable[Concatenate[_B, _P], _R],
) -> Callable[Concatenate[_B, _P], _R]:
    """Let one thread at a time use the building, because a robot's messages come from several."""

    @wraps(method)
    def run(self: _B, /, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        with self._lock:
            return method(self, *args, **kwargs)

    return run


class RobotMap:
    """What a robot has reported of one building, and what it knows by that.

    A thing is any word. A room is its id, or its label if no other room has it. What cannot be,
    such as a word that means no thing, a name that means no room, or a number out of its range,
    raises `RecipeError` and changes nothing. The object is thread-safe.
    """

    def __init__(
        self,
        graph: PartialGraph,
        model: Predictor | AnyPath = DEFAULT_MODEL,
        *,
        notes: tuple[str, ...] = (),
    ) -> None:
        """Start with a graph.

        Args:
            graph: in the class space of the model.
            model: a `Predictor`, or what it takes.
            notes: what a person should know about how the graph was read, a sentence each.

        Raises:
            CheckpointError: if there is no such model.
        """
        self._notes = notes
        self._lock = RLock()
        self._words = Dictionary(model if isinstance(model, Predictor) else Predictor(model))
        self._opened = graph.now  # what time it was
        self._named = 0  # the highest number of an id that was given
        self._weighed: Posterior | None = None
        self._take(reports.let_go(understand_rooms(graph)))

    @property
    def graph(self) -> PartialGraph:
        """What was seen so far."""
        return self._graph

    @property
    def _now(self) -> Posterior:
        """The graph as looks leave it, weighed when it is asked for."""
        if self._weighed is None or self._weighed.reported is not self._graph:
            self._weighed = Posterior(self._graph, self._words, before=self._weighed)
        return self._weighed

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know about how the graph is read, a sentence each."""
        look_up, customs = self._words.look_up, self.graph.customs
        dark = (c.thing for c in customs if not find_group(c.thing) and look_up(c.thing) is None)
        nowhere = (c.at for c in customs if c.at and not self._now.home.find_pieces(c, c.at))
        vain = (look.thing for look in self.graph.looks if look_up(look.thing) is None)
        ignored = {
            f"looks for what {self.model} has no word for are ignored": vain,
            "what people say of what nobody has a word for is ignored": dark,
            "people keep things at furniture that was not seen yet": nowhere,
        }
        notes = note_graph(self.graph, self._words.own, self._now.kinds)
        now = self.graph.now
        late = (f"answers are as of {show_time(now)}; say `now` if it is later",)
        is_late = now is not None and now == self._opened
        return (*self._notes, *(late if is_late else ()), *notes, *note_words(ignored))

    @property
    def model(self) -> str:
        """Name of the model that is asked."""
        return self._words.own.name

    @property
    def rooms(self) -> tuple[str, ...]:
        """Ids of the rooms, in their order."""
        return tuple(room.name for room in self.graph.rooms)

    @alone
    def copy(self: _B) -> _B:
        """Return an independent copy; reports to it do not change this object."""
        other = copy(self)
        other._lock = RLock()
        return other

    @alone
    def saw(
        self,
        room: str | None,
        thing: str,
        *,
        object_id: str | None = None,
        position: tuple[float, float, float] | None = None,
        score: float | None = None,
        time: AnyTime | None = None,
        age: float | None = None,
        stays: float | None = None,
        within: float = 0.5,
        besides: Collection[str] = (),
        on: str | None = None,
    ) -> str:
        """Report one object in a room, and return its id; the room may hold more.

        Args:
            room: id or label; None for an object that is in no room.
            thing: its category.
            object_id: a known id moves the object instead of adding one. A new one is that of such
                a thing that is gone, if there is one.
            position: metres, Z up.
            score: P(it is there now), such as a detector's score; None if nobody doubts it.
            time: when it was seen: seconds, or ISO 8601 with a zone; None for now.
            age: instead of the time, hours since it was seen.
            stays: hours after which half of such things are elsewhere; None for the usual.
            within: without an id, a known object of the same class in the room is the same object,
                but for two whose positions are farther apart than this, in metres. 0 keeps all
                apart. With a clock, one that is gone, or is probably no longer where it was, is the
                same, too.
            besides: ids of objects that it is not, such as others that were seen with it.
            on: id of the object on or in which it lies, or its word if the room has one such.
        """
        require_word(thing)
        where, object_id = f"saw {thing[:SHOWN]!r}", spell_id(object_id)
        index = 0 if room is None else find_room(self.graph, room)
        within = read_number("saw: within", within, most=math.inf)
        score = None if score is None else read_number(f"{where}: score", score, most=1.0)
        graph, time = self._tell_time(where, time, age)
        known = classify_seen(thing, self._words.own.class_map)
        facts = (index, thing, known.category, known.class_index, position, score)
        piece = self._find_support(on, object_id, index)
        name = object_id or self._name_object()
        seen = check_report(SeenObject(name, *facts, on=piece, time=time, stays=stays))
        if object_id is None and within:
            seen = self._recognise(graph, seen, within=within, besides=[*map(spell_id, besides)])
        graph = reports.see_object(reports.take_over(graph, seen), seen)
        if reports.is_on_itself(graph, seen):
            raise RecipeError(
                f"{where}: on: {seen.name[:SHOWN]!r} would lie on itself, by "
                f"{str(seen.on)[:SHOWN]!r}; say what is below",
                code="piece-on-itself",
                where=seen.name,
            )
        self._change(self._forget_looks(graph, seen) if seen.is_evidence else graph)
        return seen.name

    def _find_support(self, on: str | None, object_id: str | None, index: int) -> str | None:
        """Return the id of what an object lies on; who sees it again need not say it again."""
        if on is not None:
            return self._find_piece(on, index).name
        before = (o.on for o in self.graph.objects if (o.name, o.room_index) == (object_id, index))
        return next(before, None)

    def _tell_time(
        self, where: str, time: AnyTime | None, age: float | None = None
    ) -> tuple[PartialGraph, float | None]:
        """Return the graph at the time of a report, and that time; None without a clock."""
        if age is not None:
            age = read_number(f"{where}: age", age, most=_MOST_HOURS)
        reported = None if time is None else _read_time(where, time)
        reported = memory.say_time(where, reported, age=age, now=self.graph.now)
        if reported is None:
            return self.graph, self.graph.now
        # Ages of a graph without a clock count from 0.
        graph = self.graph if age is None else memory.tell_time(self.graph, self.graph.now or 0.0)
        return memory.tell_time(graph, reported), reported

    def _recognise(
        self, graph: PartialGraph, seen: SeenObject, *, within: float, besides: Collection[str]
    ) -> SeenObject:
        """Return a sighting without an id as one of a known object, if it is one.

        Detections of one object err alike: together they are as sure as the surest.
        """
        near = reports.find_near(graph, seen, within=within, besides=besides)
        if near is not None:
            before = self._still_there(graph, [near])[near.name]
            score = None if seen.score is None else max(seen.score, before)
            score = None if score == 1 and near.score is None else score
            return replace(seen, name=near.name, score=score, on=seen.on or near.on)
        if graph.now is None:
            return seen
        still_there = partial(self._still_there, graph)
        moved = reports.find_moved(graph, seen, at=still_there, besides=besides)
        return seen if moved is None else replace(seen, name=moved)

    def _still_there(
        self, graph: PartialGraph, known: Collection[SeenObject]
    ) -> Mapping[str, float]:
        """Return id → P(a known object is where it was seen)."""
        rooms = {obj.room_index for obj in known}
        objects = tuple(obj for obj in graph.objects if obj.room_index in rooms)
        looks = tuple(look for look in graph.looks if look.room_index in rooms)
        _, left = weigh_evidence(replace(graph, objects=objects, looks=looks), self._words)
        still = {obj.name: obj.probability for obj in left.objects}
        return {obj.name: still.get(obj.name, 0.0) for obj in known}

    def _forget_looks(self, graph: PartialGraph, seen: SeenObject) -> PartialGraph:
        """Return a graph without the looks for a thing that is there, after all."""

        def is_over(look: Look) -> bool:
            if look.room_index != seen.room_index or reports.is_before(seen.time, look.time):
                return False
            meaning = self._words.look_up(look.thing)
            return meaning is not None and self._words.names(meaning)(seen.raw_category)

        return replace(graph, looks=tuple(look for look in graph.looks if not is_over(look)))

    def _name_object(self) -> str:
        """Return an id that no object has, and none had that is gone."""
        taken = {obj.name for obj in self.graph.objects}.union(o.name for o in self.graph.memory)
        numbers = count(max(self._named, len(taken)) + 1)
        self._named = next(number for number in numbers if f"saw {number}" not in taken)
        return f"saw {self._named}"

    @alone
    def gone(self, object_id: str, *, time: AnyTime | None = None) -> None:
        """Report that a known object is no longer there.

        With a clock, this is a look for it at the piece of furniture on which it lay, too.

        Args:
            object_id: its id.
            time: of the report; None for now.
        """
        object_id, known = spell_id(object_id), self.graph.objects
        lost = next((obj for obj in known if obj.name == object_id), None)
        if lost is None:
            raise _refuse_object(object_id, "the id of a known object", known)
        graph, time = self._tell_time(f"gone {object_id[:SHOWN]!r}", time)
        if not reports.is_before(time, lost.time):  # else it was seen since
            graph = self._miss(reports.lose(graph, [object_id]), lost, time)
        self._change(graph)

    def _miss(self, graph: PartialGraph, lost: SeenObject, time: float | None) -> PartialGraph:
        """Return a graph with a look for what is gone, where no other such thing lies."""
        node, word = lost.room_index, lost.raw_category
        on, meaning = self._now.pieces_of(node).on, self._words.look_up(word)
        at = on.get(lost.name)
        if time is None or not node or at is None or meaning is None:
            return graph
        is_such = self._words.names(meaning)
        if any(on.get(obj.name) == at and is_such(obj.raw_category) for obj in graph.objects):
            return graph
        look = Look(node, word, 1.0, at, time)
        return reports.look(graph, look, stays=self._words.staying(graph.stays))

    @alone
    def looked(
        self,
        room: str,
        thing: str,
        *,
        chance: float = LOOK_CHANCE,
        at: str | None = None,
        time: AnyTime | None = None,
    ) -> None:
        """Report a look for one thing in a room that did not find it.

        The room becomes less likely to have one, by Bayes' rule, but not impossible. A second look
        counts less than the first, because it overlooks what that did. `searched` says that nothing
        is left in a room. `saw` reports what is found.

        Args:
            room: id or label.
            thing: any word.
            chance: P(the look would have found it, if one is there).
            at: id of the piece of furniture that was searched, or its word if the room has one
                such; None for the whole room.
            time: of the look; None for now.
        """
        index = find_room(self.graph, room)
        is_such = self._words.names(self._words.understand(thing))
        piece = None if at is None else self._find_piece(at, index)
        if piece is not None and kind_of(piece) is None and not self._has_held(piece.name):
            raise RecipeError(
                f"looked for {thing[:SHOWN]!r}: at: {piece.name[:SHOWN]!r} is no furniture that "
                "holds things; leave `at` out, if the look was into the whole room",
                code="piece-holds-nothing",
                where=piece.name,
            )
        chance = read_number(f"looked for {thing[:SHOWN]!r}: chance", chance, most=1.0)
        graph, time = self._tell_time(f"looked for {thing[:SHOWN]!r}", time)
        seen = (o for o in graph.objects if o.room_index == index and is_such(o.raw_category))
        if not any(reports.is_before(time, obj.time) for obj in seen):  # since a late look
            look = Look(index, thing, chance, None if piece is None else piece.name, time)
            graph = reports.look(graph, look, stays=self._words.staying(graph.stays))
        self._change(graph)

    def _has_held(self, name: str) -> bool:
        """Return whether anything was ever seen on an object."""
        before = (sight.on for thing in self.graph.memory for sight in thing.sightings)
        return name in {*(obj.on for obj in self.graph.objects), *before}

    def _find_piece(self, name: str, index: int) -> SeenObject:
        """Return an object of a room, by its id, its word, or that of its kind of furniture."""
        known = [obj for obj in self.graph.objects if obj.room_index == index]
        kind = find_receptacle(str(name))
        same = _find_called(name, known)
        same = same or [obj for obj in known if kind is not None and kind_of(obj) == kind]
        if len(same) == 1:
            return same[0]
        expected, code = "the id of an object of the room", "piece-unknown"
        raise _refuse_object(name, expected, known, found=len(same), code=code)

    @alone
    def entered(
        self,
        room: str,
        *,
        hidden_share: float | ShareBelief | None = None,
        floor_in_view: float | None = None,
        walls_in_view: float | None = None,
        seconds_inside: float | None = None,
        time: AnyTime | None = None,
    ) -> None:
        """Report that the robot is in a room, or has looked at more of it.

        Args:
            room: id or label.
            hidden_share: share of the room's objects not seen so far; a `ShareBelief` if uncertain.
                None estimates it from the arguments below. Without any of them, the known share
                stays; a room that was not entered before may hide any share.
            floor_in_view: share of the floor that the camera has had in view.
            walls_in_view: share of the walls that the camera has had in view.
            seconds_inside: how long the robot has looked around in the room.
            time: of the report; None for now.
        """
        index = find_room(self.graph, room)
        looked = any(x is not None for x in (floor_in_view, walls_in_view, seconds_inside))
        if hidden_share is not None and looked:
            raise RecipeError(
                f"room {room!r}: give hidden_share, or how it was looked at; not both",
                code="share-twice",
                where=room,
            )
        if looked:
            hidden_share = estimate_hidden_share(
                floor_in_view=floor_in_view,
                walls_in_view=walls_in_view,
                seconds_inside=seconds_inside,
                floor_area=self.graph.rooms[index - 1].area,
            )
        elif hidden_share is not None and not isinstance(hidden_share, ShareBelief):
            hidden_share = ShareBelief(hidden_share)
        graph, time = self._tell_time(f"entered {room[:SHOWN]!r}", time)
        self._change(reports.enter(graph, index, hidden_share=hidden_share, time=time))

    @alone
    def searched(
        self,
        room: str,
        *,
        found: Collection[str] | str | None = None,
        time: AnyTime | None = None,
    ) -> None:
        """Report that everything in a room was seen and reported by `saw`.

        Args:
            room: id or label.
            found: which of the known objects there were found again, by id or by any word; those
                that were not are gone. None keeps all.
            time: of the report; None for now.
        """
        index = find_room(self.graph, room)
        graph, time = self._tell_time(f"searched {room[:SHOWN]!r}", time)
        if found is None:
            self._change(reports.enter(graph, index, hidden_share=ShareBelief(0.0), time=time))
            return
        known = [obj for obj in self.graph.objects if obj.room_index == index]
        words = [found] if isinstance(found, str) else found
        names = {name for word in words for name in self._find_again(word, known, room)}
        self._change(reports.find_all(graph, index, names, time=time))

    def _find_again(self, name: str, known: Sequence[SeenObject], room: str) -> list[str]:
        """Return the ids of the known objects that an id or a word names."""
        same = _find_called(name, known)
        if not same and (meaning := self._words.look_up(name)):
            is_such = self._words.names(meaning)
            same = [obj for obj in known if is_such(obj.raw_category)]
        if not same:
            expected = f"an object that was known in {room!r} (report others by `saw` first)"
            raise _refuse_object(name, expected, known)
        return [obj.name for obj in same]

    @alone
    def discovered(
        self,
        room: str,
        *,
        beside: Collection[str] | str = (),
        room_type: RoomType | None = None,
        position: tuple[float, float, float] | None = None,
        floor_area: float | None = None,
    ) -> None:
        """Report a new room that the robot has not entered.

        Args:
            room: its id.
            beside: id of a room that it connects with, or several.
            room_type: a kind of room, or kinds with probabilities. None: as its id says, if it
                does. A word that is not understood says nothing; `notes` names it.
            position: metres, Z up.
            floor_area: square metres.
        """
        new = KnownRoom(
            room,
            hidden_share=1.0,
            visited=False,
            position=position,
            floor_area=floor_area,
            room_type=room_type,
        )
        neighbours = self._find_rooms(beside)
        graph = reports.discover(self.graph, check_report(new), beside=neighbours)
        self._change(understand_rooms(graph))

    @alone
    def describe(
        self,
        room: str,
        *,
        room_type: RoomType | None = None,
        label: str | None = None,
        position: tuple[float, float, float] | None = None,
        floor_area: float | None = None,
        beside: Collection[str] | str = (),
    ) -> None:
        """Say more of a known room; what is None stays as it was.

        Args:
            room: id or label.
            room_type: a kind of room, or kinds with probabilities. A word that is not understood
                says nothing; `notes` names it.
            label: its name for people.
            position: metres, Z up.
            floor_area: square metres.
            beside: id of a room that it connects with, or several; known connections stay.
        """
        graph, index = self.graph, find_room(self.graph, room)
        before, neighbours = graph.rooms[index - 1], self._find_rooms(beside)
        facts: dict[str, Any] = {"room_type": room_type, "label": label}
        facts |= {"position": position, "floor_area": floor_area}
        changed = {name: fact for name, fact in facts.items() if fact is not None}
        known = check_report(replace(before, **changed))
        if room_type is not None:
            read = read_room_type(known.room_type, read=room_reader(graph))
            is_read = read.labels is not None or not read.unread  # else nothing is said
            kind = known.room_type if is_read else before.room_type
            known = replace(known, room_type=kind, unread=read.unread)
            if is_read:
                graph = replace(graph, origins={**graph.origins, before.name: ()})
        graph = reports.describe(graph, index, known, beside=neighbours)
        self._change(understand_rooms(graph))

    def _find_rooms(self, names: Collection[str] | str) -> list[int]:
        rooms = [names] if isinstance(names, str) else names
        return [find_room(self.graph, room) for room in rooms]

    @alone
    def more_rooms(self, number: int | bool) -> None:
        """Report how many rooms are not found yet: a number, or True for as many as homes have.

        `discovered` counts a number down. 0, or False, says that the graph is whole.
        """
        self._change(replace(self.graph, more_rooms=check_more_rooms(number) or 0))

    @alone
    def passes(self, hours: float | None = None, *, until: AnyTime | None = None) -> None:
        """Report that time has passed. This starts the clock of a graph that has none.

        All that such a graph holds was seen at the time before. With a clock, reports may also say
        their `time`.

        Args:
            hours: that have passed.
            until: what time it is now, instead; `"now"` reads the clock of this computer.
        """
        if (hours is None) == (until is None):
            raise RecipeError("passes: give hours or until", code="time-unsaid")
        graph = self.graph
        if hours is not None:
            step = HOUR * read_number("passes: hours", hours, most=_MOST_HOURS)
            graph = memory.pass_until(graph, graph.now or 0.0)
            now = _read_time("passes", (graph.now or 0.0) + step)
        else:
            now = _read_time("passes", until, read=read_now)
        self._change(memory.pass_until(graph, now))

    @alone
    def keeps(self, thing: str, *, room: str | None = None, at: str | None = None) -> None:
        """Say where people of this home keep a thing, or a group of things such as drinks.

        It counts as much as two weeks of daily sightings at this time of the day: the robot goes
        there first, and what it sees elsewhere for longer counts more. What is said of the thing
        itself counts before what is said of its group. Two places of one thing share it; what is
        said last of a thing and a place counts, and `forget` takes all back.

        Args:
            thing: any word, or a group of `bsg_robot/tables/groups-v1.csv`.
            room: id or label; None if `at` says where.
            at: id of a piece of furniture, or its word: also of one that was not seen yet.
        """
        self._say_custom(thing, room, at, never=False)

    @alone
    def never(self, thing: str, *, room: str | None = None, at: str | None = None) -> None:
        """Say where a thing, or a group of things, never is. Arguments are those of `keeps`."""
        self._say_custom(thing, room, at, never=True)

    def _say_custom(self, thing: str, room: str | None, at: str | None, *, never: bool) -> None:
        require_word(thing)
        if find_group(thing) is None:
            self._words.understand(thing)
        if room is None and at is None:
            raise RecipeError(
                f"{thing[:SHOWN]!r}: expected a room, or a piece of furniture (`at`), or both",
                code="custom-nowhere",
                where=thing,
            )
        index = None if room is None else find_room(self.graph, room)
        if at is not None:
            require_word(at := spell_id(at))
        new = Custom(thing, index, at, never)
        # What is said last of a thing and a place counts.
        others = [custom for custom in self.graph.customs if _place_of(custom) != _place_of(new)]
        if len(others) >= MAX_ROBOT_CUSTOMS:
            raise RecipeError(
                f"{self.graph.scene_id}: expected at most {MAX_ROBOT_CUSTOMS:,} customs; `forget` "
                "removes those of a thing",
                code="customs-too-many",
                where=self.graph.scene_id,
            )
        self._change(replace(self.graph, customs=(*others, new)))

    @alone
    def forget(self, thing: str | None = None) -> None:
        """Forget what this home has taught: where a thing was before, and what people said of it.

        Objects that are known now stay, and looks, and the clock.

        Args:
            thing: any word, or a group; None for all.
        """
        if thing is None:
            self._change(replace(self.graph, memory=(), customs=()))
            return
        group, words = find_group(thing), self._words
        is_such = words.is_of(group) if group else words.names(words.understand(thing))
        memory = tuple(one for one in self.graph.memory if not is_such(one.raw_category))
        customs = tuple(one for one in self.graph.customs if not is_such(one.thing))
        self._change(replace(self.graph, memory=memory, customs=customs))

    def _change(self, graph: PartialGraph) -> None:
        """Take a later graph."""
        after = reports.let_go(graph)
        if len(after.looks) < len(graph.looks):
            after = reports.let_go(self._now.keep_looks(graph))
        self._take(after)

    def _take(self, graph: PartialGraph) -> None:
        if any(room.name == EXPLORE for room in graph.rooms):
            raise RecipeError(
                f"{graph.scene_id}: a room {EXPLORE!r} cannot be told from the answer {EXPLORE!r}, "
                "to look for rooms that are not found yet; rename the room",
                code="room-named-explore",
                where=EXPLORE,
            )
        self._graph = graph


def _find_called(name: str, known: Sequence[SeenObject]) -> list[SeenObject]:
    """Return the objects of an id, or else of a word."""
    name = spell_id(name)
    spoken = normalise_name(str(name))
    same = [obj for obj in known if obj.name == name]
    return same or [obj for obj in known if normalise_name(obj.raw_category) == spoken]


def _refuse_object(
    name: str,
    expected: str,
    known: Sequence[SeenObject],
    *,
    found: int = 0,
    code: str = "object-unknown",
) -> RecipeError:
    """Return the error of a name that means none of some objects, or several."""
    shown = ", ".join(f"{obj.name} ({obj.raw_category})" for obj in known[:_LISTED])
    near = ask_if_meant(str(name), [obj.name for obj in known])
    return RecipeError(
        f"{str(name)[:SHOWN]!r}: expected {expected}, found {found or 'no'} such "
        f"object{'s' * (found > 1)}; {near or 'known are ' + (shown or 'none')}",
        code=code,
        where=str(name)[:SHOWN],
    )


def _read_time(where: str, time: object, *, read: Callable[[object], float] = read_time) -> float:
    try:
        return read(time)
    except ValueError as error:
        raise RecipeError(f"{where}: time: {error}", code="time-impossible", where=where) from None


def _place_of(custom: Custom) -> tuple[object, ...]:
    at = None if custom.at is None else normalise_name(custom.at)
    return normalise_name(custom.thing), custom.room_index, at
