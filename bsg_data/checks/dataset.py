"""Check that a dataset agrees with its manifest, and its tables with each other.

Nothing here trusts the writer: every fact is read again from the files.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest
from pathlib import Path

import pyarrow as pa

from bsg_data.checks.edges import check_edges
from bsg_data.checks.nodes import ObjectCheck, check_rooms
from bsg_data.checks.pairs import PairCheck
from bsg_data.checks.part import Fault, FileReader, Part
from bsg_data.checks.scenes import Census, check_scenes, check_splits
from bsg_data.dataset.commit import is_own, list_strays
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.kept_maps import KEPT
from bsg_data.dataset.manifest import (
    CARD,
    CROISSANT,
    MANIFEST,
    FileEntry,
    Manifest,
    read_card_hashes,
    read_hashed_manifest,
)
from bsg_data.dataset.schema import TABLES
from bsg_data.errors import ClassMapError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.inputs.bounds import DATASET_CARD
from bsg_data.observation.pairs import split_of_file
from bsg_data.scene.class_map import load_class_map, published_maps
from bsg_data.scene.class_space import list_class_spaces, load_class_space


def check_dataset(
    dataset: AnyPath, *, progress: Callable[[int, int], None] | None = None
) -> tuple[Fault, ...]:
    """Return all faults of a dataset; an empty list means that it is sound.

    Memory holds one part of the tables or one file of pairs at a time, and a few words per scene.

    Args:
        dataset: folder of the dataset.
        progress: called with (files done, files in all).

    Raises:
        DatasetError: if the manifest is unreadable, so nothing can be compared with it.
    """
    dataset = Path(dataset)
    manifest, sha256 = read_hashed_manifest(dataset)
    files = FileReader(dataset, manifest, progress)
    faults = [*_check_classes(manifest), *_check_kept_maps(dataset, manifest)]
    faults += _check_strays(dataset, manifest)
    faults += _check_recipes(manifest)
    census = Census()
    faults += _check_tables(files, manifest, census)
    splits = [files.read(entry) for entry in manifest.files_of("splits")]
    if not files.faults:
        faults += census.compare(manifest)
    if not (faults or files.faults) and manifest.split is not None:
        table = pa.concat_tables(splits)
        faults += check_splits(table, census, manifest.split)
        faults += _check_pairs(files, Dataset(dataset, manifest, sha256), table)
    return tuple(dict.fromkeys([*faults, *files.faults]))


def _check_tables(files: FileReader, manifest: Manifest, census: Census) -> Iterator[Fault]:
    """Check the rows of all parts, one after another.

    Parts with a damaged file are skipped; that file is a fault already.
    """
    entries = {name: manifest.files_of(name) for name in TABLES}
    numbers = {name: len(some) for name, some in entries.items()}
    if len(set(numbers.values())) > 1:
        found = ", ".join(f"{number} of {name}" for name, number in numbers.items())
        yield Fault(MANIFEST, f"expected as many parts of each table, found {found}")
    objects = ObjectCheck(manifest)
    for number, row in enumerate(zip_longest(*entries.values())):
        read = [None if entry is None else files.read(entry) for entry in row]
        tables = {name: table for name, table in zip(TABLES, read, strict=True) if table}
        if len(tables) == len(TABLES):
            yield from _check_part(Part.of(number, tables), census, objects)
    yield from objects.faults


def _check_part(part: Part, census: Census, objects: ObjectCheck) -> Iterator[Fault]:
    """Check one part; if its rows belong to other scenes, check nothing else."""
    faults = list(census.add(part))
    if len(set(part.scene_ids)) == len(part.scene_ids):
        faults += check_scenes(part)
    yield from faults
    if not faults:
        yield from objects.add(part)
        yield from check_rooms(part)
        yield from check_edges(part)


def _check_pairs(files: FileReader, data: Dataset, splits: pa.Table) -> Iterator[Fault]:
    """Check the pairs file by file against their parts of the tables."""
    manifest = data.manifest
    if manifest.pairs is None:
        return
    split_of = dict(zip(*(splits[name].to_pylist() for name in ("scene_id", "split")), strict=True))
    pairs = PairCheck(data, split_of, manifest.pairs)
    for entry in _by_place(manifest.files_of("pairs")):
        table = files.read(entry)
        if table is not None:
            yield from pairs.add(entry, table)
    yield from pairs.finish()


def _by_place(pairs: Sequence[FileEntry]) -> list[FileEntry]:
    """Return the files of pairs, sorted by their position in their split.

    Every split has its scenes in order, so files of the same parts become neighbours.
    """
    sizes = Counter(split_of_file(entry.path) for entry in pairs)
    seen: Counter[str] = Counter()
    places = []
    for entry in pairs:
        split = split_of_file(entry.path)
        places.append(seen[split] / sizes[split])
        seen[split] += 1
    return [entry for _, entry in sorted(zip(places, pairs, strict=True), key=lambda row: row[0])]


def _check_recipes(manifest: Manifest) -> Iterator[Fault]:
    """Check that every recipe has files, and that all files have a recipe."""
    for table, recipe in (("splits", manifest.split), ("pairs", manifest.pairs)):
        if bool(manifest.files_of(table)) != (recipe is not None):
            yield Fault(MANIFEST, f"has a recipe of {table} without files, or files without one")
    for table in TABLES:
        if not manifest.files_of(table):
            yield Fault(MANIFEST, f"lists no file of {table}")


def _check_classes(manifest: Manifest) -> Iterator[Fault]:
    """Compare class space and class maps with the published ones of the same names."""
    space = manifest.class_space
    try:
        if space.name in list_class_spaces() and space != load_class_space(space.name):
            yield Fault(MANIFEST, f"class space {space.name} is not the published one")
        for ours in manifest.class_maps:
            if ours.version in published_maps():
                published = load_class_map(ours.version).sha256
                if published != ours.sha256:
                    yield Fault(
                        MANIFEST,
                        f"class map {ours.version} is not the published one: expected sha256 "
                        f"{published}, found {ours.sha256}",
                    )
    except ClassMapError as error:
        yield Fault(MANIFEST, str(error))


def _check_kept_maps(dataset: Path, manifest: Manifest) -> Iterator[Fault]:
    """Compare the class maps that the dataset keeps with their hashes."""
    try:
        for entry in manifest.class_maps:
            entry.read(dataset)
    except ClassMapError as error:
        yield Fault(KEPT, str(error))


def _check_strays(dataset: Path, manifest: Manifest) -> Iterator[Fault]:
    for name in list_strays(dataset, manifest):
        if is_own(name):
            yield Fault(
                name,
                "is not in the manifest: a command was stopped here; the next command that changes "
                "the dataset removes it",
            )
        else:
            yield Fault(name, "is not in the manifest and not of this program; move it away")
    for name in (CARD, CROISSANT):
        if not (dataset / name).is_file():
            yield Fault(name, "is missing; build, split or pairs writes it again")
    for name, expected in read_card_hashes(dataset).items():
        if not (dataset / name).is_file():
            continue
        try:
            found = hash_file(dataset / name, DATASET_CARD)
        except OSError as error:
            yield Fault(name, f"cannot be read ({error.strerror or error})")
            continue
        if found != expected:
            yield Fault(name, f"was changed: expected sha256 {expected[:12]}…, found {found[:12]}…")
