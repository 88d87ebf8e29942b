"""Choose the piece of furniture to look at next, by what going and looking cost.

The pieces that were seen, in all rooms, and the rest of every room are places of one search, as
rooms are those of `bsg_models.robot.decision`. A piece finds a thing with P(the room has it) times
the piece's share of the room (`bsg_models.belief.pieces`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.observation.partial_graph import PartialGraph, SeenObject
from bsg_models.robot.decision import Decision, choose_room
from bsg_models.robot.ways import Ways, place_of
from bsg_models.search.knowledge import find_costs

_STEP = 2.0  # metres between two pieces of a room, if nobody says where they are
LOOK_AT = 2.5  # metres that a look at a piece costs: a fifth of that of a room of 12 m²
_MOST_CLOSED = 400  # places of which all cheapest ways are found
_MOST = 100  # pieces, the likeliest ones, that a decision weighs
_WORTH = 0.05  # of the rest of a room: a piece that is less likely does not come before it


@dataclass(frozen=True, eq=False)
class Spot:
    """A place of the search: a piece, or the rest of a room."""

    node: int  # of the room
    piece: SeenObject | None
    share: float  # P(an unseen thing is there, if it is in the room)
    sure: float  # P(one that was seen is there)
    missed: float = 1.0  # P(all looks at it miss a thing that is there)
    again: bool = False  # whether the last look was there
    seen: tuple[str, ...] = ()  # ids of those that were seen on the piece

    @property
    def name(self) -> str | None:
        """Id of the piece."""
        return None if self.piece is None else self.piece.name


def leave_rest(spots: list[Spot]) -> list[Spot]:
    """Return the places of a room that was entered; its rest waits for pieces without a look.

    Nobody looks about for more furniture in front of a cupboard that is closed, unless what was
    seen is hardly worth a look.
    """
    *pieces, rest = spots
    if any(spot.missed == 1 and spot.share >= _WORTH * rest.share for spot in pieces):
        rest = replace(rest, share=0.0)
    return [*pieces, rest]


def take_likeliest(spots: list[Spot], unseen: Floats, *, at: str | None) -> list[Spot]:
    """Return the rests of all rooms, the likeliest pieces and that of the robot, in their order."""
    pieces = [spot for spot in spots if spot.piece is not None]
    if len(pieces) <= _MOST:
        return spots
    chances = [max(spot.sure, spot.share * float(unseen[spot.node])) for spot in pieces]
    kept = {id(pieces[number]) for number in np.argsort(chances)[-_MOST:]}
    return [s for s in spots if s.piece is None or id(s) in kept or s.name == at]


def choose_spot(
    decision: Decision,
    spots: list[Spot],
    graph: PartialGraph,
    ways: Ways,
    look: Floats,
    unseen: Floats,
    *,
    here: int,
    at: str | None,
    chance: float,
    look_at: float,
) -> Spot | None:
    """Return where to look next; None if nothing is left to look for.

    Args:
        decision: about N rooms, for one thing.
        spots: M places in them; the rest of a room comes after its pieces.
        graph: with the rooms.
        ways: between the rooms.
        look: `[N]` cost of a look in a room.
        unseen: `[N]` P(a look finds one that was not seen).
        here: node of the robot's room.
        at: id of the piece where the robot is; None if it is in the middle of the room.
        chance: P(a look finds a thing that is there).
        look_at: cost of a look at a piece.
    """
    nodes = np.array([spot.node for spot in spots])
    left = decision.finds[nodes, 0] > 0
    sure = np.array([spot.sure for spot in spots])
    shares = np.array([spot.share for spot in spots])
    finds = (1 - (1 - chance * sure) * (1 - shares * unseen[nodes])) * left
    if decision.is_known:
        finds = sure * left
    places = replace(  # the building stays the first node
        decision,
        finds=np.pad(finds, (1, 0))[:, None],
        missed=np.pad([spot.missed for spot in spots], (1, 0))[:, None],
        again=np.pad([spot.again for spot in spots], (1, 0))[:, None],
    )
    costs = np.pad(_measure(spots, graph, ways), ((1, 0), (1, 0)), constant_values=np.inf)
    start = next(
        (k for k, spot in enumerate(spots) if at is not None and spot.name == at),
        next(k for k, spot in enumerate(spots) if spot.piece is None and spot.node == here),
    )
    chosen = choose_room(
        places,
        replace(ways, costs=costs),
        np.pad([look[s.node] if s.piece is None else look_at for s in spots], (1, 0)),
        here=1 + start,
        planner="expected-cost",
    )
    return None if chosen is None else spots[chosen - 1]


def _measure(spots: list[Spot], graph: PartialGraph, ways: Ways) -> Floats:
    """Return the costs of going from place to place, `[M, M]`.

    Between rooms it is the cost between their middles, and how much farther apart the places are
    than the middles. What was said of a way stays what it was.
    """
    nodes = np.array([spot.node for spot in spots])
    rooms = [None, *(place_of(room) for room in graph.rooms)]
    nowhere = (np.nan, np.nan, np.nan)
    middles = np.array([(rooms[n] if n < len(rooms) else None) or nowhere for n in nodes])
    ends = np.array(
        [
            (spot.piece.position if spot.piece else None) or tuple(middle)
            for spot, middle in zip(spots, middles, strict=True)
        ]
    )
    apart, same = _lines(ends) * ways.metre, nodes[:, None] == nodes
    more = apart - _lines(middles) * ways.metre
    costs = ways.costs[nodes[:, None], nodes] + np.where(np.isfinite(more) & ~same, more, 0.0)
    costs = costs.clip(min=0.0)
    costs = np.where(same, np.where(np.isfinite(apart), apart, _STEP * ways.metre), costs)
    np.fill_diagonal(costs, 0.0)
    # A way by another piece may be cheaper than the one by the middles.
    return find_costs(costs) if len(costs) <= _MOST_CLOSED else np.asarray(costs)


def _lines(points: Floats) -> Floats:
    """Return the straight distances between points `[M, 3]`, NaN where one is unknown."""
    squares = [(one[:, None] - one) ** 2 for one in points.T]
    return np.asarray(np.sqrt(sum(squares)))
