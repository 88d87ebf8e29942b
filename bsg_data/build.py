"""Build a dataset: find the scenes of a source, read each, write shards, publish.

The work grows in `<out>.partial` and becomes `<out>` by one rename. A shard that is done leaves a
report there, so that a build which was stopped goes on where it was; the bytes are the same with
one worker or many, stopped or not.
"""

from __future__ import annotations

import hashlib
import shutil
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor
from importlib.metadata import version
from pathlib import Path

from pydantic import ValidationError

from bsg_data.dataset.growth import finish, make_parent, open_partial, refuse_overwriting
from bsg_data.dataset.kept_maps import keep_class_map
from bsg_data.dataset.manifest import (
    ClassMapEntry,
    ClassSpaceEntry,
    FileEntry,
    Manifest,
    ResolvedEntry,
    SkipEntry,
    SourceEntry,
    Totals,
    describe_unmapped,
    list_resolved,
)
from bsg_data.dataset.publication import REPORTS
from bsg_data.dataset.schema import FORMAT_VERSION
from bsg_data.dataset.shards import describe_file, write_shards
from bsg_data.errors import BSGError, SourceError, UnmappedNameError
from bsg_data.executors import run_all
from bsg_data.files import write_bytes
from bsg_data.lock import hold
from bsg_data.recipes import Record
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap, load_class_map, parse_own_map
from bsg_data.scene.mesh_coverage import MeshCoverage
from bsg_data.scene.own_map import is_own_map, read_own_map
from bsg_data.scene.scene_graph import SceneGraph, is_scene_id
from bsg_data.sources.catalogue import SOURCES, find_terms
from bsg_data.sources.source import (
    FoundScenes,
    Reading,
    SceneRef,
    SkippedScene,
    Source,
    SourceWithTerms,
)

SCENES_PER_SHARD = 16


class BuildRecipe(Record):
    """All that the bytes of a build depend on; a build resumes only its own recipe."""

    format_version: int = FORMAT_VERSION
    generator: str
    source: SourceEntry
    class_space: ClassSpaceEntry
    scenes_per_shard: int


class ShardReport(Record):
    """What one shard holds and what was left out of it."""

    files: tuple[FileEntry, ...]
    totals: Totals
    skipped: tuple[SkipEntry, ...]
    left_out: tuple[SkipEntry, ...]
    meshes: dict[str, MeshCoverage]
    unmapped: dict[str, int]
    resolved: tuple[ResolvedEntry, ...]


def build_dataset(
    source: Source,
    out: Path,
    *,
    class_map: str | None = None,
    strict: bool = False,
    force: bool = False,
    scenes_per_shard: int = SCENES_PER_SHARD,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Manifest:
    """Build the dataset of a source and return its manifest.

    Args:
        source: an `HM3DFolder`, an `HM3DStatistics` or your own `Source`.
        out: folder of the dataset; absent or empty, or a dataset to replace under `force`.
        class_map: version of a published map, or the path of your own; None takes the map of the
            source.
        strict: fail on the first malformed scene or unmapped name instead of reporting it.
        force: replace a finished dataset; it stays until the new one is finished.
        scenes_per_shard: scenes found per part of each table.
        executor: where shards are made; None makes them one after another here.
        progress: called with (shards done, shards in all).

    Raises:
        SourceError: if no scene is found or none can be read; under `strict`, for any.
        UnmappedNameError: under `strict`, for a name that is not in the map.
        DatasetError: if `out` is in the way or cannot be written.
    """
    out = out.resolve()  # a linked --out stays a link; what it leads to is replaced
    chosen = class_map or name_class_map(source)
    own = read_own_map(Path(chosen)) if is_own_map(chosen) else None
    loaded = load_class_map(chosen) if own is None else parse_own_map(own)
    refuse_overwriting(out, force=force)
    listing = source.find()
    if strict and listing.unreadable:
        skip = listing.unreadable[0]
        raise SourceError(f"{source.path / skip.location}: {skip.reason}")
    recipe = _recipe(source, listing, loaded, scenes_per_shard)
    starts = range(0, len(listing.scenes), scenes_per_shard)
    make_parent(out)
    with hold(out):  # against another build, and against split and pairs of what is replaced
        growing = open_partial(out, recipe)
        if own is not None:
            chosen = str(keep_class_map(own, recipe.source.class_map, growing))
        tasks = [
            (source, listing.scenes[a : a + scenes_per_shard], growing, part, chosen, strict)
            for part, a in enumerate(starts)
        ]
        reports = run_all(_make_shard, tasks, executor=executor, progress=progress)
        manifest = _summarise(recipe, listing, reports, loaded)
        if not manifest.totals.scenes:
            shutil.rmtree(growing)
            raise SourceError(_nothing_readable(source, manifest))
        finish(growing, out, manifest, force=force)
    return manifest


def name_class_map(source: Source) -> str:
    """Return the published class map of a source's words."""
    return SOURCES[source.kind].class_map if source.kind in SOURCES else DEFAULT_CLASS_MAP


def _nothing_readable(source: Source, manifest: Manifest) -> str:
    reasons = "\n  ".join(f"{skip.location}: {skip.reason}" for skip in manifest.skipped[:5])
    return f"{source.path}: scenes were found and none could be read:\n  {reasons}"


def _make_shard(
    source: Source,
    refs: tuple[SceneRef, ...],
    folder: Path,
    part: int,
    class_map: str,
    strict: bool,
) -> ShardReport:
    """Make one shard, unless an earlier run of the same build did."""
    path = folder / REPORTS / f"part-{part:05d}.json"
    done = _read_report(path, folder)
    if done is not None and not (strict and (done.skipped or done.left_out or done.unmapped)):
        return done
    loaded = load_class_map(class_map)
    graphs, skipped, left_out = [], [], []
    meshes: dict[str, MeshCoverage] = {}
    names: Counter[str] = Counter()
    for ref in refs:
        try:
            if not is_scene_id(ref.scene_id):
                raise SourceError(f"{ref.scene_id!r}: a scene id must do as the name of a file")
            reading = _read(source, ref, loaded)
        except SourceError as error:
            if strict:
                raise
            skip = SkippedScene(ref.scene_id, ref.location, str(error))
            skipped.append(_enter_skip(skip, source.path))
            continue
        if reading.left_out and strict:
            raise SourceError(reading.left_out[0].reason)
        graph = reading.graph
        left_out += [_enter_skip(skip, source.path) for skip in reading.left_out]
        if reading.mesh is not None:
            meshes[ref.scene_id] = reading.mesh
        unknown = [obj.raw_category for obj in graph.objects if obj.category is None]
        if unknown and strict:
            raise UnmappedNameError(_unmapped_message(ref, unknown[0], loaded))
        names.update(obj.raw_category for obj in graph.objects)
        graphs.append(graph)
    report = ShardReport(
        files=write_shards(graphs, folder, part=part, class_space=ClassSpaceEntry.of(loaded.space)),
        totals=_total(graphs),
        skipped=tuple(skipped),
        left_out=tuple(left_out),
        meshes=meshes,
        unmapped={n: times for n, times in names.items() if not loaded.classify(n).category},
        resolved=tuple(list_resolved(names, loaded)),
    )
    write_bytes(path, report.model_dump_json().encode())
    return report


def _read(source: Source, ref: SceneRef, class_map: ClassMap) -> Reading:
    """Read one scene; an error that the source does not raise on purpose names the scene.

    Raises:
        SourceError: if the scene cannot be read.
        RuntimeError: for a bug in the code of the source.
    """
    try:
        return source.read(ref, class_map)
    except (BSGError, OSError):
        raise
    except Exception as error:
        raise RuntimeError(
            f"the source {source.kind!r} has a bug, which scene {ref.scene_id!r} "
            f"({ref.location}) shows: {error!r}"
        ) from error


def _enter_skip(skip: SkippedScene, root: Path) -> SkipEntry:
    """Return the manifest's entry: the folder above the source is this machine's business."""
    reason = skip.reason.replace(f"{root}/{skip.location}", "").lstrip(" ,:")
    reason = reason.replace(f"{root}/", "")
    return SkipEntry(scene_id=skip.scene_id, location=skip.location, reason=reason)


def _read_report(path: Path, folder: Path) -> ShardReport | None:
    """Return the report of a finished shard if its files are still what it says."""
    try:
        report = ShardReport.model_validate_json(path.read_bytes())
        for entry in report.files:
            if describe_file(folder, entry.path, rows=entry.rows) != entry:
                return None
    except (OSError, ValidationError):
        return None
    return report


def _total(graphs: list[SceneGraph]) -> Totals:
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


def _recipe(
    source: Source, listing: FoundScenes, class_map: ClassMap, scenes_per_shard: int
) -> BuildRecipe:
    versions = sorted({ref.source_version for ref in listing.scenes if ref.source_version})
    digest = hashlib.sha256()
    for ref in listing.scenes:
        words = (ref.scene_id, ref.source_split, ref.fingerprint, ref.geometry)
        digest.update(("\t".join(str(word) for word in words) + "\n").encode())
    return BuildRecipe(
        generator=f"belief-scene-graphs {version('belief-scene-graphs')}",
        source=SourceEntry(
            kind=source.kind,
            version=", ".join(versions) or None,
            fingerprint=digest.hexdigest(),
            class_map=ClassMapEntry.of(class_map),
            options=source.options,
            terms=source.terms if isinstance(source, SourceWithTerms) else find_terms(source.kind),
        ),
        class_space=ClassSpaceEntry.of(class_map.space),
        scenes_per_shard=scenes_per_shard,
    )


def _summarise(
    recipe: BuildRecipe, listing: FoundScenes, reports: list[ShardReport], class_map: ClassMap
) -> Manifest:
    unmapped: Counter[str] = Counter()
    resolved: Counter[str] = Counter()
    for report in reports:
        unmapped.update(report.unmapped)
        resolved.update({entry.name: entry.instances for entry in report.resolved})
    elsewhere = [
        SkipEntry(scene_id=skip.scene_id, location=skip.location, reason=skip.reason)
        for skip in (*listing.duplicates, *listing.unreadable)
    ]
    fields = Totals.model_fields
    return Manifest(
        generator=recipe.generator,
        class_space=recipe.class_space,
        sources=(recipe.source,),
        scenes_per_shard=recipe.scenes_per_shard,
        totals=Totals(**{f: sum(getattr(r.totals, f) for r in reports) for f in fields}),
        files=tuple(sorted((f for r in reports for f in r.files), key=lambda f: f.path)),
        skipped=(*(skip for r in reports for skip in r.skipped), *elsewhere),
        left_out=(
            *(skip for report in reports for skip in report.left_out),
            *(_enter_skip(skip, Path()) for skip in listing.unused),
        ),
        meshes={scene: mesh for report in reports for scene, mesh in report.meshes.items()},
        unmapped=tuple(describe_unmapped(unmapped, class_map)),
        resolved=tuple(list_resolved(resolved, class_map)),
    )


def _unmapped_message(ref: SceneRef, name: str, class_map: ClassMap) -> str:
    near = ", ".join(repr(n) for n in class_map.nearest(name)) or "none"
    return (
        f"{ref.location}: {name!r} is not in class map {class_map.version} (nearest: {near}); "
        "leave --strict out to keep such objects without a class, or use a map that lists it"
    )
