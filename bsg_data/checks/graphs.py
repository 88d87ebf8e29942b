"""Rules that the tables of every shard keep, whatever the source."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.dataset.scenes import take_adjacent
from bsg_data.scene.scene_graph import ADJACENCY_METHODS

_AXES = ("x", "y", "z", "-x", "-y", "-z")
_ROUNDING = 2e-4  # metres: coordinates are rounded, and so are values derived from them
_Fault = tuple[str, str, str]


def find_faults(tables: Mapping[str, pa.Table]) -> Iterator[_Fault]:
    """Yield the faults of the scenes of a shard: table, what is at fault, and the rule."""
    adjacent = take_adjacent(tables["edges"])
    rows = {
        name: _Rows(name, table, tables["scenes"])
        for name, table in {**tables, "edges": adjacent}.items()
    }
    scenes, rooms, objects, edges = (rows[n] for n in ("scenes", "rooms", "objects", "edges"))
    is_axis = scenes.is_in("up_axis", [*_AXES, None])
    yield from scenes.report(~is_axis, f"up_axis is none of {', '.join(_AXES)}")
    if len(tables["edges"]) - len(adjacent) != len(rooms.table) + len(objects.table):
        yield "edges", "the shard", "expected an edge to each room and to each object"
    foreign = [fault for some in rows.values() for fault in some.find_foreign()]
    if foreign:
        yield from foreign
        return
    for some in (rooms, objects):
        counted = np.bincount(some.scene, minlength=len(scenes.table))
        number = f"num_{some.name}"
        yield from scenes.report(counted != scenes.array(number), f"{number} is not their number")
    yield from _find_room_faults(rooms)
    yield from _find_object_faults(objects, scenes.array("num_rooms"))
    yield from _find_edge_faults(edges, rooms)


class _Rows:
    """The rows of a table, which belong to scenes."""

    def __init__(self, name: str, table: pa.Table, scenes: pa.Table) -> None:
        self.name, self.table = name, table
        found = pc.index_in(table["scene_id"], value_set=scenes["scene_id"].combine_chunks())
        self.scene: Ints = found.fill_null(-1).to_numpy().astype(np.int64)

    def find_foreign(self) -> Iterator[_Fault]:
        """Yield rows that are of no scene, or not beside the others of theirs."""
        wrong = (self.scene < 0) | (np.diff(self.scene, prepend=-1) < 0)
        yield from self.report(wrong, "is of no scene, or not in their order")

    def report(self, wrong: Bools, rule: str) -> Iterator[_Fault]:
        """Yield a fault for each row that is marked."""
        for row in np.flatnonzero(wrong).tolist():
            fields = self.table.slice(row, 1).to_pylist()[0]
            kind = self.name.removesuffix("s")
            where = {"scene": "", "edge": ", rooms {source_index} and {target_index}"}
            what = where.get(kind, f", {kind} {{{kind}_index}}").format(**fields)
            yield self.name, f"{fields['scene_id']}{what}", rule

    def find_misnumbered(self, index: str, rising: str) -> Iterator[_Fault]:
        """Yield rows whose index does not run, or whose id does not rise."""
        is_first = np.diff(self.scene, prepend=-1) != 0
        places = np.arange(len(self.scene))
        first = np.maximum.accumulate(np.where(is_first, places, 0))
        wrong = self.array(index) != places - first + 1
        yield from self.report(wrong, f"{index} does not run 1, 2, 3, …")
        falls = (np.diff(self.array(rising), prepend=0) <= 0) & ~is_first
        yield from self.report(falls, f"{rising} does not rise")

    def array(self, column: str) -> np.ndarray[Any, Any]:
        """Return a column of numbers, NaN for null."""
        return np.asarray(self.table[column].to_numpy())

    def is_in(self, column: str, words: Sequence[str | None]) -> Bools:
        """Say which words of a column are among some."""
        return np.asarray(pc.is_in(self.table[column], value_set=pa.array(words, pa.string())))

    def points(self, name: str) -> Floats:
        """Return points `[n, 3]`, NaN for null."""
        return np.stack([self.array(f"{name}_{axis}") for axis in "xyz"], axis=1)

    def boxes(self, name: str) -> tuple[Floats, Bools, Bools]:
        """Return boxes `[n, 2, 3]`; which are there; and which are there and possible."""
        boxes = np.stack([self.points(f"{name}_min"), self.points(f"{name}_max")], axis=1)
        is_box = np.isfinite(boxes).all(axis=(1, 2)) & (boxes[:, 0] <= boxes[:, 1]).all(axis=1)
        return boxes, np.asarray(~np.isnan(boxes).all(axis=(1, 2))), np.asarray(is_box)

    def is_area(self, column: str) -> Bools:
        """Say which areas are not known, or above 0."""
        areas = self.array(column)
        return np.asarray(np.isnan(areas) | ((areas > 0) & (areas < np.inf)))


def _find_room_faults(rooms: _Rows) -> Iterator[_Fault]:
    yield from rooms.find_misnumbered("room_index", "region_id")
    yield from rooms.report(rooms.array("region_id") < 0, "region_id is below 0")
    (boxes, is_boxed, is_box), centroids = rooms.boxes("box"), rooms.points("centroid")
    is_near = (np.abs(centroids - boxes.mean(axis=1)) <= _ROUNDING).all(axis=1)
    is_point = np.isfinite(centroids).all(axis=1) | np.isnan(centroids).all(axis=1)
    outlines = rooms.table["footprint"].to_pylist()
    is_outline = np.array(
        [
            outline is None
            or (len(outline) >= 6 and len(outline) % 2 == 0 and bool(np.isfinite(outline).all()))
            for outline in outlines
        ],
        bool,
    )
    sound = is_point & ~np.isinf(rooms.array("floor_z")) & is_outline
    sound &= (np.nan_to_num(rooms.array("floor_index")) >= 0) & rooms.is_area("floor_area")
    sound &= ~is_boxed | (is_box & is_near)
    yield from rooms.report(~sound, "its geometry is impossible")


def _find_object_faults(objects: _Rows, rooms: Ints) -> Iterator[_Fault]:
    yield from objects.find_misnumbered("object_index", "instance_id")
    room = objects.array("room_index")
    yield from objects.report((room < 0) | (room > rooms[objects.scene]), "room_index is not 0..R")
    is_colour = pc.match_substring_regex(objects.table["colour"], "^[0-9A-F]{6}$").fill_null(True)
    yield from objects.report(~np.asarray(is_colour), "colour is not RRGGBB")
    yield from objects.report(~objects.is_area("area"), "area is not above 0")
    boxes, is_boxed, is_box = objects.boxes("box")
    parts, is_parted, is_part = objects.boxes("part")
    centroids = objects.points("centroid")
    low, high = boxes[:, :1] - _ROUNDING, boxes[:, 1:] + _ROUNDING
    inner = np.stack([centroids, parts[:, 0], parts[:, 1]], axis=1)
    is_inside: Bools = np.asarray(((low <= inner) & (inner <= high)).all(axis=2))
    is_placed = is_boxed | is_parted | ~np.isnan(centroids).all(axis=1)
    sound = np.isfinite(centroids).all(axis=1) & (~is_boxed | (is_box & is_inside[:, 0]))
    sound &= ~is_parted | (is_part & is_inside[:, 1:].all(axis=1))
    rule = "its centroid, its box or its largest part is impossible"
    yield from objects.report(is_placed & ~sound, rule)


def _find_edge_faults(edges: _Rows, rooms: _Rows) -> Iterator[_Fault]:
    """Yield the faults of edges between rooms."""
    source, target = edges.array("source_index"), edges.array("target_index")
    first = np.searchsorted(rooms.scene, edges.scene)
    number = np.searchsorted(rooms.scene, edges.scene, side="right") - first
    is_pair = (source >= 1) & (source < target) & (target <= number)
    order = edges.scene * 2**40 + source.astype(np.int64) * 2**20 + target
    rule = "an adjacent edge must join two rooms, lower index first, once, in order"
    yield from edges.report(~is_pair | (np.diff(order, prepend=-1) <= 0), rule)
    ends = [first + np.where(is_pair, end, 1) - 1 for end in (source, target)]
    centroids = rooms.points("centroid")
    known = np.linalg.norm(centroids[ends[0]] - centroids[ends[1]], axis=1)
    is_known = np.isclose(known, edges.array("distance_m"), rtol=1e-5, atol=0, equal_nan=True)
    wrong = is_pair & ~(is_known & edges.is_in("method", ADJACENCY_METHODS))
    yield from edges.report(wrong, "an adjacent edge has an unknown method or distance")
