"""Build a dataset: find the scenes of a source, make the shards, publish the dataset.

The dataset grows in `<out>.partial`, and one rename moves it to `<out>`. Each finished shard leaves
a report there, so an interrupted build can continue. The bytes depend neither on the number of
workers nor on interruptions.
"""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from pydantic import Field

from bsg_data.build_shards import ShardReport, enter_skip, make_shard
from bsg_data.dataset.growth import (
    finish,
    make_parent,
    open_partial,
    recall,
    refuse_overwriting,
    refuse_place,
    remove_growing,
)
from bsg_data.dataset.kept_maps import keep_class_map, name_kept
from bsg_data.dataset.manifest import (
    ClassMapEntry,
    ClassSpaceEntry,
    Manifest,
    ScenesPerShard,
    SkipEntry,
    SourceEntry,
    Totals,
    count_shards,
    describe_unmapped,
    list_resolved,
)
from bsg_data.dataset.replacement import is_settled, name_growing
from bsg_data.dataset.schema import FORMAT_VERSION
from bsg_data.errors import SourceError
from bsg_data.executors import run_all
from bsg_data.files import AnyPath, resolve_links
from bsg_data.inputs.bounds import MAX_PARTS
from bsg_data.lock import hold
from bsg_data.recipes import Record
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap, load_class_map, parse_own_map
from bsg_data.scene.own_map import OwnMap, is_own_map, read_own_map
from bsg_data.sources.catalogue import SOURCES, find_terms
from bsg_data.sources.source import FoundScenes, SceneRef, Source, SourceWithTerms

SCENES_PER_SHARD = 16


class BuildRecipe(Record):
    """All settings that determine the bytes of a build; a build resumes only its own recipe."""

    format_version: int = FORMAT_VERSION
    generator: str
    source: SourceEntry
    class_space: ClassSpaceEntry
    scenes_per_shard: ScenesPerShard


class BuildPlan(Record):
    """What a manifest says of a build, apart from the reports of its shards.

    Attributes:
        recipe: recipe of the build.
        shards: number of shards.
        not_read: scenes that the source found but does not read, with the reason.
        unused: files that belong to no scene.
    """

    recipe: BuildRecipe
    shards: int = Field(ge=0, le=MAX_PARTS)
    not_read: tuple[SkipEntry, ...]
    unused: tuple[SkipEntry, ...]


@dataclass(frozen=True, slots=True)
class PlannedBuild:
    """A build that is ready to run.

    Attributes:
        source: source of the scenes.
        scenes: all scenes to read.
        plan: plan of the build.
        own_map: files of the user's own class map; None for a published map.
        strict: whether to fail on the first malformed scene or unmapped name.
    """

    source: Source
    scenes: tuple[SceneRef, ...]
    plan: BuildPlan
    own_map: OwnMap | None
    strict: bool

    def keep_map(self, growing: Path) -> None:
        """Write the user's own class map into the growing dataset."""
        if self.own_map is not None:
            keep_class_map(self.own_map, self.plan.recipe.source.class_map, growing)

    def make(
        self,
        shards: Iterable[int],
        growing: Path,
        *,
        executor: Executor | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> list[ShardReport]:
        """Build the shards with some numbers and return their reports."""
        size = self.plan.recipe.scenes_per_shard
        chosen = name_kept(self.plan.recipe.source.class_map, growing)
        tasks = [
            (self.source, self.scenes[n * size : (n + 1) * size], growing, n, chosen, self.strict)
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
    refuse_place(out)
    if is_settled(out):
        refuse_overwriting(out, force=force)
    planned = plan_build(
        source, class_map=class_map, strict=strict, scenes_per_shard=scenes_per_shard
    )
    make_parent(out)
    with hold(out):  # keeps out other builds, and split and pairs of the old dataset
        done = recall(out, planned.plan.recipe)
        if done is not None:
            return done
        refuse_overwriting(out, force=force)
        growing = open_partial(out, planned.plan.recipe)
        planned.keep_map(growing)
        every = range(planned.plan.shards)
        reports = planned.make(every, growing, executor=executor, progress=progress)
        return finish_build(planned.plan, reports, out, force=force, where=source.path)


def plan_build(
    source: Source,
    *,
    class_map: AnyPath | None = None,
    strict: bool = False,
    scenes_per_shard: int = SCENES_PER_SHARD,
) -> PlannedBuild:
    """Find the scenes of a source and plan the build; write nothing.

    Raises:
        SourceError: if no scene is found; with `strict`, if one is unreadable.
        ClassMapError: if the class map does not exist.
        RecipeError: if `scenes_per_shard` is impossible.
    """
    chosen = name_class_map(source) if class_map is None else os.fspath(class_map)
    own = read_own_map(Path(chosen)) if is_own_map(chosen) else None
    loaded = load_class_map(chosen) if own is None else parse_own_map(own)
    listing = source.find()
    if strict and listing.unreadable:
        skip = listing.unreadable[0]
        raise SourceError(f"{source.path / skip.location}: {skip.reason}")
    shards = count_shards(len(listing.scenes), scenes_per_shard=scenes_per_shard)
    plan = BuildPlan(
        recipe=_recipe(source, listing, loaded, scenes_per_shard),
        shards=shards,
        not_read=tuple(
            SkipEntry(scene_id=skip.scene_id, location=skip.location, reason=skip.reason)
            for skip in (*listing.duplicates, *listing.unreadable)
        ),
        unused=tuple(enter_skip(skip, Path()) for skip in listing.unused),
    )
    return PlannedBuild(source, listing.scenes, plan, own, strict)


def finish_build(
    plan: BuildPlan,
    reports: list[ShardReport],
    out: Path,
    *,
    force: bool,
    where: Path,
) -> Manifest:
    """Publish a dataset after all its shards are built, and return its manifest.

    Args:
        plan: plan of the build.
        reports: reports of all shards.
        out: folder of the dataset.
        force: replace a finished dataset.
        where: path for error messages: the source, if it is known.

    Raises:
        SourceError: if no scene could be read; the growing dataset is removed.
        DatasetError: if the dataset cannot be moved to `out`.
    """
    class_map = name_kept(plan.recipe.source.class_map, name_growing(out))
    manifest = _summarise(plan, reports, load_class_map(class_map))
    if not manifest.totals.scenes:
        remove_growing(out)
        raise SourceError(_nothing_readable(where, manifest))
    finish(out, manifest, force=force)
    return manifest


def name_class_map(source: Source) -> str:
    """Return the name of the published class map for a source."""
    return SOURCES[source.kind].class_map if source.kind in SOURCES else DEFAULT_CLASS_MAP


def _nothing_readable(where: Path, manifest: Manifest) -> str:
    reasons = "\n  ".join(f"{skip.location}: {skip.reason}" for skip in manifest.skipped[:5])
    return f"{where}: no scene could be read. The first reasons:\n  {reasons}"


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


def _summarise(plan: BuildPlan, reports: list[ShardReport], class_map: ClassMap) -> Manifest:
    unmapped: Counter[str] = Counter()
    resolved: Counter[str] = Counter()
    for report in reports:
        unmapped.update(report.unmapped)
        resolved.update({entry.name: entry.instances for entry in report.resolved})
    fields = Totals.model_fields
    return Manifest(
        generator=plan.recipe.generator,
        class_space=plan.recipe.class_space,
        sources=(plan.recipe.source,),
        scenes_per_shard=plan.recipe.scenes_per_shard,
        totals=Totals(**{f: sum(getattr(r.totals, f) for r in reports) for f in fields}),
        files=tuple(sorted((f for r in reports for f in r.files), key=lambda f: f.path)),
        skipped=(*(skip for r in reports for skip in r.skipped), *plan.not_read),
        left_out=(
            *(skip for report in reports for skip in report.left_out),
            *plan.unused,
        ),
        meshes={scene: mesh for report in reports for scene, mesh in report.meshes.items()},
        unmapped=tuple(describe_unmapped(unmapped, class_map)),
        resolved=tuple(list_resolved(resolved, class_map)),
    )
