"""Which part of a large building a page shows, and what it says of the rest.

A browser draws some thousands of dots fluently, and a page is to be sent by mail. The numbers of
the building are always those of all of it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bsg_data.arrays import Bools, Ints
from bsg_models.belief.belief_graph import BeliefGraph

MOST_ROOMS = 200  # of a building
MOST_OBJECTS = 2_500  # of a building; so are blind nodes
PAGE_ROOMS = 2_500  # of all buildings of a page, which is then below 8 MB
PAGE_OBJECTS = 25_000
_LIKELIEST = 3  # rooms that are shown of every class
ALL_OF_IT = "bsg-belief … --out beliefs.json writes all of it."


@dataclass(frozen=True, slots=True)
class ShownPart:
    """What a page shows of a belief graph.

    Attributes:
        rooms: their numbers, 1..R, in order.
        objects: places of seen objects in the partial graph, in order.
        blind: places of blind nodes in the belief graph, in order.
        left_out: what is left out, in words; empty if nothing is.
    """

    rooms: tuple[int, ...]
    objects: tuple[int, ...]
    blind: tuple[int, ...]
    left_out: str


def choose_shown_part(belief: BeliefGraph) -> ShownPart:
    """Choose what a page shows of a belief graph: all of it, unless it is very large.

    Of more than `MOST_ROOMS` rooms those are shown in which a class is likeliest, three for every
    class, then those with most that is expected and not seen. Of more than `MOST_OBJECTS` objects,
    or blind nodes, in these every room shows as many as leave the same for others, those with a
    class first.
    """
    partial = belief.partial
    rooms = _choose_rooms(belief)
    is_shown = np.zeros(len(partial.rooms) + 1, dtype=bool)
    is_shown[[0, *rooms]] = True
    seen = np.array([obj.room_index for obj in partial.objects], dtype=np.int64)
    classless = np.array([obj.class_index is None for obj in partial.objects], dtype=bool)
    likely = np.array([node.room_index for node in belief.blind], dtype=np.int64)
    objects = _take_evenly(seen, is_shown, np.lexsort((classless, seen)))
    blind = _take_evenly(likely, is_shown, np.argsort(likely, kind="stable"))
    left_out = _say_left_out(
        rooms=(len(rooms), len(partial.rooms)),
        objects=(len(objects), len(seen)),
        blind=(len(blind), len(likely)),
    )
    return ShownPart(rooms, objects, blind, left_out)


def _say_left_out(
    *, rooms: tuple[int, int], objects: tuple[int, int], blind: tuple[int, int]
) -> str:
    """Say how many of each kind are shown, of how many; empty if all are."""
    kinds = {"rooms": rooms, "seen objects": objects, "blind nodes": blind}
    said = [f"{shown:,} of {number:,} {name}" for name, (shown, number) in kinds.items()]
    if all(shown == number for shown, number in kinds.values()):
        return ""
    rule = ""
    if rooms[0] < rooms[1]:
        rule = (
            f" The rooms are the {_LIKELIEST} where each class is likeliest, then those where most "
            "is expected."
        )
    return (
        f"This page shows {said[0]}, {said[1]} and {said[2]}.{rule} What it says of the building "
        f"and of each room counts everything. {ALL_OF_IT}"
    )


def count_buildings(parts: Sequence[ShownPart]) -> int:
    """Return how many buildings, the first ones, a page has room for: one at least."""
    rooms = np.cumsum([len(part.rooms) for part in parts])
    objects = np.cumsum([len(part.objects) + len(part.blind) for part in parts])
    fits = (rooms <= PAGE_ROOMS) & (objects <= 2 * PAGE_OBJECTS)
    return max(int(fits.sum()), min(len(parts), 1))


def _choose_rooms(belief: BeliefGraph) -> tuple[int, ...]:
    number = len(belief.partial.rooms)
    if number <= MOST_ROOMS:
        return tuple(range(1, number + 1))
    likeliest = np.argsort(-belief.presence[1:], axis=0, kind="stable")[:_LIKELIEST]
    promising = np.argsort(-belief.hidden[1:].sum(axis=1), kind="stable")
    order = dict.fromkeys([*likeliest.ravel().tolist(), *promising.tolist()])
    return tuple(sorted(room + 1 for room in list(order)[:MOST_ROOMS]))


def _take_evenly(room: Ints, is_shown: Bools, order: Ints) -> tuple[int, ...]:
    """Return `MOST_OBJECTS` at most of some things, by the room of each, as even as can be.

    `order` has those of a room one after another, the most important first.
    """
    order = order[is_shown[room[order]]]
    counts = np.bincount(room[order], minlength=len(is_shown))
    caps = range(int(counts.max(initial=0)) + 1)
    cap = bisect_right(caps, MOST_OBJECTS, key=lambda most: np.minimum(counts, most).sum()) - 1
    first = np.cumsum(counts) - counts
    place = np.arange(len(order)) - first[room[order]]
    return tuple(np.sort(order[place < max(cap, 0)]).tolist())
