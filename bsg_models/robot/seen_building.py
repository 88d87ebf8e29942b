"""Keep what a robot has seen of a building, and answer its questions about the rest.

    seen = open_graph("graph.json")
    seen.where("microwave")[0].room

All names are the robot's own: ids or labels of its rooms, and any word for a thing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, wraps
from itertools import count, pairwise
from pathlib import Path
from threading import RLock
from typing import Any, Concatenate, ParamSpec, TypeAlias, TypeVar, overload

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.dataset.manifest import UnmappedEntry, describe_unmapped
from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath
from bsg_data.observation import reports
from bsg_data.observation.hidden_share import ShareBelief, estimate_hidden_share
from bsg_data.observation.partial_graph import (
    KnownRoom,
    Look,
    PartialGraph,
    SeenObject,
    check_more_rooms,
    check_report,
    reclassify,
)
from bsg_data.observation.reports import LOOK_CHANCE, say_score
from bsg_data.observation.robot_json import list_unmapped, understand_rooms
from bsg_data.recipes import read_number
from bsg_data.scene.class_map import (
    DEFAULT_CLASS_MAP,
    ClassMap,
    list_class_maps,
    load_class_map,
    normalise_name,
)
from bsg_data.scene.room_label import RoomType
from bsg_data.scene.surroundings import area_of
from bsg_data.scene.things import find_receptacle
from bsg_data.spelling import SHOWN, ask_if_meant, show_value
from bsg_models.belief.belief_graph import LEAST_PRESENCE, BeliefGraph, believe
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.graph_file import open_graph_file, parse_graph
from bsg_models.belief.nouns import NounTable, looks_of, may_be_one, read_nouns, split_head
from bsg_models.belief.pieces import TIDY, Furniture, SeenPieces, find_pieces, furnish, kind_of
from bsg_models.robot.decision import (
    Decision,
    choose_likeliest,
    choose_room,
    choose_rooms,
    order_rooms,
    weigh,
)
from bsg_models.robot.destinations import (
    LOOK_AT,
    Spot,
    choose_spot,
    is_there,
    leave_rest,
    list_spots,
)
from bsg_models.robot.looks import AnyLook, cost_looks
from bsg_models.robot.missed_looks import (
    MissedLook,
    MissedPieces,
    doubt_objects,
    sum_looks,
    sum_pieces,
)
from bsg_models.robot.notes import note_graph
from bsg_models.robot.thing_belief import (
    SHARE_OF_KIND,
    ThingBelief,
    after_looks,
    believe_class,
    believe_kind,
    believe_noun,
    believe_thing,
    list_searched,
)
from bsg_models.robot.unfound_rooms import EXPLORE, add_unfound
from bsg_models.robot.ways import Costs, Ways, add_places, list_lost, measure_ways
from bsg_models.robot.words import (
    Meaning,
    counts,
    explain_everyday,
    find_everyday,
    find_meaning,
    find_room,
    find_wider,
    require_word,
    tell_apart,
)
from bsg_models.runs.found_model import DEFAULT_MODEL, WIDE_MAP, WIDE_MODEL, shipped_names
from bsg_models.runs.predictor import Predictor
from bsg_models.search.catalogue import AnyPlanner, find_planner
from bsg_models.search.knowledge import Task
from bsg_models.search.planners import require_task

# Models besides the building's own, and their class maps.
_OTHERS = {1: (WIDE_MODEL, WIDE_MAP), 2: (DEFAULT_MODEL, DEFAULT_CLASS_MAP)}


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of furniture on or in which a thing may be."""

    piece: str | None  # its id; None for pieces that were not seen yet
    name: str  # its category; `NOT_SEEN`
    probability: float  # P(at least one is there); 1 if one was seen on it, and nobody doubts it
    if_there: float  # P(an unseen one is there, if the room has one)
    seen: tuple[str, ...]  # ids of those that were seen on it


@dataclass(frozen=True, slots=True)
class Destination:
    """Where a robot looks next."""

    room: str  # its id, or `EXPLORE`
    piece: str | None  # id of a piece of furniture; None for the rest of the room


@dataclass(frozen=True, slots=True)
class Place:
    """A room where a thing may be."""

    room: str | None  # its id; None for objects that were seen in no room; `EXPLORE`, see `label`
    label: str | None
    probability: float  # P(at least one is there); 1 if one was seen, and nobody doubts it
    if_there: float  # the same, given that the building has one
    unseen: float  # P(at least one unseen is there)
    expected: float  # number of unseen ones
    seen: tuple[str, ...]  # ids of those that were seen there
    cost: float | None  # of the way to the room; None if unknown
    pieces: tuple[Piece, ...] = ()  # the likeliest three, if furniture was seen there


@dataclass(frozen=True, slots=True)
class ExpectedClass:
    """A class of things that a room may hide."""

    name: str
    probability: float  # P(at least one unseen is there)
    expected: float  # number of unseen ones
    seen: int  # number that was seen there


@dataclass(frozen=True, eq=False)
class _Sought:
    """A thing that is sought, in the graph as it is now."""

    meaning: Meaning
    belief: ThingBelief
    missed: Mapping[int, MissedPieces]  # by node with looks for it


@dataclass(frozen=True, slots=True)
class Step:
    """A room in the order in which a robot would search."""

    room: str  # its id, or `EXPLORE`
    label: str | None
    probability: float  # P(any of the things is there)
    way: float  # cost of going there from the room before
    look: float  # cost of looking there
    found: float  # P(the search has ended by then)


_Now: TypeAlias = tuple[PartialGraph, Expectation]  # a graph as a model reads it, and the belief
NOT_FOUND = "rooms not found yet"
NOT_SEEN = "a piece not seen yet"
THINGS = "things-v1"  # the table of everyday things, where it answers
_MOST_HOURS = 1e9
_LISTED = 8  # objects in an error
_SHOWN_PIECES = 3  # of each room
_MOST_MEANINGS = 1000  # words that are remembered
_MOST_SOUGHT = 32  # of these, what is believed of them
_LEAST = 1e-12  # a smaller number is not divided by


def open_graph(
    graph: AnyPath | Mapping[str, Any],
    *,
    model: Predictor | AnyPath = DEFAULT_MODEL,
    labels: AnyPath | None = None,
) -> SeenBuilding:
    """Open a robot's graph, to ask about it.

    Args:
        graph: file of a robot's graph, in this project's JSON or Spark-DSG's; `-` for standard
            input; or the document itself, as `json.loads` returns it.
        model: a `Predictor`, or what it takes.
        labels: label space of a Hydra graph, as `load_label_space` takes it.

    Raises:
        BSGError: if the graph cannot be read.
        CheckpointError: if there is no such model.
    """
    if isinstance(graph, Mapping):
        file = parse_graph(dict(graph), path=Path("graph"), labels=labels)
    else:
        file = open_graph_file(Path(graph), labels=labels)
    predictor = model if isinstance(model, Predictor) else Predictor(model)
    return SeenBuilding(reclassify(file.graph, predictor.class_map), predictor, notes=file.notes)


_P = ParamSpec("_P")
_R = TypeVar("_R")


def _alone(
    method: Callable[Concatenate[SeenBuilding, _P], _R],
) -> Callable[Concatenate[SeenBuilding, _P], _R]:
    """Let one thread at a time use the building, because a robot's messages come from several."""

    @wraps(method)
    def run(self: SeenBuilding, /, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        with self._lock:
            return method(self, *args, **kwargs)

    return run


class SeenBuilding:
    """What a robot has seen of one building; the robot reports to it and asks it.

    Reports change this object: `saw`, `gone`, `looked`, `entered`, `searched`, `discovered`,
    `describe` and `more_rooms`. Questions do not: `where`, `anywhere`, `expected`, `next_room`,
    `next_rooms`, `explain` and `belief`. The state is one immutable `PartialGraph`. Keep `graph`,
    or a `copy`, to ask what-if questions.

    A thing is any word. A room is its id, or its label if no other room has it. A word that means
    no thing, and a name that means no room, raise `RecipeError`. The object is thread-safe.
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
        own = model if isinstance(model, Predictor) else Predictor(model)
        # 0: the building's own, 1: the wide one, 2: that nouns are judged by
        self._models = {0: own}
        self._meanings: dict[str, Meaning] = {}
        self._unknown: set[str] = set()
        self._named = 0  # the highest number of an id that was given
        self._expectations: dict[int, Expectation] = {}
        self._evidence: PartialGraph | None = None
        self._ways: Ways | None = None
        self._change(graph)

    @property
    def graph(self) -> PartialGraph:
        """What was seen so far."""
        return self._graph

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know about how the graph is read, a sentence each."""
        lost = dict.fromkeys(
            one.thing for one in self._graph.looks if self._understand_or_none(one.thing) is None
        )
        words = ", ".join(repr(word[:SHOWN]) for word in [*lost][:_LISTED])
        ignored = (f"looks for what {self.model} has no word for are ignored: {words}",)
        notes = note_graph(self._graph, self._models[0])
        return (*self._notes, *notes, *(ignored if lost else ()))

    @property
    def model(self) -> str:
        """Name of the model that is asked."""
        return self._models[0].name

    @property
    def rooms(self) -> tuple[str, ...]:
        """Ids of the rooms, in their order."""
        return tuple(room.name for room in self._graph.rooms)

    @property
    def unmapped(self) -> tuple[UnmappedEntry, ...]:
        """Seen objects whose name no class map knows; models do not read them."""
        class_map = self._models[0].class_map
        return tuple(describe_unmapped(list_unmapped(self._graph), class_map))

    @_alone
    def copy(self) -> SeenBuilding:
        """Return an independent copy; reports to it do not change this object."""
        other = SeenBuilding(self._graph, self._models[0], notes=self._notes)
        other._models, other._meanings = self._models, dict(self._meanings)
        other._expectations, other._evidence = dict(self._expectations), self._evidence
        other._ways = self._ways
        return other

    # Reports of the robot

    @_alone
    def saw(
        self,
        room: str | None,
        thing: str,
        *,
        object_id: str | None = None,
        position: tuple[float, float, float] | None = None,
        score: float | None = None,
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
            object_id: a known id moves the object instead of adding one.
            position: metres, Z up.
            score: P(it is there now), such as a detector's score; None if nobody doubts it.
            age: instead of the score, hours since it was seen; needs `stays`.
            stays: hours after which half of such things are elsewhere; None for the graph's.
            within: without an id, a known object of the same class in the room that is this near,
                in metres, is the same object. 0 keeps all apart; ∞ takes any in the room.
            besides: ids of objects that it is not, such as others that were seen with it.
            on: id of the object on or in which it lies, or its word if the room has one such.

        Raises:
            RecipeError: for a room, a word or a number that cannot be.
        """
        require_word(thing)
        index = 0 if room is None else find_room(self._graph, room)
        within = read_number("saw: within", within, most=math.inf)
        where, hours = f"saw {thing[:SHOWN]!r}", stays or self._graph.stays
        if age is not None:
            age = read_number(f"{where}: age", age, most=_MOST_HOURS)
        if stays is not None and not read_number(f"{where}: stays", stays, most=_MOST_HOURS):
            raise RecipeError(f"{where}: stays: expected above 0 hours, found 0", code="stays-zero")
        if score is not None:
            score = read_number(f"{where}: score", score, most=1.0)
        if stays is not None and age is None:
            raise RecipeError(
                f"{where}: has stays; say also its age", code="age-unsaid", where=where
            )
        score = say_score(where, score, age=age, stays=hours)
        known = self._models[0].class_map.classify(thing)
        facts = (index, thing, known.category, known.class_index, position, score)
        before = {obj.name: obj for obj in self._graph.objects}.get(object_id or "")
        piece = None if on is None else self._find_piece(on, index).name
        if on is None and before is not None and before.room_index == index:
            piece = before.on  # who sees it again need not say it again
        seen = check_report(SeenObject(object_id or self._name_object(), *facts, on=piece))
        if object_id is None:
            near = reports.find_near(self._graph, seen, within=within, besides=besides)
            if near is not None:
                certain = score is None or near.score is None
                likelier = max(seen.probability, near.probability)
                score = None if certain else likelier
                seen = replace(seen, name=near.name, score=score, on=seen.on or near.on)
        graph = reports.see_object(self._graph, seen)
        if reports.is_on_itself(graph, seen):
            raise RecipeError(
                f"{where}: on: {seen.name[:SHOWN]!r} would lie on itself, by "
                f"{str(seen.on)[:SHOWN]!r}; say what is below",
                code="piece-on-itself",
                where=seen.name,
            )
        if seen.is_evidence:  # it is there, after all
            missed = [
                one.look
                for one in self._looks
                if one.look.room_index == index and self._names(one.meaning)(thing)
            ]
            kept = tuple(one for one in graph.looks if one not in missed)
            graph = replace(graph, looks=kept)
        self._change(graph)
        return seen.name

    def _name_object(self) -> str:
        """Return an id that no object has, and none had that is gone."""
        taken = {obj.name for obj in self._graph.objects}
        numbers = count(max(self._named, len(taken)) + 1)
        self._named = next(number for number in numbers if f"saw {number}" not in taken)
        return f"saw {self._named}"

    @_alone
    def gone(self, object_id: str) -> None:
        """Report that a known object is no longer there.

        Raises:
            RecipeError: if there is no such object.
        """
        known = [obj.name for obj in self._graph.objects]
        if object_id not in known:
            hint = ask_if_meant(str(object_id), known) or "`graph.objects` has the ids"
            raise RecipeError(
                f"{self._graph.scene_id}: no object {str(object_id)[:SHOWN]!r}; {hint}",
                code="object-unknown",
                where=str(object_id),
            )
        self._change(reports.lose(self._graph, [object_id]))

    @_alone
    def looked(
        self, room: str, thing: str, *, chance: float = LOOK_CHANCE, at: str | None = None
    ) -> None:
        """Report a look for one thing in a room that did not find it.

        The room becomes less likely to have one, by Bayes' rule, but not impossible; two looks
        count twice. `searched` says that nothing is left in a room. `saw` reports what is found.

        Args:
            room: id or label.
            thing: any word.
            chance: P(the look would have found it, if one is there).
            at: id of the piece of furniture that was searched, or its word if the room has one
                such; None for the whole room.

        Raises:
            RecipeError: for a room, a word or a chance that cannot be.
        """
        index = find_room(self._graph, room)
        self.understand(thing)
        piece = None if at is None else self._find_piece(at, index)
        if piece is not None and kind_of(piece) is None:
            raise RecipeError(
                f"looked for {thing[:SHOWN]!r}: at: {piece.name[:SHOWN]!r} is no furniture that "
                "holds things; leave `at` out, if the look was into the whole room",
                code="piece-holds-nothing",
                where=piece.name,
            )
        chance = read_number(f"looked for {thing[:SHOWN]!r}: chance", chance, most=1.0)
        look = Look(index, thing, chance, None if piece is None else piece.name)
        self._change(reports.look(self._graph, look))

    def _find_piece(self, said: str, index: int) -> SeenObject:
        """Return an object of a room, by its id, its word, or that of its kind of furniture."""
        known = [obj for obj in self._graph.objects if obj.room_index == index]
        spoken, kind = normalise_name(str(said)), find_receptacle(str(said))
        same = (
            [obj for obj in known if obj.name == said]
            or [obj for obj in known if normalise_name(obj.raw_category) == spoken]
            or [obj for obj in known if kind is not None and kind_of(obj) == kind]
        )
        if len(same) == 1:
            return same[0]
        shown = ", ".join(f"{obj.name} ({obj.raw_category})" for obj in known[:_LISTED])
        found = f"{len(same)} such objects" if same else "no such object"
        raise RecipeError(
            f"{str(said)[:SHOWN]!r}: expected the id of an object of the room, found {found}; "
            f"known are {shown or 'none'}",
            code="piece-unknown",
            where=str(said)[:SHOWN],
        )

    @_alone
    def entered(
        self,
        room: str,
        *,
        hidden_share: float | ShareBelief | None = None,
        floor_in_view: float | None = None,
        walls_in_view: float | None = None,
        seconds_inside: float | None = None,
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

        Raises:
            RecipeError: also if a share is not 0 to 1, or both `hidden_share` and another argument
                are given.
        """
        index = find_room(self._graph, room)
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
                floor_area=area_of(self._graph.rooms[index - 1]),
            )
        elif hidden_share is not None and not isinstance(hidden_share, ShareBelief):
            hidden_share = ShareBelief(hidden_share)
        self._change(reports.enter(self._graph, index, hidden_share=hidden_share))

    @_alone
    def searched(self, room: str, *, found: Collection[str] | str | None = None) -> None:
        """Report that everything in a room was seen and reported by `saw`.

        Args:
            room: id or label.
            found: which of the known objects there were found again, by id or by any word; those
                that were not are gone. None keeps all.

        Raises:
            RecipeError: if there is no such room, or it had no such object.
        """
        index = find_room(self._graph, room)
        if found is None:
            self._change(reports.enter(self._graph, index, hidden_share=ShareBelief(0.0)))
            return
        if not isinstance(found, Collection):
            raise RecipeError(
                f"searched {room!r}: found: expected ids or words, found {show_value(found)}",
                code="found-impossible",
                where=room,
            )
        known = [obj for obj in self._graph.objects if obj.room_index == index]
        words = [found] if isinstance(found, str) else found
        kept = {name for one in words for name in self._find_again(one, known, room)}
        self._change(reports.find_all(self._graph, index, kept))

    def _find_again(self, said: str, known: Sequence[SeenObject], room: str) -> list[str]:
        """Return the ids of the known objects that an id or a word names."""
        names = [obj.name for obj in known]
        if said in names:
            return [said]
        spoken = normalise_name(str(said))
        same = [obj.name for obj in known if normalise_name(obj.raw_category) == spoken]
        if not same and (meaning := self._understand_or_none(said)):
            is_kind = self._names(meaning)
            same = [obj.name for obj in known if is_kind(obj.raw_category)]
        if not same:
            shown = ", ".join(f"{obj.name} ({obj.raw_category})" for obj in known[:_LISTED])
            raise RecipeError(
                f"searched {room!r}: found {str(said)[:SHOWN]!r}, and no such object was known "
                f"there; report it by `saw` first. Known are {shown or 'none'}",
                code="object-unknown",
                where=str(said),
            )
        return same

    @_alone
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
            room_type: a room label, or labels with probabilities. None: as its id says, if it does.
            position: metres, Z up.
            floor_area: square metres.

        Raises:
            RecipeError: also if the room is already known, or is not valid.
        """
        new = KnownRoom(
            room,
            hidden_share=1.0,
            visited=False,
            position=position,
            floor_area=floor_area,
            room_type=room_type,
        )
        others = [beside] if isinstance(beside, str) else beside
        neighbours = [find_room(self._graph, other) for other in others]
        graph = reports.discover(self._graph, check_report(new), beside=neighbours)
        self._change(understand_rooms(graph))

    @_alone
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
            room_type: a room label, or labels with probabilities.
            label: its name for people.
            position: metres, Z up.
            floor_area: square metres.
            beside: id of a room that it connects with, or several; known connections stay.

        Raises:
            RecipeError: if there is no such room, or the facts cannot be.
        """
        index = find_room(self._graph, room)
        before = self._graph.rooms[index - 1]
        known = replace(
            before,
            room_type=before.room_type if room_type is None else room_type,
            label=before.label if label is None else label,
            position=before.position if position is None else position,
            floor_area=before.floor_area if floor_area is None else floor_area,
        )
        others = [beside] if isinstance(beside, str) else beside
        neighbours = [find_room(self._graph, other) for other in others]
        graph = reports.describe(self._graph, index, check_report(known), beside=neighbours)
        self._change(understand_rooms(graph))

    @_alone
    def more_rooms(self, number: int | bool) -> None:
        """Report how many rooms are not found yet: a number, or True for as many as homes have.

        `discovered` counts a number down. 0, or False, says that the graph is whole.
        """
        self._change(replace(self._graph, more_rooms=check_more_rooms(number) or 0))

    def _change(self, graph: PartialGraph) -> None:
        """Take a graph; what was believed stays if no evidence of models has changed."""
        if any(room.name == EXPLORE for room in graph.rooms):
            raise RecipeError(
                f"{graph.scene_id}: a room {EXPLORE!r} cannot be told from the answer {EXPLORE!r}, "
                "to look for rooms that are not found yet; rename the room",
                code="room-named-explore",
                where=EXPLORE,
            )
        if self._evidence is not None:
            graph = self._keep_looks(graph)
        graph = reports.let_go(graph)
        understood = ((one, self._understand_or_none(one.thing)) for one in graph.looks)
        looks = tuple(MissedLook(one, meaning) for one, meaning in understood if meaning)
        whole = add_unfound(doubt_objects(graph, looks, names=self._names))
        evidence = replace(
            whole,
            looks=(),
            objects=tuple(replace(o, score=None) for o in whole.objects if o.is_evidence),
        )
        if self._evidence is None or evidence != self._evidence:
            self._evidence, self._expectations, self._ways = evidence, {}, None
        self._graph, self._whole, self._looks = graph, whole, looks
        self._read: dict[int, PartialGraph] = {0: whole}
        self._by_room: dict[int, list[SeenObject]] = {}
        self._pieces: dict[int, SeenPieces] = {}
        self._sought: dict[str, _Sought] = {}

    def _keep_looks(self, graph: PartialGraph) -> PartialGraph:
        """Return the graph in which looks at a piece that is gone are looks into its room.

        They have the chance that the piece had its share of.
        """
        room_of = {obj.name: obj.room_index for obj in graph.objects}
        left: dict[str, dict[str, float | None]] = {}  # a piece that is gone → scores in its room
        for one in graph.looks:
            meaning = self._understand_or_none(one.thing)
            if one.at is None or room_of.get(one.at) == one.room_index or meaning is None:
                continue
            furniture = self._furnish(meaning, one.room_index)
            if furniture is not None and one.at in furniture.names:
                missed = 1 - furniture.overlooked({one.at: 1 - one.chance})
                graph = reports.look(graph, replace(one, at=None, chance=missed))
                if one.at not in left:
                    objects = self._objects_of(one.room_index)
                    left[one.at] = {obj.name: obj.score for obj in objects}
        if not left:
            return graph
        objects = tuple(
            replace(obj, score=left[obj.on].get(obj.name, 0.0)) if obj.on in left else obj
            for obj in graph.objects
        )
        return replace(graph, objects=objects)

    # Questions of the robot

    @overload
    def where(
        self,
        thing: str,
        *,
        here: str | None = None,
        costs: Costs | None = None,
        within: None = None,
        tidy: float = TIDY,
    ) -> tuple[Place, ...]: ...

    @overload
    def where(
        self,
        thing: str,
        *,
        here: str | None = None,
        costs: Costs | None = None,
        within: str,
        tidy: float = TIDY,
    ) -> tuple[Piece, ...]: ...

    def where(
        self,
        thing: str,
        *,
        here: str | None = None,
        costs: Costs | None = None,
        within: str | None = None,
        tidy: float = TIDY,
    ) -> tuple[Place, ...] | tuple[Piece, ...]:
        """Return where a thing is, the likeliest first: rooms, or pieces of furniture of one room.

        Rooms have their three likeliest pieces. Of a room, the last is any piece that was not seen
        yet; there are none for what stands by itself, such as a wardrobe. The formulas are in
        `bsg_models.belief.pieces`.

        Args:
            thing: any word; `understand` says which class answers it.
            here: the robot's room, from which costs are measured.
            costs: (room, room) → cost, replacing what the graph measures; ∞ closes a way.
            within: id or label of a room, to ask for its pieces of furniture.
            tidy: share of things that lie where they belong, 0 to 1; the others lie as in an untidy
                home.
        """
        tidy = read_number("tidy", tidy, most=1.0)
        with self._lock:
            if within is None:
                return self._list_rooms(thing, here, costs, tidy)
            node = find_room(self._graph, within)
            return self._list_pieces(thing, node, tidy)

    def _list_rooms(
        self, thing: str, here: str | None, costs: Costs | None, tidy: float
    ) -> tuple[Place, ...]:
        sought = self._seek(thing)
        belief = sought.belief
        known_costs = {} if here is None else self._known_costs(here, costs)
        number = len(self._graph.rooms)
        anywhere = max(float(belief.probability[0]), _LEAST)
        places = [
            Place(
                room=room.name,
                label=room.label,
                probability=float(belief.probability[node]),
                if_there=min(1.0, float(belief.probability[node]) / anywhere),
                unseen=float(belief.unseen[node]),
                expected=float(belief.expected[node]),
                seen=tuple(obj.name for obj in belief.seen[node]),
                cost=known_costs.get(node),
                pieces=self._best_pieces(sought, node, tidy),
            )
            for node, room in enumerate(self._graph.rooms, 1)
        ]
        if belief.seen[0]:
            ids = tuple(obj.name for obj in belief.seen[0])
            there = 1 - math.prod(1 - obj.probability for obj in belief.seen[0])
            places.append(Place(None, None, there, min(1.0, there / anywhere), 0.0, 0.0, ids, None))
        if self._graph.more_rooms:
            new = slice(number + 1, None)
            there = belief.somewhere(new)
            places.append(
                Place(
                    room=EXPLORE,
                    label=NOT_FOUND,
                    probability=there,
                    if_there=min(1.0, there / anywhere),
                    unseen=there,
                    expected=float(belief.expected[new].sum()),
                    seen=(),
                    cost=None if here is None else self.ways(costs).usual,
                )
            )
        far = math.inf
        return tuple(
            sorted(places, key=lambda p: (-p.probability, far if p.cost is None else p.cost))
        )

    @_alone
    def anywhere(self, thing: str) -> float:
        """Return P(at least one is in the building, seen or not).

        It is never below that of the likeliest room.
        """
        return float(self._seek(thing).belief.probability[0])

    @_alone
    def expected(self, room: str) -> tuple[ExpectedClass, ...]:
        """Return the unseen classes that a room may hold, the likeliest first.

        Classes below half a percent are left out.
        """
        node, belief = find_room(self._graph, room), self.expectation()
        presence = belief.presence[node]
        return tuple(
            ExpectedClass(
                name=self._models[0].classes[c],
                probability=float(presence[c]),
                expected=float(belief.hidden[node, c]),
                seen=int(belief.inputs[node, c]),
            )
            for c in np.argsort(-presence, kind="stable")
            if presence[c] >= LEAST_PRESENCE
        )

    @_alone
    def next_room(
        self,
        things: str | Sequence[str],
        *,
        here: str | None = None,
        costs: Costs | None = None,
        look: AnyLook | None = None,
        chance: float = LOOK_CHANCE,
        planner: AnyPlanner = "expected-cost",
        task: Task = "single",
    ) -> str | None:
        """Return the room to look into next, to find one or several things at the least cost.

        The cost is that of going and of looking. The robot's own room is a room like others, with a
        way of 0; a room in which it has just looked is left out as long as others are left. A thing
        of which one was seen and is not in doubt is looked for where it was seen. Of several
        things, those are found; the others are searched for first.

        Args:
            things: any word, or several.
            here: the robot's room; None for the likeliest room, wherever it is.
            costs: (room, room) → cost, replacing what the graph measures; ∞ closes a way.
            look: cost of a look, of every room or by room, in the unit of the ways; None for the
                usual cost, see `bsg_models.robot.looks`.
            chance: P(a look finds a thing that is there).
            planner: a name of `PLANNERS`, a `Planner`, or a function of `Knowledge`.
            task: whether one of each is enough (`single`), or all must be found (`all`).

        Returns:
            Its id; `explore` if rooms that are not found yet are worth more; None if no room is
            left to search.

        Raises:
            RecipeError: also if the planner cannot be used, a number cannot be, or no way leads to
                a room that is left.
        """
        require_task(task)
        find_planner(planner)
        if here is None:
            if costs is not None or look is not None:
                self._cost(costs, look)  # what is said must be right, though it does not count
            node = choose_likeliest(self._weigh(things, [], None, chance, task)[0])
        else:
            start = find_room(self._graph, here)
            ways, costs_of_looks = self._cost(costs, look)
            decision, _ = self._weigh(things, [start], ways, chance, task)
            node = choose_room(decision, ways, costs_of_looks, here=start, planner=planner)
        return None if node is None else self._name(node)

    @_alone
    def next_place(
        self,
        thing: str,
        *,
        here: str,
        at: str | None = None,
        costs: Costs | None = None,
        look: float | None = None,
        chance: float = LOOK_CHANCE,
    ) -> Destination | None:
        """Return the piece of furniture to look at next, to find a thing at the least cost.

        All pieces that were seen, in any room, and the rest of each room are weighed at once, by
        what going and looking cost. Report a look that missed by `looked(room, thing, at=piece)`.

        Args:
            thing: any word.
            here: the robot's room.
            at: id of the piece where the robot is; None for the middle of the room.
            costs: as for `next_room`.
            look: cost of a look at a piece, in the unit of the ways; None for 2.5 m.
            chance: P(a look finds a thing that is there).

        Returns:
            A room, and a piece there; without a piece, enter the room, or look about in it for more
            furniture. None if nothing is left to search.

        Raises:
            RecipeError: as `next_room`, and if there is no such piece.
        """
        start, sought = find_room(self._graph, here), self._seek(thing)
        piece = None if at is None else self._find_piece(at, start).name
        ways, costs_of_looks = self._cost(costs, None)
        look_at = LOOK_AT * ways.metre if look is None else read_number("look", look, most=1e9)
        decision, (belief,) = self._weigh(thing, [start], ways, chance, "single")
        spots = [
            spot
            for node in range(1, 1 + len(self._whole.rooms))
            for spot in self._list_places(sought, node)
        ]
        unseen = belief.finds_unseen(chance)
        left = decision.finds[:, 0] > 0
        finds = [
            (spot.sure if decision.is_known else spot.finds(chance, float(unseen[spot.node])))
            * left[spot.node]
            for spot in spots
        ]
        chosen = choose_spot(
            spots,
            finds,
            [costs_of_looks[spot.node] if spot.piece is None else look_at for spot in spots],
            decision=decision,
            graph=self._graph,
            ways=ways,
            here=start,
            at=piece,
        )
        if chosen is None:
            return None
        return Destination(self._name(chosen.node), chosen.name)

    def _list_places(self, sought: _Sought, node: int) -> list[Spot]:
        """Return where to look in a room."""
        spots = self._list_spots(sought, node)
        if not spots:
            return [Spot(node=node, sure=is_there(sought.belief.seen[node]))]
        return leave_rest(spots) if self._whole.rooms[node - 1].visited else spots

    @_alone
    def next_rooms(
        self,
        robots: Mapping[str, str],
        things: str | Sequence[str],
        *,
        costs: Costs | None = None,
        look: AnyLook | None = None,
        chance: float = LOOK_CHANCE,
        task: Task = "single",
    ) -> dict[str, str | None]:
        """Return the room that each of several robots looks into next: see `next_room`.

        The time until any of them finds it is least, if all move at the same speed.

        Args:
            robots: name of each robot → its room.
            things: any word, or several.
            costs: as for `next_room`, and so below.
            look: cost of a look.
            chance: P(a look finds a thing that is there).
            task: `single` or `all`.

        Returns:
            Name → id of a room, `explore`, or None if fewer rooms than robots are left.
        """
        require_task(task)
        if not robots:
            raise RecipeError("robots: expected one or more, found none", code="robots-none")
        starts = [find_room(self._graph, room) for room in robots.values()]
        ways, costs_of_looks = self._cost(costs, look)
        decision, _ = self._weigh(things, starts, ways, chance, task)
        nodes = choose_rooms(decision, ways, costs_of_looks, here=starts)
        return {
            robot: None if node is None else self._name(node)
            for robot, node in zip(robots, nodes, strict=True)
        }

    @_alone
    def explain(
        self,
        things: str | Sequence[str],
        *,
        here: str,
        costs: Costs | None = None,
        look: AnyLook | None = None,
        chance: float = LOOK_CHANCE,
        task: Task = "single",
    ) -> tuple[Step, ...]:
        """Return the rooms in the order of the plan whose first room is `next_room`.

        Arguments are those of `next_room`. Several rooms in a row that are not found yet are one
        step.
        """
        require_task(task)
        start = find_room(self._graph, here)
        ways, costs_of_looks = self._cost(costs, look)
        decision, beliefs = self._weigh(things, [start], ways, chance, task)
        order = order_rooms(decision, ways, costs_of_looks, here=start)
        sought = [beliefs[number].probability for number in decision.things]
        likely = 1 - np.prod([1 - one for one in sought], axis=0)
        q = 1 - decision.finds[order]
        before = np.concatenate([np.ones((1, q.shape[1])), q.cumprod(axis=0)])
        after = np.concatenate([q[::-1].cumprod(axis=0)[::-1], np.ones((1, q.shape[1]))])
        found = (1 - before).prod(axis=1) if task == "single" else after.prod(axis=1)
        steps: list[Step] = []
        for number, (place, node) in enumerate(pairwise([start, *order]), 1):
            room = self._name(node)
            step = Step(
                room=room,
                label=self._label(node),
                probability=float(likely[node]),
                way=float(ways.costs[place, node]),
                look=0.0 if decision.is_known else float(costs_of_looks[node]),
                found=float(found[number]),
            )
            if steps and room == EXPLORE == steps[-1].room:
                step = _join(steps.pop(), step)
            steps.append(step)
        return tuple(steps)

    @_alone
    def belief(self) -> BeliefGraph:
        """Return the belief graph, for files and pages: `write_belief(seen.belief(), path)`.

        It has as many blind nodes as are expected. `believe` also makes those of the paper's Table
        II: `believe(seen.graph, seen.expectation(), mode="unseen", model=seen.model)`.
        """
        return believe(self._graph, self.expectation(), model=self.model)

    @_alone
    def expectation(self) -> Expectation:
        """Return what the model believes of the building and its rooms, `[1 + R, C]`.

        It includes what looks have missed, and in the building what rooms not found yet may hold.
        """
        belief, rooms = self._believe(0)[1], np.arange(1 + len(self._graph.rooms))
        chances = np.zeros(belief.inputs.shape)
        words = {one.meaning.word: one.meaning for one in self._looks}.values()
        own = {m.class_index: m for m in words if m.model == 0 and m.is_class}
        for index, meaning in own.items():
            chances[:, index] = 1 - self._sum_looks(meaning, nodes=len(chances))
        if chances.any():
            belief = replace(belief, hidden_counts=after_looks(belief.hidden_counts, chances))
        # A doubted object is no evidence, and is one of those that were seen all the same.
        seen = self._graph.histograms().astype(np.float64)
        return replace(belief.take(rooms), inputs=seen)

    @_alone
    def asked(self, thing: str) -> str:
        """Return the name of the model that answers for a word, or of the table of things."""
        meaning = self.understand(thing)
        if meaning.thing is not None:
            return THINGS
        model = self._judge if meaning.class_index is None else meaning.model
        return self.model if model == 0 else _OTHERS[model][0]

    @_alone
    def understand(self, thing: str) -> Meaning:
        """Return what a word is taken for, and why.

        The building's own model is preferred. If it has no class for the word, the shipped model
        `universal-wide` with its 170 classes answers; and a word without a class is judged by what
        it means (`NounTable`). Neither helps a model that everybody may use: both are for research.
        """
        require_word(thing)
        own = self._models[0].class_map.version not in list_class_maps()
        nouns = None if self._models[0].is_free else read_nouns()
        if thing not in self._meanings:
            found = self._find_meaning(thing, prefer_exact=not own, nouns=nouns)
            if found.class_name in self._model(found.model).untaught:
                never = f"no training building had a {found.class_name}, so none is expected"
                found = replace(found, how="; ".join(filter(None, (found.how, never))))
            if len(self._meanings) >= _MOST_MEANINGS:
                self._meanings.clear()
            self._meanings[thing] = found
        return self._meanings[thing]

    def _find_meaning(self, word: str, *, prefer_exact: bool, nouns: NounTable | None) -> Meaning:
        """Return what a word means; the table of everyday things knows more than likenesses do."""
        thing, read = find_everyday(word), partial(find_meaning, prefer_exact=prefer_exact)
        if not prefer_exact and self._models[0].class_map.lookup(word):
            return read(word, self._class_maps(), nouns=nouns)
        more: tuple[str, ...] = ()
        if thing is None:
            thing, more = find_wider(word)
        if thing is None:
            return read(word, self._class_maps(), nouns=nouns)
        for name in self._models[0].class_map.classes:
            if counts(name, thing):
                found = read(name, self._class_maps(), nouns=nouns)
                how = explain_everyday(thing, word, class_name=name)
                return replace(found, word=word, how=how)
        try:
            found = read(thing.name, self._class_maps(), nouns=nouns)
        except RecipeError:
            found = Meaning(word, None, None, 0, "", is_exact=False)
        how, told = explain_everyday(thing, word), tell_apart(word)
        kind = frozenset(more if nouns is not None and nouns.knows(more) else ())  # else a brand
        return replace(found, word=word, thing=thing, how=how, told=told, kind=kind)

    def _understand_or_none(self, thing: str) -> Meaning | None:
        if thing in self._unknown:
            return None
        try:
            return self.understand(thing)
        except RecipeError:  # which takes long, to say what may have been meant
            if len(self._unknown) >= _MOST_MEANINGS:
                self._unknown.clear()
            self._unknown.add(thing)
            return None

    @_alone
    def ways(self, costs: Costs | None = None) -> Ways:
        """Return the costs of going from room to room, at most 2,000 rooms.

        Raises:
            RecipeError: also if there are more rooms, or a cost is not 0 or more.
        """
        if costs is not None:
            return measure_ways(self._graph, costs)
        if self._ways is None:
            self._ways = measure_ways(self._graph)
        return self._ways

    def _known_costs(self, here: str, costs: Costs | None) -> dict[int, float]:
        """Return the cost of the way from a room to each node, without ways that are guessed."""
        start, ways = find_room(self._graph, here), self.ways(costs)
        lost = set() if costs else list_lost(self._graph)
        if start in lost:
            return {start: 0.0}
        return {
            node: float(cost) for node, cost in enumerate(ways.costs[start]) if node not in lost
        }

    def _class_maps(self) -> Iterator[ClassMap]:
        """Yield the model's class map, then that of the wide model if it may answer, too.

        It has to have another class space. A model that everybody may use is not helped by one
        with terms of its own.
        """
        model = self._models[0]
        yield model.class_map
        wide = load_class_map(WIDE_MAP)
        has_wide = WIDE_MODEL in shipped_names() and model.class_map.space != wide.space
        if has_wide and not model.is_free:
            yield wide

    @property
    def _judge(self) -> int:
        """The model by whose classes nouns are judged."""
        return 0 if self._models[0].class_space == load_class_map().space else 2

    def _name(self, node: int) -> str:
        return self.rooms[node - 1] if node <= len(self._graph.rooms) else EXPLORE

    def _label(self, node: int) -> str | None:
        rooms = self._graph.rooms
        return rooms[node - 1].label if node <= len(rooms) else NOT_FOUND

    def _cost(self, costs: Costs | None, look: AnyLook | None) -> tuple[Ways, Floats]:
        """Return the ways and the costs of looks, with those of rooms that are not found yet."""
        ways = self.ways(costs)
        looks = cost_looks(self._graph, ways, look)
        more = len(self._whole.rooms) - len(self._graph.rooms)
        every = np.concatenate([looks[:-1], np.repeat(looks[-1], more)])
        return add_places(ways, more) if more else ways, every

    def _weigh(
        self,
        things: str | Sequence[str],
        here: Sequence[int],
        ways: Ways | None,
        chance: float,
        task: Task,
    ) -> tuple[Decision, list[ThingBelief]]:
        """Return what a decision depends on, and what is believed of the things."""
        words = _list_words(things)
        if not read_number("chance", chance, most=1.0):
            raise RecipeError("chance: expected above 0, found 0", code="chance-zero")
        # A thing that is asked for in two words is one thing.
        meanings = {_key_of(self.understand(word)): word for word in reversed(words)}
        distinct = [word for word in words if word in meanings.values()]
        beliefs = [self._seek(word).belief for word in distinct]
        nodes = 1 + len(self._whole.rooms)
        looked = [sum_looks(self._looks, self.understand(w), nodes=nodes) for w in distinct]
        open_: Bools = np.ones(nodes, dtype=bool)  # from wherever the robot is
        if ways is not None:
            open_ = np.asarray(np.isfinite(ways.costs[list(here)]).any(axis=0))
        found = weigh(beliefs, looked, here=here, open_=open_, chance=chance, task=task)
        return found, beliefs

    def _names(self, meaning: Meaning) -> Callable[[str], bool]:
        """Return whether a robot's word for an object names a thing of this meaning."""
        noun, thing = meaning.noun, meaning.thing
        if thing is not None:

            def is_thing(word: str) -> bool:
                is_listed = thing in (find_everyday(word), find_wider(word)[0])
                is_named = is_listed or bool(noun and noun.names(word))
                told = tell_apart(word)
                return is_named and meaning.kind <= told and may_be_one(meaning.told, told)

            return is_thing
        if noun is not None:
            return noun.names
        class_map = self._model(meaning.model).class_map

        def is_of_class(word: str) -> bool:
            known = class_map.classify(word)
            if known.role != "unmapped":
                return known.class_index == meaning.class_index
            thing = find_everyday(word)
            return thing is not None and thing.wider == meaning.class_name

        return is_of_class

    def _seek(self, thing: str) -> _Sought:
        """Return what is known of a thing; a question asks several times."""
        if thing not in self._sought:
            meaning = self.understand(thing)
            found = _Sought(meaning, self._look_up(meaning), sum_pieces(self._looks, meaning))
            if len(self._sought) >= _MOST_SOUGHT:
                self._sought.clear()
            self._sought[thing] = found
        return self._sought[thing]

    def _look_up(self, meaning: Meaning) -> ThingBelief:
        graph = self._whole
        if meaning.noun is not None:
            graph, belief = self._believe(self._judge)
            hidden, none = believe_noun(meaning.noun, belief, read_nouns())
        if meaning.thing is not None:
            likeness = None if meaning.noun is None else hidden.mean[:, 0]
            hidden, none = believe_thing(
                meaning.thing,
                self._whole,
                likeness=likeness,
                part=SHARE_OF_KIND if meaning.kind else 1.0,
            )
        is_sought = self._names(meaning)
        if meaning.thing is not None or meaning.noun is not None:
            found = [obj for obj in graph.objects if is_sought(obj.raw_category)]
        if meaning.class_index is not None and meaning.thing is None:
            graph, belief = self._believe(meaning.model)
            counted, of_class = believe_class(belief, meaning.class_index)
            if meaning.noun is None:
                found = [
                    obj
                    for obj in graph.objects
                    if obj.class_index == meaning.class_index
                    or (obj.class_index is None and is_sought(obj.raw_category))
                ]
                hidden, none = counted, of_class
            else:
                hidden, none = believe_kind(counted, hidden)
        seen: list[list[SeenObject]] = [[] for _ in range(len(graph.rooms) + 1)]
        for obj in found:
            seen[obj.room_index].append(obj)
        held = ThingBelief(tuple(map(tuple, seen)), hidden, none, list_searched(graph))
        return held.after(1 - self._sum_looks(meaning, nodes=len(seen)))

    def _list_pieces(self, thing: str, node: int, tidy: float) -> tuple[Piece, ...]:
        sought = self._seek(thing)
        return self._describe_pieces(sought.belief, self._list_spots(sought, node, tidy))

    def _best_pieces(self, sought: _Sought, node: int, tidy: float) -> tuple[Piece, ...]:
        """Return the likeliest pieces of a room; none if no furniture was seen there."""
        if not self._pieces_of(node).is_furnished:
            return ()
        spots = self._list_spots(sought, node, tidy)
        return self._describe_pieces(sought.belief, spots)[:_SHOWN_PIECES]

    def _describe_pieces(self, belief: ThingBelief, spots: Sequence[Spot]) -> tuple[Piece, ...]:
        pieces = (
            Piece(
                piece=spot.name,
                name=spot.piece.raw_category if spot.piece else NOT_SEEN,
                probability=spot.finds(1.0, float(belief.unseen[spot.node])),
                if_there=spot.share,
                seen=spot.seen,
            )
            for spot in spots
        )
        return tuple(sorted(pieces, key=lambda one: (one.piece is None, -one.probability)))

    def _list_spots(self, sought: _Sought, node: int, tidy: float = TIDY) -> list[Spot]:
        """Return the pieces of a room where a thing may be, then its rest; none if it stands."""
        furniture = self._furnish(sought.meaning, node, tidy)
        if furniture is None:
            return []
        return list_spots(
            furniture,
            sought.belief.seen[node],
            node=node,
            on=self._pieces_of(node).on,
            missed=sought.missed.get(node, MissedPieces({})),
        )

    def _pieces_of(self, node: int) -> SeenPieces:
        """Return the furniture of a room, as looks leave it."""
        if node not in self._pieces:
            self._pieces[node] = find_pieces(self._objects_of(node))
        return self._pieces[node]

    def _objects_of(self, node: int) -> Sequence[SeenObject]:
        """Return the objects of a room, as looks leave them."""
        if not self._by_room:
            for obj in self._whole.objects:
                self._by_room.setdefault(obj.room_index, []).append(obj)
        return self._by_room.get(node, ())

    def _furnish(self, meaning: Meaning, node: int, tidy: float = TIDY) -> Furniture | None:
        belief = self._believe(0)[1]
        return furnish(
            meaning.said,
            self._whole.rooms[node - 1],
            self._pieces_of(node),
            classes=self._models[0].classes,
            unseen=belief.presence[node],
            tidy=tidy,
        )

    def _sum_looks(self, meaning: Meaning, *, nodes: int) -> Floats:
        """Return P(all looks miss a thing that is in the room), `[N]`: at its pieces, too."""
        missed = sum_looks(self._looks, meaning, nodes=nodes).missed
        for node, pieces in sum_pieces(self._looks, meaning).items():
            is_at_pieces = not pieces.of_pieces.keys() <= {None}
            if is_at_pieces and (furniture := self._furnish(meaning, node)) is not None:
                missed[node] *= furniture.overlooked(pieces.of_pieces)
        return missed

    def _model(self, model: int) -> Predictor:
        if model not in self._models:
            self._models[model] = Predictor(_OTHERS[model][0])
        return self._models[model]

    def _believe(self, model: int) -> _Now:
        """Return the graph as a model reads it, and what it believes; 0 is the building's own.

        The graph has the rooms that are not found yet.
        """
        if model not in self._read:
            self._read[model] = reclassify(self._whole, load_class_map(_OTHERS[model][1]))
        graph = self._read[model]
        if model not in self._expectations:
            self._expectations[model] = self._model(model)(graph)
        return graph, self._expectations[model]


def _list_words(things: str | Sequence[str]) -> list[str]:
    if not isinstance(things, str | Sequence):
        raise RecipeError(
            f"things: expected a word or several, found {show_value(things)}", code="things-none"
        )
    words = [things] if isinstance(things, str) else [*things]
    if not words:
        raise RecipeError("things: expected one word or more, found none", code="things-none")
    return words


def _key_of(meaning: Meaning) -> tuple[object, ...]:
    """Return what two words have in common that mean the same thing."""
    noun = meaning.noun
    if meaning.thing is not None:
        return meaning.thing.name, meaning.told
    parts = None if noun is None else (*split_head(noun.name)[0], noun.head, looks_of(noun.name))
    return meaning.model, meaning.class_index, parts


def _join(step: Step, more: Step) -> Step:
    """Return two steps into rooms that are not found yet as one."""
    return replace(
        step,
        probability=1 - (1 - step.probability) * (1 - more.probability),
        way=step.way + more.way,
        look=step.look + more.look,
        found=more.found,
    )
