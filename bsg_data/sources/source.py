"""The protocol of a source of scene graphs, its records and its terms.

A source first finds its scenes, which is cheap, then reads them one by one. Every source returns
`SceneGraph`s. To add one, write a file with a `Source` and a `SourceRow`. Then add a row to
`bsg_data.sources.catalogue` or an entry point to the group `bsg_data.sources`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn, Protocol, runtime_checkable

from bsg_data.errors import SourceError
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_data.scene.scene_graph import MeshCoverage, SceneGraph, building_hash

LICENCE_REF = "LicenseRef-"  # SPDX's prefix for a licence that is not on its list


@dataclass(frozen=True, slots=True)
class SceneRef:
    """The location of one scene of a source.

    Attributes:
        scene_id: e.g. `00006-HkseAnWCgqk`, or only the hash if the source has no number.
        location: path below the source's root, or the scene's name inside the zip.
        fingerprint: hash of the annotation; a resumed build uses it to detect changes.
        source_split: e.g. `train`; None if the source has none.
        source_version: e.g. `v0.2`; None if the source has none.
        geometry: fingerprint of mesh and layout, to detect changes; None without them.
    """

    scene_id: str
    location: str
    fingerprint: str
    source_split: str | None = None
    source_version: str | None = None
    geometry: str | None = None

    @property
    def building(self) -> str:
        """The building's own hash: the scene id without its number."""
        return building_hash(self.scene_id)


@dataclass(frozen=True, slots=True)
class SkippedScene:
    """A scene, or what belongs to it, that was left out, with the reason."""

    scene_id: str
    location: str
    reason: str


@dataclass(frozen=True, slots=True)
class Reading:
    """The result of reading one scene.

    Attributes:
        graph: its scene graph.
        mesh: how much of its mesh the annotation explains; None without a mesh, or if it was left
            out.
        left_out: meshes and layouts that could not be used, with the reasons.
    """

    graph: SceneGraph
    mesh: MeshCoverage | None = None
    left_out: tuple[SkippedScene, ...] = ()


@dataclass(frozen=True, slots=True)
class FoundScenes:
    """The scenes of a source.

    Attributes:
        scenes: the scenes, sorted by scene id, each building once.
        duplicates: further copies of the same buildings; they are not read.
        unreadable: folders that could not be read.
        unused: room layouts that belong to no scene.
    """

    scenes: tuple[SceneRef, ...]
    duplicates: tuple[SkippedScene, ...] = ()
    unreadable: tuple[SkippedScene, ...] = ()
    unused: tuple[SkippedScene, ...] = ()


@runtime_checkable
class Source(Protocol):
    """An object that finds scenes and reads each as a scene graph.

    A build sends a source to its workers, so it must support pickling.
    """

    @property
    def kind(self) -> str:
        """Return the kind of source, e.g. `hm3d`: the name of its row in the catalogue."""

    @property
    def path(self) -> Path:
        """Return the file or folder of the source."""

    @property
    def options(self) -> dict[str, int | str]:
        """Return the options that change the bytes of a build."""

    def find(self) -> FoundScenes:
        """Find the scenes without parsing them.

        Raises:
            SourceError: if there is none; it says where it looked and what it expected.
        """

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene; unusable geometry is left out, with the reason in the result.

        Raises:
            SourceError: if the scene is unreadable.
        """


@dataclass(frozen=True, slots=True)
class Terms:
    """Licence and citation of data derived from a source, for the cards of datasets.

    Attributes:
        licence: its SPDX identifier, e.g. `Apache-2.0`; `LicenseRef-NAME` for a licence that SPDX
            does not list.
        licence_url: address of the text of the licence.
        homepage: address of the source.
        citation: how to cite the source, on one line.
        sentence: what a user must know about the terms, in one sentence.
    """

    licence: str
    licence_url: str
    homepage: str
    citation: str
    sentence: str

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[A-Za-z0-9.+-]+", self.licence):
            self._refuse("licence", f"an SPDX identifier such as MIT, or {LICENCE_REF}NAME")
        for name in ("licence_url", "homepage"):
            if not is_address(getattr(self, name)):
                self._refuse(name, "an address")
        for name in ("citation", "sentence"):
            if not getattr(self, name).strip() or "\n" in getattr(self, name):
                self._refuse(name, "one line")

    def _refuse(self, name: str, expected: str) -> NoReturn:
        message = f"{name}: expected {expected}, found {getattr(self, name)!r}"
        raise SourceError(message, code="terms-malformed", where=name)


def is_address(text: str) -> bool:
    """Say whether a text is a web address without characters that could end a link."""
    return re.fullmatch(r"https?://[^\s<>()\[\]|\"]+", text) is not None


@runtime_checkable
class SourceWithTerms(Protocol):
    """A source that knows the terms of its data."""

    @property
    def terms(self) -> Terms | None:
        """Return the terms; None if they are unknown."""


@dataclass(frozen=True, slots=True)
class SourceRow:
    """One row of the catalogue of sources; its name is the `kind` of the opened source.

    Attributes:
        summary: what it reads, in one line.
        open: opens a path; takes the source's options as keywords.
        terms: terms of derived data; None if only the user knows them, as for the user's own table
            (`SourceWithTerms`).
        class_map: the published map of its names; the default of a build.
    """

    summary: str
    open: Callable[..., Source]
    terms: Terms | None
    class_map: str = DEFAULT_CLASS_MAP
