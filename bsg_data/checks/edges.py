"""Check edges: containment follows from rooms and objects, and adjacency joins two rooms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bsg_data.arrays import Bools, Ints
from bsg_data.checks.part import Fault, Part
from bsg_data.checks.scenes import repeats
from bsg_data.scene.scene_graph import ADJACENCY_METHODS

_BUILDING, _ROOM, _OBJECT = range(3)
_KINDS = {"building": _BUILDING, "room": _ROOM, "object": _OBJECT}
_ODD = -1  # instead of a kind


@dataclass(frozen=True, eq=False)
class _Edges:
    """Columns of the edges of a part, `[E]` each."""

    scene: Ints
    source_kind: Ints
    source: Ints
    target_kind: Ints
    target: Ints


def check_edges(part: Part) -> Iterator[Fault]:
    """Check the edges of a part; its rooms and objects must be numbered correctly."""
    edges, kind = part.edges, part.edges.words("kind")
    contains, adjacent = kind.is_word("contains"), kind.is_word("adjacent")
    columns = _Edges(
        scene=edges.scene,
        source_kind=edges.words("source_kind").look_up(_number_kind, null=_ODD),
        source=edges.integers("source_index"),
        target_kind=edges.words("target_kind").look_up(_number_kind, null=_ODD),
        target=edges.integers("target_index"),
    )
    yield from _check_contains(part, columns, contains)
    rows = np.flatnonzero(adjacent & _join_rooms(part, columns))
    again = repeats(columns.scene[rows], columns.target[rows], columns.source[rows])
    wrong = adjacent.copy()
    wrong[rows[~again]] = False
    for scene in part.name_scenes(edges, wrong):
        yield Fault(
            "edges",
            f"{scene}: an adjacent edge must join two rooms, lower index first, once",
        )
    method = edges.words("method")
    unknown = method.look_up(lambda name: name not in ADJACENCY_METHODS, null=True)
    unknown[rows] |= ~_are_distances(part, columns, rows)
    for scene in part.name_scenes(edges, adjacent & unknown):
        yield Fault("edges", f"{scene}: an adjacent edge has an unknown method or distance")
    odd = ~method.is_word("annotation") | ~np.isnan(edges.numbers("distance_m"))
    for scene in part.name_scenes(edges, contains & odd):
        yield Fault("edges", f"{scene}: a contains edge has another method, or a distance")
    for name in sorted(set(kind.names) - {"contains", "adjacent"}):
        yield Fault("edges", f"kind {name!r} is neither contains nor adjacent")


def _number_kind(name: str) -> int:
    return _KINDS.get(name, _ODD)


def _check_contains(part: Part, edges: _Edges, chosen: Bools) -> Iterator[Fault]:
    """Check that every room and object is the target of one edge, from its parent."""
    room = part.objects.integers("room_index")
    inside = np.concatenate([np.zeros(len(part.rooms), dtype=np.int64), room])
    node = _number_targets(part, edges)
    known = np.flatnonzero(chosen & (node >= 0))
    right = np.zeros(len(chosen), dtype=bool)
    container = inside[node[known]]
    kind = np.where(container > 0, _ROOM, _BUILDING)
    right[known] = (edges.source[known] == container) & (edges.source_kind[known] == kind)
    times = np.bincount(node[right], minlength=len(inside))
    wrong = np.concatenate([edges.scene[chosen & ~right], _scene_of_nodes(part)[times == 0]])
    for number in np.unique(wrong):
        scene = part.scene_ids[number]
        yield Fault("edges", f"{scene}: contains edges do not agree with rooms and objects")
    if (times > 1).any():
        yield Fault("edges", "a contains edge is there twice")


def _scene_of_nodes(part: Part) -> Ints:
    """Return the scene of every room of the part, then of every object."""
    return np.concatenate([part.rooms.scene, part.objects.scene])


def _number_targets(part: Part, edges: _Edges) -> Ints:
    """Return the number of every edge's target: all rooms, then all objects; -1 if missing."""
    node = np.full(len(edges.scene), -1)
    before = 0
    for rows, kind in ((part.rooms, _ROOM), (part.objects, _OBJECT)):
        first = np.searchsorted(rows.scene, np.arange(len(part.scenes) + 1))
        sizes = np.diff(first)[edges.scene]
        there = (edges.target_kind == kind) & (edges.target >= 1) & (edges.target <= sizes)
        node[there] = before + first[edges.scene[there]] + edges.target[there] - 1
        before += len(rows)
    return node


def _join_rooms(part: Part, edges: _Edges) -> Bools:
    """Say for every edge whether it joins two rooms, lower index first, `[E]`."""
    limit = part.scenes.integers("num_rooms")[edges.scene]
    rooms: Bools = (edges.source_kind == _ROOM) & (edges.target_kind == _ROOM)
    return rooms & (edges.source >= 1) & (edges.source < edges.target) & (edges.target <= limit)


def _are_distances(part: Part, edges: _Edges, rows: Ints) -> Bools:
    """Say for edges between rooms whether their distance is that of the centroids, `[rows]`.

    Without centroids the distance must be null.
    """
    first = np.searchsorted(part.rooms.scene, edges.scene[rows]) - 1
    centre = part.rooms.points("centroid")
    apart = centre[first + edges.source[rows]] - centre[first + edges.target[rows]]
    expected = np.linalg.norm(apart, axis=1)
    stored = part.edges.numbers("distance_m")[rows]
    same: Bools = np.isclose(stored, expected, equal_nan=True)
    return same
