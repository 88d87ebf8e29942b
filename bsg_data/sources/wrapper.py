"""A source around another source: what it does not change is the other's."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bsg_data.dataset.terms import Terms
from bsg_data.scene.class_map import ClassMap
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, Source


@dataclass(frozen=True)
class Wrapper:
    """Forward everything to a source."""

    source: Source

    @property
    def kind(self) -> str:
        """The kind of the source itself."""
        return self.source.kind

    @property
    def path(self) -> Path:
        """The path of the source itself."""
        return self.source.path

    @property
    def options(self) -> dict[str, int | str]:
        """The options of the source itself."""
        return self.source.options

    @property
    def terms(self) -> Terms | None:
        """The terms that the source itself states; None if it states none."""
        terms: Terms | None = getattr(self.source, "terms", None)
        return terms

    def lists(self, word: str) -> bool:
        """Say whether the source itself has a list of words for rooms, with this one."""
        return bool(getattr(self.source, "lists", lambda _: False)(word))

    def find(self) -> FoundScenes:
        """Find the scenes of the source itself."""
        return self.source.find()

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read a scene of the source itself."""
        return self.source.read(ref, class_map)
