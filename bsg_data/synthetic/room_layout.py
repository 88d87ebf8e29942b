"""Lay synthetic buildings out: labels, boxes and connections of rooms, as DomestiGraph has them.

`bsg_data.sources.room_layouts` reads these files. They are made up: a floor plan knows nothing of
what its rooms hold but stairs, and a label is a word for the latent type of a room.
"""

from __future__ import annotations

import numpy as np

from bsg_data.geometry.placement import STAIRS
from bsg_data.synthetic.building import SyntheticBuilding, SyntheticRates
from bsg_data.synthetic.floor_plan import FloorPlan, draw_floor_plan

MOST_ROOMS = 100  # of a building with a layout; rooms of larger floor plans are narrower than doors
# Of the latent types of `rates.json`, by what they hold most of.
LABELS = (
    "dining room",
    "bathroom",
    "office",
    "other",
    "bedroom",
    "kitchen",
    "bedroom",
    "living room",
    "kitchen",
    "utility room",
    "bathroom",
    "living room",
    "office",
    "bedroom",
    "bedroom",
    "living room",
    "kitchen",
    "hallway",
    "bathroom",
    "closet",
)


def draw_layout(
    rates: SyntheticRates, building: SyntheticBuilding, *, seed: int, number: int
) -> str:
    """Return the layout of a building as YAML; equal arguments give equal text.

    Args:
        rates: of the building.
        building: with at most `MOST_ROOMS` rooms.
        seed: of the building.
        number: of the building.
    """
    # Apart from the numbers that drew the building, so that a layout changes no annotation.
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, number, 1))))
    labels = [LABELS[kind] for _, kind in building.room_types]
    plan = draw_floor_plan(
        len(labels),
        with_stairs=_list_stairs(rates, building),
        hallways={room for room, label in enumerate(labels) if label == "hallway"},
        rng=rng,
    )
    lines = ["rooms:"]
    for room, label in enumerate(labels):
        lines += [f"  room_{room + 1}:", f"    label: {label}", *_write_box(plan, room)]
    pairs = [f"- [{a + 1}, {b + 1}]" for a, b, _ in plan.connections()]
    return "\n".join([*lines, "connections:" if pairs else "connections: []", *pairs, ""])


def _list_stairs(rates: SyntheticRates, building: SyntheticBuilding) -> set[int]:
    """Return the indices of the rooms in which the annotation lists stairs."""
    spelt = zip(rates.categories, rates.spellings, strict=True)
    names = {raw for category, raws in spelt if category in STAIRS for raw, _ in raws}
    regions = {row.region_id for row in building.rows if row.name in names}
    return {room for room, (region, _) in enumerate(building.room_types) if region in regions}


def _write_box(plan: FloorPlan, room: int) -> list[str]:
    """Return the centroid and the sides of a room; of the layouts' axes, z points backwards."""
    box = plan.box(room)
    x, y, z = box.centre
    a, b, c = (high - low for low, high in zip(box.minimum, box.maximum, strict=True))
    return [
        f"    centroid: {{x: {x:.2f}, y: {z:.2f}, z: {-y:.2f}}}",
        f"    dims: {{x: {a:.2f}, y: {c:.2f}, z: {b:.2f}}}",
    ]
