"""Build a dataset: find the scenes of a source, make the shards, put the dataset in its place.

The dataset grows in `<out>.partial`. Each finished shard leaves a report in its `.build` folder, so
the same build goes on after an interruption, and processes on any machines can build parts of it:
part i of n makes every n-th shard, beginning with the i-th. The bytes depend on none of this.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from pydantic import Field, ValidationError

from bsg_data.build_shards import ShardReport, is_reported, make_shard, read_report, skip_entry
from bsg_data.dataset.commit import BUILD, PLAN, growing, name_growing, put_in_place, require_place
from bsg_data.dataset.kept_maps import ClassMapEntry
from bsg_data.dataset.manifest import (
    MANIFEST,
    Manifest,
    ScenesPerShard,
    SourceEntry,
    Totals,
    count_shards,
    describe_unmapped,
    list_resolved,
    read_manifest,
)
from bsg_data.dataset.schema import FORMAT_VERSION
from bsg_data.errors import DatasetError, RecipeError, SourceError
from bsg_data.executors import run_all
from bsg_data.files import AnyPath, resolve_links
from bsg_data.inputs.bounds import MAX_PARTS
from bsg_data.recipes import Record
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
from bsg_data.scene.class_space import ClassSpace
from bsg_data.sources.catalogue import SOURCES, find_terms
from bsg_data.sources.source import (
    FoundScenes,
    SceneRef,
    SkippedScene,
    Source,
    SourceWithTerms,
)

SCENES_PER_SHARD = 16
_MAX_NAMED = 20  # parts in an error
_PARTS_OF = "parts-of-"  # a mark in `.build`: the number of parts that a process was told


class _BuildPlan(Record):
    """All that determines the bytes of a dataset; a build goes on with its own plan only."""

    format_version: int = FORMAT_VERSION  # version of the dataset format
    generator: str  # this program and its version
    source: SourceEntry  # what is built
    class_space: ClassSpace  # the classes of all histograms
    scenes_per_shard: ScenesPerShard  # number of scenes in each part of a table
    shards: int = Field(ge=0, le=MAX_PARTS)  # number of parts of each table
    # scenes that the source found but does not read, with the reason
    not_read: tuple[SkippedScene, ...]
    unused: tuple[SkippedScene, ...]  # files that belong to no scene


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


@dataclass(frozen=True, slots=True)
class _Job:
    """A planned build: its source, the scenes to read, and the user's own class map."""

    source: Source
    scenes: tuple[SceneRef, ...]
    plan: _BuildPlan
    own_map: OwnMap | None
    strict: bool

    def make(
        self,
        shards: Iterable[int],
        folder: Path,
        *,
        executor: Executor | None,
        progress: Callable[[int, int], None] | None,
    ) -> list[ShardReport]:
        """Build the shards with some numbers, and return their reports."""
        size, entry = self.plan.scenes_per_shard, self.plan.source.class_map
        if self.own_map is not None:
            write_own_map(self.own_map, folder / entry.folder)
        chosen = entry.name_in(folder)
        tasks = [
            (self.source, self.scenes[n * size : (n + 1) * size], folder, n, chosen, self.strict)
            for n in shards
        ]
        return run_all(make_shard, tasks, executor=executor, progress=progress)


def build_dataset(
    source: Source,
    out: AnyPath,
    *,
    class_map: AnyPath | None = None,
    strict: bool = False,
    force: bool = False,
    scenes_per_shard: int = SCENES_PER_SHARD,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
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

    Returns:
        The manifest of the finished dataset.

    Raises:
        SourceError: if no scene is found or readable; with `strict`, if any is unreadable.
        UnmappedNameError: with `strict`, for a name that is not in the map.
        RecipeError: if `scenes_per_shard` is impossible.
        DatasetError: if `out` is taken or cannot be written.
    """
    out = resolve_links(out)  # a linked --out stays a link; its target is replaced
    require_place(out, force=force)
    job = _plan(source, class_map, strict=strict, scenes_per_shard=scenes_per_shard)
    with growing(out, job.plan, force=force) as (folder, done):
        if done:
            return read_manifest(out)
        every = range(job.plan.shards)
        reports = job.make(every, folder, executor=executor, progress=progress)
        return _finish(job.plan, reports, out, where=source.path)


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
    progress: Callable[[int, int], None] | None = None,
) -> BuiltPart:
    """Build one part of the shards of a dataset; other processes can build the other parts.

    Args:
        source: as in `build_dataset`; the same for all parts.
        out: folder of the dataset, on a file system that all parts see.
        part: the part to build.
        class_map: as in `build_dataset`.
        strict: as in `build_dataset`.
        force: allow a finished dataset at `out`; `finalise_dataset` replaces it.
        scenes_per_shard: number of scenes in each part of a table.
        executor: runs the shards in parallel; None builds them one by one in this process.
        progress: called with (shards done, shards of this part).

    Returns:
        What the part built, and which shards are still missing.

    Raises:
        SourceError: if no scene is found; with `strict`, if any is unreadable.
        UnmappedNameError: with `strict`, for a name that is not in the map.
        RecipeError: if `scenes_per_shard` is impossible.
        DatasetError: if parts of another build are there, or a file cannot be written.
    """
    out = resolve_links(out)
    require_place(out, force=force)
    job = _plan(source, class_map, strict=strict, scenes_per_shard=scenes_per_shard)
    shards = tuple(range(part.number - 1, job.plan.shards, part.of))
    with growing(out, job.plan, force=force, shared=True) as (folder, _):
        (folder / BUILD / f"{_PARTS_OF}{part.of}").touch()
        reports = job.make(shards, folder, executor=executor, progress=progress)
        missing = tuple(n for n in range(job.plan.shards) if not is_reported(folder, n))
    return BuiltPart(shards, sum(report.totals.scenes for report in reports), missing)


def finalise_dataset(
    out: AnyPath, *, force: bool = False, progress: Callable[[int, int], None] | None = None
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
        reports, missing = [], []
        for number in range(plan.shards):
            report = read_report(folder, number)
            if report is None:
                missing.append(number)
            else:
                reports.append(report)
            if progress is not None:
                progress(number + 1, plan.shards)
        if missing:
            message = _say_missing(folder, missing, plan.shards)
            raise DatasetError(message, code="shards-missing", where=folder)
        return _finish(plan, reports, out, where=out)


def _plan(
    source: Source, class_map: AnyPath | None, *, strict: bool, scenes_per_shard: int
) -> _Job:
    """Find the scenes of a source and plan the build; write nothing."""
    chosen = _name_class_map(source) if class_map is None else os.fspath(class_map)
    own = read_own_map(Path(chosen)) if is_own_map(chosen) else None
    loaded = load_class_map(chosen) if own is None else parse_own_map(own)
    listing = source.find()
    if strict and listing.unreadable:
        skip = listing.unreadable[0]
        where = source.path / skip.location
        raise SourceError(f"{where}: {skip.reason}", code="scene-unreadable", where=where)
    plan = _BuildPlan(
        generator=f"belief-scene-graphs {version('belief-scene-graphs')}",
        source=_describe_source(source, listing, loaded),
        class_space=loaded.space,
        scenes_per_shard=scenes_per_shard,
        shards=count_shards(len(listing.scenes), scenes_per_shard=scenes_per_shard),
        not_read=(*listing.duplicates, *listing.unreadable),
        unused=tuple(skip_entry(skip, Path()) for skip in listing.unused),
    )
    return _Job(source, listing.scenes, plan, own, strict)


def _name_class_map(source: Source) -> str:
    """Return the name of the published class map for a source."""
    return SOURCES[source.kind].class_map if source.kind in SOURCES else DEFAULT_CLASS_MAP


def _describe_source(source: Source, listing: FoundScenes, class_map: ClassMap) -> SourceEntry:
    versions = sorted({ref.source_version for ref in listing.scenes if ref.source_version})
    digest = hashlib.sha256()
    for ref in listing.scenes:
        words = (ref.scene_id, ref.source_split, ref.fingerprint, ref.geometry)
        digest.update(("\t".join(str(word) for word in words) + "\n").encode())
    return SourceEntry(
        kind=source.kind,
        version=", ".join(versions) or None,
        fingerprint=digest.hexdigest(),
        class_map=ClassMapEntry.of(class_map),
        options=source.options,
        terms=source.terms if isinstance(source, SourceWithTerms) else find_terms(source.kind),
        nameable=None if class_map.nameable == class_map.classes else class_map.nameable,
    )


def _finish(plan: _BuildPlan, reports: list[ShardReport], out: Path, *, where: Path) -> Manifest:
    """Put a dataset in place after all its shards are built."""
    folder = name_growing(out)
    manifest = _summarise(plan, reports, load_class_map(plan.source.class_map.name_in(folder)))
    if not manifest.totals.scenes:
        reasons = "\n  ".join(f"{skip.location}: {skip.reason}" for skip in manifest.skipped[:5])
        shutil.rmtree(folder)
        message = f"{where}: no scene could be read. The first reasons:\n  {reasons}"
        raise SourceError(message, code="no-scene", where=where)
    put_in_place(out, manifest)
    return manifest


def _summarise(plan: _BuildPlan, reports: list[ShardReport], class_map: ClassMap) -> Manifest:
    unmapped: Counter[str] = Counter()
    resolved: Counter[str] = Counter()
    for report in reports:
        unmapped.update(report.unmapped)
        resolved.update({entry.name: entry.instances for entry in report.resolved})
    return Manifest(
        generator=plan.generator,
        class_space=plan.class_space,
        sources=(plan.source,),
        scenes_per_shard=plan.scenes_per_shard,
        totals=Totals.sum(report.totals for report in reports),
        files=tuple(sorted((f for r in reports for f in r.files), key=lambda f: f.path)),
        skipped=(*(skip for report in reports for skip in report.skipped), *plan.not_read),
        left_out=(*(skip for report in reports for skip in report.left_out), *plan.unused),
        meshes={scene: mesh for report in reports for scene, mesh in report.meshes.items()},
        unmapped=tuple(describe_unmapped(unmapped, class_map)),
        resolved=tuple(list_resolved(resolved, class_map)),
    )


def _read_plan(out: Path) -> _BuildPlan:
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
        return _BuildPlan.model_validate_json(paths[0].read_bytes())
    except ValidationError as error:
        message = f"{paths[0]}: is damaged; remove it and run any part again"
        raise DatasetError(message, code="plan-damaged", where=paths[0]) from error


def _say_missing(folder: Path, missing: list[int], shards: int) -> str:
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
