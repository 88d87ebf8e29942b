"""Merge datasets of one class space into one, with one shard of each in memory at a time."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import islice
from typing import TypeVar

from bsg_data.build import SCENES_PER_SHARD, name_generator
from bsg_data.dataset.commit import DATASET, publish, sweep
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import (
    FileEntry,
    Manifest,
    ResolvedEntry,
    Totals,
    UnknownLabel,
    UnmappedEntry,
    count_shards,
    read_manifest,
    require_class_space,
)
from bsg_data.dataset.shards import read_scene_graphs, write_shards
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import AnyPath, resolve_links
from bsg_data.results import require_place, write_folder

_Entry = TypeVar("_Entry", UnmappedEntry, ResolvedEntry, UnknownLabel)


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
    require_place(out, DATASET, force=force)
    if len(datasets) < 2:
        message = f"expected two or more datasets to merge, found {len(datasets)}"
        raise RecipeError(message, code="too-few-datasets")
    parts = sorted((Dataset.open(one) for one in datasets), key=lambda part: part.sha256)
    for part in parts:
        require_class_space(parts[0].manifest, part.manifest.class_space, what=str(part.path))
    scenes = sum(part.manifest.totals.scenes for part in parts)
    count_shards(scenes, scenes_per_shard=scenes_per_shard)  # an impossible number is refused
    _refuse_shared_buildings(parts)
    merged = combine_manifests([part.manifest for part in parts], scenes_per_shard=scenes_per_shard)
    plan = merged.model_dump_json().encode()
    with write_folder(out, DATASET, plan=plan, force=force) as (folder, done):
        if done:
            return read_manifest(out)
        for part in parts:
            for entry in part.manifest.class_maps:
                entry.copy_map(part.path, folder)
        graphs = heapq.merge(
            *(read_scene_graphs(part.path, manifest=part.manifest) for part in parts),
            key=lambda graph: graph.scene_id,
        )
        files: list[FileEntry] = []
        for number, first in enumerate(range(0, scenes, scenes_per_shard)):
            batch = list(islice(graphs, scenes_per_shard))
            files += write_shards(batch, folder, part=number, class_space=merged.class_space)
            if progress is not None:
                progress(first + len(batch), scenes)
        files.sort(key=lambda entry: entry.path)
        merged = merged.model_copy(update={"files": tuple(files)})
        sweep(folder, merged)
        publish(folder, merged)
    return merged


def combine_manifests(manifests: Sequence[Manifest], *, scenes_per_shard: int) -> Manifest:
    """Return the manifest of a dataset that holds what several hold, with all their files."""
    sources = {source.model_dump_json(): source for one in manifests for source in one.sources}
    return Manifest(
        generator=name_generator(),
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
        unknown_labels=_add_up(entry for one in manifests for entry in one.unknown_labels),
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


def _refuse_shared_buildings(parts: Sequence[Dataset]) -> None:
    """Refuse a building that two datasets hold: a model could train and be tested on it."""
    found: dict[str, int] = {}
    for number, part in enumerate(parts):
        for scene, key in zip(part.scene_ids, part.keys, strict=True):
            first = found.setdefault(key, number)
            if first != number:
                raise DatasetError(
                    f"{part.path}: building {scene} is also in {parts[first].path}; build one of "
                    "the datasets without it",
                    code="building-twice",
                    where=scene,
                )
