"""What `SeenBuilding` answers: records of rooms, pieces of furniture and steps of a search."""

from __future__ import annotations

from dataclasses import dataclass

EXPLORE = "explore"  # a room's id in answers: look for rooms that are not found yet
NOT_FOUND = "rooms not found yet"
NOT_SEEN = "a piece not seen yet"


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
    kind: str | None = None  # that the room is taken for; None if none is likelier than half
    pieces: tuple[Piece, ...] = ()  # the likeliest three, if furniture was seen there


@dataclass(frozen=True, slots=True)
class Habit:
    """A place where things of a kind usually are in this home."""

    room: str | None  # its id; None: elsewhere, also as in homes that nobody knows
    piece: str | None  # id of a piece of furniture; None if nobody said on what
    share: float  # P(one that was moved is there now, by its habits)
    sightings: int  # of such things there
    last: str | float | None  # time of the last one: a date, or seconds
    told: bool  # whether people said that they are kept there


@dataclass(frozen=True, slots=True)
class RoomKind:
    """A kind that a room may be of."""

    name: str  # a room label
    probability: float


@dataclass(frozen=True, slots=True)
class ExpectedClass:
    """A class of things that a room may hide."""

    name: str
    probability: float  # P(at least one unseen is there)
    expected: float  # number of unseen ones
    seen: int  # number that was seen there


@dataclass(frozen=True, slots=True)
class Step:
    """A look into a room, in the order in which a robot would search."""

    room: str  # its id, or `EXPLORE`
    label: str | None
    probability: float  # P(any of the things is there)
    way: float  # cost of going there from the room before
    look: float  # cost of looking there
    found: float  # P(the search has ended by then: all that are sought are found)
    any_found: float  # P(any of the things is found by then)
    seconds: float | None = None  # until this look ends; None if the robot's speed is not said
