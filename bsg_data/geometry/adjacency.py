"""Find which rooms of a placed building connect: by doors and stairs, otherwise by their boxes.

A door joins the room of its annotation and the room whose footprint it touches. Stairs join the
room where they begin and the room where they end. Open kitchens and other openings have no door:
`bsg_data.geometry.passages` guesses them. In a building with doors it must be more certain than in
one without.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.geometry.passages import THRESHOLD, choose_pairs, score_pairs
from bsg_data.geometry.placement import STAIRS
from bsg_data.scene.scene_graph import Box, Edge, Point, Room, SceneGraph, SceneObject

_DOORS = (  # corrected categories
    "door",
    "door frame",
    "door window",
    "door/window",
    "doorpost",
    "doorway",
    "glass door",
    "sliding door",
    "sliding glass door",
)
_DOOR_REACH = 0.35  # metres from a door to the room behind it: a wall, and the frame
_DOOR_HEIGHT = 1.0  # metres of height that both must share with it: more than a hatch
_ROUNDED = 1e-3  # metres; boxes and footprints of rooms are rounded apart
_STAIRS_REACH = 0.5  # metres from the stairs to a room at their end
_LANDING = 0.7  # metres between an end of the stairs and the floor of the room there
_SURE = 0.6  # of a pair without a door, in a building that shows doors


def connect_rooms(graph: SceneGraph) -> SceneGraph:
    """Return the scene graph with the adjacency of its rooms, from their boxes and their objects.

    Every edge has its `method`, `door`, `stairs` or `boxes` in this order of trust, and the
    distance of the rooms' centroids. Rooms without geometry stay unconnected.
    """
    placed = [room for room in graph.rooms if room.box is not None]
    boxes = np.array([[r.box.minimum, r.box.maximum] for r in placed if r.box]).reshape(-1, 2, 3)
    floors = np.array([room.floor_z or 0.0 for room in placed])
    ways = _Ways(placed, boxes.copy(), floors)
    seen = dict.fromkeys(ways.by_stairs(graph.objects), "stairs")
    seen |= dict.fromkeys(ways.by_doors(graph.objects), "door")
    boxes[:, 0, 2] = np.minimum(floors, boxes[:, 1, 2])
    pairs, probability = score_pairs(boxes)
    threshold = _SURE if "door" in seen.values() else THRESHOLD
    chosen = choose_pairs(pairs, probability, rooms=len(placed), known=seen, threshold=threshold)
    methods = {(int(a), int(b)): "boxes" for a, b in pairs[chosen]} | seen
    edges = [
        Edge(
            placed[a].room_index,
            placed[b].room_index,
            "adjacent",
            method,
            measure_distance(placed[a], placed[b]),
        )
        for (a, b), method in sorted(methods.items())
    ]
    return replace(graph, adjacency=tuple(edges))


def measure_distance(room: Room, other: Room) -> float | None:
    """Return the metres between the centroids of two rooms; None without geometry."""
    if room.centroid is None or other.centroid is None:
        return None
    return float(np.linalg.norm(np.subtract(room.centroid, other.centroid)))


class _Ways:
    """Finds the rooms behind the doors and at the ends of the stairs of a building."""

    def __init__(self, rooms: Sequence[Room], boxes: Floats, floors: Floats) -> None:
        self._rooms, self._boxes, self._floors = rooms, boxes, floors
        self._place = {room.room_index: number for number, room in enumerate(rooms)}

    @cached_property
    def _shapes(self) -> Any:
        import shapely  # Imported here because importing Shapely is slow.

        return np.array([shapely.Polygon(room.footprint) for room in self._rooms])

    def by_doors(self, objects: Iterable[SceneObject]) -> Iterator[tuple[int, int]]:
        """Yield the pairs, ascending places in the rooms, that a door stands between."""
        for door in objects:
            box, here = door.part_box, self._place.get(door.room_index)
            if door.category not in _DOORS or box is None or here is None:
                continue
            top = np.minimum(box.maximum[2], self._boxes[:, 1, 2])
            shared = top - np.maximum(box.minimum[2], self._boxes[:, 0, 2])
            yield from self._reach(box, here, shared >= _DOOR_HEIGHT, _DOOR_REACH)

    def by_stairs(self, objects: Iterable[SceneObject]) -> Iterator[tuple[int, int]]:
        """Yield the pairs that the stairs of a room lead from and to."""
        steps: dict[int, list[Point]] = {}
        for step in objects:
            here = self._place.get(step.room_index)
            if step.category in STAIRS and step.part_box and here is not None:
                steps.setdefault(here, []).extend([step.part_box.minimum, step.part_box.maximum])
        for here in sorted(steps):
            flight = Box.around(np.array(steps[here]))
            for end in (flight.minimum[2], flight.maximum[2]):
                is_level = np.abs(self._floors - end) <= _LANDING
                if not is_level[here]:  # else this end is in the room itself
                    yield from self._reach(flight, here, is_level, _STAIRS_REACH)

    def _reach(self, box: Box, here: int, others: Bools, reach: float) -> Iterator[tuple[int, int]]:
        """Yield a room and that of the others which is nearest to a box, if one is within reach.

        Nearest from above: 0 where a box meets a footprint; the first of several.
        """
        import shapely

        (a, b, _), (c, d, _) = box.minimum, box.maximum
        low, high = self._boxes[:, 0, :2] - (c, d), (a, b) - self._boxes[:, 1, :2]
        others = others & (np.maximum(low, high) <= reach + _ROUNDED).all(axis=1)
        others[here] = False
        near = np.flatnonzero(others)
        if not len(near):
            return
        gaps = shapely.distance(shapely.box(a, b, c, d), self._shapes[near])
        nearest = int(near[gaps.argmin()])
        if gaps.min() <= reach:
            yield min(here, nearest), max(here, nearest)
