"""The protocol of a source of scene graphs, its records and its terms.

A source first finds its scenes, which is cheap, then reads them one by one. Every source returns
`SceneGraph`s. To add one, write a file with a `Source` and a `SourceRow`. Then add a row to
`bsg_data.sources.catalogue` or an entry point to the group `bsg_data.sources`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Protocol, runtime_checkable

from bsg_data.errors import SourceError
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_data.scene.scene_graph import MeshCoverage, SceneGraph, building_hash

LICENCE_REF = "LicenseRef-"  # SPDX's prefix for a licence that is not on its list
_ADDRESS = r"https?://[^\s<>()\[\]|\"]+"


@dataclass(frozen=True, slots=True)
class SceneRef:
    """The location of one scene of a source."""

    scene_id: str  # e.g. `00006-HkseAnWCgqk`, or only the hash if the source has no number
    location: str  # path below the source's root, or the scene's name in its file
    fingerprint: str  # hash of the annotation; a resumed build uses it to detect changes
    source_split: str | None = None  # e.g. `train`; None if the source has none
    source_version: str | None = None  # e.g. `v0.2`; None if the source has none
    geometry: str | None = None  # fingerprint of mesh and layout; None without them

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
    """The result of reading one scene."""

    graph: SceneGraph
    # how much of its mesh the annotation explains; None without a mesh, or if it was left out
    mesh: MeshCoverage | None = None
    left_out: tuple[SkippedScene, ...] = ()  # meshes and layouts that could not be used


@dataclass(frozen=True, slots=True)
class FoundScenes:
    """The scenes of a source."""

    scenes: tuple[SceneRef, ...]  # sorted by scene id, each building once
    duplicates: tuple[SkippedScene, ...] = ()  # further copies of the same buildings: not read
    unreadable: tuple[SkippedScene, ...] = ()  # folders that could not be read
    unused: tuple[SkippedScene, ...] = ()  # room layouts that belong to no scene


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
    """Licence and citation of data derived from a source, for the cards of datasets."""

    # its SPDX identifier, e.g. `Apache-2.0`; `LicenseRef-NAME` for one that SPDX does not list
    licence: str
    licence_url: str  # address of the text of the licence
    homepage: str  # address of the source
    citation: str  # how to cite the source, on one line
    sentence: str  # what a user must know about the terms, in one sentence

    def __post_init__(self) -> None:
        line = r".*\S.*", "one line"
        address = _ADDRESS, "an address"
        spdx = r"[A-Za-z0-9.+-]+", f"an SPDX identifier such as MIT, or {LICENCE_REF}NAME"
        rules = (spdx, address, address, line, line)
        for one, (pattern, expected) in zip(fields(self), rules, strict=True):
            value = getattr(self, one.name)
            if not re.fullmatch(pattern, value):
                message = f"{one.name}: expected {expected}, found {value!r}"
                raise SourceError(message, code="terms-malformed", where=one.name)


def is_address(text: str) -> bool:
    """Say whether a text is a web address without characters that could end a link."""
    return re.fullmatch(_ADDRESS, text) is not None


@dataclass(frozen=True, slots=True)
class SourceRow:
    """One row of the catalogue of sources; its name is the `kind` of the opened source."""

    summary: str  # what it reads, in one line
    open: Callable[..., Source]  # opens a path; takes the source's options as keywords
    # of derived data; None if only the user knows them: such a source may have `terms` of its own
    terms: Terms | None
    class_map: str = DEFAULT_CLASS_MAP  # the published map of its names; the default of a build
