"""The partial graph 𝒢′: what a robot has seen of a building (paper, section II).

A robot knows the rooms, which of them it entered, what it saw there, and the hidden share of each
room. The hidden share is 1 for a room that it never entered, and 0 for a room that it searched.
Node indices are those of `bsg_data.scene.scene_graph`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bsg_data.arrays import Bools, Counts
from bsg_data.dataset.categories import place_columns
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import count_cells, to_histograms
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath
from bsg_data.geometry.floor_area import find_floor_area
from bsg_data.observation.hidden_others import sample_hidden_others
from bsg_data.observation.hidden_share import ShareBelief
from bsg_data.observation.masks import sample_hidden, sample_view, sample_withheld
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.class_map import ClassMap, is_nameless
from bsg_data.scene.class_space import ClassSpace
from bsg_data.scene.connections import Connections
from bsg_data.scene.parts import find_wholes, load_parts
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.scene_graph import Box, Point, SceneGraph, SceneObject
from bsg_data.scene.surroundings import BUILDING_KINDS, RoomType, Surroundings, is_floor_area


@dataclass(frozen=True, slots=True)
class SeenObject:
    """One object that the robot saw.

    Attributes:
        name: its id in the source, unique in the graph.
        room_index: its room, 1..R; 0 for an object in no room.
        raw_category: its name in the source.
        category: the corrected name by the class map; None if the map does not have the name.
        class_index: its class; None outside the classes.
        position: metres, Z up; None if unknown.
    """

    name: str
    room_index: int
    raw_category: str
    category: str | None
    class_index: int | None
    position: Point | None = None


@dataclass(frozen=True, slots=True)
class KnownRoom:
    """One room that the robot knows.

    Attributes:
        name: its id in the source, unique in the graph.
        hidden_share: share of its objects that the robot has not seen, 0 to 1; the mean, if
            uncertain.
        visited: whether the robot was inside.
        label: its name in the source, for people; models never read it.
        position: metres, Z up; None if unknown.
        box: metres; None if unknown.
        footprint: corners (x, y) from above, metres; None if unknown.
        floor_index: storey, 0 at the bottom; None if unknown.
        floor_area: square metres; None: take it from footprint or box, if any.
        room_type: one of `list_room_labels()`, or several with probabilities. Models read it. None
            if unknown.
        hidden_share_sd: standard deviation of the hidden share; 0 if it is certain.
    """

    name: str
    hidden_share: float
    visited: bool = True
    label: str | None = None
    position: Point | None = None
    box: Box | None = None
    footprint: tuple[tuple[float, float], ...] | None = None
    floor_index: int | None = None
    floor_area: float | None = None
    room_type: RoomType | None = None
    hidden_share_sd: float = 0.0

    @property
    def share(self) -> ShareBelief:
        """The belief about the hidden share.

        Raises:
            RecipeError: if mean and standard deviation do not fit together.
        """
        return ShareBelief(self.hidden_share, self.hidden_share_sd)


@dataclass(frozen=True, slots=True)
class PartialGraph:
    """What a robot has seen of one building.

    Attributes:
        scene_id: id of the building.
        class_space: class space of the objects' classes.
        hidden_share: hidden share of the whole building; it changes with the shares of the rooms,
            see `share_with`.
        rooms: the rooms, in the order of their indices 1..R.
        objects: the seen objects, in any order.
        adjacency: pairs of indices of connected rooms, ascending.
        building_kind: one of `BUILDING_KINDS`; None if unknown.
        source: kind of source with the same names and counting of objects, e.g. `hm3d`; None if
            unknown.
    """

    scene_id: str
    class_space: ClassSpace
    hidden_share: float
    rooms: tuple[KnownRoom, ...]
    objects: tuple[SeenObject, ...]
    adjacency: tuple[tuple[int, int], ...] = ()
    building_kind: str | None = None
    source: str | None = None

    def share_with(self, shares: Sequence[float]) -> float:
        """Return the hidden share of the building if its rooms have these shares, `[R]`.

        It is proportional to the sum of the rooms' shares, and at most 1. If no room of the graph
        hides anything, it is the mean of the shares.
        """
        before, after = sum(room.hidden_share for room in self.rooms), sum(shares)
        if not before:
            return after / len(shares) if after else self.hidden_share
        return min(1.0, self.hidden_share * after / before)

    def histograms(self) -> Counts:
        """Return the histograms of what was seen, E′ × O′, `[1 + R, C]`, the building first."""
        known = [obj for obj in self.objects if obj.class_index is not None]
        shape = (len(self.rooms) + 1, len(self.class_space.classes))
        rooms = np.array([obj.room_index for obj in known], dtype=np.int64)
        classes = np.array([obj.class_index for obj in known], dtype=np.int64)
        return to_histograms(count_cells(rooms, classes, shape=shape))

    def observation(
        self, *, vocabulary: tuple[str, ...] = (), withheld: Collection[int] | Bools = ()
    ) -> Observation:
        """Return the graph as arrays, the input of models; hidden shares become their means.

        Args:
            vocabulary: categories outside the classes to count.
            withheld: classes that the graph shows only in searched rooms, so their absence
                elsewhere says nothing. Or an array `[1 + R, C]`, true where nothing of a class is
                shown.

        Raises:
            RecipeError: if an array has another shape, or a floor area, room type or kind of
                building is impossible.
        """
        inputs = self.histograms()
        share = np.array([self.hidden_share, *(room.hidden_share for room in self.rooms)])
        if isinstance(withheld, np.ndarray):
            if withheld.shape != inputs.shape:
                raise RecipeError(
                    f"{self.scene_id}: withheld: expected {inputs.shape}, found {withheld.shape}"
                )
            without = withheld.astype(bool)
        else:
            classes = np.isin(np.arange(inputs.shape[1]), list(withheld))
            without = classes & (share > 0)[:, None]
        return Observation(
            scene_ids=(self.scene_id,),
            starts=np.array([0, len(inputs)]),
            inputs=inputs,
            hidden_share=share.astype(np.float32),
            visited=np.array([True, *(room.visited for room in self.rooms)]),
            withheld=without,
            vocabulary=vocabulary,
            others=self._others(vocabulary),
            connections=Connections.of_pairs(self.adjacency),
            surroundings=self.surroundings(),
        )

    def surroundings(self) -> Surroundings:
        """Return what is known of the building and its rooms besides their objects.

        Raises:
            RecipeError: if a floor area, a room type or a kind of building cannot be.
        """
        try:
            return Surroundings.of_rooms(
                [area_of(room) for room in self.rooms],
                [room.room_type for room in self.rooms],
                building_kind=self.building_kind,
                source=self.source,
            )
        except RecipeError as error:
            raise RecipeError(f"{self.scene_id}: {error}") from error

    def _others(self, vocabulary: Sequence[str]) -> Counts:
        """Return the seen objects outside the classes, counted by a vocabulary, `[N, V]`."""
        known = [
            (obj.room_index, obj.category)
            for obj in self.objects
            if obj.class_index is None and obj.category and not is_nameless(obj.category)
        ]
        columns = place_columns([category for _, category in known], vocabulary)
        rooms = np.array([room for room, _ in known], dtype=np.int64)
        shape = (len(self.rooms) + 1, len(vocabulary))
        cells = count_cells(rooms[columns >= 0], columns[columns >= 0], shape=shape)
        return to_histograms(cells)


def area_of(room: KnownRoom) -> float | None:
    """Return the floor area of a room, or the area of its shape, in square metres."""
    if room.floor_area is not None:
        return room.floor_area
    return find_floor_area(None, footprint=room.footprint, box=room.box)


def observe(graph: PartialGraph, room_index: int, objects: Iterable[SeenObject]) -> PartialGraph:
    """Return the partial graph after the robot has searched a room.

    The hidden share of the building falls in proportion to the sum of its rooms' shares.

    Args:
        graph: the partial graph before.
        room_index: the room, 1..R.
        objects: all objects in the room, seen before or not; they replace the known objects.

    Raises:
        RecipeError: if the room does not exist, or an object is in another room or occurs twice.
    """
    if not 1 <= room_index <= len(graph.rooms):
        raise RecipeError(
            f"{graph.scene_id}: expected a room of 1..{len(graph.rooms)}, found room {room_index}"
        )
    inside = tuple(objects)
    strays = [obj.name for obj in inside if obj.room_index != room_index]
    if strays:
        raise RecipeError(f"{graph.scene_id}: object {strays[0]} is not in room {room_index}")
    elsewhere = tuple(obj for obj in graph.objects if obj.room_index != room_index)
    twice = {obj.name for obj in elsewhere} & {obj.name for obj in inside}
    if twice or len({obj.name for obj in inside}) < len(inside):
        what = min(twice) if twice else "an object"
        raise RecipeError(f"{graph.scene_id}: {what} is there twice")
    rooms = list(graph.rooms)
    rooms[room_index - 1] = replace(rooms[room_index - 1], visited=True)
    known = replace(graph, rooms=tuple(rooms), objects=elsewhere + inside)
    return hide_of_room(known, room_index, ShareBelief(0.0))


def hide_of_room(graph: PartialGraph, room_index: int, share: ShareBelief) -> PartialGraph:
    """Return the graph with another hidden share of a room, 1..R."""
    rooms = list(graph.rooms)
    rooms[room_index - 1] = replace(
        rooms[room_index - 1], hidden_share=share.mean, hidden_share_sd=share.sd
    )
    building = graph.share_with([room.hidden_share for room in rooms])
    return replace(graph, rooms=tuple(rooms), hidden_share=building)


def reclassify(graph: PartialGraph, class_map: ClassMap) -> PartialGraph:
    """Return the graph with the classes that another class map gives its objects."""
    found = [class_map.classify(obj.raw_category) for obj in graph.objects]
    return replace(
        graph,
        class_space=class_map.space,
        objects=tuple(
            replace(obj, category=one.category, class_index=one.class_index)
            for obj, one in zip(graph.objects, found, strict=True)
        ),
    )


def mask_scene(
    graph: SceneGraph, recipe: MaskRecipe, *, draw: int, class_space: ClassSpace
) -> PartialGraph:
    """Return the partial graph that a mask leaves of a scene graph.

    Its histograms equal the inputs of `bsg-data pairs`. A mask says how many objects of each class
    and room are hidden, not which. This function hides those that are listed last. Withheld classes
    are left out, and the graph does not say which: give `list_withheld` to `observation`.
    """
    adjacent = [(edge.source, edge.target) for edge in graph.adjacency]
    cells, others, kinds, categories = _count(graph, len(class_space.classes))
    view = sample_view(
        cells.shape,
        recipe,
        scene_id=graph.scene_id,
        draw=draw,
        connections=Connections.of_pairs(adjacent),
    )
    hidden = sample_hidden(cells, view, recipe, scene_id=graph.scene_id, draw=draw)
    unseen = sample_hidden_others(
        others,
        view,
        recipe,
        scene_id=graph.scene_id,
        draw=draw,
        there=cells,
        hidden=hidden,
        wholes=find_wholes(categories, class_space.classes, load_parts()) if recipe.parts else None,
    )
    left = np.concatenate([cells - hidden, others - unseen], axis=1)
    seen = []
    for obj, kind in zip(graph.objects, kinds, strict=True):
        left[obj.room_index, kind] -= 1
        if left[obj.room_index, kind] >= 0:
            seen.append(_see(obj))
    share = view.hidden_share
    return PartialGraph(
        scene_id=graph.scene_id,
        class_space=class_space,
        hidden_share=float(share[0]),
        rooms=tuple(
            KnownRoom(
                str(room.region_id),
                float(share[room.room_index]),
                bool(view.visited[room.room_index]),
                room.source_label,
                room.centroid,
                room.box,
                room.footprint,
                room.floor_index,
                room.floor_area if is_floor_area(room.floor_area) else None,
                room.label if room.label in list_room_labels() else None,
            )
            for room in graph.rooms
        ),
        objects=tuple(seen),
        adjacency=tuple(adjacent),
        building_kind=graph.building_kind if graph.building_kind in BUILDING_KINDS else None,
        source=graph.source,
    )


def list_withheld(recipe: MaskRecipe, graph: PartialGraph, *, draw: int = 0) -> tuple[int, ...]:
    """Return the indices of the classes that the mask of `mask_scene` withheld."""
    withheld = sample_withheld(
        recipe, scene_id=graph.scene_id, draw=draw, classes=len(graph.class_space.classes)
    )
    return tuple(np.flatnonzero(withheld).tolist())


def enter_room(known: PartialGraph, graph: SceneGraph, room_index: int) -> PartialGraph:
    """Return the partial graph after the robot has entered a room and seen all objects in it.

    Raises:
        RecipeError: if the room does not exist.
    """
    inside = (obj for obj in graph.objects if obj.room_index == room_index)
    return observe(known, room_index, map(_see, inside))


def mask_dataset(
    dataset: AnyPath, scenes: Collection[str], recipe: MaskRecipe, *, draw: int = 0
) -> Iterator[tuple[PartialGraph, Counts]]:
    """Yield the partial graphs of some masked scenes with their true histograms `[N, C]`."""
    dataset = Path(dataset)
    data = Dataset.open(dataset)
    for graph in read_scene_graphs(dataset):
        if graph.scene_id in scenes:
            left = mask_scene(graph, recipe, draw=draw, class_space=data.manifest.class_space)
            yield left, to_histograms(data.cells(graph.scene_id))


def _see(obj: SceneObject) -> SeenObject:
    return SeenObject(
        str(obj.instance_id),
        obj.room_index,
        obj.raw_category,
        obj.category,
        obj.class_index,
        obj.centroid,
    )


def _count(graph: SceneGraph, classes: int) -> tuple[Counts, Counts, list[int], tuple[str, ...]]:
    """Return classified cells, other cells, the column of each object, and the others' names."""
    names = [
        None if obj.category is None or is_nameless(obj.category) else obj.category
        for obj in graph.objects
    ]
    others = sorted(
        {
            name or ""
            for obj, name in zip(graph.objects, names, strict=True)
            if obj.class_index is None
        }
    )
    column = {name: classes + i for i, name in enumerate(others)}
    kinds = [
        column[name or ""] if obj.class_index is None else obj.class_index
        for obj, name in zip(graph.objects, names, strict=True)
    ]
    rooms = np.array([obj.room_index for obj in graph.objects], dtype=np.int64)
    shape = (len(graph.rooms) + 1, classes + len(others))
    cells = count_cells(rooms, np.array(kinds, dtype=np.int64), shape=shape)
    return cells[:, :classes], cells[:, classes:], kinds, tuple(others)
