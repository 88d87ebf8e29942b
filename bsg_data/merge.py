"""Merge datasets of one class space, and rewrite a dataset of an earlier format.

Both read scene graphs with one shard in memory at a time. They write new shards beside the result,
and one rename moves them there.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from itertools import islice
from pathlib import Path

from bsg_data.build import SCENES_PER_SHARD
from bsg_data.dataset.growth import (
    finish,
    make_parent,
    open_partial,
    recall,
    refuse_overwriting,
    refuse_place,
    remove_growing,
)
from bsg_data.dataset.kept_maps import copy_class_maps
from bsg_data.dataset.manifest import (
    MANIFEST,
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
from bsg_data.dataset.replacement import is_settled, settle
from bsg_data.dataset.schema import FORMAT_VERSION
from bsg_data.dataset.shards import read_scene_graphs, read_table, write_shards
from bsg_data.dataset.splits import write_splits
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import AnyPath, resolve_links
from bsg_data.lock import hold
from bsg_data.observation.pairs import rewrite_pairs
from bsg_data.recipes import Record
from bsg_data.scene.scene_graph import SceneGraph
from bsg_data.scene.scene_id import building_hash


class MergeRecipe(Record):
    """What determines the bytes of a merged dataset: the hashes of the manifests."""

    generator: str
    parts: tuple[str, ...]
    scenes_per_shard: ScenesPerShard


@dataclass(frozen=True, slots=True)
class MergedPart:
    """One dataset of a merge. Later changes to it are refused.

    Attributes:
        dataset: folder of the dataset.
        manifest: its manifest.
        sha256: hash of the manifest.
    """

    dataset: Path
    manifest: Manifest
    sha256: str

    @classmethod
    def open(cls, dataset: Path) -> MergedPart:
        """Read the manifest of a dataset."""
        return cls(dataset, *read_hashed_manifest(dataset))


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
    refuse_place(out)
    places = [Path(one) for one in datasets]
    if len(places) < 2:
        raise RecipeError(f"expected two or more datasets to merge, found {len(places)}")
    parts = sorted(map(MergedPart.open, places), key=lambda part: part.sha256)
    for part in parts:
        first = parts[0].manifest
        require_class_space(first, part.manifest.class_space, what=str(part.dataset))
    scenes = sum(part.manifest.totals.scenes for part in parts)
    count_shards(scenes, scenes_per_shard=scenes_per_shard)
    _refuse_shared_buildings(parts)
    merged = _combine([part.manifest for part in parts], scenes_per_shard=scenes_per_shard)
    if is_settled(out):
        refuse_overwriting(out, force=force)
    make_parent(out)
    with hold(out):
        return _rewrite(parts, out, merged, force=force, progress=progress)


def upgrade_dataset(
    dataset: AnyPath, *, progress: Callable[[int, int], None] | None = None
) -> Manifest:
    """Rewrite a dataset of format version 1 as version 2, and return its manifest.

    Split and pairs stay the same. The old dataset stays until the new one is complete.

    Raises:
        DatasetError: if it cannot be read or replaced.
    """
    dataset = resolve_links(dataset)
    manifest = read_manifest(dataset)
    if manifest.format_version == FORMAT_VERSION and is_settled(dataset):
        return manifest
    refuse_place(dataset)
    with hold(dataset):
        settle(dataset)
        part = MergedPart.open(dataset)  # read again: it may have changed
        if part.manifest.format_version == FORMAT_VERSION:
            return part.manifest
        upgraded = part.manifest.model_copy(
            update={"format_version": FORMAT_VERSION, "generator": _generator()}
        )
        return _rewrite([part], dataset, upgraded, force=True, progress=progress)


def _generator() -> str:
    return f"belief-scene-graphs {version('belief-scene-graphs')}"


def _refuse_shared_buildings(parts: Sequence[MergedPart]) -> None:
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
                    "one of the datasets without it"
                )


def _combine(manifests: Sequence[Manifest], *, scenes_per_shard: int) -> Manifest:
    """Return the manifest of merged datasets, without its files."""
    sources = {source.model_dump_json(): source for one in manifests for source in one.sources}
    totals = {
        name: sum(getattr(one.totals, name) for one in manifests) for name in Totals.model_fields
    }
    return Manifest(
        generator=_generator(),
        class_space=manifests[0].class_space,
        sources=tuple(sources[key] for key in sorted(sources)),
        scenes_per_shard=scenes_per_shard,
        totals=Totals(**totals),
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


def _rewrite(
    parts: Sequence[MergedPart],
    out: Path,
    manifest: Manifest,
    *,
    force: bool,
    progress: Callable[[int, int], None] | None,
) -> Manifest:
    """Write the scenes of several datasets as one; the caller holds the lock.

    Args:
        parts: the datasets.
        out: the place of the new one.
        manifest: what it is, but for its files.
        force: replace a finished dataset.
        progress: called with (scenes done, scenes in all).
    """
    recipe = MergeRecipe(
        generator=manifest.generator,
        parts=tuple(part.sha256 for part in parts),
        scenes_per_shard=manifest.scenes_per_shard,
    )
    done = recall(out, recipe)
    if done is not None:
        return done
    refuse_overwriting(out, force=force)
    growing = open_partial(out, recipe)
    try:
        files = _write_tables(parts, growing, manifest, progress=progress)
        written = manifest.model_copy(update={"files": files})
        finish(out, written, force=force)
    except BaseException:
        if not (growing / MANIFEST).is_file():  # the next merge starts again
            with suppress(DatasetError):
                remove_growing(out)
        raise
    return written


def _write_tables(
    parts: Sequence[MergedPart],
    folder: Path,
    manifest: Manifest,
    *,
    progress: Callable[[int, int], None] | None,
) -> tuple[FileEntry, ...]:
    """Write class maps, scenes, split and pairs; return the entries of the files, by path."""
    for part in parts:
        copy_class_maps(part.dataset, part.manifest, folder)
    files = _write_scenes(parts, folder, manifest, progress=progress)
    first = parts[0]
    if manifest.split is not None:
        files += write_splits(first.dataset, folder, manifest, old=first.manifest)
    if manifest.pairs is not None:
        files += rewrite_pairs(first.dataset, folder, manifest, old=first.manifest)
    return tuple(sorted(files, key=lambda entry: entry.path))


def _write_scenes(
    parts: Sequence[MergedPart],
    folder: Path,
    manifest: Manifest,
    *,
    progress: Callable[[int, int], None] | None,
) -> list[FileEntry]:
    """Write all scenes in the order of their ids, some at a time."""
    scenes = (read_scene_graphs(part.dataset, manifest=part.manifest) for part in parts)
    graphs = heapq.merge(*scenes, key=lambda graph: graph.scene_id)
    files: list[FileEntry] = []
    for number, batch in enumerate(_batches(graphs, manifest.scenes_per_shard)):
        files += write_shards(batch, folder, part=number, class_space=manifest.class_space)
        if progress is not None:
            done = min((number + 1) * manifest.scenes_per_shard, manifest.totals.scenes)
            progress(done, manifest.totals.scenes)
    return files


def _batches(graphs: Iterator[SceneGraph], size: int) -> Iterator[list[SceneGraph]]:
    while batch := list(islice(graphs, size)):
        yield batch
