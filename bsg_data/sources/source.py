"""What a source of scene graphs is: the protocol, the records that it gives, and its terms.

A source finds its scenes first, cheaply, then reads one scene at a time. All sources end in the
same `SceneGraph`. A new one is a file with a `Source` and a `SourceRow`, and a row in
`bsg_data.sources.catalogue` or an entry point of the group `bsg_data.sources`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from bsg_data.errors import SourceError
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_data.scene.mesh_coverage import MeshCoverage
from bsg_data.scene.scene_graph import SceneGraph
from bsg_data.scene.scene_id import building_hash

LICENCE_REF = "LicenseRef-"  # SPDX's prefix for a licence that is not on its list


@dataclass(frozen=True, slots=True)
class SceneRef:
    """Where one scene of a source is.

    Attributes:
        scene_id: e.g. `00006-HkseAnWCgqk`, or the hash alone where the source has no number.
        location: path below the source's root, or the scene's name inside the zip.
        fingerprint: hash of the annotation's bytes, so that a resumed build sees a change.
        source_split: e.g. `train`; None where the source does not say.
        source_version: e.g. `v0.2`; None where the source does not say.
        geometry: what tells a resumed build that the mesh or the layout changed; None without one.
    """

    scene_id: str
    location: str
    fingerprint: str
    source_split: str | None
    source_version: str | None
    geometry: str | None = None

    @property
    def building(self) -> str:
        """The building's own hash: the scene id without its number."""
        return building_hash(self.scene_id)


@dataclass(frozen=True, slots=True)
class SkippedScene:
    """A scene that a build leaves out, and why."""

    scene_id: str
    location: str
    reason: str


@dataclass(frozen=True, slots=True)
class Reading:
    """One scene as it was read.

    Attributes:
        graph: its scene graph.
        mesh: how much of its mesh is explained; None without one, or where it was left out.
        left_out: meshes and layouts that could not be used, and why; the graph does without.
    """

    graph: SceneGraph
    mesh: MeshCoverage | None = None
    left_out: tuple[SkippedScene, ...] = ()


@dataclass(frozen=True, slots=True)
class FoundScenes:
    """The scenes of a source.

    Attributes:
        scenes: sorted by scene id, every building once.
        duplicates: further copies of the same buildings, left out.
        unreadable: folders that could not be looked into.
        unused: room layouts of no scene.
    """

    scenes: tuple[SceneRef, ...]
    duplicates: tuple[SkippedScene, ...] = ()
    unreadable: tuple[SkippedScene, ...] = ()
    unused: tuple[SkippedScene, ...] = ()


@runtime_checkable
class Source(Protocol):
    """Anything that finds scenes and reads each as a scene graph.

    A build sends a source to its workers, so it must survive pickling.
    """

    @property
    def kind(self) -> str:
        """Name the kind of source, e.g. `hm3d`: the name of its row in the catalogue."""

    @property
    def path(self) -> Path:
        """Return what the source reads."""

    @property
    def options(self) -> dict[str, int | str]:
        """Return the choices that the bytes of a build depend on."""

    def find(self) -> FoundScenes:
        """Find the scenes without parsing them.

        Raises:
            SourceError: if there is none, saying where it looked and what it expected.
        """

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene; geometry that cannot be used is left out with the reason.

        Raises:
            SourceError: if it cannot be read.
        """


@dataclass(frozen=True, slots=True)
class Terms:
    """The terms of what is derived from a source, for the cards of datasets.

    Attributes:
        licence: its SPDX identifier, e.g. `Apache-2.0`; `LicenseRef-NAME` for a licence that SPDX
            does not list.
        licence_url: where the licence is to be read.
        homepage: of the source.
        citation: how to cite the source, on one line.
        sentence: what a user has to know of the terms, in one sentence.
    """

    licence: str
    licence_url: str
    homepage: str
    citation: str
    sentence: str

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[A-Za-z0-9.+-]+", self.licence):
            raise SourceError(
                f"licence {self.licence!r}: expected an SPDX identifier such as Apache-2.0, or "
                f"{LICENCE_REF}NAME for a licence that SPDX does not list"
            )
        for name in ("licence_url", "homepage"):
            if not is_address(getattr(self, name)):
                raise SourceError(f"{name}: expected an address, found {getattr(self, name)!r}")
        for name in ("citation", "sentence"):
            if not getattr(self, name).strip() or "\n" in getattr(self, name):
                raise SourceError(f"{name}: expected one line, found {getattr(self, name)!r}")


def is_address(text: str) -> bool:
    """Say whether a text is an address of the web, without any sign that could end a link."""
    return re.fullmatch(r"https?://[^\s<>()\[\]|\"]+", text) is not None


@runtime_checkable
class SourceWithTerms(Protocol):
    """A source that says itself under which terms its data are."""

    @property
    def terms(self) -> Terms | None:
        """Return them; None where nobody said any."""


@dataclass(frozen=True, slots=True)
class SourceRow:
    """One row of the catalogue of sources; its name is the `kind` of the source that it opens.

    Attributes:
        summary: what it reads, in one line.
        open: takes a path, and the source's own options as keywords.
        terms: of what is derived from the source; None where only whoever opens it can know them,
            as of a table of a user's (`SourceWithTerms`).
        class_map: the published map of its words, which a build takes unless it is told another.
    """

    summary: str
    open: Callable[..., Source]
    terms: Terms | None
    class_map: str = DEFAULT_CLASS_MAP
