"""Check a belief graph from a file for values that no belief graph can have."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from bsg_data.errors import RecipeError
from bsg_data.observation.hidden_share import ShareBelief
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph
from bsg_data.scene.surroundings import is_floor_area
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.errors import BeliefFileError

FARTHEST = 1e6  # metres from the origin


def check_beliefs(belief: BeliefGraph, *, path: Path) -> None:
    """Check the histograms and blind nodes of a belief graph against its partial graph.

    Raises:
        BeliefFileError: naming the file and the first fault.
    """
    for fault in _faults_of_beliefs(belief):
        raise BeliefFileError(f"{path}: {fault}")


def check_partial(partial: PartialGraph, *, path: Path) -> None:
    """Check ids, shares, positions and room numbers of a partial graph.

    Raises:
        BeliefFileError: naming the file and the first fault.
    """
    for fault in _faults_of_partial(partial):
        raise BeliefFileError(f"{path}: {fault}")


def _faults_of_beliefs(belief: BeliefGraph) -> Iterator[str]:
    rooms, classes = len(belief.partial.rooms), belief.partial.class_space.classes
    shape = (rooms + 1, len(classes))
    if belief.expected.shape != shape or belief.presence.shape != shape:
        yield f"expected histograms of {shape[0]} × {shape[1]}"
        return
    if not (np.isfinite(belief.expected) & (belief.expected >= 0)).all():
        yield "expected counts must be finite and not negative"
    if not ((belief.presence >= 0) & (belief.presence <= 1)).all():
        yield "a presence must be between 0 and 1"
    if not (belief.expected >= belief.partial.histograms()).all():
        yield "fewer objects are expected than were seen"
    for node in belief.blind:
        if not 1 <= node.room_index <= rooms:
            yield f"a blind node in room {node.room_index}; rooms are 1 to {rooms}"
        elif not 0 <= node.class_index < len(classes):
            yield f"a blind node of class {node.class_index}; there are {len(classes)}"
        elif not (math.isfinite(node.expected) and node.expected >= 0):
            yield f"a blind node in room {node.room_index} stands for {node.expected} objects"
        elif node.presence != belief.presence[node.room_index, node.class_index]:
            yield f"a blind node in room {node.room_index} has another presence than its room"


def _faults_of_partial(partial: PartialGraph) -> Iterator[str]:
    yield from _faults_of_ids("room", [room.name for room in partial.rooms])
    yield from _faults_of_ids("object", [obj.name for obj in partial.objects])
    rooms = len(partial.rooms)
    for room in partial.rooms:
        try:
            ShareBelief(room.hidden_share, room.hidden_share_sd)
        except RecipeError as error:
            yield f"room {room.name!r}: {error}"
        if not all(abs(value) <= FARTHEST for value in _coordinates(room)):
            yield f"room {room.name!r}: lies more than {FARTHEST:.0e} metres away"
        if room.floor_area is not None and not is_floor_area(room.floor_area):
            yield f"room {room.name!r}: no room has {room.floor_area} square metres"
        if room.footprint is not None and len(room.footprint) < 3:
            yield f"room {room.name!r}: a footprint needs 3 corners or more"
    for obj in partial.objects:
        if not 0 <= obj.room_index <= rooms:
            yield f"object {obj.name!r} is in room {obj.room_index}; rooms are 1 to {rooms}"
        if not all(abs(value) <= FARTHEST for value in obj.position or ()):
            yield f"object {obj.name!r}: lies more than {FARTHEST:.0e} metres away"
    for a, b in partial.adjacency:
        if not 1 <= a < b <= rooms:
            yield f"rooms {a} and {b} cannot be adjacent; rooms are 1 to {rooms}"


def _faults_of_ids(kind: str, names: list[str]) -> Iterator[str]:
    if not all(names):
        yield f"a {kind} has no id"
    for name, times in Counter(names).items():
        if times > 1:
            yield f"{kind} id {name!r} occurs {times} times"


def _coordinates(room: KnownRoom) -> Iterable[float]:
    yield from room.position or ()
    if room.box is not None:
        yield from (*room.box.minimum, *room.box.maximum)
    for corner in room.footprint or ():
        yield from corner
