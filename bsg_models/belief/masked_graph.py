"""The partial graph that a mask leaves of a scene graph: the same masks as those of pairs."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from bsg_data.arrays import Bools, Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import Unclassified, count_cells, to_histograms
from bsg_data.files import AnyPath
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.masks import Layout, sample_masks
from bsg_data.observation.view import View, sample_unknown, see_unclassified
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.class_map import is_nameless
from bsg_data.scene.class_space import ClassSpace
from bsg_data.scene.connections import Connections
from bsg_data.scene.room_label import known_label, list_room_labels
from bsg_data.scene.scene_graph import Room, SceneGraph
from bsg_data.scene.surroundings import BUILDING_KINDS, is_floor_area
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph, SeenObject


def mask_scene(
    graph: SceneGraph, recipe: MaskRecipe, *, draw: int, class_space: ClassSpace
) -> PartialGraph:
    """Return the partial graph that a mask leaves of a scene graph.

    Its histograms equal the inputs of `bsg-data pairs`. A mask says how many objects of each class
    and room are hidden, not which. This function hides those that are listed last. Withheld classes
    are left out, and the graph does not say which: give `list_withheld` to `observation`. It does
    say which classes a detector of few words knows.

    Args:
        graph: of the whole building.
        recipe: the mask.
        draw: its number.
        class_space: of the objects' classes.
    """
    return _mask(graph, recipe, draw=draw, class_space=class_space)[0]


def mask_dataset(
    dataset: AnyPath, scenes: Collection[str], recipe: MaskRecipe
) -> Iterator[tuple[PartialGraph, Counts]]:
    """Yield the partial graphs of some masked scenes with their true histograms `[N, C]`.

    The robot's detector does not know a class that the source has no word for.
    """
    data = Dataset.open(dataset)
    space = data.manifest.class_space
    for graph in data.read_graphs():
        if graph.scene_id in scenes:
            nameable = data.nameable(graph.scene_id)
            yield _mask(graph, recipe, draw=0, class_space=space, nameable=nameable)


def list_withheld(recipe: MaskRecipe, graph: PartialGraph, *, draw: int = 0) -> tuple[int, ...]:
    """Return the indices of the classes that the mask of `mask_scene` withheld."""
    (rng,) = MaskStreams([recipe], [graph.scene_id], [draw]).of("withheld")
    withheld = rng.random(len(graph.class_space.classes)) < recipe.withhold
    return tuple(np.flatnonzero(withheld).tolist())


def _mask(
    graph: SceneGraph,
    recipe: MaskRecipe,
    *,
    draw: int,
    class_space: ClassSpace,
    nameable: Bools | bool = True,
) -> tuple[PartialGraph, Counts]:
    """Return the partial graph, and the true histograms `[N, C]` of its nodes."""
    ways = Connections.of_pairs((edge.source, edge.target) for edge in graph.adjacency)
    whole, unclassified, columns = _count(graph, class_space)
    streams = MaskStreams([recipe], [graph.scene_id], [draw])
    views, cells, hidden = sample_masks([whole], [Layout(whole.shape, ways)], streams)
    (shown,) = see_unclassified(
        [unclassified],
        views,
        streams,
        present=cells,
        hidden=hidden,
        classes=class_space.classes,
    )
    seen, view = shown.count(unclassified.names), views[0]
    rows = {node: row for row, node in enumerate(view.nodes.tolist())}
    rooms = [room for room in graph.rooms if room.room_index in rows]
    partial = PartialGraph(
        scene_id=graph.scene_id,
        class_space=class_space,
        hidden_share=float(view.hidden_share[0]),
        rooms=tuple(_know(room, view, rows[room.room_index]) for room in rooms),
        objects=tuple(_see(graph, columns, np.hstack([cells - hidden, seen]), rows)),
        adjacency=tuple((a, b) for a, b in ways.among(view.nodes).pairs.tolist()),
        building_kind=graph.building_kind if graph.building_kind in BUILDING_KINDS else None,
        source=graph.source,
        detector=_list_known(recipe, class_space, nameable, streams),
    )
    return partial, to_histograms(cells)


def _list_known(
    recipe: MaskRecipe,
    class_space: ClassSpace,
    nameable: Bools | bool,
    streams: MaskStreams,
) -> tuple[tuple[str, int], ...] | None:
    """Return the classes that the robot's detector knows; None: all."""
    names = class_space.classes
    (rng,) = streams.of("detector")
    unknown, _ = sample_unknown(rng, recipe, classes=len(names))
    unknown = unknown | ~(np.ones(len(names), dtype=bool) & nameable)
    if not unknown.any():
        return None
    return tuple((name, index) for index, name in enumerate(names) if not unknown[index])


def _count(graph: SceneGraph, class_space: ClassSpace) -> tuple[Counts, Unclassified, list[int]]:
    """Return classified cells, the other objects, and the column of each object in both."""
    width = len(class_space.classes)
    names = [
        "" if obj.category is None or is_nameless(obj.category) else obj.category
        for obj in graph.objects
    ]
    listed = list(zip(graph.objects, names, strict=True))
    kinds = sorted({name for obj, name in listed if obj.class_index is None})
    columns = [
        width + kinds.index(name) if obj.class_index is None else obj.class_index
        for obj, name in listed
    ]
    rooms = np.array([obj.room_index for obj in graph.objects], dtype=np.int64)
    shape = (len(graph.rooms) + 1, width + len(kinds))
    cells = count_cells(rooms, np.array(columns, dtype=np.int64), shape=shape)
    return cells[:, :width], Unclassified.of_cells(tuple(kinds), cells[:, width:]), columns


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
    graph: SceneGraph, columns: Sequence[int], left: Counts, rows: dict[int, int]
) -> Iterator[SeenObject]:
    """Yield the first objects of each room and column, as many as are `left` `[N, K]`."""
    for obj, column in zip(graph.objects, columns, strict=True):
        row = rows.get(obj.room_index)
        if row is None:  # in a room that was not found
            continue
        left[row, column] -= 1
        if left[row, column] >= 0:
            name, raw = str(obj.instance_id), obj.raw_category
            yield SeenObject(name, row, raw, obj.category, obj.class_index, obj.centroid)
