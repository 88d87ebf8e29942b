"""Keep what a robot has seen of a building, and answer its questions about the rest.

    seen = open_graph("graph.json")
    seen.where("microwave")[0].room

All names are the robot's own: ids or labels of its rooms, and any word for a thing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from itertools import count
from pathlib import Path
from threading import RLock
from types import MappingProxyType
from typing import Any, Concatenate, ParamSpec, TypeAlias, TypeVar

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.dataset.manifest import COMPARED, UnmappedEntry, describe_unmapped
from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath
from bsg_data.observation.hidden_share import ShareBelief, estimate_hidden_share
from bsg_data.observation.partial_graph import (
    KnownRoom,
    PartialGraph,
    SeenObject,
    check_report,
    discover,
    enter,
    reclassify,
    see_object,
)
from bsg_data.observation.robot_json import list_unmapped
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap, list_class_maps, load_class_map
from bsg_data.scene.room_label import RoomType
from bsg_data.scene.surroundings import area_of
from bsg_models.belief.belief_graph import LEAST_PRESENCE, BeliefGraph, Mode, believe
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.graph_file import open_graph_file, parse_graph
from bsg_models.belief.nouns import read_nouns
from bsg_models.robot.notes import note_graph
from bsg_models.robot.ways import Costs, Ways, choose_destination, list_lost, measure_ways
from bsg_models.robot.words import Meaning, find_meaning, find_room, set_hidden_shares
from bsg_models.runs.found_model import DEFAULT_MODEL, WIDE_MAP, WIDE_MODEL, shipped_names
from bsg_models.runs.predictor import Predictor
from bsg_models.search.catalogue import AnyPlanner, find_planner
from bsg_models.search.knowledge import Task
from bsg_models.search.planners import require_task

# Models besides the building's own, and their class maps.
_OTHERS = {1: (WIDE_MODEL, WIDE_MAP), 2: (DEFAULT_MODEL, DEFAULT_CLASS_MAP)}


@dataclass(frozen=True, slots=True)
class Place:
    """A room where a thing may be."""

    room: str | None  # its id; None for objects that were seen in no room
    label: str | None
    probability: float  # P(at least one is there); 1 if one was seen
    unseen: float  # P(at least one unseen is there)
    expected: float  # number of unseen ones
    seen: tuple[str, ...]  # ids of those that were seen there
    cost: float | None  # of the way to the room; None if unknown


@dataclass(frozen=True, slots=True)
class ExpectedClass:
    """A class of things that a room may hide."""

    name: str
    probability: float  # P(at least one unseen is there)
    expected: float  # number of unseen ones
    seen: int  # number that was seen there


# Of one thing, for each node: ids of those seen, P(at least one unseen), expected unseen number.
_Answer: TypeAlias = tuple[list[tuple[str, ...]], Floats, Floats]


def open_graph(
    graph: AnyPath | Mapping[str, Any],
    *,
    model: Predictor | AnyPath = DEFAULT_MODEL,
    labels: AnyPath | None = None,
    hidden_share: float | None = None,
    hidden_shares: Mapping[str, float] = MappingProxyType({}),
) -> SeenBuilding:
    """Open a robot's graph, to ask about it.

    Args:
        graph: file of a robot's graph, in this project's JSON or Spark-DSG's; `-` for standard
            input; or the document itself, as `json.loads` returns it.
        model: a `Predictor`, or what it takes.
        labels: label space of a Hydra graph, as `load_label_space` takes it.
        hidden_share: share of the objects of every room that was not seen; None takes it from the
            graph.
        hidden_shares: hidden share of single rooms, by room id or label; see `set_hidden_shares`.

    Raises:
        BSGError: if the graph cannot be read.
        CheckpointError: if there is no such model.
        RecipeError: if a share is not 0 to 1 or names an unknown room.
    """
    if isinstance(graph, Mapping):
        file = parse_graph(dict(graph), path=Path("graph"), labels=labels)
    else:
        file = open_graph_file(Path(graph), labels=labels)
    known = set_hidden_shares(file.graph, every=hidden_share, rooms=hidden_shares)
    predictor = model if isinstance(model, Predictor) else Predictor(model)
    return SeenBuilding(reclassify(known, predictor.class_map), predictor, notes=file.notes)


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

    Reports change this object: `saw`, `entered`, `searched` and `discovered`. Questions do not:
    `where`, `anywhere`, `expected`, `next_room` and `belief`. The state is one immutable
    `PartialGraph`. Keep `graph`, or a `copy`, to ask what-if questions.

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
        self._graph = graph
        own = model if isinstance(model, Predictor) else Predictor(model)
        self._models = {
            0: own
        }  # 0: the building's own, 1: the wide one, 2: that nouns are judged by
        self._beliefs: dict[int, tuple[PartialGraph, Expectation]] = {}
        self._ways: Ways | None = None

    @property
    def graph(self) -> PartialGraph:
        """What was seen so far."""
        return self._graph

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know about how the graph is read, a sentence each."""
        return (*self._notes, *note_graph(self._graph, self._models[0]))

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
        return tuple(describe_unmapped(list_unmapped(self._graph), class_map, near=COMPARED))

    @_alone
    def copy(self) -> SeenBuilding:
        """Return an independent copy; reports to it do not change this object."""
        other = SeenBuilding(self._graph, self._models[0], notes=self._notes)
        other._models, other._beliefs = self._models, dict(self._beliefs)
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
    ) -> str:
        """Report one object in a room, and return its id; the room may hold more.

        Args:
            room: id or label; None for an object that is in no room.
            thing: its category.
            object_id: a known id moves the object instead of adding one. Give an id to detections
                that repeat; without it, every call adds an object.
            position: metres, Z up.
        """
        if not thing.strip():
            raise RecipeError("saw: expected the name of a thing, found none", code="thing-none")
        index = 0 if room is None else find_room(self._graph, room)
        if object_id is None:
            taken = {obj.name for obj in self._graph.objects}
            names = (f"saw {number}" for number in count(len(taken) + 1))
            object_id = next(name for name in names if name not in taken)
        known = self._models[0].class_map.classify(thing)
        seen = check_report(
            SeenObject(object_id, index, thing, known.category, known.class_index, position)
        )
        self._change(see_object(self._graph, seen))
        return seen.name

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
        self._change(enter(self._graph, index, hidden_share=hidden_share))

    def searched(self, room: str) -> None:
        """Report that everything in a room was seen and reported by `saw`."""
        self.entered(room, hidden_share=0.0)

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
            room_type: a room label, or labels with probabilities.
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
        self._change(discover(self._graph, check_report(new), beside=neighbours))

    def _change(self, graph: PartialGraph) -> None:
        self._graph = graph
        self._beliefs, self._ways = {}, None

    # Questions of the robot

    @_alone
    def where(
        self, thing: str, *, here: str | None = None, costs: Costs | None = None
    ) -> tuple[Place, ...]:
        """Return the rooms by the probability that a thing is there, the likeliest first.

        Args:
            thing: any word; `understand` says which class answers it.
            here: the robot's room, from which costs are measured.
            costs: (room, room) → cost, replacing what the graph measures; ∞ closes a way.
        """
        seen, presence, hidden = self._look_up(thing)
        known_costs = {} if here is None else self._known_costs(here, costs)
        places = [
            Place(
                room=room.name,
                label=room.label,
                probability=1.0 if seen[node] else float(presence[node]),
                unseen=float(presence[node]),
                expected=float(hidden[node]),
                seen=seen[node],
                cost=known_costs.get(node),
            )
            for node, room in enumerate(self._graph.rooms, 1)
        ]
        if seen[0]:
            places.append(Place(None, None, 1.0, 0.0, 0.0, seen[0], None))
        far = math.inf
        return tuple(
            sorted(places, key=lambda p: (-p.probability, far if p.cost is None else p.cost))
        )

    @_alone
    def anywhere(self, thing: str) -> float:
        """Return P(at least one is in the building, seen or not)."""
        seen, presence, _ = self._look_up(thing)
        return 1.0 if any(seen) else float(presence[0])

    @_alone
    def expected(self, room: str) -> tuple[ExpectedClass, ...]:
        """Return the unseen classes that a room may hold, the likeliest first.

        Classes below half a percent are left out.
        """
        node, belief = find_room(self._graph, room), self._believe(0)[1]
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
        planner: AnyPlanner = "expected-cost",
        task: Task = "single",
    ) -> str | None:
        """Return the room to go to next, to find one or several things.

        A room where one was seen has probability 1. The robot's own room counts like the others
        until it is `searched`: it is returned while it is likelier than the rooms beyond. A room on
        the way to a likelier one is skipped.

        Args:
            things: any word, or several.
            here: the robot's room; None for the likeliest room, wherever it is.
            costs: (room, room) → cost, replacing what the graph measures; ∞ closes a way.
            planner: a name of `PLANNERS`, a `Planner`, or a function of `Knowledge`.
            task: whether one of each is enough (`single`), or all must be found (`all`).

        Returns:
            Its id; None if no room is left to search or none can be reached.

        Raises:
            RecipeError: also if the planner cannot be used.
        """
        require_task(task)
        find_planner(planner)
        answers = [self._look_up(one) for one in ([things] if isinstance(things, str) else things)]
        if not answers:
            raise RecipeError("things: expected one word or more, found none", code="things-none")
        seen = np.array([[bool(ids) for ids in every] for every, _, _ in answers]).T
        presence = np.where(seen, 1.0, np.stack([one for _, one, _ in answers], axis=1))
        explored = np.array([True, *(room.hidden_share == 0 for room in self._graph.rooms)])
        explored &= ~seen.any(axis=1)
        explored[0] = True  # node 0 holds objects of no room, and nobody can go there
        chosen: int | None
        if here is None:
            chosen = int(np.where(explored, -1.0, 1 - (1 - presence).prod(axis=1)).argmax())
            return None if explored[chosen] else self.rooms[chosen - 1]
        place = find_room(self._graph, here)
        if seen[place].all():
            return self.rooms[place - 1]
        chosen = choose_destination(
            self.ways(costs),
            here=place,
            explored=explored,
            presence=presence,
            planner=planner,
            task=task,
        )
        return None if chosen is None else self.rooms[chosen - 1]

    @_alone
    def belief(self, *, mode: Mode = "complete", top: int = 3) -> BeliefGraph:
        """Return the belief graph, for files and pages: `write_belief(seen.belief(), path)`.

        Args:
            mode: which blind nodes: as many as expected (`complete`), or the top unseen classes
                (`unseen`).
            top: number of classes per room that get a blind node under `unseen`.
        """
        return believe(*self._believe(0), mode=mode, top=top, model=self.model)

    @_alone
    def asked(self, thing: str) -> str:
        """Return the name of the model that answers for a word."""
        meaning = self.understand(thing)
        model = self._judge if meaning.class_index is None else meaning.model
        return self.model if model == 0 else _OTHERS[model][0]

    @_alone
    def understand(self, thing: str) -> Meaning:
        """Return what a word is taken for, and why.

        The building's own model is preferred. If it has no class for the word, the shipped model
        `universal-wide` with its 170 classes answers; and a word without a class is judged by what
        it means (`NounTable`). Neither helps a model that everybody may use: both are for research.
        """
        own = self._models[0].class_map.version not in list_class_maps()
        nouns = None if self._models[0].is_free else read_nouns()
        return find_meaning(thing, self._class_maps(), prefer_exact=not own, nouns=nouns)

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

    def _look_up(self, thing: str) -> _Answer:
        meaning = self.understand(thing)
        seen: list[list[str]] = [[] for _ in range(len(self._graph.rooms) + 1)]
        if meaning.noun is not None:
            graph, belief = self._believe(self._judge)
            counts = read_nouns().expect(meaning.noun, belief)
            presence, hidden = counts.presence[:, 0], counts.mean[:, 0]
            found = [obj for obj in graph.objects if meaning.noun.names(obj.raw_category)]
        if meaning.class_index is not None:
            (graph, belief), column = self._believe(meaning.model), meaning.class_index
            counted = belief.presence[:, column], belief.hidden[:, column]
            if meaning.noun is None:
                found = [obj for obj in graph.objects if obj.class_index == column]
                presence, hidden = counted
            else:
                presence, hidden = _narrow(counted, (presence, hidden))
        for obj in found:
            seen[obj.room_index].append(obj.name)
        return [tuple(names) for names in seen], presence, hidden

    def _believe(self, model: int) -> tuple[PartialGraph, Expectation]:
        """Return the graph as a model reads it, and what it believes; 0 is the building's own."""
        if model not in self._models:
            self._models[model] = Predictor(_OTHERS[model][0])
        if model not in self._beliefs:
            graph = (
                self._graph
                if not model
                else reclassify(self._graph, load_class_map(_OTHERS[model][1]))
            )
            self._beliefs[model] = graph, self._models[model](graph)
        return self._beliefs[model]


def _narrow(counted: tuple[Floats, Floats], judged: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Return presence and number of a kind of a class's things: a geometric mean of two beliefs.

    The class is counted but wider; the noun is exact but judged by its meaning alone. A kind is
    never likelier than its class.
    """
    rates = [-np.log1p(-np.minimum(presence, 1 - 1e-12)) for presence, _ in (counted, judged)]
    presence = np.minimum(-np.expm1(-np.sqrt(rates[0] * rates[1])), counted[0])
    return presence, np.minimum(np.sqrt(counted[1] * judged[1]), counted[1])
