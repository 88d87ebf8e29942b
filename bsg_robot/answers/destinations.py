"""Choose the piece of furniture to look at next, by what going and looking cost.

The pieces that were seen, in all rooms, and the rest of every room are places of one search, as
rooms are those of `bsg_robot.answers.decision`. A piece finds a thing with P(the room has it) times
the piece's share of the room (`bsg_robot.things.pieces`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bsg_data.arrays import Floats
from bsg_models.belief.partial_graph import PartialGraph, SeenObject
from bsg_models.search.knowledge import find_costs
from bsg_robot.answers.decision import Decision, choose_room
from bsg_robot.answers.missed_looks import MissedPieces
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
    missed: float = 1.0  # P(all looks at it miss a thing that is there)
    again: bool = False  # whether the last look was there
    seen: tuple[str, ...] = ()  # ids of those that were seen on the piece

    @property
    def name(self) -> str | None:
        """Id of the piece."""
        return None if self.piece is None else self.piece.name

    def finds(self, sure: float, unseen: float) -> float:
        """Return P(a look finds the thing), where one finds what was seen there with `sure`.

        `unseen` is P(a look everywhere in the room finds one that was not seen).
        """
        return 1 - (1 - sure * self.sure) * (1 - self.share * unseen)


def list_spots(
    furniture: Furniture,
    seen: Sequence[SeenObject],
    *,
    node: int,
    on: Mapping[str, str],
    missed: MissedPieces,
) -> list[Spot]:
    """Return the pieces of a room where a thing may be, then the rest of the room.

    What was seen, and nobody said on what, is on a piece that was seen.

    Args:
        furniture: of the room.
        seen: the things of the kind that were seen in the room.
        node: of the room.
        on: id of an object → that of its piece (`SeenPieces`).
        missed: what looks at the pieces have missed.
    """
    shares = furniture.shares(missed.of_pieces).tolist()
    lying: dict[str | None, list[SeenObject]] = {}  # None: nobody said on what
    for obj in seen:
        lying.setdefault(on.get(obj.name), []).append(obj)
    loose = is_there(lying.pop(None, ()))
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
                missed=missed.of_pieces.get(name, 1.0),
                again=missed.is_last and missed.last == name,
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
    *pieces, rest = spots
    if any(spot.missed == 1 and spot.share >= _WORTH * rest.share for spot in pieces):
        rest = replace(rest, share=0.0)
    return [*pieces, rest]


def choose_spot(
    spots: Sequence[Spot],
    finds: Sequence[float],
    looks: Sequence[float],
    *,
    decision: Decision,
    graph: PartialGraph,
    ways: Ways,
    here: int,
    at: str | None,
) -> Spot | None:
    """Return where to look next; None if nothing is left to look for.

    Of many pieces only the likeliest are weighed, besides the rests of all rooms.

    Args:
        spots: M places; the rest of a room comes after its pieces.
        finds: `[M]` P(a look finds the thing).
        looks: `[M]` costs of a look.
        decision: about the rooms, for one thing.
        graph: with the rooms.
        ways: between the rooms.
        here: node of the robot's room.
        at: id of the piece where the robot is; None if it is in the middle of the room.
    """
    start = next(
        (k for k, spot in enumerate(spots) if at is not None and spot.name == at),
        next(k for k, spot in enumerate(spots) if spot.piece is None and spot.node == here),
    )
    ranked = sorted((k for k, spot in enumerate(spots) if spot.piece), key=lambda k: -finds[k])
    left_out = {*ranked[_MOST:]} - {start}
    kept = [k for k in range(len(spots)) if k not in left_out]
    some = [spots[k] for k in kept]
    # The building stays the first node.
    places = replace(
        decision,
        finds=np.array([0.0, *(finds[k] for k in kept)])[:, None],
        missed=np.array([1.0, *(spot.missed for spot in some)])[:, None],
        again=np.array([False, *(spot.again for spot in some)])[:, None],
    )
    costs = np.pad(_measure(some, graph, ways), ((1, 0), (1, 0)), constant_values=np.inf)
    chosen = choose_room(
        places,
        replace(ways, costs=costs),
        np.array([0.0, *(looks[k] for k in kept)]),
        here=1 + kept.index(start),
        planner="expected-cost",
    )
    return None if chosen is None else some[chosen - 1]


def _measure(spots: Sequence[Spot], graph: PartialGraph, ways: Ways) -> Floats:
    """Return the costs of going from place to place, `[M, M]`.

    Between rooms it is the cost between their middles, and how much farther apart the places are
    than the middles. What was said of a way stays what it was.
    """
    nodes = np.array([spot.node for spot in spots])
    rooms = [None, *(place_of(room) for room in graph.rooms)]
    nowhere = (np.nan, np.nan, np.nan)
    middles = [(rooms[n] if n < len(rooms) else None) or nowhere for n in nodes]
    ends = [
        (spot.piece.position if spot.piece else None) or middle
        for spot, middle in zip(spots, middles, strict=True)
    ]
    apart, between = (measure_lines(np.array(one)) * ways.metre for one in (ends, middles))
    costs = ways.costs[nodes[:, None], nodes].copy()
    known = np.isfinite(apart) & np.isfinite(between)
    costs[known] = (costs[known] + apart[known] - between[known]).clip(min=0.0)
    same = nodes[:, None] == nodes
    costs[same] = np.where(np.isfinite(apart), apart, _STEP * ways.metre)[same]
    np.fill_diagonal(costs, 0.0)
    # A way by another piece may be cheaper than the one by the middles.
    return find_costs(costs) if len(costs) <= _MOST_CLOSED else costs
