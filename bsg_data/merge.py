"""Merge datasets of one class space into one, with one shard of each in memory at a time."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from itertools import islice

from bsg_data.build import name_generator
from bsg_data.dataset.commit import DATASET, publish
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import (
    FileEntry,
    Manifest,
    combine_manifests,
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
    for data in opened:
        require_class_space(opened[0].manifest, data.manifest.class_space, what=str(data.path))
    scenes = sum(data.manifest.totals.scenes for data in opened)
    merged = combine_manifests([data.manifest for data in opened])
    merged = merged.model_copy(update={"generator": name_generator()})
    size = merged.scenes_per_shard
    count_shards(scenes, scenes_per_shard=size)
    _refuse_shared_buildings(opened)
    plan = merged.model_dump_json().encode()
    with write_folder(out, DATASET, plan=plan, force=force) as (folder, done):
        if done:
            return read_manifest(out)
        for data in opened:
            for entry in data.manifest.class_maps:
                entry.copy_map(data.path, folder)
        parts = (data.read_graphs() for data in opened)
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


def _refuse_shared_buildings(datasets: Sequence[Dataset]) -> None:
    """Refuse a building that two datasets hold: a model could train and be tested on it."""
    found: dict[str, int] = {}
    for number, data in enumerate(datasets):
        for scene, key in zip(data.scene_ids, data.keys, strict=True):
            first = min(found.setdefault(name, number) for name in (scene, key))
            if first != number:
                raise DatasetError(
                    f"{data.path}: building {scene} is also in {datasets[first].path}; build one "
                    "of the datasets without it",
                    code="building-twice",
                    where=scene,
                )
