"""What yields scene graphs: an HM3D folder, or the public HM3DSem statistics.

A source finds its scenes first, cheaply, then reads one scene at a time. Both kinds end in the
same `SceneGraph`: the same building read from either differs only in spellings and colours.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol

from bsg_data.errors import SourceError
from bsg_data.geometry.adjacency import connect_rooms
from bsg_data.geometry.gltf import MeshError
from bsg_data.geometry.placement import place_scene
from bsg_data.geometry.semantic_mesh import survey_mesh
from bsg_data.scene.class_map import ClassMap, is_nameless
from bsg_data.scene.mesh_coverage import MeshCoverage
from bsg_data.scene.scene_graph import Room, SceneGraph, SceneObject
from bsg_data.sources.annotations import MAX_BYTES, Annotation, Instance, read_annotation
from bsg_data.sources.statistics import digest_scene_lines, parse_scene_lines, read_scene_lines

_SUFFIXES = (".semantic.txt", "_semantic.txt")
_NUMBERED = re.compile(r"([0-9]{5})-(.+)")
_VERSION = re.compile(r"v[0-9]+\.[0-9]+")
# minival is part of val: a building in both is val's. The order decides which copy is kept.
_SPLITS = ("train", "val", "test", "minival", "example")
SYNTHETIC_MARK = "synthetic.json"
_ENDS = 2**16  # bytes


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


class Source(Protocol):
    """Anything that finds scenes and reads each as a scene graph."""

    @property
    def kind(self) -> str:
        """Name the kind of source, e.g. `hm3d`."""

    @property
    def path(self) -> Path:
        """Return what the source reads."""

    @property
    def options(self) -> dict[str, int]:
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


@dataclass(frozen=True)
class HM3DFolder:
    """A folder with HM3D's annotation text anywhere below it.

    `bsg-data synth` leaves a `synthetic.json` above the buildings that it writes, so that they are
    never taken for real ones.

    Attributes:
        path: the folder.
        meshes: read the mesh beside an annotation, if there is one.
        snap_colours: how far a texel of a JPEG texture may be from an instance's colour; None
            leaves meshes with such textures out.
    """

    path: Path
    meshes: bool = True
    snap_colours: int | None = None

    @property
    def options(self) -> dict[str, int]:
        """Whether meshes are read, and how."""
        snap = {} if self.snap_colours is None else {"snap_colours": self.snap_colours}
        return {"meshes": int(self.meshes), **snap}

    @property
    def kind(self) -> str:
        """`synthetic` for buildings of `bsg-data synth`, otherwise `hm3d`."""
        return "synthetic" if self._marks_above() else "hm3d"

    def _marks_above(self) -> list[Path]:
        above = (self.path, *self.path.resolve().parents[:2])
        return [mark for folder in above if (mark := folder / SYNTHETIC_MARK).is_file()]

    def find(self) -> FoundScenes:
        """Find every `*.semantic.txt` and `*_semantic.txt` below the folder."""
        if not self.path.is_dir():
            zipped = "; the statistics are read with --hm3d-stats" if self.path.is_file() else ""
            what = "is a file, not a folder" if self.path.is_file() else "no such folder"
            raise SourceError(f"{self.path}: {what}{zipped}")
        self._refuse_unfinished_or_mixed()
        unreadable: list[SkippedScene] = []
        refs = [self._refer(path) for path in _walk(self.path, unreadable)]
        if not refs:
            raise SourceError(
                f"{self.path}: no scene found; looked in every folder below it for "
                "<hash>.semantic.txt or <hash>_semantic.txt, as in "
                "hm3d/train/00006-HkseAnWCgqk/HkseAnWCgqk.semantic.txt. The annotations come in "
                "HM3D's `semantic-annots` archives, which are downloaded beside the meshes"
            )
        found = _once_each(refs)
        return FoundScenes(found.scenes, found.duplicates, tuple(unreadable))

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene from its annotation text, and its geometry from the mesh beside that."""
        path = self.path / ref.location
        graph = assemble(read_annotation(path), ref=ref, kind=self.kind, class_map=class_map)
        mesh = _mesh_beside(path) if self.meshes else None
        if mesh is None:
            return Reading(graph)
        try:
            if not mesh.is_file():
                raise MeshError(f"{mesh}: not a file, or a link that leads nowhere")
            colours = [str(obj.colour) for obj in graph.objects]
            survey = survey_mesh(mesh, colours, snap_colours=self.snap_colours)
        except MeshError as error:
            where = mesh.relative_to(self.path).as_posix()
            return Reading(graph, left_out=(SkippedScene(ref.scene_id, where, str(error)),))
        return Reading(connect_rooms(place_scene(graph, survey)), survey.coverage)

    def _refuse_unfinished_or_mixed(self) -> None:
        above = self._marks_above()
        for mark in (*above, *sorted(self.path.rglob(SYNTHETIC_MARK))):
            if not above:
                raise SourceError(
                    f"{self.path}: holds synthetic buildings in {mark.parent}; point --hm3d at "
                    "these or at the real ones alone"
                )
            if b'"finished": true' not in mark.read_bytes():
                raise SourceError(f"{mark.parent}: `bsg-data synth` was stopped; run it again")

    def _refer(self, path: Path) -> SceneRef:
        relative = path.relative_to(self.path)
        suffix = next(suffix for suffix in _SUFFIXES if path.name.endswith(suffix))
        building = path.name.removesuffix(suffix)
        numbered = _NUMBERED.fullmatch(path.parent.resolve().name)
        scene_id = f"{numbered[1]}-{building}" if numbered and numbered[2] == building else building
        folders = (self.path.resolve().name, *relative.parts[:-1])
        return SceneRef(
            scene_id=scene_id,
            location=relative.as_posix(),
            fingerprint=_fingerprint(path),
            source_split=_last(_split_of(part) for part in folders) or _split_by_number(scene_id),
            source_version=_last(_version_of(part) for part in folders),
            geometry=_mesh_mark(path) if self.meshes else None,
        )


@dataclass(frozen=True)
class HM3DStatistics:
    """The public zip of HM3DSem's statistics."""

    path: Path
    kind: str = "hm3d-stats"

    @property
    def options(self) -> dict[str, int]:
        """None: there is nothing to choose."""
        return {}

    def find(self) -> FoundScenes:
        """List the scenes of the zip."""
        refs = [
            SceneRef(
                scene_id=scene_id,
                location=scene_id,
                fingerprint=digest_scene_lines(lines),
                source_split=_split_by_number(scene_id),
                source_version=_version_of(self.path.name),
            )
            for scene_id, lines in self._lines.items()
        ]
        if not refs:
            raise SourceError(f"{self.path}: the table of regions has no row")
        return _once_each(refs)

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene from its rows."""
        annotation = parse_scene_lines(self._lines[ref.location], path=self.path)
        return Reading(assemble(annotation, ref=ref, kind=self.kind, class_map=class_map))

    @cached_property
    def _lines(self) -> dict[str, list[tuple[int, str]]]:
        return read_scene_lines(self.path)

    def __reduce__(self) -> tuple[object, ...]:
        """Travel to a worker without the table, which the worker reads itself."""
        return type(self), (self.path,)


def building_hash(scene_id: str) -> str:
    """Return the building's own hash: the scene id without its number.

    >>> building_hash("00006-HkseAnWCgqk")
    'HkseAnWCgqk'
    """
    match = _NUMBERED.fullmatch(scene_id)
    return match[2] if match else scene_id


def assemble(
    annotation: Annotation, *, ref: SceneRef, kind: str, class_map: ClassMap
) -> SceneGraph:
    """Make the scene graph of one annotation.

    A region with an id of 0 or more is a room if it holds an instance. Objects of the null region
    belong to the building. A nameless object and one outside the classes stay, without a class.
    """
    regions = sorted({i.region_id for i in annotation.instances if i.region_id >= 0})
    room_of = {region: index for index, region in enumerate(regions, start=1)}
    return SceneGraph(
        scene_id=ref.scene_id,
        source=kind,
        source_version=ref.source_version,
        source_split=ref.source_split,
        annotation_sha256=annotation.sha256,
        rooms=tuple(Room(index, region) for region, index in room_of.items()),
        objects=tuple(
            _classify(instance, index, room_of.get(instance.region_id, 0), class_map)
            for index, instance in enumerate(annotation.instances, start=1)
        ),
    )


def _classify(instance: Instance, index: int, room: int, class_map: ClassMap) -> SceneObject:
    entry = class_map.lookup(instance.name)
    category = entry.category if entry else None
    if entry is None and is_nameless(instance.name):
        category = "unknown"
    return SceneObject(
        object_index=index,
        instance_id=instance.instance_id,
        room_index=room,
        raw_category=instance.name,
        category=category,
        class_index=entry.class_index if entry else None,
        colour=instance.colour,
    )


def _walk(root: Path, unreadable: list[SkippedScene]) -> Iterator[Path]:
    """Yield annotation files below `root`, through linked folders but never round a loop."""

    def note(error: OSError) -> None:
        where = Path(str(error.filename)).relative_to(root).as_posix()
        unreadable.append(SkippedScene("-", where, f"the folder cannot be read ({error.strerror})"))

    seen: set[Path] = set()
    for folder, folders, names in os.walk(root, followlinks=True, onerror=note):
        real = Path(folder).resolve()
        if real in seen:
            folders.clear()
            continue
        seen.add(real)
        folders.sort()
        for name in sorted(names):
            if name.endswith(_SUFFIXES) and not name.startswith("."):
                reason = _why_not(Path(folder, name))
                if reason is None:
                    yield Path(folder, name)
                else:
                    where = Path(folder, name).relative_to(root).as_posix()
                    shown = where.encode("utf-8", "backslashreplace").decode()
                    unreadable.append(SkippedScene("-", shown, reason))


def _why_not(path: Path) -> str | None:
    """Return why a path cannot be an annotation; None if it can."""
    if not path.is_file():  # a link that leads nowhere, a pipe, a device
        return "not a file, or a link that leads nowhere"
    if not str(path).isprintable() and any("\ud800" <= c <= "\udfff" for c in str(path)):
        return "its path is not UTF-8"
    return None


def _mesh_beside(annotation: Path) -> Path | None:
    mesh = annotation.with_suffix(".glb")
    return mesh if mesh.exists() or mesh.is_symlink() else None


def _mesh_mark(annotation: Path) -> str | None:
    """Return what tells one mesh from another: its size, and a hash of its beginning and its end.

    Hashing all meshes of HM3D would take minutes before anything is read.
    """
    mesh = _mesh_beside(annotation)
    if mesh is None or not mesh.is_file():
        return None if mesh is None else "mesh that is no file"
    try:
        with mesh.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            digest = hashlib.sha256()
            for start in (0, max(0, size - _ENDS)):
                file.seek(start)
                digest.update(file.read(_ENDS))
    except OSError as error:
        return f"unreadable mesh: {error.strerror}"
    return f"mesh of {size} bytes, {digest.hexdigest()}"


def _fingerprint(path: Path) -> str:
    """Hash a file; one that cannot be read, or is far too large, is reported when it is read."""
    try:
        if path.stat().st_size > MAX_BYTES:
            return "too large"
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        return f"unreadable: {error.strerror}"


def _once_each(refs: list[SceneRef]) -> FoundScenes:
    """Keep one copy of every building: numbered first, newest version, then split, then path."""

    def preference(ref: SceneRef) -> tuple[bool, tuple[int, ...], int, str]:
        rank = _SPLITS.index(ref.source_split) if ref.source_split in _SPLITS else len(_SPLITS)
        version = (ref.source_version or "v0.0").removeprefix("v").split(".")
        newest = tuple(-int(number) for number in version)
        return (ref.scene_id == ref.building, newest, rank, ref.location)

    kept: dict[str, SceneRef] = {}
    duplicates = []
    for ref in sorted(refs, key=preference):
        first = kept.setdefault(ref.building, ref)
        if first is not ref:
            same = "the same" if first.fingerprint == ref.fingerprint else "OTHER"
            reason = f"building found before at {first.location} with {same} annotation"
            duplicates.append(SkippedScene(ref.scene_id, ref.location, reason))
    scenes = sorted(kept.values(), key=lambda ref: ref.scene_id)
    return FoundScenes(tuple(scenes), tuple(sorted(duplicates, key=lambda skip: skip.location)))


def _split_of(folder: str) -> str | None:
    """Read the split from a folder's name: `train`, or `hm3d-minival-semantic-annots-v0.2`."""
    name = folder.split("-")[1] if folder.startswith("hm3d-") else folder
    return name if name in _SPLITS else None


def _split_by_number(scene_id: str) -> str | None:
    """Read the split from HM3D's own numbers: 0-799 train, 800-899 val, 900-999 test."""
    match = _NUMBERED.fullmatch(scene_id)
    number = int(match[1]) if match else 1000
    return "train" if number < 800 else "val" if number < 900 else "test" if number < 1000 else None


def _version_of(name: str) -> str | None:
    match = _VERSION.search(name)
    return match[0] if match else None


def _last(values: Iterator[str | None]) -> str | None:
    """Return the last value that is not None: the folder nearest to the file decides."""
    return next((value for value in reversed(list(values)) if value is not None), None)
