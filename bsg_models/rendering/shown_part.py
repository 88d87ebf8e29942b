"""Choose the part of a large building that a page shows, and say what is left out.

A browser draws a few thousand dots smoothly, and a page should fit into a mail. The numbers of a
building always count all of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bsg_data.arrays import Bools, Ints
from bsg_models.belief.belief_graph import BeliefGraph

MOST_ROOMS = 200  # of a building
MOST_OBJECTS = 2_500  # of a building; also the limit of its blind nodes
PAGE_ROOMS = 2_500  # of all buildings of a page, which keeps it below 8 MB
PAGE_OBJECTS = 25_000
_LIKELIEST = 3  # rooms shown for every class
ALL_OF_IT = "`bsg-belief … --out beliefs.json` writes everything."


@dataclass(frozen=True, slots=True)
class ShownPart:
    """The part of a belief graph that a page shows.

    Attributes:
        rooms: their numbers, 1..R, in order.
        objects: indices of seen objects in the partial graph, in order.
        blind: indices of blind nodes in the belief graph, in order.
        left_out: sentence about what is left out; empty if nothing is.
    """

    rooms: tuple[int, ...]
    objects: tuple[int, ...]
    blind: tuple[int, ...]
    left_out: str


def choose_shown_part(belief: BeliefGraph) -> ShownPart:
    """Choose what a page shows of a belief graph: everything, unless the building is very large.

    Beyond `MOST_ROOMS` rooms, the three likeliest rooms of every class are shown, then the rooms
    with the largest expected number of hidden objects. Beyond `MOST_OBJECTS` objects or blind
    nodes, every room shows equally many, if it has that many; objects with a class come first.
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
        ("rooms", len(rooms), len(partial.rooms)),
        ("seen objects", len(objects), len(seen)),
        ("blind nodes", len(blind), len(likely)),
    )
    return ShownPart(rooms, objects, blind, left_out)


def _say_left_out(*kinds: tuple[str, int, int]) -> str:
    """Return a sentence with name, shown and total number of each kind; empty if all are shown."""
    if all(shown == number for _, shown, number in kinds):
        return ""
    rooms, objects, blind = (f"{shown:,} of {number:,} {name}" for name, shown, number in kinds)
    return (
        f"This page shows {rooms}, {objects} and {blind}. The rooms are the {_LIKELIEST} likeliest "
        "for each class, then those with the most expected unseen objects. The numbers of the "
        f"building and of each room count everything. {ALL_OF_IT}"
    )


def count_buildings(parts: Sequence[ShownPart]) -> int:
    """Return how many buildings, counted from the first, fit on a page; at least one."""
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
    """Return at most `MOST_OBJECTS` things: the first of every room, then the second, and so on.

    `order` lists the things of a room one after another, the most important first.
    """
    order = order[is_shown[room[order]]]
    counts = np.bincount(room[order], minlength=len(is_shown))
    place = np.arange(len(order)) - (np.cumsum(counts) - counts)[room[order]]
    chosen = order[np.argsort(place, kind="stable")[:MOST_OBJECTS]]
    return tuple(np.sort(chosen).tolist())
