"""The floor area of a room, from what is known of its shape."""

from __future__ import annotations

from collections.abc import Sequence

from bsg_data.scene.scene_graph import Box
from bsg_data.scene.surroundings import is_floor_area


def find_floor_area(
    said: float | None, *, footprint: Sequence[tuple[float, float]] | None, box: Box | None
) -> float | None:
    """Return the floor area of a room in square metres; None if nothing says one.

    What is said counts first, then the polygon, then the box. What no room can have counts as not
    said: see `is_floor_area`.

    Args:
        said: by whoever made the room.
        footprint: corners (x, y) from above, metres.
        box: metres.

    >>> find_floor_area(None, footprint=[(0, 0), (3, 0), (3, 2), (0, 2)], box=None)
    6.0
    """
    if is_floor_area(said):
        return said
    area = measure_footprint(footprint) if footprint else None
    if area is None and box is not None:
        (a, b, _), (c, d, _) = box.minimum, box.maximum
        area = (c - a) * (d - b) if c > a and d > b else None
    return area if is_floor_area(area) else None


def measure_footprint(corners: Sequence[tuple[float, float]]) -> float | None:
    """Return the area of a polygon (x, y), also of one that crosses itself; None if it has none."""
    import shapely  # Imported here because importing Shapely is slow.

    if len(corners) < 3:
        return None
    return float(shapely.make_valid(shapely.Polygon(corners)).area) or None
