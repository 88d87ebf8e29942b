"""The protocol of a source of scene graphs, its records and its terms.

A source first finds its scenes, which is cheap, then reads them one by one. It reads an
`Annotation`, of which `bsg_data.sources.assembly.assemble` makes a `SceneGraph`. To add a source,
write a file with a `Source` and a `SourceRow`. Then add a row to `bsg_data.sources.catalogue` or an
entry point to the group `bsg_data.sources`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from bsg_data.arrays import Ints
from bsg_data.dataset.manifest import SkippedScene
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_data.scene.scene_graph import Box, MeshCoverage, Point, SceneGraph
from bsg_data.terms import Terms

if TYPE_CHECKING:
    import pyarrow as pa


@dataclass(frozen=True, slots=True)
class SceneRef:
    """The location of one scene of a source."""

    scene_id: str  # e.g. `00006-HkseAnWCgqk`, or only the hash if the source has no number
    location: str  # path below the source's root, or the scene's name in its file
    # state of its file, or hash of the annotation; a resumed build uses it to detect changes
    fingerprint: str
    source_split: str | None = None  # e.g. `train`; None if the source has none
    source_version: str | None = None  # e.g. `v0.2`; None if the source has none
    geometry: str | None = None  # state of its mesh; None without one
    layout: str | None = None  # state of its room layout; None without one
    building: str | None = None  # key of its building; None: the scene id

    @property
    def key(self) -> str:
        """The key of its building: two scenes of one key are the same building."""
        return self.building or self.scene_id


@dataclass(frozen=True, slots=True, kw_only=True)
class AnnotatedRoom:
    """What a source tells of one room; metres, Z up. What is None is not known."""

    region: int  # its id, 0 or more
    source_label: str | None = None  # what the source calls it
    label: str | None = None  # its common label; None: that of `source_label`
    box: Box | None = None
    centroid: Point | None = None  # None: the centre of the box
    footprint: tuple[tuple[float, float], ...] | None = None  # None: the floor of the box
    floor_area: float | None = None  # square metres; None, without a footprint: of the box
    # its level, from 0 at the bottom; where no room has one, the heights of the boxes tell it
    floor_index: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Annotation:
    """What a source tells of one building of O objects, as columns; metres, Z up."""

    regions: Sequence[int] | Ints  # [O] below 0 the null region: such objects are the building's
    names: Sequence[str]  # [O] exactly as annotated
    _: KW_ONLY
    ids: Sequence[int] | Ints | None = None  # [O] the annotation's own; None: 1, 2, 3, …
    colours: Sequence[str | None] | pa.Array | None = None  # [O] in the semantic mesh, RRGGBB
    centroids: Sequence[Point | None] | None = None  # [O]; without one, the centre of the box
    boxes: Sequence[Box | None] | None = None  # [O]
    parts: Sequence[Box | None] | None = None  # [O] boxes of the largest connected parts
    rooms: Iterable[AnnotatedRoom] = ()  # those of which something is told, each once
    doors: Iterable[tuple[int, int]] = ()  # regions that connect, in any order, also twice
    method: str = "given"  # how the source knows of these, e.g. `door`
    building_kind: str | None = None  # e.g. `office`
    sha256: str | None = None  # hash of the annotation; None: the fingerprint of the scene is it


@dataclass(frozen=True, slots=True)
class Reading:
    """The result of reading one scene."""

    graph: SceneGraph
    # how much of its mesh the annotation explains; None without a mesh, or if it was left out
    mesh: MeshCoverage | None = None
    left_out: tuple[SkippedScene, ...] = ()  # meshes, layouts and labels that are not used


@dataclass(frozen=True, slots=True)
class FoundScenes:
    """The scenes of a source."""

    scenes: tuple[SceneRef, ...]  # sorted by scene id, each building once
    duplicates: tuple[SkippedScene, ...] = ()  # further copies of the same scenes: not read
    conflicts: tuple[SkippedScene, ...] = ()  # other scenes of the same buildings: not read
    unreadable: tuple[SkippedScene, ...] = ()  # folders that could not be read
    unused: tuple[SkippedScene, ...] = ()  # what belongs to no scene; notes on the source


@runtime_checkable
class Source(Protocol):
    """An object that finds scenes and reads each as a scene graph.

    A build sends a source to its workers, so it must support pickling. A source may also have
    `terms` of its own, and `lists(word)`, which says whether its own list of rooms has a word.
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
class SourceRow:
    """One row of the catalogue of sources; its name is the `kind` of the opened source."""

    summary: str  # what it reads, in one line
    open: Callable[..., Source]  # opens a path; takes the source's options as keywords
    # of derived data; None if only the user knows them: such a source may have `terms` of its own
    terms: Terms | None
    class_map: str = DEFAULT_CLASS_MAP  # the published map of its names; the default of a build
    # whether a building is all there; not if it is what a robot saw: no ground truth
    is_complete: bool = True


class Wrapper:
    """Forward everything to a source.

    Attributes:
        source: the source itself.
        kind: of the source itself.
        path: of the source itself.
        terms: that the source itself states; None if it states none.
    """

    def __init__(self, source: Source) -> None:
        self.source, self.kind, self.path = source, source.kind, source.path
        self.terms: Terms | None = getattr(source, "terms", None)

    @property
    def options(self) -> dict[str, int | str]:
        """The options of the source itself."""
        return self.source.options

    def lists(self, word: str) -> bool:
        """Say whether the source itself has a list of words for rooms, with this one."""
        return bool(getattr(self.source, "lists", lambda _: False)(word))

    def find(self) -> FoundScenes:
        """Find the scenes of the source itself."""
        return self.source.find()

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read a scene of the source itself."""
        return self.source.read(ref, class_map)
