"""Merge datasets of one class space into one, with one shard of each in memory at a time."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Sequence
from itertools import islice
from typing import TypeVar

from bsg_data.build import name_generator
from bsg_data.dataset.commit import DATASET, publish
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import (
    FileEntry,
    Manifest,
    ResolvedEntry,
    SourceEntry,
    Totals,
    UnknownLabel,
    UnmappedEntry,
    add_fingerprints,
    count_shards,
    read_manifest,
    require_class_space,
)
from bsg_data.dataset.scenes import make_tables
from bsg_data.dataset.shards import write_shards
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import AnyPath, resolve_links
from bsg_data.places import require_free
from bsg_data.results import write_folder

_Entry = TypeVar("_Entry", UnmappedEntry, ResolvedEntry, UnknownLabel)


def merge_datasets(
    datasets: Sequence[AnyPath],
    out: AnyPath,
    *,
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Manifest:
    """Merge datasets into one, and return its manifest.

    Rows keep their source. Splits and pairs are not copied, because a training building of one
    dataset could be a test building of another. A shard has as many scenes as one of the dataset
    with the largest. The order of the datasets does not change the bytes.

    Args:
        datasets: two or more datasets of one class space.
        out: folder of the merged dataset: absent, empty, or, with `force`, a dataset to replace.
        force: replace a finished dataset; it stays until the new one is finished.
        progress: called with (scenes done, scenes in all).

    Raises:
        RecipeError: for fewer than two datasets, or too many shards.
        MismatchError: if two datasets have different class spaces.
        DatasetError: if two datasets hold the same building, one is unreadable, or `out` is taken
            or cannot be written.
    """
    out = resolve_links(out)
    require_free(out, DATASET, force=force)
    if len(datasets) < 2:
        message = f"expected two or more datasets to merge, found {len(datasets)}"
        raise RecipeError(message, code="too-few-datasets")
    opened = sorted((Dataset.open(path) for path in datasets), key=lambda data: data.sha256)
    for one in opened:
        require_class_space(opened[0].manifest, one.manifest.class_space, what=str(one.path))
    scenes = sum(one.manifest.totals.scenes for one in opened)
    merged = _combine_manifests([one.manifest for one in opened])
    size = merged.scenes_per_shard
    count_shards(scenes, scenes_per_shard=size)
    _refuse_shared_buildings(opened)
    plan = merged.model_dump_json().encode()
    with write_folder(out, DATASET, plan=plan, force=force) as (folder, done):
        if done:
            return read_manifest(out)
        for one in opened:
            for entry in one.manifest.class_maps:
                entry.copy_map(one.path, folder)
        parts = (one.read_graphs() for one in opened)
        graphs = heapq.merge(*parts, key=lambda graph: graph.scene_id)
        files: list[FileEntry] = []
        for number, first in enumerate(range(0, scenes, size)):
            batch = list(islice(graphs, size))
            space = merged.class_space
            tables = make_tables(batch, space.classes)
            files += write_shards(tables, folder, number=number, class_space=space)
            if progress is not None:
                progress(first + len(batch), scenes)
        in_order = tuple(sorted(files, key=lambda entry: entry.path))
        merged = merged.model_copy(update={"files": in_order})
        publish(folder, merged)
    return merged


def _combine_manifests(manifests: Sequence[Manifest]) -> Manifest:
    """Return the manifest of a dataset that holds what several hold, with all their files."""
    sources = [source for one in manifests for source in one.sources]
    return Manifest(
        generator=name_generator(),
        class_space=manifests[0].class_space,
        sources=tuple(_join_sources(sources)),
        scenes_per_shard=max(one.scenes_per_shard for one in manifests),
        totals=Totals.sum(one.totals for one in manifests),
        files=tuple(sorted((f for one in manifests for f in one.files), key=lambda f: f.path)),
        skipped=tuple(skip for one in manifests for skip in one.skipped),
        left_out=tuple(skip for one in manifests for skip in one.left_out),
        meshes={scene: mesh for one in manifests for scene, mesh in one.meshes.items()},
        unmapped=_add_up(entry for one in manifests for entry in one.unmapped),
        resolved=_add_up(entry for one in manifests for entry in one.resolved),
        unknown_labels=_add_up(entry for one in manifests for entry in one.unknown_labels),
    )


def _join_sources(sources: Iterable[SourceEntry]) -> list[SourceEntry]:
    """Return the sources, those that differ in their annotations alone as one, in an order."""
    found: dict[str, list[SourceEntry]] = {}
    for source in sources:
        found.setdefault(source.model_dump_json(exclude={"fingerprint"}), []).append(source)
    return [
        same[0].model_copy(update={"fingerprint": add_fingerprints(s.fingerprint for s in same)})
        for _, same in sorted(found.items())
    ]


def _add_up(entries: Iterable[_Entry]) -> tuple[_Entry, ...]:
    """Add up the objects of equal names, most frequent first."""
    found: dict[str, _Entry] = {}
    for entry in entries:
        key = entry.model_dump_json(exclude={"instances", "nearest"})
        there = found.setdefault(key, entry.model_copy(update={"instances": 0}))
        found[key] = there.model_copy(update={"instances": there.instances + entry.instances})
    return tuple(sorted(found.values(), key=lambda entry: (-entry.instances, entry.name)))


def _refuse_shared_buildings(datasets: Sequence[Dataset]) -> None:
    """Refuse a building that two datasets hold: a model could train and be tested on it."""
    found: dict[str, int] = {}
    for number, one in enumerate(datasets):
        for scene, key in zip(one.scene_ids, one.keys, strict=True):
            first = min(found.setdefault(name, number) for name in (scene, key))
            if first != number:
                raise DatasetError(
                    f"{one.path}: building {scene} is also in {datasets[first].path}; build one of "
                    "the datasets without it",
                    code="building-twice",
                    where=scene,
                )
