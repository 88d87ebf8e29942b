"""Answers to a robot, in the names and ids that it uses itself."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Place:
    """A room where a thing may be.

    Attributes:
        room: its id; None for what was seen in no room.
        label: what people call it; None if nobody does.
        probability: P(at least one is there); 1 where one was seen.
        unseen: P(at least one is there that was not seen).
        expected: expected number of those that are there and were not seen.
        seen: ids of those that were seen there.
        cost: of the way to the room; None if the robot did not say where it is.
    """

    room: str | None
    label: str | None
    probability: float
    unseen: float
    expected: float
    seen: tuple[str, ...]
    cost: float | None


@dataclass(frozen=True, slots=True)
class ExpectedClass:
    """A class of things that a room may hide.

    Attributes:
        name: of the class.
        probability: P(at least one is there and was not seen).
        expected: expected number of those.
        seen: how many were seen there.
    """

    name: str
    probability: float
    expected: float
    seen: int
