"""The partial graph that a mask leaves of a scene graph: the same masks as those of pairs."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import count_cells, to_histograms
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.files import AnyPath
from bsg_data.observation.hidden_objects import sample_hidden, sample_hidden_others
from bsg_data.observation.masks import sample_view, sample_withheld
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_data.observation.view import View
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.class_map import is_nameless
from bsg_data.scene.class_space import ClassSpace, find_wholes
from bsg_data.scene.connections import Connections
from bsg_data.scene.room_label import known_label, list_room_labels
from bsg_data.scene.scene_graph import Room, SceneGraph
from bsg_data.scene.surroundings import BUILDING_KINDS, is_floor_area


def mask_scene(
    graph: SceneGraph, recipe: MaskRecipe, *, draw: int, class_space: ClassSpace
) -> PartialGraph:
    """Return the partial graph that a mask leaves of a scene graph.

    Its histograms equal the inputs of `bsg-data pairs`. A mask says how many objects of each class
    and room are hidden, not which. This function hides those that are listed last. Withheld classes
    are left out, and the graph does not say which: give `list_withheld` to `observation`.

    Args:
        graph: of the whole building.
        recipe: the mask.
        draw: its number.
        class_space: of the objects' classes.
    """
    return _mask(graph, recipe, draw=draw, class_space=class_space)[0]


def _mask(
    graph: SceneGraph, recipe: MaskRecipe, *, draw: int, class_space: ClassSpace
) -> tuple[PartialGraph, Counts]:
    """Return the partial graph, and the true histograms `[N, C]` of its nodes."""
    ways = Connections.of_pairs((edge.source, edge.target) for edge in graph.adjacency)
    cells, others, kinds, categories = _count(graph, len(class_space.classes))
    view = sample_view(cells.shape, recipe, scene_id=graph.scene_id, draw=draw, connections=ways)
    cells, others = view.cut(cells), view.cut(others)
    hidden = sample_hidden(cells, view, recipe, scene_id=graph.scene_id, draw=draw)
    unseen = sample_hidden_others(
        others,
        view,
        recipe,
        scene_id=graph.scene_id,
        draw=draw,
        there=cells,
        hidden=hidden,
        wholes=find_wholes(categories, class_space.classes) if recipe.parts else None,
    )
    left = np.concatenate([cells - hidden, others - unseen], axis=1)
    place = {node: row for row, node in enumerate(view.nodes.tolist())}
    partial = PartialGraph(
        scene_id=graph.scene_id,
        class_space=class_space,
        hidden_share=float(view.hidden_share[0]),
        rooms=tuple(
            _know(room, view, place[room.room_index])
            for room in graph.rooms
            if room.room_index in place
        ),
        objects=tuple(_see(graph, kinds, left, place)),
        adjacency=tuple((a, b) for a, b in ways.among(view.nodes).pairs.tolist()),
        building_kind=graph.building_kind if graph.building_kind in BUILDING_KINDS else None,
        source=graph.source,
    )
    return partial, to_histograms(cells)


def _know(room: Room, view: View, row: int) -> KnownRoom:
    return KnownRoom(
        name=str(room.region_id),
        hidden_share=float(view.hidden_share[row]),
        visited=bool(view.visited[row]),
        label=room.source_label,
        position=room.centroid,
        box=room.box,
        footprint=room.footprint,
        floor_index=room.floor_index,
        floor_area=room.floor_area if is_floor_area(room.floor_area) else None,
        room_type=room.label if known_label(room.label or "") in list_room_labels() else None,
    )


def _see(
    graph: SceneGraph, kinds: Sequence[int], left: Counts, place: Mapping[int, int]
) -> Iterator[SeenObject]:
    """Yield the first objects of each room and kind, as many as are `left` `[N, K]`."""
    for obj, kind in zip(graph.objects, kinds, strict=True):
        row = place.get(obj.room_index)
        if row is None:  # in a room that was not found
            continue
        left[row, kind] -= 1
        if left[row, kind] >= 0:
            yield SeenObject(
                str(obj.instance_id),
                row,
                obj.raw_category,
                obj.category,
                obj.class_index,
                obj.centroid,
            )


def list_withheld(recipe: MaskRecipe, graph: PartialGraph, *, draw: int = 0) -> tuple[int, ...]:
    """Return the indices of the classes that the mask of `mask_scene` withheld."""
    withheld = sample_withheld(
        recipe, scene_id=graph.scene_id, draw=draw, classes=len(graph.class_space.classes)
    )
    return tuple(np.flatnonzero(withheld).tolist())


def mask_dataset(
    dataset: AnyPath, scenes: Collection[str], recipe: MaskRecipe, *, draw: int = 0
) -> Iterator[tuple[PartialGraph, Counts]]:
    """Yield the partial graphs of some masked scenes with their true histograms `[N, C]`."""
    dataset = Path(dataset)
    data = Dataset.open(dataset)
    for graph in read_scene_graphs(dataset):
        if graph.scene_id in scenes:
            yield _mask(graph, recipe, draw=draw, class_space=data.manifest.class_space)


def _count(graph: SceneGraph, classes: int) -> tuple[Counts, Counts, list[int], tuple[str, ...]]:
    """Return classified cells, other cells, the column of each object, and the others' names."""
    names = [
        "" if obj.category is None or is_nameless(obj.category) else obj.category
        for obj in graph.objects
    ]
    listed = zip(graph.objects, names, strict=True)
    others = sorted({name for obj, name in listed if obj.class_index is None})
    column = {name: classes + i for i, name in enumerate(others)}
    kinds = [
        column[name] if obj.class_index is None else obj.class_index
        for obj, name in zip(graph.objects, names, strict=True)
    ]
    rooms = np.array([obj.room_index for obj in graph.objects], dtype=np.int64)
    shape = (len(graph.rooms) + 1, classes + len(others))
    cells = count_cells(rooms, np.array(kinds, dtype=np.int64), shape=shape)
    return cells[:, :classes], cells[:, classes:], kinds, tuple(others)
