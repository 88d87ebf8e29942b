"""Combine a source with a list of its words for rooms: which common label each one means."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import RoomReader
from bsg_data.scene.scene_graph import Room
from bsg_data.sources.label_table import read_room_words
from bsg_data.sources.source import Reading, SceneRef, Source, Wrapper


class WithRoomLabels(Wrapper):
    """A source combined with a file `source_label,label`.

    A word that the file lists has its label, whatever we read it as; without one, it names no kind
    of room. A word counts as it is written, or else in any case and without its number. The file is
    read here, once.

    Raises:
        SourceError: if the file is no such table, or a label is none of ours.
    """

    def __init__(self, source: Source, file: AnyPath) -> None:
        super().__init__(source)
        self._reader = RoomReader(read_room_words(file))
        self._name = f"{Path(file).name} (sha256 {hash_file(Path(file))})"

    @property
    def options(self) -> dict[str, int | str]:
        """The source's options, and which file it is."""
        return {**self.source.options, "room_labels": self._name}

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read a scene, with the labels that the file gives its rooms."""
        reading = self.source.read(ref, class_map)
        rooms = tuple(self._label(room) for room in reading.graph.rooms)
        return replace(reading, graph=replace(reading.graph, rooms=rooms))

    def lists(self, word: str) -> bool:
        """Say whether the file lists a word, with a label or without, or the source does."""
        return self._reader.find_own(word) is not None or super().lists(word)

    def _label(self, room: Room) -> Room:
        word = room.source_label or ""
        is_listed = self._reader.find_own(word)
        return replace(room, label=self._reader(word).label) if is_listed else room
