"""Merge datasets of one class space into one, with one shard of each in memory at a time."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import islice
from pathlib import Path

from bsg_data.build import SCENES_PER_SHARD
from bsg_data.dataset.commit import growing, put_in_place, require_place
from bsg_data.dataset.manifest import (
    FileEntry,
    Manifest,
    ResolvedEntry,
    ScenesPerShard,
    Totals,
    UnmappedEntry,
    count_shards,
    read_hashed_manifest,
    read_manifest,
    require_class_space,
)
from bsg_data.dataset.shards import read_scene_graphs, read_table, write_shards
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import AnyPath, resolve_links
from bsg_data.recipes import Record
from bsg_data.scene.scene_graph import building_hash


class _MergePlan(Record):
    """All that determines the bytes of a merged dataset; `parts` are hashes of manifests."""

    generator: str
    parts: tuple[str, ...]
    scenes_per_shard: ScenesPerShard


@dataclass(frozen=True, slots=True)
class _Part:
    """One dataset of a merge, with its manifest and the hash of that."""

    dataset: Path
    manifest: Manifest
    sha256: str


def merge_datasets(
    datasets: Sequence[AnyPath],
    out: AnyPath,
    *,
    force: bool = False,
    scenes_per_shard: int = SCENES_PER_SHARD,
    progress: Callable[[int, int], None] | None = None,
) -> Manifest:
    """Merge datasets into one, and return its manifest.

    Rows keep their source. Splits and pairs are not copied, because a training building of one
    dataset could be a test building of another. The order of the datasets does not change the
    bytes.

    Args:
        datasets: two or more datasets of one class space.
        out: folder of the merged dataset: absent, empty, or, with `force`, a dataset to replace.
        force: replace a finished dataset; it stays until the new one is finished.
        scenes_per_shard: number of scenes in each part of a table.
        progress: called with (scenes done, scenes in all).

    Raises:
        RecipeError: for fewer than two datasets, or an impossible `scenes_per_shard`.
        MismatchError: if two datasets have different class spaces.
        DatasetError: if two datasets hold the same building, one is unreadable, or `out` is taken
            or cannot be written.
    """
    out = resolve_links(out)
    require_place(out, force=force)
    if len(datasets) < 2:
        message = f"expected two or more datasets to merge, found {len(datasets)}"
        raise RecipeError(message, code="too-few-datasets")
    parts = sorted(
        (_Part(Path(one), *read_hashed_manifest(Path(one))) for one in datasets),
        key=lambda part: part.sha256,
    )
    for part in parts:
        require_class_space(parts[0].manifest, part.manifest.class_space, what=str(part.dataset))
    scenes = sum(part.manifest.totals.scenes for part in parts)
    count_shards(scenes, scenes_per_shard=scenes_per_shard)  # an impossible number is refused
    _refuse_shared_buildings(parts)
    merged = _combine([part.manifest for part in parts], scenes_per_shard=scenes_per_shard)
    plan = _MergePlan(
        generator=merged.generator,
        parts=tuple(part.sha256 for part in parts),
        scenes_per_shard=scenes_per_shard,
    )
    with growing(out, plan, force=force) as (folder, done):
        if done:
            return read_manifest(out)
        for part in parts:
            for entry in part.manifest.class_maps:
                entry.copy_map(part.dataset, folder)
        files = _write_scenes(parts, folder, merged, progress)
        merged = merged.model_copy(update={"files": files})
        put_in_place(out, merged)
        return merged


def _write_scenes(
    parts: Sequence[_Part],
    folder: Path,
    manifest: Manifest,
    progress: Callable[[int, int], None] | None,
) -> tuple[FileEntry, ...]:
    """Write all scenes in the order of their ids; return the entries of the files, by path."""
    scenes = (read_scene_graphs(part.dataset, manifest=part.manifest) for part in parts)
    graphs = heapq.merge(*scenes, key=lambda graph: graph.scene_id)
    files: list[FileEntry] = []
    done = 0
    while batch := list(islice(graphs, manifest.scenes_per_shard)):
        number = done // manifest.scenes_per_shard
        files += write_shards(batch, folder, part=number, class_space=manifest.class_space)
        done += len(batch)
        if progress is not None:
            progress(done, manifest.totals.scenes)
    return tuple(sorted(files, key=lambda entry: entry.path))


def _refuse_shared_buildings(parts: Sequence[_Part]) -> None:
    """Refuse a building that two datasets hold: a model could train and be tested on it."""
    found: dict[str, int] = {}
    for number, part in enumerate(parts):
        columns = ["scene_id"]
        table = read_table(part.dataset, "scenes", columns=columns, manifest=part.manifest)
        for scene in table["scene_id"].to_pylist():
            first = found.setdefault(building_hash(scene), number)
            if first != number:
                raise DatasetError(
                    f"{part.dataset}: building {scene} is also in {parts[first].dataset}; build "
                    "one of the datasets without it",
                    code="building-twice",
                    where=scene,
                )


def _combine(manifests: Sequence[Manifest], *, scenes_per_shard: int) -> Manifest:
    """Return the manifest of merged datasets, without its files."""
    sources = {source.model_dump_json(): source for one in manifests for source in one.sources}
    return Manifest(
        generator=f"belief-scene-graphs {version('belief-scene-graphs')}",
        class_space=manifests[0].class_space,
        sources=tuple(sources[key] for key in sorted(sources)),
        scenes_per_shard=scenes_per_shard,
        totals=Totals.sum(one.totals for one in manifests),
        files=(),
        skipped=tuple(skip for one in manifests for skip in one.skipped),
        left_out=tuple(skip for one in manifests for skip in one.left_out),
        meshes={scene: mesh for one in manifests for scene, mesh in one.meshes.items()},
        unmapped=tuple(_add_unmapped(entry for one in manifests for entry in one.unmapped)),
        resolved=tuple(_add_resolved(entry for one in manifests for entry in one.resolved)),
    )


def _add_unmapped(entries: Iterable[UnmappedEntry]) -> Iterator[UnmappedEntry]:
    times: Counter[str] = Counter()
    first: dict[str, UnmappedEntry] = {}
    for entry in entries:
        times[entry.name] += entry.instances
        first.setdefault(entry.name, entry)
    for name, instances in sorted(times.items(), key=lambda item: (-item[1], item[0])):
        yield first[name].model_copy(update={"instances": instances})


def _add_resolved(entries: Iterable[ResolvedEntry]) -> Iterator[ResolvedEntry]:
    times: Counter[ResolvedEntry] = Counter()
    for entry in entries:
        times[entry.model_copy(update={"instances": 0})] += entry.instances
    for entry, instances in sorted(times.items(), key=lambda item: (-item[1], item[0].name)):
        yield entry.model_copy(update={"instances": instances})
