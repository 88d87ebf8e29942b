"""Record beliefs for the Rerun viewer: `.rrd` files of metres, Z up.

The timeline `step` counts graphs; times are in none. Each entity has a row for every step, which
is empty where the entity is not there.
"""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath, write_bytes
from bsg_data.scene.scene_graph import Box, Point
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.partial_graph import KnownRoom
from bsg_models.rendering.plan import KnownOutline, draw_plan, outline_room, place_beside
from bsg_robot.graph.formats import FormatRow

_STOREY, _HEIGHT, _GAP = 3.0, 2.5, 2.4  # metres, where nobody says them
_OBJECT, _BLIND = 0.08, 0.12  # metres: radii
_TOLD = 5  # blind nodes of a room that are named beside the world
_NAMED = 100  # objects, and blind nodes, that show their names at once; of more, under the pointer
_Colour = tuple[int, ...]
_ENTERED, _ROOM = (128, 134, 148), (189, 107, 255)  # colours as in theme.css, dark
_Columns = Mapping[str, Sequence[Any]]


def write_recording(beliefs: Iterable[BeliefGraph], path: AnyPath) -> None:
    """Write belief graphs of one class space, one a step. A failed write leaves no partial file.

    Rooms without a position are squares beside the others, as on the explorer's plan. Things
    without one are spread over their room: seen objects on the floor, blind nodes at the ceiling.

    Raises:
        RecipeError: if rerun-sdk is not installed.
        DatasetError: if it cannot be written.
    """
    if find_spec("rerun") is None:  # before the first graph is asked for
        raise RecipeError(
            "a recording needs rerun-sdk; use pip install 'docs/examples/formats[rerun]' in your "
            "clone of the project",
            code="library-missing",
        )
    recording = _Recording()
    for recording.step, belief in enumerate(beliefs):
        _show_belief(recording, belief)
    recording.write(Path(path))


class _Recording:
    """Rows of entities, collected step by step."""

    def __init__(self) -> None:
        self.step = 0
        self.classes: Sequence[str] = ()  # names of the class ids
        self._rows: dict[tuple[str, ...], dict[int, _Columns]] = {}

    def show(self, kind: str, *entity: str, **columns: Sequence[Any]) -> None:
        """Show an entity at this step as an archetype of Rerun, with one value an instance."""
        self._rows.setdefault((kind, *entity), {})[self.step] = columns

    def show_classes(
        self, kind: str, of: str, ids: Sequence[int], **columns: Sequence[Any]
    ) -> None:
        """Show things with these class ids as one entity for each class, `world/OF/CLASS`."""
        for c in sorted(set(ids)):
            mine = [k for k, index in enumerate(ids) if index == c]
            chosen = {name: [values[k] for k in mine] for name, values in columns.items()}
            self.show(kind, "world", of, self.classes[c], **chosen)

    def write(self, path: Path) -> None:
        """Write all rows, and views of the world, the text and the series of numbers.

        The id is the hash of the content, because Rerun joins files that have the same.
        """
        import rerun
        from rerun import blueprint

        content = repr((self.classes, self._rows)).encode()
        name, identity = "belief-scene-graphs", hashlib.sha256(content).hexdigest()
        stream = rerun.RecordingStream(name, recording_id=identity, send_properties=False)
        file = stream.binary_stream()
        stream.send_recording_name(path.stem)
        roots = sorted({(kind, entity[0]) for kind, *entity in self._rows}, reverse=True)
        made = {"TextDocument": blueprint.TextDocumentView, "Scalars": blueprint.TimeSeriesView}
        if self.step == 0:
            del made["Scalars"]  # a line needs two steps
        views = [made[kind](origin=root, name=root) for kind, root in roots if kind in made]
        world, beside = blueprint.Spatial3DView(origin="world"), blueprint.Vertical(*views)
        both = blueprint.Horizontal(world, beside, column_shares=[3, 2])
        panels = blueprint.SelectionPanel(state="collapsed"), blueprint.TimePanel(fps=1)
        stream.send_blueprint(blueprint.Blueprint(both, *panels))
        classes = rerun.AnnotationContext(list(enumerate(self.classes)))
        stream.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, classes, static=True)
        steps = range(self.step + 1)
        for (kind, *entity), rows in self._rows.items():
            names = next(iter(rows.values()))
            columns = {
                name: [value for row in rows.values() for value in row[name]] for name in names
            }
            stream.send_columns(
                "/".join(map(rerun.escape_entity_path_part, entity)),
                [rerun.TimeColumn("step", sequence=steps)],
                getattr(rerun, kind)
                .columns(**columns)
                .partition([len(next(iter(rows[k].values()))) if k in rows else 0 for k in steps]),
            )
        write_bytes(path, file.read())


def _show_belief(recording: _Recording, belief: BeliefGraph) -> None:
    partial, objects, blind = belief.partial, belief.partial.objects, belief.blind
    recording.classes = classes = [*partial.class_space.classes, "no class"]
    boxes, more = _place_rooms(partial.rooms), belief.hidden.sum(axis=1).tolist()
    lines = [f"{partial.scene_id}, by {belief.model}"]
    names = [f"{classes[node.class_index]} {node.presence:.0%}" for node in blind]
    expected: list[dict[str, None]] = [{} for _ in boxes]  # names of each room, each once
    for hidden, name in zip(blind, names, strict=True):
        expected[hidden.room_index][name] = None
    for node, room in enumerate(partial.rooms, 1):
        label = room.label or room.name
        colour = _ENTERED if room.visited else _ROOM
        _show_room(recording, room.name, boxes[node], f"{label}: {more[node]:.1f} more", colour)
        recording.show("Scalars", "expected", room.name, scalars=[more[node]])
        recording.show("SeriesLines", "expected", room.name, names=[label])
        named = [f"{more[node]:.1f} more", *[*expected[node]][:_TOLD]]
        lines.append(f"{label}: {', '.join(named)}")
    recording.show("TextDocument", "belief", text=["\n".join(lines)])  # no markup: names are data
    _show_ways(recording, partial.adjacency, dict(enumerate(boxes)))
    spots = _spread([obj.room_index for obj in objects], boxes, level=0.0)
    ids = [len(classes) - 1 if obj.class_index is None else obj.class_index for obj in objects]
    recording.show_classes(
        *("Points3D", "objects", ids),
        positions=[obj.position or spot for obj, spot in zip(objects, spots, strict=True)],
        labels=[obj.raw_category for obj in objects],
        show_labels=[len(ids) <= _NAMED] * len(ids),
        class_ids=ids,
        radii=[_OBJECT] * len(ids),
    )
    spots = _spread([hidden.room_index for hidden in blind], boxes, level=1.0)
    places = {obj.name: obj.position for obj in objects}
    ids = [hidden.class_index for hidden in blind]
    recording.show_classes(
        *("Ellipsoids3D", "blind", ids),
        centers=[
            place_beside(places.get(hidden.on or ""), number) or spot
            for number, (hidden, spot) in enumerate(zip(blind, spots, strict=True))
        ],
        labels=names,
        show_labels=[len(ids) <= _NAMED] * len(ids),
        class_ids=ids,
        half_sizes=[(_BLIND, _BLIND, _BLIND)] * len(ids),
    )
    recording.show_classes(
        *("AnyValues", "blind", ids),
        room=[partial.rooms[hidden.room_index - 1].name for hidden in blind],
        presence=[hidden.presence for hidden in blind],
        expected=[hidden.expected for hidden in blind],
    )


def _show_room(recording: _Recording, name: str, box: Box, label: str, colour: _Colour) -> None:
    half = [(b - a) / 2 for a, b in zip(box.minimum, box.maximum, strict=True)]
    shape: _Columns = {"centers": [box.centre], "half_sizes": [half]}
    recording.show("Boxes3D", "world", "rooms", name, **shape, labels=[label], colors=[colour])


def _show_ways(
    recording: _Recording, pairs: Sequence[tuple[int, int]], boxes: Mapping[int, Box]
) -> None:
    strips = [(boxes[a].centre, boxes[b].centre) for a, b in pairs]
    colours = [_ENTERED] * len(pairs)
    recording.show("LineStrips3D", "world", "adjacency", strips=strips, colors=colours)


def _place_rooms(rooms: Sequence[KnownRoom]) -> list[Box]:
    """Return the boxes of the building and of its rooms, `[1 + R]`."""
    known = [outline_room(room, room.position) for room in rooms]
    right = max((x for outline in known if outline for x, _ in outline), default=-_GAP)
    loose = [KnownOutline(k, "", None, None) for k, outline in enumerate(known) if outline is None]
    squares = {room.number: room.outline for room in draw_plan(loose).rooms}
    boxes = []
    for k, (room, outline) in enumerate(zip(rooms, known, strict=True)):
        low = room.position[2] if room.position else _STOREY * (room.floor_index or 0)
        high = low + _HEIGHT
        if room.box is not None:
            low, high = room.box.minimum[2], room.box.maximum[2]
        boxes.append(_stand(outline or [(right + _GAP + x, -y) for x, y in squares[k]], low, high))
    corners = [corner for box in boxes for corner in (box.minimum, box.maximum)]
    return [Box.around(np.array(corners or [(0.0, 0.0, 0.0)])), *boxes]


def _stand(outline: Sequence[tuple[float, float]], low: float, high: float) -> Box:
    xs, ys = zip(*outline, strict=True)
    return Box((min(xs), min(ys), low), (max(xs), max(ys), high))


def _spread(rooms: Sequence[int], boxes: Sequence[Box], *, level: float) -> list[Point]:
    """Return spots for things, in rows over their rooms; level 0 is the floor, 1 the ceiling."""
    number, before, spots = Counter(rooms), Counter[int](), []
    for room in rooms:
        (left, front, low), (right, back, high) = boxes[room].minimum, boxes[room].maximum
        across = math.ceil(math.sqrt(number[room]))
        down = -(-number[room] // across)
        row, column = divmod(before[room], across)
        before[room] += 1
        x = left + (right - left) * (column + 0.5) / across
        y = front + (back - front) * (row + 0.5) / down
        spots.append((x, y, low + level * (high - low)))
    return spots


RERUN = FormatRow("rerun", (".rrd",), write_all=write_recording)
