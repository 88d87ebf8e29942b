"""Define the answers to a robot, in its own names and ids."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Place:
    """A room where a thing may be.

    Attributes:
        room: its id; None for objects that were seen in no room.
        label: of the room; None if it has none.
        probability: P(at least one is there); 1 if one was seen.
        unseen: P(at least one unseen is there).
        expected: expected number of unseen ones.
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
        probability: P(at least one unseen is there).
        expected: expected number of unseen ones.
        seen: number that was seen there.
    """

    name: str
    probability: float
    expected: float
    seen: int
