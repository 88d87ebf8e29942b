"""List the places where one thing may be: pieces of furniture, and the rests of rooms.

The pieces that were seen, in all rooms, and the rest of every room are places of one search, as
rooms are those of `bsg_robot.answers.decision`. A piece finds a thing with P(the room has it) times
the piece's share of the room (`bsg_robot.things.pieces`). A thing that was not seen is in one place
of its room.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bsg_data.arrays import Floats
from bsg_models.belief.partial_graph import PartialGraph, SeenObject
from bsg_models.search.knowledge import find_costs
from bsg_robot.answers.decision import Decision, found_by
from bsg_robot.answers.evidence import Chances, missed_by
from bsg_robot.answers.thing_belief import ThingBelief
from bsg_robot.answers.ways import Ways, measure_lines, place_of
from bsg_robot.things.pieces import Furniture

LOOK_AT = 2.5  # metres that a look at a piece costs: a fifth of that of a room of 12 m²
_STEP = 2.0  # metres between two pieces of a room, if nobody says where they are
_MOST_CLOSED = 400  # places of which all cheapest ways are found
_MOST = 100  # pieces, the likeliest ones, that a decision weighs
_WORTH = 0.05  # of the rest of a room: a piece that is less likely does not come before it


@dataclass(frozen=True, eq=False, kw_only=True)
class Spot:
    """A place of the search: a piece, or the rest of a room."""

    node: int  # of the room
    piece: SeenObject | None = None
    share: float = 1.0  # P(an unseen thing is there, if it is in the room)
    sure: float = 0.0  # P(one that was seen is there)
    looked: tuple[float, ...] = ()  # chances of the looks that missed there
    seen: tuple[str, ...] = ()  # ids of those that were seen on the piece

    @property
    def name(self) -> str | None:
        """Id of the piece."""
        return None if self.piece is None else self.piece.name

    def holds(self, unseen: float) -> float:
        """Return P(at least one is there), of P(the room has one that was not seen)."""
        return 1 - (1 - self.sure) * (1 - self.share * unseen)


def list_spots(
    furniture: Furniture,
    seen: Sequence[SeenObject],
    *,
    node: int,
    on: Mapping[str, str],
    looked: Chances,
) -> list[Spot]:
    """Return the pieces of a room where a thing may be, then the rest of the room.

    What was seen, and nobody said on what, is on a piece that was seen. What is on something else,
    such as the floor, is in the rest.

    Args:
        furniture: of the room.
        seen: the things of the kind that were seen in the room.
        node: of the room.
        on: id of an object → that of its piece (`SeenPieces`).
        looked: what was looked at for such a thing there.
    """
    shares = furniture.shares(missed_by(looked)).tolist()
    lying: dict[str | None, list[SeenObject]] = {}
    unsaid: list[SeenObject] = []
    names = furniture.names
    for obj in seen:
        below = obj.on if obj.on in names else on.get(obj.name)
        (unsaid if obj.on is None else lying.setdefault(below, [])).append(obj)
    loose = is_there(unsaid)
    known = 1 - shares[-1] if furniture.pieces else 1.0
    spots = []
    for piece, share in zip((*furniture.pieces, None), shares, strict=True):
        name = None if piece is None else piece.name
        here = lying.get(name, ())
        carries = min(1.0, share / known) if known and (piece or not furniture.pieces) else 0.0
        spots.append(
            Spot(
                node=node,
                piece=piece,
                share=share,
                sure=1 - (1 - is_there(here)) * (1 - carries * loose),
                looked=looked.get(name, ()),
                seen=tuple(obj.name for obj in here),
            )
        )
    return spots


def is_there(objects: Iterable[SeenObject]) -> float:
    """Return P(any of some objects is there)."""
    return 1 - math.prod([1 - obj.probability for obj in objects])


def leave_rest(spots: list[Spot]) -> list[Spot]:
    """Return the places of a room that was entered; its rest waits for pieces without a look.

    Nobody looks about for more furniture in front of a cupboard that is closed, unless what was
    seen is hardly worth a look.
    """
    *pieces, remainder = spots
    if any(not spot.looked and spot.share >= _WORTH * remainder.share for spot in pieces):
        remainder = replace(remainder, share=0.0)
    return [*pieces, remainder]


def keep_likeliest(
    spots: Sequence[Spot], belief: ThingBelief, *, here: int, at: str | None
) -> tuple[list[Spot], int]:
    """Return the likeliest pieces and the rests of all rooms, and which of them the robot is at."""
    start = next(
        (k for k, spot in enumerate(spots) if at is not None and spot.name == at),
        next(k for k, spot in enumerate(spots) if spot.piece is None and spot.node == here),
    )
    pieces = (k for k, spot in enumerate(spots) if spot.piece)
    ranked = sorted(pieces, key=lambda k: -spots[k].holds(belief.unseen[spots[k].node]))
    left_out = {*ranked[_MOST:]} - {start}
    chosen = [k for k in range(len(spots)) if k not in left_out]
    return [spots[k] for k in chosen], chosen.index(start)


def weigh_spots(
    spots: Sequence[Spot], belief: ThingBelief, rooms: Decision, *, chance: float
) -> Decision:
    """Return what a decision about one thing depends on, by the pieces and rests of rooms.

    Args:
        spots: M places.
        belief: where the thing is.
        rooms: the decision by rooms.
        chance: P(a look finds a thing that is there).
    """
    nodes, share, sure = (
        np.array([getattr(spot, name) for spot in spots]) for name in ("node", "share", "sure")
    )
    left, is_seen = rooms.left[nodes], sure > 0
    if rooms.is_known:
        return replace(rooms, finds=(sure * left)[None, :, None], missed=np.ones(len(nodes)))
    found = np.array([found_by(spot.looked, chance, piece=spot.name) for spot in spots]).T
    by_then = [
        1 - (1 - sure * some) * (1 - share * belief.finds_unseen(some, nodes)) for some in found
    ]
    finds = np.diff(by_then, axis=0, prepend=0.0).clip(min=0.0) * left
    # What was seen in two places is two things, which do not exclude each other.
    apart = nodes + is_seen * np.linspace(0.25, 0.75, len(nodes))
    return replace(rooms, finds=finds[:, :, None], missed=np.ones(len(nodes)), rooms=apart)


def measure_spots(spots: Sequence[Spot], graph: PartialGraph, ways: Ways, *, given: bool) -> Floats:
    """Return the costs of going from place to place, `[M, M]`.

    Between rooms it is the cost between their middles, and how much farther apart the places are
    than the middles; if ways were `said`, it stays what it was.
    """
    nodes = np.array([spot.node for spot in spots])
    rooms = [None, *(place_of(room) for room in graph.rooms)]
    nowhere = (np.nan, np.nan, np.nan)
    middles = [(rooms[n] if n < len(rooms) else None) or nowhere for n in nodes]
    ends = [
        (spot.piece.position if spot.piece else None) or middle
        for spot, middle in zip(spots, middles, strict=True)
    ]
    apart, between = (measure_lines(np.array(points)) * ways.metre for points in (ends, middles))
    costs = ways.costs[nodes[:, None], nodes].copy()
    known = np.isfinite(apart) & np.isfinite(between) & (not given)
    costs[known] = (costs[known] + apart[known] - between[known]).clip(min=0.0)
    same = nodes[:, None] == nodes
    costs[same] = np.where(np.isfinite(apart), apart, _STEP * ways.metre)[same]
    np.fill_diagonal(costs, 0.0)
    # A way by another piece may be cheaper than the one by the middles.
    return find_costs(costs) if not given and len(costs) <= _MOST_CLOSED else costs
