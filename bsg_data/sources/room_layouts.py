"""Combine a source with room layouts: labels, boxes and connections of rooms from other files."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cached_property
from pathlib import Path

from bsg_data.dataset.manifest import SkippedScene
from bsg_data.errors import SourceError
from bsg_data.files import AnyPath
from bsg_data.geometry.placement import find_storeys
from bsg_data.inputs import text_table
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import LAYOUTS, label_of
from bsg_data.scene.scene_graph import SceneGraph
from bsg_data.sources.annotation_files import (
    fingerprint,
    list_files,
    require_lasting,
    skip_columns,
)
from bsg_data.sources.assembly import connect, place_room
from bsg_data.sources.layout_files import (
    CONFIG_SUFFIX,
    SUFFIXES,
    LayoutError,
    RoomLayout,
    read_layout,
    read_layout_table,
)
from bsg_data.sources.source import (
    FoundScenes,
    Reading,
    SceneRef,
    Source,
    Wrapper,
)
from bsg_data.words.shown import list_some

_SHOWN = 10  # region ids in a message
_Named = tuple[str, Path]  # how a layout names its scene, and the file where it is
_EXPECTED = (
    f"no room layout found; expected a folder with <scene id>.yaml or <scene id>{CONFIG_SUFFIX}, "
    "one such file, or a table .csv or .tsv with the columns scene, region, label"
)


def _lay_out(graph: SceneGraph, layout: RoomLayout) -> SceneGraph:
    """Return the scene graph with the labels and connections of a layout.

    Boxes come from the layout only if there is no mesh, because the origins may differ. Between
    rooms of the layout, its connections replace those of the mesh, if it says any. All other rooms
    and connections stay as they are.
    """
    index_of = _find_rooms(graph, layout)
    rooms, is_placed = list(graph.rooms), graph.up_axis is not None
    for number, laid in layout.rooms.items():
        room, word = rooms[index_of[number] - 1], laid.source_label
        if word is not None:
            room = replace(room, source_label=word, label=label_of(LAYOUTS, word))
        rooms[room.room_index - 1] = place_room(room, laid) if laid.box and not is_placed else room
    is_moved = not is_placed and any(laid.box for laid in layout.rooms.values())
    laid_out = replace(graph, rooms=find_storeys(rooms) if is_moved else tuple(rooms))
    if layout.connections is None:
        return laid_out
    own = {index_of[number] for number in layout.rooms}
    others = tuple(edge for edge in graph.adjacency if not {edge.source, edge.target} <= own)
    pairs = [(index_of[first], index_of[second]) for first, second in layout.connections]
    return connect(replace(laid_out, adjacency=others), pairs, method="layout")


def _find_rooms(graph: SceneGraph, layout: RoomLayout) -> dict[int, int]:
    """Return the room index of every key that a room has in a layout."""
    by_region = layout.by_region
    index_of = {r.region_id if by_region else r.room_index: r.room_index for r in graph.rooms}
    beyond = [number for number in layout.rooms if number not in index_of]
    if not beyond:
        return index_of
    listed, room = list_some([*map(str, sorted(index_of))], _SHOWN), min(beyond)
    count = f"{len(graph.rooms)} rooms of {graph.scene_id}"
    fault = f"region {room} is no region id of the {count} ({listed})"
    raise LayoutError(
        f"{fault if by_region else f'room_{room} is not among the {count}'}; the layout "
        f"({len(layout.rooms)} rooms) is of another scene or another version",
        code="layout-foreign",
        where=graph.scene_id,
    )


class WithLayouts(Wrapper):
    """A source combined with room layouts, for some of its scenes.

    A layout names its scene by the scene id or the key of the building.

    Attributes:
        layouts: a folder of files, at any depth below it; one file; or a table of labels.
    """

    def __init__(self, source: Source, layouts: AnyPath) -> None:
        super().__init__(source)
        self.layouts = Path(layouts)

    @property
    def options(self) -> dict[str, int | str]:
        """The source's options, and a mark that there are layouts."""
        return {**self.source.options, "room_layouts": 1}

    def find(self) -> FoundScenes:
        """Find the scenes of the source, and the layouts that belong to no scene.

        Raises:
            SourceError: as the source does, if there is no layout, or if none belongs to a scene.
        """
        own = self.source.find()
        vars(self).pop("_listed", None)  # once for each build
        vars(self).pop("_files", None)
        named, unread = self._listed
        scenes = tuple(replace(ref, layout=self._state_of(ref)) for ref in own.scenes)
        used = {self._layout_of(ref) for ref in own.scenes} - {None}
        if not used:
            like = own.scenes[0].scene_id + ("" if _is_table(self.layouts) else ".yaml")
            raise SourceError(
                f"{self.layouts}: none of its {len(named)} layouts belongs to a scene "
                f"of {self.source.path}; expected names like {like}",
                code="layouts-foreign",
                where=self.layouts,
            )
        known = {name for ref in own.scenes for name in (ref.scene_id, ref.key)}
        unused = (
            self._skip(*layout, is_known=layout[0] in known)
            for layout in named
            if layout not in used
        )
        return replace(own, scenes=scenes, unused=(*own.unused, *unread, *unused))

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read a scene and its layout; an unusable layout is left out, with the reason."""
        reading = self.source.read(ref, class_map)
        named = self._layout_of(ref)
        if named is None:
            return reading
        name, path = named
        graph, reason = reading.graph, ""
        try:
            layout = _read(name, path)
            rooms = {region: laid for region, laid in layout.rooms.items() if region >= 0}
            graph = _lay_out(graph, replace(layout, rooms=rooms))
            if len(rooms) < len(layout.rooms):
                reason = "a label of the null region, which is no room"
        except LayoutError as error:
            require_lasting(error, path)
            reason = str(error).replace(f"{self._root}/", "")
        left = [SkippedScene(ref.scene_id, self._locate(path), reason)] if reason else []
        return replace(reading, graph=graph, left_out=(*reading.left_out, *left))

    @cached_property
    def _listed(self) -> tuple[list[_Named], list[SkippedScene]]:
        """The layouts, and the folders or columns that are not read."""
        path = self.layouts
        if _is_table(path):
            layouts, unread = read_layout_table(path)
            return [(scene, path) for scene in layouts], [*skip_columns(path, unread)]
        files, left = list_files(path, SUFFIXES, expected=_EXPECTED)
        suffixes = "|".join(map(re.escape, SUFFIXES))
        return [(re.sub(f"({suffixes})$", "", file.name), file) for file in files], [*left]

    @cached_property
    def _files(self) -> dict[str, Path]:
        return dict(reversed(self._listed[0]))  # the first where several have one name

    @property
    def _root(self) -> Path:
        return self.layouts if self.layouts.is_dir() else self.layouts.parent

    def _locate(self, path: Path) -> str:
        return path.relative_to(self._root).as_posix()

    def _layout_of(self, ref: SceneRef) -> _Named | None:
        files = self._files
        return next(
            ((name, files[name]) for name in (ref.scene_id, ref.key) if name in files), None
        )

    def _state_of(self, ref: SceneRef) -> str | None:
        named = self._layout_of(ref)
        return None if named is None else fingerprint(named[1])

    def _skip(self, name: str, path: Path, *, is_known: bool) -> SkippedScene:
        """Say why a layout is not used."""
        is_one = not _is_table(path)
        what = "a room layout" if is_one else f"{len(_read(name, path).rooms)} room labels"
        why = "of a scene that has another layout" if is_known else "of no scene of the source"
        return SkippedScene(name, self._locate(path), f"{what} {why}")


def _is_table(path: Path) -> bool:
    return path.name.casefold().endswith(text_table.SUFFIXES) and not path.is_dir()


def _read(name: str, path: Path) -> RoomLayout:
    return read_layout_table(path)[0][name] if _is_table(path) else read_layout(path)
