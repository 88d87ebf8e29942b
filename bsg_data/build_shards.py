"""Build one shard: read its scenes, write its files, and write a report of them.

A shard depends only on its arguments, so any process on any machine can build it. The report comes
last: a shard without it, or with other hashes than it says, is made again.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from uuid import uuid4

from pydantic import ValidationError

from bsg_data.dataset.commit import BUILD
from bsg_data.dataset.manifest import (
    FileEntry,
    ResolvedEntry,
    Totals,
    list_resolved,
)
from bsg_data.dataset.shards import write_shards
from bsg_data.errors import (
    BSGError,
    SourceChangedError,
    SourceError,
    UnmappedNameError,
    find_io_error,
)
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.recipes import Record
from bsg_data.scene.class_map import ClassMap, load_class_map
from bsg_data.scene.scene_graph import MeshCoverage, SceneGraph, is_scene_id
from bsg_data.sources.source import Reading, SceneRef, SkippedScene, Source

_NOTHING_SKIPPED = "no scene was skipped; repair the source, then run the command again"


class ShardReport(Record):
    """What one shard holds, and what was left out."""

    files: tuple[FileEntry, ...]
    totals: Totals
    skipped: tuple[SkippedScene, ...]
    left_out: tuple[SkippedScene, ...]
    meshes: dict[str, MeshCoverage]
    unmapped: dict[str, int]
    resolved: tuple[ResolvedEntry, ...]


def make_shard(
    source: Source,
    refs: tuple[SceneRef, ...],
    folder: Path,
    part: int,
    class_map: str,
    strict: bool,
) -> ShardReport:
    """Build one shard, unless an earlier run of the same build did."""
    done = read_report(folder, part)
    if done is not None and not (strict and (done.skipped or done.left_out or done.unmapped)):
        return done
    loaded = load_class_map(class_map)
    graphs, skipped, left_out = [], [], []
    meshes: dict[str, MeshCoverage] = {}
    names: Counter[str] = Counter()
    for ref in refs:
        try:
            if not is_scene_id(ref.scene_id):
                raise SourceError(
                    f"{ref.scene_id!r}: is no scene id: it must be usable as a file name"
                )
            reading = _read(source, ref, loaded)
        except SourceChangedError:
            raise
        except SourceError as error:
            if strict:
                raise
            skip = SkippedScene(scene_id=ref.scene_id, location=ref.location, reason=str(error))
            skipped.append(skip_entry(skip, source.path))
            continue
        if reading.left_out and strict:
            raise SourceError(reading.left_out[0].reason)
        graph = reading.graph
        left_out += [skip_entry(skip, source.path) for skip in reading.left_out]
        if reading.mesh is not None:
            meshes[ref.scene_id] = reading.mesh
        unknown = [obj.raw_category for obj in graph.objects if obj.category is None]
        if unknown and strict:
            raise UnmappedNameError(_unmapped_message(ref, unknown[0], loaded))
        names.update(obj.raw_category for obj in graph.objects)
        graphs.append(graph)
    report = ShardReport(
        files=write_shards(graphs, folder, part=part, class_space=loaded.space),
        totals=_total(graphs),
        skipped=tuple(skipped),
        left_out=tuple(left_out),
        meshes=meshes,
        unmapped={n: times for n, times in names.items() if not loaded.classify(n).category},
        resolved=tuple(list_resolved(names, loaded)),
    )
    partial = folder / f"{_name_report(part)}.{uuid4().hex}"  # two machines may make one shard
    partial.write_text(report.model_dump_json(), "utf-8")
    partial.replace(folder / _name_report(part))
    return report


def _read(source: Source, ref: SceneRef, class_map: ClassMap) -> Reading:
    """Read one scene; unexpected errors of the source are raised again with the scene's name."""
    try:
        return source.read(ref, class_map)
    except SourceChangedError as error:
        raise SourceChangedError(f"{error}; {_NOTHING_SKIPPED}") from error
    except (BSGError, OSError) as error:
        failed = find_io_error(error)
        if failed is not None:
            raise SourceChangedError(
                f"{source.path}: scene {ref.scene_id} ({ref.location}) cannot be read now "
                f"({failed.strerror or failed}); {_NOTHING_SKIPPED}"
            ) from error
        if isinstance(error, OSError):
            raise SourceError(
                f"{ref.location}: cannot be read ({error.strerror or error})"
            ) from error
        raise
    except Exception as error:
        raise RuntimeError(
            f"the source {source.kind!r} has a bug: scene {ref.scene_id!r} ({ref.location}) "
            f"raised {error!r}"
        ) from error


def skip_entry(skip: SkippedScene, root: Path) -> SkippedScene:
    """Return the manifest's entry of a skipped scene, without paths of this machine."""
    reason = skip.reason.replace(f"{root}/{skip.location}", "").lstrip(" ,:")
    reason = reason.replace(f"{root}/", "")
    return replace(skip, reason=reason)


def read_report(folder: Path, part: int) -> ShardReport | None:
    """Return the report of a finished shard; None if its files changed or it has none."""
    try:
        report = ShardReport.model_validate_json((folder / _name_report(part)).read_bytes())
        sound = all(hash_file(folder / entry.path) == entry.sha256 for entry in report.files)
    except (OSError, ValidationError):
        return None
    return report if sound else None


def is_reported(folder: Path, part: int) -> bool:
    """Say whether a shard has a report; its files are not checked."""
    return (folder / _name_report(part)).is_file()


def _name_report(part: int) -> str:
    return f"{BUILD}/part-{part:05d}.json"


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


def _unmapped_message(ref: SceneRef, name: str, class_map: ClassMap) -> str:
    near = ", ".join(repr(n) for n in class_map.nearest(name)) or "none"
    return (
        f"{ref.location}: {name!r} is not in class map {class_map.version} (nearest: {near}); "
        "leave --strict out to keep such objects without a class, or use a map that lists it"
    )
