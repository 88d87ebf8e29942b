"""Build a dataset: find the scenes of a source, make the shards, publish the dataset.

The dataset grows in `<out>.partial`. Each finished shard leaves a manifest in the folder `.build`
there, so the same build goes on after an interruption. The bytes depend neither on this nor on
workers. The manifest of the dataset is the sum of these.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from uuid import uuid4

import pyarrow as pa
from pydantic import ValidationError

from bsg_data.dataset.commit import DATASET, publish
from bsg_data.dataset.manifest import (
    ClassMapEntry,
    CountedName,
    Manifest,
    SkippedScene,
    SourceEntry,
    Totals,
    UnmappedEntry,
    add_fingerprints,
    combine_manifests,
    count_shards,
    describe_unmapped,
    list_resolved,
    read_manifest,
)
from bsg_data.dataset.scenes import count_totals, make_tables
from bsg_data.dataset.shards import write_shards
from bsg_data.errors import (
    EXTRA_OF,
    BSGError,
    ClassMapError,
    SourceChangedError,
    SourceError,
    ask_to_install,
    find_io_error,
)
from bsg_data.executors import run_all
from bsg_data.files import AnyPath, resolve_links
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.places import BUILD, require_free
from bsg_data.results import write_folder
from bsg_data.scene.class_map import (
    DEFAULT_CLASS_MAP,
    ClassMap,
    is_own_map,
    load_class_map,
    parse_own_map,
    read_own_map,
    write_own_map,
)
from bsg_data.scene.room_label import is_understood
from bsg_data.scene.scene_graph import SceneGraph, is_scene_id
from bsg_data.sources.catalogue import SOURCES, find_terms
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, Source

_SHOWN = 5  # reasons why scenes were skipped, where all were
_NOTHING_SKIPPED = "no scene was skipped; repair the source, then run the command again"
_Progress = Callable[[int, int], None]


def build_dataset(
    source: Source,
    out: AnyPath,
    *,
    class_map: AnyPath | None = None,
    strict: bool = False,
    force: bool = False,
    scenes_per_shard: int = 16,
    executor: Executor | None = None,
    progress: _Progress | None = None,
) -> Manifest:
    """Build the dataset of a source and return its manifest.

    Args:
        source: an `HM3DFolder`, or any other `Source`.
        out: folder of the dataset: absent, empty, or, with `force`, a dataset to replace.
        class_map: version of a published map, or path of your own; None: the map of the source.
        strict: fail on the first malformed scene or unmapped name instead of reporting it.
        force: replace a finished dataset; it stays until the new one is finished.
        scenes_per_shard: number of scenes in each shard.
        executor: runs the shards in parallel; None builds them one by one in this process.
        progress: called with (shards done, shards in all).

    Raises:
        SourceError: if no scene is found or readable; with `strict`, if any is unreadable.
        ClassMapError: with `strict`, for a name that is not in the map.
        RecipeError: if `scenes_per_shard` is impossible.
        DatasetError: if `out` is taken or cannot be written.
    """
    out = resolve_links(out)  # a linked --out stays a link; its target is replaced
    require_free(out, DATASET, force=force)
    usual = SOURCES[source.kind].class_map if source.kind in SOURCES else DEFAULT_CLASS_MAP
    chosen = os.fspath(class_map or usual)
    own = read_own_map(Path(chosen)) if is_own_map(chosen) else None
    loaded = load_class_map(chosen) if own is None else parse_own_map(own)
    found = _find_scenes(source, strict=strict)
    plan, every = _make_plan(source, found, loaded, scenes_per_shard), found.scenes
    scenes = hashlib.sha256(repr(every).encode("utf-8", "backslashreplace")).hexdigest()
    encoded = f"{plan.model_dump_json()}\n{scenes}".encode()  # all that the bytes depend on
    with write_folder(out, DATASET, plan=encoded, force=force) as (folder, done):
        if done:
            return read_manifest(out)
        if own is not None:
            write_own_map(own, folder / plan.class_maps[0].folder)
        bare = plan.model_copy(update={"skipped": (), "left_out": ()})
        tasks = [
            (_Shard(source, every[first : first + scenes_per_shard], bare, folder, number, strict),)
            for number, first in enumerate(range(0, len(every), scenes_per_shard))
        ]
        shards = run_all(_Shard.make, tasks, executor=executor, progress=progress)
        manifest = combine_manifests([*shards, plan])
        if not manifest.totals.scenes:
            shutil.rmtree(folder)
            raise _refuse_nothing(source.path, manifest.skipped)
        unmapped = {entry.name: entry.instances for entry in manifest.unmapped}
        near = tuple(describe_unmapped(unmapped, loaded))
        if _find_scenes(source, strict=strict) != found:
            shutil.rmtree(folder)
            message = f"{source.path}: changed while it was read; run the command again"
            raise SourceChangedError(message, code="source-changed", where=source.path)
        manifest = manifest.model_copy(update={"unmapped": near})
        publish(folder, manifest)
    return manifest


def _find_scenes(source: Source, *, strict: bool) -> FoundScenes:
    """Find the scenes of a source, each id once."""
    found = source.find()
    for skip in (*found.conflicts, *found.unreadable) if strict else ():
        where = source.path / skip.location
        message = f"{where}: {skip.reason}; mend it, or build without --strict"
        raise SourceError(message, code="scene-unreadable", where=where)
    for scene, times in Counter(ref.scene_id for ref in found.scenes).most_common(1):
        if times > 1:
            message = f"{source.path}: two scenes have the id {scene!r}; rename one of them"
            raise SourceError(message, code="scene-twice", where=scene)
    return found


def _make_plan(
    source: Source, found: FoundScenes, class_map: ClassMap, scenes_per_shard: int
) -> Manifest:
    """Return the manifest of the dataset before any shard is made."""
    count_shards(len(found.scenes), scenes_per_shard=scenes_per_shard)
    versions = sorted({ref.source_version for ref in found.scenes if ref.source_version})
    entry = SourceEntry(
        kind=source.kind,
        version=", ".join(versions) or None,
        fingerprint=add_fingerprints([]),
        class_map=ClassMapEntry.of(class_map),
        options=source.options,
        terms=getattr(source, "terms", None) or find_terms(source.kind),
        nameable=None if class_map.nameable == class_map.classes else class_map.nameable,
        is_complete=source.kind not in SOURCES or SOURCES[source.kind].is_complete,
    )
    return Manifest(
        generator=name_generator(),
        class_space=class_map.space,
        sources=(entry,),
        scenes_per_shard=scenes_per_shard,
        totals=Totals(),
        files=(),
        skipped=(*found.duplicates, *found.conflicts, *found.unreadable),
        left_out=tuple(_without_root(skip, Path()) for skip in found.unused),
    )


def _refuse_nothing(where: Path, skipped: Sequence[SkippedScene]) -> SourceError:
    reasons = "; ".join(
        skip.reason if skip.location in skip.reason else f"{skip.location}: {skip.reason}"
        for skip in skipped[:_SHOWN]
    )
    message = f"{where}: no scene could be read: {reasons}"
    return SourceError(message, code="no-scene", where=where)


def name_generator() -> str:
    """Return the name and the version of this program, as a manifest has it."""
    return f"belief-scene-graphs {version('belief-scene-graphs')}"


@dataclass(frozen=True, slots=True)
class _Shard:
    """What a worker makes one shard of."""

    source: Source
    scenes: tuple[SceneRef, ...]
    bare: Manifest  # of a dataset of none of its scenes
    folder: Path  # of the dataset
    number: int
    strict: bool

    def make(self) -> Manifest:
        """Make the shard, unless an earlier run of the same build did; its manifest comes last."""
        class_map = load_class_map(self.bare.class_maps[0].name_in(self.folder))
        path = self.folder / BUILD / f"part-{self.number:05d}.json"
        done = _read_report(self.folder, path)
        if done and not (self.strict and (done.skipped or done.left_out or done.unmapped)):
            return done
        readings: list[Reading] = []
        skipped: list[SkippedScene] = []
        for ref in self.scenes:
            try:
                readings.append(self._read(ref, class_map))
            except SourceError as error:
                if self.strict or isinstance(error, SourceChangedError):
                    raise
                skipped.append(SkippedScene(ref.scene_id, ref.location, str(error)))
        report = self._write(readings, skipped, class_map)
        partial = path.with_name(f"{path.name}.{uuid4().hex}")  # two machines may make one shard
        partial.write_text(report.model_dump_json(), "utf-8")
        partial.replace(path)
        return report

    def _read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene; if the build is strict, refuse one that would lose anything."""
        if not is_scene_id(ref.scene_id):
            raise SourceError(f"{ref.scene_id!r}: is no scene id: it must be usable as a file name")
        reading = _read(self.source, ref, class_map)
        if not self.strict:
            return reading
        if reading.left_out:
            raise SourceError(
                "; ".join(f"{skip.location}: {skip.reason}" for skip in reading.left_out)
            )
        for name in (obj.raw_category for obj in reading.graph.objects if obj.category is None):
            near = ", ".join(repr(near_name) for near_name in class_map.nearest(name)) or "none"
            raise ClassMapError(
                f"{ref.location}: {name!r} is not in class map {class_map.version} (nearest: "
                f"{near}); leave --strict out to keep such objects without a class, or use a map "
                "that lists it",
                code="name-unmapped",
                where=name,
            )
        return reading

    def _write(
        self, readings: Sequence[Reading], skipped: Sequence[SkippedScene], class_map: ClassMap
    ) -> Manifest:
        """Write the files of the shard, and say what is in them."""
        graphs, space = [reading.graph for reading in readings], class_map.space
        root = self.source.path if self.source.path.is_dir() else self.source.path.parent
        tables = make_tables(graphs, space.classes)
        names = _count_unlisted(tables["objects"], class_map)
        lines = (f"{graph.scene_id}\t{graph.annotation_sha256}".encode() for graph in graphs)
        fingerprint = add_fingerprints(hashlib.sha256(line).hexdigest() for line in lines)
        (source,) = self.bare.sources
        found = {
            "sources": (source.model_copy(update={"fingerprint": fingerprint}),),
            "totals": count_totals(tables),
            "files": write_shards(tables, self.folder, number=self.number, class_space=space),
            "skipped": tuple(_without_root(skip, root) for skip in skipped),
            "left_out": tuple(
                _without_root(skip, root) for reading in readings for skip in reading.left_out
            ),
            "meshes": {
                reading.graph.scene_id: reading.mesh
                for reading in readings
                if reading.mesh is not None
            },
            "unmapped": tuple(
                UnmappedEntry(name=name, instances=times)
                for name, times in names.items()
                if class_map.classify(name).category is None
            ),
            "resolved": tuple(list_resolved(names, class_map)),
            "unknown_labels": tuple(_list_unknown_labels(graphs, self.source)),
        }
        return self.bare.model_copy(update=found)


def _count_unlisted(objects: pa.Table, class_map: ClassMap) -> Mapping[str, int]:
    """Return the names that a class map does not list, and their objects."""
    times = dict(row.values() for row in objects["raw_category"].value_counts().to_pylist())
    return {name: times[name] for name in times if class_map.lookup(name) is None}


def _list_unknown_labels(graphs: Sequence[SceneGraph], source: Source) -> Iterator[CountedName]:
    """Yield what a source calls rooms that names no kind of room that we know, and the rooms."""
    lists = getattr(source, "lists", lambda word: False)  # of a source with a list of its own
    rooms = ((graph.source, room) for graph in graphs for room in graph.rooms if room.label is None)
    labels = Counter(
        room.source_label
        for kind, room in rooms
        if room.source_label is not None
        and not (lists(room.source_label) or is_understood(kind, room.source_label))
    )
    return (CountedName(name=name, instances=times) for name, times in labels.items())


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


def _read_report(folder: Path, path: Path) -> Manifest | None:
    """Return the manifest of a finished shard; None if its files changed or it has none."""
    try:
        shard = Manifest.model_validate_json(path.read_bytes())
        sound = all(hash_file(folder / entry.path) == entry.sha256 for entry in shard.files)
    except (OSError, ValidationError):
        return None
    return shard if sound else None
