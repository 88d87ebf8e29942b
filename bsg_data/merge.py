"""Merge datasets of one class space into one, with one shard of each in memory at a time."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from itertools import islice

from bsg_data.build import SCENES_PER_SHARD, combine_manifests
from bsg_data.dataset.commit import growing, put_in_place, require_place
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import (
    FileEntry,
    Manifest,
    count_shards,
    read_manifest,
    require_class_space,
)
from bsg_data.dataset.shards import read_scene_graphs, write_shards
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import AnyPath, resolve_links
from bsg_data.scene.scene_graph import building_hash


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
    parts = sorted((Dataset.open(one) for one in datasets), key=lambda part: part.sha256)
    for part in parts:
        require_class_space(parts[0].manifest, part.manifest.class_space, what=str(part.path))
    scenes = sum(part.manifest.totals.scenes for part in parts)
    count_shards(scenes, scenes_per_shard=scenes_per_shard)  # an impossible number is refused
    _refuse_shared_buildings(parts)
    merged = combine_manifests([part.manifest for part in parts], scenes_per_shard=scenes_per_shard)
    with growing(out, merged, force=force) as (folder, done):
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
        put_in_place(out, merged)
        return merged


def _refuse_shared_buildings(parts: Sequence[Dataset]) -> None:
    """Refuse a building that two datasets hold: a model could train and be tested on it."""
    found: dict[str, int] = {}
    for number, part in enumerate(parts):
        for scene in part.scene_ids:
            first = found.setdefault(building_hash(scene), number)
            if first != number:
                raise DatasetError(
                    f"{part.path}: building {scene} is also in {parts[first].path}; build one of "
                    "the datasets without it",
                    code="building-twice",
                    where=scene,
                )
