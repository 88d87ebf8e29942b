"""Surroundings: what is known of a room and its building besides the objects. A mask hides none.

Each kind of evidence is a field of `Surroundings`. A new kind also needs a field of
`bsg_models.belief.partial_graph.KnownRoom`, which is how a robot says it, and a row of
`bsg_models.inputs.nodes.EVIDENCE`, which is how networks read and forget it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Floats, Ints
from bsg_data.scene.room_label import (
    RoomType,
    known_label,
    list_room_labels,
    spread_labels,
)
from bsg_data.scene.scene_graph import Box

if TYPE_CHECKING:
    import pyarrow as pa

# Models know each by its index here; add new kinds and sources at the end.
BUILDING_KINDS = ("home", "office", "school", "shop", "restaurant", "hotel", "hall")
# Kinds that a robot may say and no model was trained on: they are read as unknown.
SAID_KINDS = (*BUILDING_KINDS, "hospital", "warehouse", "museum", "gym", "library", "other")
KNOWN_SOURCES = ("hm3d", "behavior", "procthor", "mp3d")
UNKNOWN = -1  # the index of a kind or a source that is not known
MAX_FLOOR_AREA = 1e5  # square metres, of a room: the largest halls that are built
_BOX = tuple(f"box_{end}_{axis}" for end in ("min", "max") for axis in "xyz")
# Columns of a dataset's tables that `Surroundings.of_tables` reads.
ROOM_COLUMNS = ("floor_area", "footprint", *_BOX, "label")
SCENE_COLUMNS = ("building_kind", "source")


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What is known of N nodes of interest in B buildings besides their objects; L room labels."""

    floor_area: Floats  # [N] square metres; NaN if unknown, and for buildings
    labels: npt.NDArray[np.float32]  # [N, L] distributions; all 0 if unknown
    building_kinds: Ints  # [B] indices in `BUILDING_KINDS`
    sources: Ints  # [B] in `KNOWN_SOURCES`: sources that name and count objects in the same way

    def __len__(self) -> int:
        """Return the number of nodes N."""
        return len(self.floor_area)

    @classmethod
    def unknown(cls, *, nodes: int, buildings: int = 1) -> Surroundings:
        """Return surroundings that are all unknown."""
        return cls(
            floor_area=np.full(nodes, np.nan),
            labels=np.zeros((nodes, len(list_room_labels())), dtype=np.float32),
            building_kinds=np.full(buildings, UNKNOWN, dtype=np.int64),
            sources=np.full(buildings, UNKNOWN, dtype=np.int64),
        )

    @classmethod
    def of_rooms(
        cls,
        areas: Sequence[float | None],
        room_types: Sequence[RoomType | None],
        *,
        building_kind: str | None = None,
        source: str | None = None,
    ) -> Surroundings:
        """Return the surroundings of what a robot says of rooms; the building's node is first.

        Raises:
            RecipeError: if the type of a room is impossible.
        """
        found = cls.unknown(nodes=1 + len(areas))
        for row, (area, room_type) in enumerate(zip(areas, room_types, strict=True), start=1):
            found.floor_area[row] = np.nan if area is None else area
            found.labels[row] = spread_labels(room_type)
        found.building_kinds[:] = _find(building_kind, BUILDING_KINDS)
        found.sources[:] = _find(source, KNOWN_SOURCES)
        return found

    @classmethod
    def of_tables(
        cls, scenes: pa.Table, rooms: pa.Table, *, rows: Ints, nodes: int
    ) -> Surroundings:
        """Return those of a dataset's tables; `rows` `[R]` has the node of each row of `rooms`."""
        found = cls.unknown(nodes=nodes, buildings=len(scenes))
        found.building_kinds[:] = [
            _find(word, BUILDING_KINDS) for word in scenes["building_kind"].to_pylist()
        ]
        found.sources[:] = [_find(word, KNOWN_SOURCES) for word in scenes["source"].to_pylist()]
        found.floor_area[rows] = _measure_rooms(rooms)
        found.labels[rows] = _mark_labels(rooms)
        for evidence in fields(cls):
            getattr(found, evidence.name).setflags(
                write=False
            )  # all readers of the dataset share it
        return found

    def take(self, rows: slice | Ints, *, buildings: slice | Ints) -> Surroundings:
        """Return those of some nodes and of their buildings."""
        return Surroundings(
            self.floor_area[rows],
            self.labels[rows],
            self.building_kinds[buildings],
            self.sources[buildings],
        )

    def without(self, *evidence: str) -> Surroundings:
        """Return a copy with some evidence, names of `EVIDENCE`, set to unknown."""
        nothing = self.unknown(nodes=len(self), buildings=len(self.sources))
        return replace(self, **{name: getattr(nothing, name) for name in evidence})


EVIDENCE = tuple(evidence.name for evidence in fields(Surroundings))


def stack_surroundings(several: Sequence[Surroundings]) -> Surroundings:
    """Return the surroundings of several buildings, one or more, in order."""
    return Surroundings(
        *(
            np.concatenate([getattr(surroundings, name) for surroundings in several])
            for name in EVIDENCE
        )
    )


def is_floor_area(area: float | None) -> bool:
    """Say whether a room can have a floor area, in square metres."""
    return area is not None and 0 < area <= MAX_FLOOR_AREA


def find_floor_area(
    area: float | None, *, footprint: Sequence[tuple[float, float]] | None, box: Box | None
) -> float | None:
    """Return the floor area of a room in square metres; None if nothing says one.

    The area that is said counts first, then the footprint `(x, y)`, then the box. What no room can
    have counts as not said.
    """
    if is_floor_area(area):
        return area
    area = measure_area(footprint) if footprint else None
    if area is None and box is not None:
        (a, b, _), (c, d, _) = box.minimum, box.maximum
        area = (c - a) * (d - b) if c > a and d > b else None
    return area if is_floor_area(area) else None


def measure_area(corners: Sequence[tuple[float, float]]) -> float | None:
    """Return the area of a polygon (x, y) in square metres, four digits; None if it has none.

    Of one that crosses itself it is the area of the convex hull: to take it apart takes minutes.
    """
    import shapely  # Imported here because importing Shapely is slow.

    if len(corners) < 3:
        return None
    polygon = shapely.Polygon(corners)
    return round((polygon if polygon.is_valid else polygon.convex_hull).area, 4) or None


def _measure_rooms(rooms: pa.Table) -> Floats:
    """Return the floor area of every room `[R]`, from its shape where the source says none."""
    areas = np.array(rooms["floor_area"].to_numpy(), dtype=np.float64)  # NaN for null
    unsaid = ~((areas > 0) & (areas <= MAX_FLOOR_AREA))
    areas[unsaid] = np.nan
    shaped = rooms["footprint"].is_valid().to_numpy() | rooms[_BOX[0]].is_valid().to_numpy()
    silent = np.flatnonzero(unsaid & shaped)
    for row, room in zip(silent, rooms.take(silent).to_pylist(), strict=True):
        corners = room["footprint"] or ()
        ends = [room[name] for name in _BOX]
        box = None if None in ends else Box(tuple(ends[:3]), tuple(ends[3:]))
        pairs = tuple(zip(corners[::2], corners[1::2], strict=False))
        area = find_floor_area(None, footprint=pairs, box=box)
        areas[row] = np.nan if area is None else area
    return areas


def _mark_labels(rooms: pa.Table) -> Floats:
    """Return 1 at the label of every room `[R, L]`; all 0 for a label that this version lacks."""
    index = {label: number for number, label in enumerate(list_room_labels())}
    labels = rooms["label"].to_pylist()
    found = [index.get(label and known_label(label), len(index)) for label in labels]
    return np.eye(len(index) + 1, len(index))[found]


def _find(word: str | None, listed: Sequence[str]) -> int:
    return listed.index(word) if word in listed else UNKNOWN
