"""Check that a dataset is what its manifest says, and that the tables agree with each other.

Nothing here trusts the writer: every fact is read again from the files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.checks.faults import Fault
from bsg_data.checks.pairs import PairTruth, check_every_scene_has_pairs, check_splits
from bsg_data.checks.tables import (
    check_edges,
    check_meshes,
    check_objects,
    check_parts,
    check_rooms,
    check_scenes,
)
from bsg_data.dataset.kept_maps import KEPT, read_class_maps
from bsg_data.dataset.manifest import (
    MANIFEST,
    ClassSpaceEntry,
    FileEntry,
    Manifest,
    read_manifest,
)
from bsg_data.dataset.publication import CARD, CROISSANT, list_strays
from bsg_data.dataset.schema import TABLES
from bsg_data.dataset.shards import check_file_metadata, describe_file, schema_of, to_current
from bsg_data.errors import BSGError, ClassMapError
from bsg_data.observation.pairs import fits_pairs
from bsg_data.scene.class_map import load_class_map, published_maps
from bsg_data.scene.class_space import list_class_spaces, load_class_space


def check_dataset(
    dataset: Path, *, progress: Callable[[int, int], None] | None = None
) -> tuple[Fault, ...]:
    """Return every fault of a dataset; none for a sound one.

    Raises:
        DatasetError: if the manifest cannot be read, so that there is nothing to check against.
    """
    manifest = read_manifest(dataset)
    faults = [*_check_classes(manifest), *_check_kept_maps(dataset, manifest)]
    faults += _check_strays(dataset, manifest)
    faults += _check_recipes(manifest)
    tables: dict[str, list[pa.Table]] = {}
    pairs = manifest.files_of("pairs")
    for done, entry in enumerate((f for f in manifest.files if f not in pairs), start=1):
        file_faults, table = _check_file(dataset, entry, manifest)
        faults += file_faults
        if table is not None:
            tables.setdefault(_table_of(entry), []).append(table)
        if progress is not None:
            progress(done, len(manifest.files))
    if faults:  # the rows of a damaged file would only raise more of the same
        return tuple(faults)
    faults += check_parts(tables)
    frames = {name: pa.concat_tables(tables[name]).to_pandas() for name in TABLES}
    faults += check_scenes(frames, manifest)
    if faults:
        return tuple(faults)
    faults += [*check_objects(frames, manifest), *check_rooms(frames), *check_edges(frames)]
    faults += check_meshes(manifest, frames["scenes"])
    if faults or manifest.split is None:
        return tuple(faults)
    splits = pa.concat_tables(tables["splits"]).to_pandas()
    faults += check_splits(splits, frames["scenes"], manifest.split)
    truth = PairTruth(frames, splits, manifest)
    # What the format cannot hold is left out of it, and counts as held.
    held = [scene for scene, cells in truth.cells.items() if not fits_pairs(cells)]
    for done, entry in enumerate(pairs, start=len(manifest.files) - len(pairs) + 1):
        file_faults, table = _check_file(dataset, entry, manifest)  # one file in memory at a time
        faults += file_faults
        if table is not None:
            faults += truth.check(entry, table)
            held += table["scene_id"].unique().to_pylist()
        if progress is not None:
            progress(done, len(manifest.files))
    if manifest.pairs is not None:
        faults += check_every_scene_has_pairs(held, splits)
    return tuple(faults)


def _check_recipes(manifest: Manifest) -> Iterator[Fault]:
    """A recipe without files, or files without a recipe, would go unchecked."""
    for table, recipe in (("splits", manifest.split), ("pairs", manifest.pairs)):
        if bool(manifest.files_of(table)) != (recipe is not None):
            yield Fault(MANIFEST, f"has a recipe of {table} without files, or files without one")
    for table in TABLES:
        if not manifest.files_of(table):
            yield Fault(MANIFEST, f"lists no file of {table}")


def _check_classes(manifest: Manifest) -> Iterator[Fault]:
    """Compare class space and class maps with those that are published under their names."""
    space = manifest.class_space
    try:
        if space.name in list_class_spaces() and space != ClassSpaceEntry.of(
            load_class_space(space.name)
        ):
            yield Fault(MANIFEST, f"class space {space.name} is not the published one")
        for ours in {source.class_map for source in manifest.sources}:
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
        read_class_maps(dataset, manifest)
    except ClassMapError as error:
        yield Fault(KEPT, str(error))


def _check_strays(dataset: Path, manifest: Manifest) -> Iterator[Fault]:
    for name in list_strays(dataset, manifest):
        yield Fault(name, "is not in the manifest: left by a stopped command, or put there")
    for name in (CARD, CROISSANT):
        if not (dataset / name).is_file():
            yield Fault(name, "is missing; any of build, split or pairs writes it again")


def _table_of(entry: FileEntry) -> str:
    return entry.path.split("/")[0].removesuffix(".parquet")


def _check_file(
    dataset: Path, entry: FileEntry, manifest: Manifest
) -> tuple[list[Fault], pa.Table | None]:
    path = dataset / entry.path
    if not path.is_file():
        return [Fault(entry.path, "is in the manifest but not there")], None
    faults = []
    try:
        actual = describe_file(dataset, entry.path, rows=entry.rows)
        if actual != entry:
            faults.append(
                Fault(
                    entry.path,
                    f"was changed: expected {entry.bytes} bytes, sha256 {entry.sha256[:12]}…, "
                    f"found {actual.bytes} bytes, sha256 {actual.sha256[:12]}…",
                )
            )
        table = pq.ParquetFile(path).read()
        check_file_metadata(path, table.schema, manifest)
    except BSGError as error:
        return [*faults, Fault(entry.path, str(error))], None
    except (OSError, pa.ArrowInvalid) as error:
        return [*faults, Fault(entry.path, f"is not readable parquet: {error}")], None
    expected = schema_of(_table_of(entry), manifest)
    if not table.schema.equals(expected, check_metadata=False):
        faults.append(Fault(entry.path, f"expected the columns\n{expected}\nfound\n{table.schema}"))
        return faults, None
    if len(table) != entry.rows:
        faults.append(Fault(entry.path, f"expected {entry.rows} rows, found {len(table)}"))
    faults += [
        Fault(entry.path, f"column {field.name} has nulls and must not")
        for field in expected
        if not field.nullable and table[field.name].null_count
    ]
    return faults, None if faults else to_current(path, table, manifest)
