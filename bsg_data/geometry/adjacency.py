"""Find which rooms of a placed building connect: by doors and stairs, otherwise by their boxes.

A door joins the room of its annotation and the room whose footprint it touches. Stairs join the
room where they begin and the room where they end. Open kitchens and other openings have no door:
`bsg_data.geometry.passages` guesses them. In a building with doors it must be more certain than in
one without.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from bsg_data.geometry.passages import THRESHOLD, choose_pairs, score_pairs
from bsg_data.geometry.placement import STAIRS
from bsg_data.scene.scene_graph import Box, Edge, Room, SceneGraph, SceneObject

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
_STAIRS_REACH = 0.5  # metres from the stairs to a room at their end
_LANDING = 0.7  # metres between an end of the stairs and the floor of the room there
_SURE = 0.6  # of a pair without a door, in a building that shows doors


def connect_rooms(graph: SceneGraph) -> SceneGraph:
    """Return the scene graph with the adjacency of its rooms, from their boxes and their objects.

    Every edge has its `method`, `door`, `stairs` or `boxes` in this order of trust, and the
    distance of the rooms' centroids. Rooms without geometry stay unconnected.
    """
    placed = [room for room in graph.rooms if room.box is not None]
    floors = [room.floor_z or 0.0 for room in placed]
    seen = dict.fromkeys(_by_stairs(placed, floors, graph.objects), "stairs")
    seen |= dict.fromkeys(_by_doors(placed, graph.objects), "door")
    boxes = np.array([[r.box.minimum, r.box.maximum] for r in placed if r.box]).reshape(-1, 2, 3)
    boxes[:, 0, 2] = np.minimum(floors, boxes[:, 1, 2])
    pairs, probability = score_pairs(boxes)
    threshold = _SURE if "door" in seen.values() else THRESHOLD
    kept = choose_pairs(pairs, probability, rooms=len(placed), known=seen, threshold=threshold)
    methods = {(int(a), int(b)): "boxes" for a, b in pairs[kept]} | seen
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


def measure_distance(one: Room, other: Room) -> float | None:
    """Return the metres between the centroids of two rooms; None without geometry."""
    if one.centroid is None or other.centroid is None:
        return None
    return float(np.linalg.norm(np.subtract(one.centroid, other.centroid)))


def _by_doors(rooms: Sequence[Room], objects: Sequence[SceneObject]) -> Iterator[tuple[int, int]]:
    """Yield the pairs, ascending places in `rooms`, that a door stands between."""
    place = {room.room_index: number for number, room in enumerate(rooms)}
    for door in objects:
        if door.category not in _DOORS or door.part_box is None or door.room_index not in place:
            continue
        shared = [_share_height(door.part_box, room.box) if room.box else 0.0 for room in rooms]
        high = [number for number, height in enumerate(shared) if height >= _DOOR_HEIGHT]
        yield from _reach(door.part_box, rooms, place[door.room_index], high, _DOOR_REACH)


def _by_stairs(
    rooms: Sequence[Room], floors: Sequence[float], objects: Sequence[SceneObject]
) -> Iterator[tuple[int, int]]:
    """Yield the pairs that the stairs of a room lead from and to."""
    for here, room in enumerate(rooms):
        steps = [
            obj.part_box
            for obj in objects
            if obj.room_index == room.room_index and obj.category in STAIRS and obj.part_box
        ]
        if not steps:
            continue
        flight = _surround(steps)
        for end in (flight.minimum[2], flight.maximum[2]):
            level = [number for number, floor in enumerate(floors) if abs(floor - end) <= _LANDING]
            if here not in level:  # else this end is in the room itself
                yield from _reach(flight, rooms, here, level, _STAIRS_REACH)


def _reach(
    box: Box, rooms: Sequence[Room], here: int, others: Sequence[int], reach: float
) -> Iterator[tuple[int, int]]:
    """Yield a room and that of the others which is nearest to a box, if one is within reach."""
    gaps = [(_gap(box, rooms[number]), number) for number in others if number != here]
    gap, there = min(gaps, default=(np.inf, here))
    if gap <= reach:
        yield min(here, there), max(here, there)


def _surround(boxes: Sequence[Box]) -> Box:
    low = np.min([box.minimum for box in boxes], axis=0)
    high = np.max([box.maximum for box in boxes], axis=0)
    return Box((low[0], low[1], low[2]), (high[0], high[1], high[2]))


def _share_height(one: Box, other: Box) -> float:
    return min(one.maximum[2], other.maximum[2]) - max(one.minimum[2], other.minimum[2])


def _gap(box: Box, room: Room) -> float:
    """Return the metres from above between a box and the footprint of a room, 0 where they meet."""
    import shapely  # Imported here because importing Shapely is slow.

    (a, b, _), (c, d, _) = box.minimum, box.maximum
    return float(shapely.distance(shapely.box(a, b, c, d), shapely.Polygon(room.footprint)))
