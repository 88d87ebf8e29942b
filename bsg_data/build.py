"""Build a dataset: find the scenes of a source, make the shards, put the dataset in its place.

The dataset grows in `<out>.partial`. Each finished shard leaves its manifest in the folder `.build`
there, so the same build goes on after an interruption, and processes on any machines can build
parts of it: part i of n makes every n-th shard, beginning with the i-th. The bytes depend on none
of this. The manifest of the dataset is the sum of those of its shards.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar
from uuid import uuid4

from pydantic import ValidationError

from bsg_data.dataset.commit import BUILD, PLAN, growing, name_growing, put_in_place, require_place
from bsg_data.dataset.kept_maps import ClassMapEntry
from bsg_data.dataset.manifest import (
    MANIFEST,
    Manifest,
    ResolvedEntry,
    SourceEntry,
    Totals,
    UnmappedEntry,
    count_shards,
    describe_unmapped,
    list_resolved,
    read_manifest,
)
from bsg_data.dataset.shards import write_shards
from bsg_data.errors import (
    EXTRA_OF,
    BSGError,
    DatasetError,
    RecipeError,
    SourceChangedError,
    SourceError,
    UnmappedNameError,
    ask_to_install,
    find_io_error,
)
from bsg_data.executors import run_all
from bsg_data.files import AnyPath, resolve_links
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.scene.class_map import (
    DEFAULT_CLASS_MAP,
    ClassMap,
    OwnMap,
    is_own_map,
    load_class_map,
    parse_own_map,
    read_own_map,
    write_own_map,
)
from bsg_data.scene.scene_graph import SceneGraph, is_scene_id
from bsg_data.sources.catalogue import SOURCES, find_terms
from bsg_data.sources.source import (
    FoundScenes,
    Reading,
    SceneRef,
    SkippedScene,
    Source,
)

SCENES_PER_SHARD = 16
_MAX_NAMED = 20  # parts in an error
_PARTS_OF = "parts-of-"  # a mark in `.build`: the number of parts that a process was told
_NOTHING_SKIPPED = "no scene was skipped; repair the source, then run the command again"
_Progress = Callable[[int, int], None]
_Entry = TypeVar("_Entry", UnmappedEntry, ResolvedEntry)


class _Share(Manifest):
    """Manifest of a share of a dataset: of no shard, which is the plan of a build, or of one."""

    shards: int  # number of shards of the whole


@dataclass(frozen=True, slots=True)
class Part:
    """Part `number` of `of` parts, from 1. A build needs all of them.

    Raises:
        RecipeError: if `number` is not 1 to `of`.
    """

    number: int
    of: int

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.of:
            message = f"part {self.number}/{self.of}: expected I/N with I from 1 to N"
            raise RecipeError(message, code="part-range", where=f"{self.number}/{self.of}")


@dataclass(frozen=True, slots=True)
class BuiltPart:
    """What a part of a build built.

    Attributes:
        shards: numbers of its shards.
        scenes: number of scenes in them.
        missing: numbers of the shards of the dataset that are still missing.
    """

    shards: tuple[int, ...]
    scenes: int
    missing: tuple[int, ...]


def build_dataset(
    source: Source,
    out: AnyPath,
    *,
    class_map: AnyPath | None = None,
    strict: bool = False,
    force: bool = False,
    scenes_per_shard: int = SCENES_PER_SHARD,
    executor: Executor | None = None,
    progress: _Progress | None = None,
) -> Manifest:
    """Build the dataset of a source and return its manifest.

    Args:
        source: an `HM3DFolder`, an `HM3DStatistics` or any other `Source`.
        out: folder of the dataset: absent, empty, or, with `force`, a dataset to replace.
        class_map: version of a published map, or path of your own; None: the map of the source.
        strict: fail on the first malformed scene or unmapped name instead of reporting it.
        force: replace a finished dataset; it stays until the new one is finished.
        scenes_per_shard: number of scenes in each part of a table.
        executor: runs the shards in parallel; None builds them one by one in this process.
        progress: called with (shards done, shards in all).

    Raises:
        SourceError: if no scene is found or readable; with `strict`, if any is unreadable.
        UnmappedNameError: with `strict`, for a name that is not in the map.
        RecipeError: if `scenes_per_shard` is impossible.
        DatasetError: if `out` is taken or cannot be written.
    """
    out = resolve_links(out)  # a linked --out stays a link; its target is replaced
    require_place(out, force=force)
    build = _plan(source, class_map, strict=strict, scenes_per_shard=scenes_per_shard)
    with growing(out, build.plan, force=force) as (folder, done):
        if done:
            return read_manifest(out)
        shards = build.make(range(build.plan.shards), folder, executor, progress)
        return _finish(build.plan, shards, out, where=source.path)


def build_part(
    source: Source,
    out: AnyPath,
    part: Part,
    *,
    class_map: AnyPath | None = None,
    strict: bool = False,
    force: bool = False,
    scenes_per_shard: int = SCENES_PER_SHARD,
    executor: Executor | None = None,
    progress: _Progress | None = None,
) -> BuiltPart:
    """Build one part of the shards of a dataset; other processes can build the other parts.

    The other arguments are those of `build_dataset`, and the same for all parts. `out` is on a file
    system that all parts see; with `force` a finished dataset may be there, which
    `finalise_dataset` replaces.

    Returns:
        What the part built, and which shards are still missing.

    Raises:
        BSGError: as `build_dataset`; a DatasetError also if parts of another build are there.
    """
    out = resolve_links(out)
    require_place(out, force=force)
    build = _plan(source, class_map, strict=strict, scenes_per_shard=scenes_per_shard)
    every = range(build.plan.shards)
    numbers = every[part.number - 1 :: part.of]
    with growing(out, build.plan, force=force, shared=True) as (folder, done):
        if done:
            return BuiltPart(tuple(numbers), 0, ())
        (folder / BUILD / f"{_PARTS_OF}{part.of}").touch()
        shards = build.make(numbers, folder, executor, progress)
        missing = tuple(n for n in every if not _name_manifest(folder, n).is_file())
    return BuiltPart(tuple(numbers), sum(shard.totals.scenes for shard in shards), missing)


def finalise_dataset(
    out: AnyPath, *, force: bool = False, progress: _Progress | None = None
) -> Manifest:
    """Finish a dataset that was built in parts, and return its manifest.

    The bytes equal those of `build_dataset`.

    Args:
        out: folder of the dataset, as in `build_part`.
        force: replace a finished dataset.
        progress: called with (shards verified, shards in all).

    Raises:
        DatasetError: if there are no parts, a shard is missing or damaged, or `out` is taken.
        SourceError: if no scene could be read.
    """
    out = resolve_links(out)
    plan = _read_plan(out)
    with growing(out, plan, force=force) as (folder, done):
        if done:
            return read_manifest(out)
        tasks = [(folder, number) for number in range(plan.shards)]
        shards = run_all(_read_shard, tasks, progress=progress)
        missing = [number for number, shard in enumerate(shards) if shard is None]
        if missing:
            message = _say_missing(folder, missing, plan.shards)
            raise DatasetError(message, code="shards-missing", where=folder)
        return _finish(plan, [shard for shard in shards if shard], out, where=out)


def combine_manifests(manifests: Sequence[Manifest], *, scenes_per_shard: int) -> Manifest:
    """Return the manifest of a dataset that holds what several hold, with all their files."""
    sources = {source.model_dump_json(): source for one in manifests for source in one.sources}
    return Manifest(
        generator=f"belief-scene-graphs {version('belief-scene-graphs')}",
        class_space=manifests[0].class_space,
        sources=tuple(sources[key] for key in sorted(sources)),
        scenes_per_shard=scenes_per_shard,
        totals=Totals.sum(one.totals for one in manifests),
        files=tuple(sorted((f for one in manifests for f in one.files), key=lambda f: f.path)),
        skipped=tuple(skip for one in manifests for skip in one.skipped),
        left_out=tuple(skip for one in manifests for skip in one.left_out),
        meshes={scene: mesh for one in manifests for scene, mesh in one.meshes.items()},
        unmapped=_add_up(entry for one in manifests for entry in one.unmapped),
        resolved=_add_up(entry for one in manifests for entry in one.resolved),
    )


def _add_up(entries: Iterable[_Entry]) -> tuple[_Entry, ...]:
    """Add up the objects of equal names, most frequent first."""
    times: Counter[str] = Counter()
    first: dict[str, _Entry] = {}
    for entry in entries:
        key = entry.model_dump_json(exclude={"instances", "nearest"})
        times[key] += entry.instances
        first.setdefault(key, entry)
    added = (entry.model_copy(update={"instances": times[key]}) for key, entry in first.items())
    return tuple(sorted(added, key=lambda entry: (-entry.instances, entry.name)))


@dataclass(frozen=True, slots=True)
class _Build:
    """A planned build, of all scenes or of those of one shard."""

    source: Source
    scenes: tuple[SceneRef, ...]
    plan: _Share
    own_map: OwnMap | None
    strict: bool

    def make(
        self,
        numbers: Iterable[int],
        folder: Path,
        executor: Executor | None,
        progress: _Progress | None,
    ) -> list[_Share]:
        """Make the shards with some numbers, and return their manifests."""
        if self.own_map is not None:
            write_own_map(self.own_map, folder / self.plan.class_maps[0].folder)
        size = self.plan.scenes_per_shard
        empty = replace(
            self, plan=self.plan.model_copy(update={"skipped": (), "left_out": ()}), own_map=None
        )
        tasks = [
            (replace(empty, scenes=self.scenes[n * size : (n + 1) * size]), folder, n)
            for n in numbers
        ]
        return run_all(_make_shard, tasks, executor=executor, progress=progress)

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene; if the build is strict, refuse one that would lose anything."""
        if not is_scene_id(ref.scene_id):
            raise SourceError(f"{ref.scene_id!r}: is no scene id: it must be usable as a file name")
        reading = _read(self.source, ref, class_map)
        if self.strict and reading.left_out:
            raise SourceError(reading.left_out[0].reason)
        names = (obj.raw_category for obj in reading.graph.objects if obj.category is None)
        name = next(names, None)
        if self.strict and name is not None:
            near = ", ".join(repr(one) for one in class_map.nearest(name)) or "none"
            raise UnmappedNameError(
                f"{ref.location}: {name!r} is not in class map {class_map.version} (nearest: "
                f"{near}); leave --strict out to keep such objects without a class, or use a map "
                "that lists it"
            )
        return reading


def _plan(
    source: Source, class_map: AnyPath | None, *, strict: bool, scenes_per_shard: int
) -> _Build:
    """Find the scenes of a source and plan the build; write nothing."""
    chosen = _name_class_map(source) if class_map is None else os.fspath(class_map)
    own = read_own_map(Path(chosen)) if is_own_map(chosen) else None
    loaded = load_class_map(chosen) if own is None else parse_own_map(own)
    found = source.find()
    if strict and found.unreadable:
        skip = found.unreadable[0]
        where = source.path / skip.location
        raise SourceError(f"{where}: {skip.reason}", code="scene-unreadable", where=where)
    plan = _Share(
        generator=f"belief-scene-graphs {version('belief-scene-graphs')}",
        class_space=loaded.space,
        sources=(_describe_source(source, found, loaded),),
        scenes_per_shard=scenes_per_shard,
        totals=Totals(),
        files=(),
        skipped=(*found.duplicates, *found.unreadable),
        left_out=tuple(_without_root(skip, Path()) for skip in found.unused),
        shards=count_shards(len(found.scenes), scenes_per_shard=scenes_per_shard),
    )
    return _Build(source, found.scenes, plan, own, strict)


def _name_class_map(source: Source) -> str:
    """Return the name of the published class map for a source."""
    return SOURCES[source.kind].class_map if source.kind in SOURCES else DEFAULT_CLASS_MAP


def _describe_source(source: Source, found: FoundScenes, class_map: ClassMap) -> SourceEntry:
    versions = sorted({ref.source_version for ref in found.scenes if ref.source_version})
    digest = hashlib.sha256()
    for ref in found.scenes:
        words = (ref.scene_id, ref.source_split, ref.fingerprint, ref.geometry)
        digest.update(("\t".join(str(word) for word in words) + "\n").encode())
    return SourceEntry(
        kind=source.kind,
        version=", ".join(versions) or None,
        fingerprint=digest.hexdigest(),
        class_map=ClassMapEntry.of(class_map),
        options=source.options,
        terms=getattr(source, "terms", None) or find_terms(source.kind),
        nameable=None if class_map.nameable == class_map.classes else class_map.nameable,
    )


def _make_shard(build: _Build, folder: Path, number: int) -> _Share:
    """Make one shard, unless an earlier run of the same build did; its manifest comes last."""
    done = _read_shard(folder, number)
    if done and not (build.strict and (done.skipped or done.left_out or done.unmapped)):
        return done
    class_map = load_class_map(build.plan.class_maps[0].name_in(folder))
    readings: list[Reading] = []
    skipped: list[SkippedScene] = []
    for ref in build.scenes:
        try:
            readings.append(build.read(ref, class_map))
        except SourceError as error:
            if build.strict or isinstance(error, SourceChangedError):
                raise
            skipped.append(SkippedScene(ref.scene_id, ref.location, str(error)))
    graphs = [reading.graph for reading in readings]
    names = Counter(obj.raw_category for graph in graphs for obj in graph.objects)
    unknown = {n: times for n, times in names.items() if not class_map.classify(n).category}
    left_out = [skip for reading in readings for skip in reading.left_out]
    update = {
        "files": write_shards(graphs, folder, part=number, class_space=class_map.space),
        "totals": count_totals(graphs),
        "skipped": tuple(_without_root(skip, build.source.path) for skip in skipped),
        "left_out": tuple(_without_root(skip, build.source.path) for skip in left_out),
        "meshes": {one.graph.scene_id: one.mesh for one in readings if one.mesh is not None},
        "unmapped": tuple(describe_unmapped(unknown, class_map, near=0)),
        "resolved": tuple(list_resolved(names, class_map)),
    }
    shard = build.plan.model_copy(update=update)
    path = _name_manifest(folder, number)
    partial = path.with_name(f"{path.name}.{uuid4().hex}")  # two machines may make one shard
    partial.write_text(shard.model_dump_json(), "utf-8")
    partial.replace(path)
    return shard


def _read(source: Source, ref: SceneRef, class_map: ClassMap) -> Reading:
    """Read one scene; say whose fault an unexpected error is."""
    scene = f"scene {ref.scene_id} ({ref.location})"
    try:
        return source.read(ref, class_map)
    except SourceChangedError as error:
        raise SourceChangedError(f"{error}; {_NOTHING_SKIPPED}") from error
    except (BSGError, OSError) as error:
        failed = find_io_error(error)
        if failed is not None:
            why = f"cannot be read now ({failed.strerror or failed}); {_NOTHING_SKIPPED}"
            raise SourceChangedError(f"{source.path}: {scene} {why}") from error
        if isinstance(error, OSError):
            why = f"cannot be read ({error.strerror or error})"
            raise SourceError(f"{ref.location}: {why}") from error
        raise
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in EXTRA_OF:
            raise
        raise BSGError(
            f"{scene} has a mesh, which needs {error.name}: {ask_to_install('meshes')}",
            code="library-missing",
            where=ref.location,
        ) from error
    except Exception as error:
        raise RuntimeError(
            f"the source {source.kind!r} has a bug: {scene} raised {error!r}"
        ) from error


def _without_root(skip: SkippedScene, root: Path) -> SkippedScene:
    """Return a skipped scene without paths of this machine in its reason."""
    reason = skip.reason.replace(f"{root}/{skip.location}", "").lstrip(" ,:")
    return replace(skip, reason=reason.replace(f"{root}/", ""))


def count_totals(graphs: Sequence[SceneGraph]) -> Totals:
    """Return the sums over some scene graphs."""
    objects = [obj for graph in graphs for obj in graph.objects]
    return Totals(
        scenes=len(graphs),
        rooms=sum(len(graph.rooms) for graph in graphs),
        objects=len(objects),
        classified=sum(obj.class_index is not None for obj in objects),
        unmapped=sum(obj.category is None for obj in objects),
        placed=sum(graph.has_geometry for graph in graphs),
        adjacent=sum(len(graph.adjacency) for graph in graphs),
    )


def _name_manifest(folder: Path, number: int) -> Path:
    """Return the path of the manifest of a shard."""
    return folder / BUILD / f"part-{number:05d}.json"


def _read_shard(folder: Path, number: int) -> _Share | None:
    """Return the manifest of a finished shard; None if its files changed or it has none."""
    try:
        shard = _Share.model_validate_json(_name_manifest(folder, number).read_bytes())
        sound = all(hash_file(folder / entry.path) == entry.sha256 for entry in shard.files)
    except (OSError, ValidationError):
        return None
    return shard if sound else None


def _finish(plan: _Share, shards: Sequence[_Share], out: Path, *, where: Path) -> Manifest:
    """Put a dataset in place after all its shards are built."""
    folder = name_growing(out)
    manifest = combine_manifests([*shards, plan], scenes_per_shard=plan.scenes_per_shard)
    if not manifest.totals.scenes:
        reasons = "\n  ".join(f"{skip.location}: {skip.reason}" for skip in manifest.skipped[:5])
        shutil.rmtree(folder)
        message = f"{where}: no scene could be read. The first reasons:\n  {reasons}"
        raise SourceError(message, code="no-scene", where=where)
    class_map = load_class_map(plan.class_maps[0].name_in(folder))
    names = {entry.name: entry.instances for entry in manifest.unmapped}
    unmapped = tuple(describe_unmapped(names, class_map))  # with the nearest names, for each once
    manifest = manifest.model_copy(update={"unmapped": unmapped})
    put_in_place(out, manifest)
    return manifest


def _read_plan(out: Path) -> _Share:
    """Read the plan that the first part of a build left, where it grows or has grown."""
    paths = [folder / PLAN for folder in (name_growing(out), out) if (folder / PLAN).is_file()]
    if not paths:
        if (out / MANIFEST).is_file():
            message = f"{out}: is finished already; there is no part left to finish"
            raise DatasetError(message, code="finished", where=out)
        raise DatasetError(
            f"{name_growing(out)}: holds no part of a build; build parts with "
            "`bsg-data build --parts I/N`, and name the dataset as there",
            code="no-parts",
            where=out,
        )
    try:
        return _Share.model_validate_json(paths[0].read_bytes())
    except ValidationError as error:
        message = f"{paths[0]}: is damaged; remove it and run any part again"
        raise DatasetError(message, code="plan-damaged", where=paths[0]) from error


def _say_missing(folder: Path, missing: Sequence[int], shards: int) -> str:
    """Return which parts to run again, in the finest division that was used."""
    marks = (mark.name.removeprefix(_PARTS_OF) for mark in (folder / BUILD).glob(f"{_PARTS_OF}*"))
    of = max((int(number) for number in marks), default=1)
    parts = sorted({number % of + 1 for number in missing})
    named = ", ".join(f"{part}/{of}" for part in parts[:_MAX_NAMED])
    more = f" and {len(parts) - _MAX_NAMED:,} more" if len(parts) > _MAX_NAMED else ""
    return (
        f"{folder}: {len(missing):,} of {shards:,} shards missing or damaged; run these again "
        f"by --parts: {named}{more}"
    )
