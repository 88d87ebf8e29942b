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
_DETOUR = 3.0  # most that a way between pieces is longer than a straight line


@dataclass(frozen=True, eq=False)
class Spot:
    """A place of the search: a piece, or the rest of a room."""

    node: int  # of the room
    piece: SeenObject | None
    share: float  # P(an unseen thing is there, if it is in the room)
    sure: float  # P(one that was seen is there)
    missed: float = 1.0  # P(all looks at it miss a thing that is there)
    again: bool = False  # whether the last look was there

    @property
    def name(self) -> str | None:
        """Id of the piece."""
        return None if self.piece is None else self.piece.name


def leave_rest(spots: list[Spot]) -> list[Spot]:
    """Return the places of a room; its rest waits until every piece had a look.

    Nobody looks about for more furniture in front of a cupboard that is closed.
    """
    *pieces, rest = spots
    if any(spot.missed == 1 for spot in pieces):
        rest = replace(rest, share=0.0)
    return [*pieces, rest]


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
        finds = (sure > 0) * left * 1.0
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

    A way between rooms is as much longer than the straight line as that between their middles.
    """
    nodes = np.array([spot.node for spot in spots])
    costs = ways.costs[nodes[:, None], nodes]
    rooms = [None, *(place_of(room) for room in graph.rooms)]
    nowhere = (np.nan, np.nan, np.nan)
    middles = np.array([(rooms[n] if n < len(rooms) else None) or nowhere for n in nodes])
    ends = np.array(
        [
            (spot.piece.position if spot.piece else None) or tuple(middle)
            for spot, middle in zip(spots, middles, strict=True)
        ]
    )
    straight = _lines(ends) * ways.metre
    between = _lines(middles) * ways.metre
    with np.errstate(invalid="ignore", divide="ignore"):
        detour = np.clip(costs / between, 1.0, _DETOUR)
        bent = np.where(np.isfinite(detour), detour * straight, np.nan)
    same = nodes[:, None] == nodes
    bent = np.where(same, straight, np.where(np.isinf(costs), np.inf, bent))
    found = np.where(np.isnan(bent), np.where(same, _STEP * ways.metre, costs), bent)
    np.fill_diagonal(found, 0.0)
    return find_costs(found)  # a way past a piece is never longer than one to it and on


def _lines(points: Floats) -> Floats:
    """Return the straight distances between points `[M, 3]`, NaN where one is unknown."""
    return np.asarray(np.sqrt(((points[:, None] - points) ** 2).sum(axis=-1)))
