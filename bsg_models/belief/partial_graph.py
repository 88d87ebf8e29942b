"""The partial graph 𝒢′: what a robot has seen of a building (paper, section II).

A robot knows the rooms, which of them it entered, what it saw there, and the hidden share of each
room. The hidden share is 1 for a room that it never entered, and 0 for a room that it searched.
Node indices are those of `bsg_data.scene.scene_graph`. `bsg_robot` reads and updates it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache, lru_cache
from numbers import Real
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    GetPydanticSchema,
    PlainValidator,
    TypeAdapter,
    ValidationError,
    WithJsonSchema,
)

from bsg_data.arrays import Bools, Counts, Floats, Ints
from bsg_data.dataset.histograms import count_cells, find_columns, to_histograms
from bsg_data.errors import RecipeError
from bsg_data.inputs.bounds import MAX_CORNERS, MAX_UNREAD
from bsg_data.observation.observation import Observation
from bsg_data.observation.view import View
from bsg_data.records import MAX_METRES, name_fault
from bsg_data.scene.class_map import is_nameless
from bsg_data.scene.class_space import ClassSpace
from bsg_data.scene.connections import Connections
from bsg_data.scene.room_label import Origin, RoomType, check_room_type
from bsg_data.scene.scene_graph import Box
from bsg_data.scene.surroundings import MAX_FLOOR_AREA, Surroundings, find_floor_area
from bsg_data.words.shown import show_value
from bsg_models.belief.clock import HOUR, Time
from bsg_models.belief.hidden_share import ShareBelief

MOST_HIDDEN = 0.99  # of a room that shows something, though all of it is said to be hidden
LOOK_CHANCE = 0.8  # P(a look finds a thing that is there), if the robot does not say
EVIDENCE_SCORE = 0.5  # models read objects that are there with at least this probability
_MOST_MORE_ROOMS = 100
_MOST_ID = 10**20  # of an id that is a number: any of 64 bits


def _plain(value: Any) -> Any:
    """Return a value of NumPy as Python's."""
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def _read_number(value: object) -> object:
    """Refuse what pydantic would take for a number: true, false and text."""
    number = _plain(value)
    if isinstance(number, bool) or not isinstance(number, Real):
        raise ValueError(f"expected a number, found {show_value(number)}")
    return number


def check_more_rooms(value: object) -> int | None:
    """Return a number of rooms that are not found yet; True for as many as homes have.

    Raises:
        RecipeError: for what is no whole number.
    """
    if value is None or value is True:
        return value
    number = 0 if value is False else _plain(value)
    if not isinstance(number, int) or not 0 <= number <= _MOST_MORE_ROOMS:
        raise RecipeError(
            f"more_rooms: expected true or a whole number of 0 to {_MOST_MORE_ROOMS:,}, found "
            f"{show_value(value)}",
            code="more-rooms-impossible",
        )
    return number


def spell_id(value: Any) -> Any:
    """Return an id as text: a number is one, too."""
    number = _plain(value)
    is_number = isinstance(number, int) and not isinstance(number, bool)
    return str(number) if is_number and abs(number) < _MOST_ID else number


def _read_point(value: object) -> object:
    """Return a point as a list: of NumPy, or with names of its axes."""
    if isinstance(value, Mapping) and value.keys() in ({"x", "y"}, {"x", "y", "z"}):
        return [value[axis] for axis in sorted(value)]
    return _plain(value)


def _read_position(value: object) -> object:
    point = _read_point(value)
    if isinstance(point, list | tuple) and len(point) != 3:
        raise ValueError(f"expected [x, y, z] in metres, found {show_value(point)}")
    return point


def _read_flag(value: object) -> object:
    """Return true or false: also of NumPy, and as 1 or 0."""
    flag = _plain(value)
    if not isinstance(flag, bool | int) or flag not in (0, 1):
        raise ValueError(f"expected true or false, found {show_value(flag)}")
    return bool(flag)


# What a robot's JSON may hold; `KnownRoom` in Python is trusted.
Id = Annotated[str, Field(min_length=1, max_length=500), BeforeValidator(spell_id)]
Text = Annotated[str, Field(max_length=500)]
Number = BeforeValidator(_read_number)
Metres = Annotated[float, Number, Field(ge=-MAX_METRES, le=MAX_METRES)]
Footprint = Annotated[
    tuple[Annotated[tuple[Metres, Metres], BeforeValidator(_read_point)], ...],
    Field(min_length=3, max_length=MAX_CORNERS),
    BeforeValidator(_plain),
]
Position = Annotated[tuple[Metres, Metres, Metres], BeforeValidator(_read_position)]
_Corners = Annotated[
    tuple[Position, Position],
    BeforeValidator(lambda said: (said.minimum, said.maximum) if isinstance(said, Box) else said),
    AfterValidator(lambda ends: Box(*ends)),
]
_AS_CORNERS = GetPydanticSchema(lambda _, handler: handler.generate_schema(_Corners | None))
StrictFraction = Annotated[float, Number, Field(ge=0, le=1)]
Score = Annotated[float, Number, Field(ge=0, le=1)]
Hours = Annotated[float, Number, Field(ge=0, le=1e6)]
Stay = Annotated[float, Number, Field(gt=0, le=1e9)]
Unread = Annotated[tuple[Text, ...], Field(max_length=MAX_UNREAD)]
MoreRooms = Annotated[
    int | None,
    PlainValidator(check_more_rooms),
    WithJsonSchema({"type": ["integer", "boolean", "null"], "minimum": 0}),
]


@dataclass(frozen=True, slots=True)
class SeenObject:
    """One object that the robot saw.

    Attributes:
        name: its id in the source, unique in the graph.
        room_index: its room, 1..R; 0 for an object in no room.
        raw_category: its name in the source.
        category: the corrected name by the class map; None if the map does not have the name.
        class_index: its class; None outside the classes.
        position: metres, Z up; None if unknown.
        score: P(it is there now), of a detector or of what has happened since; None if nobody
            doubts it.
        on: id of the object on or in which it lies; None if unknown.
        time: when it was seen there; None if nobody says: then it stays there.
        stays: hours after which half of such things are elsewhere; None for the usual.
    """

    name: Annotated[Id, Field(alias="id")]
    room_index: int
    raw_category: Text
    category: str | None
    class_index: int | None
    position: Position | None = None
    score: Score | None = None
    on: Id | None = None
    time: Time | None = None
    stays: Stay | None = None

    @property
    def probability(self) -> float:
        """P(it is there now); 1 if nobody doubts it."""
        return 1.0 if self.score is None else self.score

    @property
    def is_evidence(self) -> bool:
        """Whether models read it: it is probably there."""
        return self.probability >= EVIDENCE_SCORE


@dataclass(frozen=True, slots=True)
class KnownRoom:
    """One room that the robot knows. The types of its fields say what its JSON may hold.

    Attributes:
        name: its id in the source, unique in the graph.
        hidden_share: share of its objects that the robot has not seen, 0 to 1; the mean, if
            uncertain.
        visited: whether the robot was inside.
        label: its name in the source, for people; models never read it.
        position: metres, Z up; None if unknown.
        box: metres; None if unknown.
        footprint: corners (x, y) from above, metres; None if unknown.
        floor_index: storey, 0 at the bottom; None if unknown.
        floor_area: square metres; None: take it from footprint or box, if any.
        room_type: one of `list_all_labels()`, or several with probabilities. Models read it. None
            if unknown.
        hidden_share_sd: standard deviation of the hidden share; 0 if it is certain.
        unread: words for its type that nobody could read; they say nothing.
        time: when so much of it was seen; None if nobody says.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    name: Annotated[Id, Field(alias="id")]
    hidden_share: StrictFraction
    visited: Annotated[bool, BeforeValidator(_read_flag)] = True
    label: Text | None = None
    position: Position | None = None
    box: Annotated[Box | None, _AS_CORNERS] = None
    footprint: Footprint | None = None
    floor_index: Annotated[int, Number, Field(ge=-1000, le=1000)] | None = None
    floor_area: Annotated[float, Number, Field(gt=0, le=MAX_FLOOR_AREA)] | None = None
    room_type: Annotated[RoomType | None, PlainValidator(check_room_type)] = None
    hidden_share_sd: StrictFraction = 0.0
    unread: Unread = ()
    time: Time | None = None

    @property
    def share(self) -> ShareBelief:
        """The belief about the hidden share.

        Raises:
            RecipeError: if mean and standard deviation do not fit together.
        """
        return _believe_share(self.hidden_share, self.hidden_share_sd)

    @property
    def area(self) -> float | None:
        """The floor area, square metres, as said or by the shape; None if nothing says one."""
        return find_floor_area(self.floor_area, footprint=self.footprint, box=self.box)


_believe_share = lru_cache(ShareBelief)  # every answer asks again, and most rooms share a belief
_Report = TypeVar("_Report", KnownRoom, SeenObject)


@dataclass(frozen=True, slots=True)
class Look:
    """A search of a room, or of one object in it, for one thing, which did not find it.

    Attributes:
        room_index: the room, 1..R.
        thing: what was looked for, in the robot's word.
        chance: P(the look would have found it, if one is there).
        at: id of the object that was searched, such as a table; None for the whole room.
        time: of the look; None if nobody says.
    """

    room_index: int
    thing: Text
    chance: Score
    at: Id | None = None
    time: Time | None = None


class Sighting(NamedTuple):
    """Where a thing was seen once."""

    time: float
    room_index: int
    on: str | None  # id of the object on which it lay


@dataclass(frozen=True, slots=True)
class Remembered:
    """Where one thing was seen before it was where it is now.

    Attributes:
        name: its id; no object of the graph has it if nobody knows where it is now.
        raw_category: its name in the source.
        sightings: the latest is the last.
        score: P(there is such a thing): the highest of its detections, which err alike; None if
            nobody doubts it.
    """

    name: str
    raw_category: str
    sightings: tuple[Sighting, ...]
    score: float | None = None


@dataclass(frozen=True, slots=True)
class Custom:
    """Where people say that a thing belongs, or never is.

    Attributes:
        thing: it, or a group of things such as drinks, in any word.
        room_index: 1..R; None for any room.
        at: id of a piece of furniture, or its word; None for the whole room.
        never: whether it is never there.
    """

    thing: str
    room_index: int | None
    at: str | None = None
    never: bool = False


@dataclass(frozen=True, slots=True)
class PartialGraph:
    """What a robot has seen of one building.

    A node that shows something hides less than all: a share of 1 becomes `MOST_HIDDEN` there.

    Attributes:
        scene_id: id of the building.
        class_space: class space of the objects' classes.
        hidden_share: hidden share of the whole building; it changes with the shares of the rooms,
            see `share_with`.
        rooms: the rooms, in the order of their indices 1..R.
        objects: the seen objects, in any order.
        adjacency: pairs of indices of connected rooms, ascending.
        building_kind: one of `SAID_KINDS`; None if unknown.
        source: kind of source with the same names and counting of objects, e.g. `hm3d`; None if
            unknown.
        detector: the words that the robot's detector knows, each with its class, None for one
            outside the classes. Absence of any other class says nothing, in searched rooms too.
            None: it knows every class.
        looks: searches for single things that did not find them, the last one at the end; one for
            each place and thing, with the chance of all of them together.
        more_rooms: number of rooms that are not found yet; True for as many as homes have; None if
            nobody says: then none are expected.
        stays: hours after which half of the things are elsewhere; None: it depends on the thing.
        now: the time; None without a clock: then nothing gets older.
        memory: where things were seen before.
        customs: where people say that things belong.
        room_labels: the user's words for rooms, each with its label; None for no kind of room.
        unread: words for the kind of building that nobody could read; they say nothing.
        origins: id of a room → what its type was read from; `""` → the kind of building.
    """

    scene_id: str
    class_space: ClassSpace
    hidden_share: float
    rooms: tuple[KnownRoom, ...]
    objects: tuple[SeenObject, ...]
    adjacency: tuple[tuple[int, int], ...] = ()
    building_kind: str | None = None
    source: str | None = None
    detector: tuple[tuple[str, int | None], ...] | None = None
    looks: tuple[Look, ...] = ()
    more_rooms: int | None = None
    stays: float | None = None
    now: float | None = None
    memory: tuple[Remembered, ...] = ()
    customs: tuple[Custom, ...] = ()
    room_labels: tuple[tuple[str, str | None], ...] = ()
    unread: tuple[str, ...] = ()
    origins: Mapping[str, tuple[Origin, ...]] = field(default_factory=dict, compare=False)

    def __post_init__(self) -> None:
        """Let no node that shows something hide all."""
        full = {number for number, room in enumerate(self.rooms, 1) if room.hidden_share == 1}
        if not full and self.hidden_share < 1:
            return
        shown = {obj.room_index for obj in self.objects if obj.is_evidence}
        if self.hidden_share == 1 and shown:
            object.__setattr__(self, "hidden_share", MOST_HIDDEN)
        if hidden := full & shown:
            rooms = (
                replace(room, hidden_share=MOST_HIDDEN) if number in hidden else room
                for number, room in enumerate(self.rooms, 1)
            )
            object.__setattr__(self, "rooms", tuple(rooms))

    def share_with(self, shares: Sequence[float]) -> float:
        """Return the hidden share of the building if its rooms have these shares, `[R]`.

        It is proportional to the sum of the rooms' shares, and at most 1. If no room of the graph
        hides anything, it is the mean of the shares.
        """
        before, after = sum(room.hidden_share for room in self.rooms), sum(shares)
        if not before:
            return after / len(shares) if after else self.hidden_share
        return min(1.0, self.hidden_share * after / before)

    def still_so(self, stays: Floats) -> Floats:
        """Return the share of the things of each room that did not move since, `[..., R]`.

        It is 2^(−age / stays) of what was seen of a room; 1 if nobody says when.

        Args:
            stays: hours after which half of some things are elsewhere, `[...]`; those of the graph
                count before.
        """
        stays = stays if self.stays is None else np.full_like(stays, self.stays)
        now = self.now or 0.0
        times = [now if room.time is None or self.now is None else room.time for room in self.rooms]
        hours = (now - np.array(times, dtype=np.float64)).clip(min=0) / HOUR
        return np.asarray(2.0 ** (-hours / stays[..., None]))

    def histograms(self) -> Counts:
        """Return the histograms of what was seen, E′ × O′, `[1 + R, C]`, the building first."""
        return to_histograms(self._cells())

    def observation(
        self, *, vocabulary: tuple[str, ...] = (), withheld: Collection[int] | Bools = ()
    ) -> Observation:
        """Return the graph as arrays, the input of models; hidden shares become their means.

        Args:
            vocabulary: categories outside the classes to count.
            withheld: classes that the graph shows only in searched rooms, so their absence
                elsewhere says nothing. Or an array `[1 + R, C]`, true where nothing of a class is
                shown.

        Raises:
            RecipeError: if an array has another shape, or a room type is impossible.
        """
        cells = self._cells()
        share = np.array([self.hidden_share, *(room.hidden_share for room in self.rooms)])
        visited = np.array([True, *(room.visited for room in self.rooms)])
        if isinstance(withheld, np.ndarray):
            if withheld.shape != cells.shape:
                raise RecipeError(
                    f"{self.scene_id}: withheld: expected {cells.shape}, found {withheld.shape}",
                    code="withheld-shape",
                    where=self.scene_id,
                )
            without = withheld.astype(bool)
        else:
            without = np.isin(np.arange(cells.shape[1]), list(withheld)) & (share > 0)[:, None]
        if self.detector is not None:
            known = {index for _, index in self.detector if index is not None}
            without = without | ~np.isin(np.arange(cells.shape[1]), [*known])
        surroundings = Surroundings.of_rooms(
            [room.area for room in self.rooms],
            [room.room_type for room in self.rooms],
            building_kind=self.building_kind,
            source=self.source,
        )
        return Observation.of_views(
            [self.scene_id],
            [View(visited, share, without, np.arange(len(cells)))],
            to_histograms(cells),
            to_histograms(self._count_unclassified(vocabulary)),
            vocabulary=vocabulary,
            connections=[Connections.of_pairs(self.adjacency)],
            surroundings=[surroundings],
        )

    def _cells(self) -> Counts:
        """Return the seen objects of the classes, `[1 + R, C]`."""
        known = [
            (obj.room_index, obj.class_index)
            for obj in self.objects
            if obj.class_index is not None and obj.is_evidence
        ]
        return self._count(np.array(known, dtype=np.int64), len(self.class_space.classes))

    def _count_unclassified(self, vocabulary: Sequence[str]) -> Counts:
        """Return the seen objects outside the classes, counted by a vocabulary, `[1 + R, V]`."""
        known = [
            (obj.room_index, obj.category)
            for obj in self.objects
            if obj.class_index is None
            and obj.category
            and not is_nameless(obj.category)
            and obj.is_evidence
        ]
        columns = find_columns([category for _, category in known], vocabulary)
        pairs = np.stack([[room for room, _ in known], columns], axis=-1).astype(np.int64)
        return self._count(pairs[columns >= 0], len(vocabulary))

    def _count(self, pairs: Ints, width: int) -> Counts:
        """Count pairs of a room and a column `[O, 2]`."""
        rooms, columns = pairs.reshape(-1, 2).T
        return count_cells(rooms, columns, shape=(len(self.rooms) + 1, width))


def check_report(seen: _Report) -> _Report:
    """Return a room or an object with plain numbers, as a file holds it.

    Raises:
        RecipeError: for what no file could hold.
    """
    values = {field.name: getattr(seen, field.name) for field in fields(seen)}
    try:
        checked: _Report = _adapter_of(is_room=isinstance(seen, KnownRoom)).validate_python(
            {"id": values.pop("name"), **values}
        )
        return checked
    except ValidationError as error:
        where = f"{'room' if isinstance(seen, KnownRoom) else 'object'} {show_value(seen.name)}"
        message = f"{where}: {name_fault(error)}"
        raise RecipeError(message, code="report-impossible", where=where) from error


@cache
def _adapter_of(*, is_room: bool) -> TypeAdapter[Any]:
    return TypeAdapter(KnownRoom if is_room else SeenObject)
