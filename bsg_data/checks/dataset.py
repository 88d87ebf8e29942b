"""Check that a dataset agrees with its manifest, and its tables with each other.

Every file is read again, and compared with its hash and with the schema. Tables must have the rows
that the manifest and the scenes count, and keep the rules of scene graphs. What a program edited
and hashed again by the rules is not found.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, zip_longest
from pathlib import Path

import pyarrow as pa

from bsg_data.checks.graphs import find_faults
from bsg_data.checks.pairs import check_pairs, check_splits
from bsg_data.dataset.commit import list_strays
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import (
    CARD,
    CROISSANT,
    KEPT,
    MANIFEST,
    FileEntry,
    Manifest,
    Totals,
    hash_manifest,
    read_hashed_manifest,
)
from bsg_data.dataset.scenes import count_totals
from bsg_data.dataset.schema import TABLES
from bsg_data.errors import BSGError, ClassMapError, DatasetError
from bsg_data.files import AnyPath, hold
from bsg_data.scene.class_map import load_class_map, parse_own_map
from bsg_data.scene.class_space import list_class_spaces, load_class_space

_NAMED = 3  # named of each kind of fault; the others are counted
_Tables = Mapping[str, pa.Table]


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of a dataset: where it is, and what is wrong."""

    where: str
    what: str


def check_dataset(
    dataset: AnyPath, *, progress: Callable[[int, int], None] | None = None
) -> tuple[Fault, ...]:
    """Return all faults of a dataset; an empty list means that it is sound.

    Memory holds one shard or one file of pairs at a time, and a few words per scene.

    Args:
        dataset: folder of the dataset.
        progress: called with (files done, files in all).

    Raises:
        DatasetError: if the manifest is unreadable, so nothing can be compared with it; or if
            another command writes the dataset.
    """
    while True:
        manifest, sha256 = read_hashed_manifest(Path(dataset))
        data = Dataset(Path(dataset), manifest, {}, sha256)  # nothing held: all is read again
        strays = list_strays(data.path, manifest)
        faults = _check_once(data, progress)
        if not faults or _is_still(data, strays):
            return faults


def _is_still(data: Dataset, strays: Sequence[str]) -> bool:
    """Say whether no command has written a dataset meanwhile, so that its faults are its own.

    One that had replaced the manifest before removes the old files, which are the `strays`.
    """
    try:
        with hold(data.path):
            pass
    except DatasetError as error:
        if error.code == "folder-busy":
            raise
    is_same = hash_manifest(data.path) == data.sha256
    return is_same and list_strays(data.path, data.manifest) == strays


def _check_once(data: Dataset, progress: Callable[[int, int], None] | None) -> tuple[Fault, ...]:
    check, manifest = _Check(data, progress), data.manifest
    check.faults += _check_files(data.path, manifest)
    scenes = _check_tables(check)
    splits = [check.read(entry) for entry in manifest.files_of("splits")]
    if not check.faults and manifest.split is not None:
        table = pa.concat_tables(splits)
        check.add("splits", check_splits(table, scenes, manifest.split))
        if manifest.pairs is not None and not check.faults:
            check.add("pairs", check_pairs(data, table, check.read))
    return (*dict.fromkeys(check.faults), *check.count_others())


@dataclass(eq=False)
class _Check:
    """A check of a dataset, and the faults found so far."""

    data: Dataset
    progress: Callable[[int, int], None] | None
    faults: list[Fault] = field(default_factory=list)
    _times: Counter[Fault] = field(default_factory=Counter)
    _done: int = 0

    def read(self, entry: FileEntry) -> pa.Table | None:
        """Read a file; None if it has a fault."""
        found: list[str] = []
        try:
            table = self.data.read_file(entry)
            if len(table) != entry.rows:
                found.append(f"expected {entry.rows} rows, found {len(table)}")
            found += [
                f"column {column.name} has nulls and must not"
                for column in table.schema
                if not column.nullable and table[column.name].null_count
            ]
        except BSGError as error:
            found.append(str(error).removeprefix(f"{self.data.path / entry.path}: "))
        self.faults += [Fault(entry.path, what) for what in found]
        self._done += 1
        if self.progress is not None:
            self.progress(self._done, len(self.data.manifest.files))
        return None if found else table

    def add(self, where: str, faults: Iterator[tuple[str, str]]) -> None:
        """Add faults, each a name and a rule: the first names of each rule are kept."""
        for name, rule in faults:
            self._times[Fault(where, rule)] += 1
            if self._times[Fault(where, rule)] <= _NAMED:
                self.faults.append(Fault(where, f"{name}: {rule}"))

    def count_others(self) -> Iterator[Fault]:
        """Yield how many faults of each rule were not named."""
        for fault, times in self._times.items():
            if times > _NAMED:
                yield Fault(fault.where, f"… and {times - _NAMED} more: {fault.what}")


def _check_tables(check: _Check) -> pa.Table:
    """Check the rows of all shards one after another, and return words of all scenes.

    Shards with a damaged file are skipped; that file is a fault already.
    """
    manifest = check.data.manifest
    entries = {name: manifest.files_of(name) for name in TABLES}
    numbers = {name: len(some) for name, some in entries.items()}
    if len(set(numbers.values())) > 1:
        found = ", ".join(f"{number} of {name}" for name, number in numbers.items())
        what = f"expected as many files of each table, found {found}"
        check.faults.append(Fault(MANIFEST, what))
    maps = _check_class_maps(check)
    totals: list[Totals] = []
    scenes: list[pa.Table] = []
    for row in zip_longest(*entries.values()):
        read = [None if entry is None else check.read(entry) for entry in row]
        pairs = zip(TABLES, read, strict=True)
        tables = {name: table for name, table in pairs if table is not None}
        if len(tables) == len(TABLES):
            scenes.append(tables["scenes"])
            totals.append(_check_shard(check, tables, maps))
    every = pa.concat_tables(
        table.select(["scene_id", "building", "source", "source_split", "up_axis"])
        for table in scenes or [TABLES["scenes"].empty_table()]  # which imports pandas
    )
    check.add("scenes", _check_order(every))
    if not check.faults:
        sums = _check_sums(manifest, every, Totals.sum(totals))
        check.faults += [Fault(MANIFEST, what) for what in sums]
    return every


def _check_shard(check: _Check, tables: _Tables, maps: Collection[str]) -> Totals:
    """Check the tables of one shard, and return their sums."""
    scenes = tables["scenes"]
    ids, versions = scenes["scene_id"].to_pylist(), scenes["class_map"].to_pylist()
    if len(set(ids)) < len(ids):
        return Totals()  # the order of the scenes tells
    for scene, version in zip(ids, versions, strict=True):
        if version not in maps:
            check.add("scenes", iter([(scene, "its class map is none of the manifest")]))
    for table, name, rule in find_faults(tables):
        check.add(table, iter([(name, rule)]))
    return count_totals(tables)


def _check_order(every: pa.Table) -> Iterator[tuple[str, str]]:
    """Check that scenes are sorted, and that each building is there once."""
    ids = every["scene_id"].to_pylist()
    scenes = Counter(ids)
    yield from ((scene, "is there twice") for scene, times in scenes.items() if times > 1)
    for before, after in pairwise(ids):
        if after < before:
            yield after, "is not sorted by scene_id"
    keys = every["building"].to_pylist()
    pairs = {(key or scene, scene) for key, scene in zip(keys, ids, strict=True)}
    buildings = Counter(key for key, _ in pairs)
    yield from ((name, "has two scene ids") for name, times in buildings.items() if times > 1)


def _check_sums(manifest: Manifest, scenes: pa.Table, totals: Totals) -> Iterator[str]:
    """Compare what the manifest says of all scenes with them."""
    listed = {source.kind for source in manifest.sources}
    for kind in sorted(set(scenes["source"].to_pylist()) ^ listed):
        yield f"source {kind} is not in both the manifest and the scenes"
    for name, stated in manifest.totals:
        counted = getattr(totals, name)
        if stated != counted:
            yield f"totals.{name}: expected {counted}, found {stated}"
    rows = zip(scenes["scene_id"].to_pylist(), scenes["up_axis"].to_pylist(), strict=True)
    for scene in sorted(
        {scene for scene, axis in rows if axis}.symmetric_difference(manifest.meshes)
    ):
        yield f"{scene}: has a mesh in the manifest but no up_axis, or reverse"
    for scene, mesh in manifest.meshes.items():
        if mesh.texels != mesh.listed + mesh.snapped + mesh.black + mesh.unlisted:
            yield f"{scene}: the texels of its mesh do not add up"
        surface = mesh.listed_area + mesh.unlisted_area + mesh.uncoloured_area
        if not abs(surface - mesh.area) < 0.01:
            yield f"{scene}: the surface of its mesh does not add up"


def _check_class_maps(check: _Check) -> set[str]:
    """Compare class space and class maps with those of the same names; return their versions."""
    manifest, space = check.data.manifest, check.data.manifest.class_space
    if space.name in list_class_spaces() and space != load_class_space(space.name):
        what = f"class space {space.name} is not the published one"
        check.faults.append(Fault(MANIFEST, what))
    nameable: dict[str, tuple[str, ...]] = {}
    for entry in manifest.class_maps:
        try:
            found = entry.read(check.data.path)
        except ClassMapError as error:
            check.faults.append(Fault(KEPT, str(error)))
            continue
        loaded = load_class_map(found) if isinstance(found, str) else parse_own_map(found)
        nameable[entry.sha256] = loaded.nameable
        if loaded.sha256 != entry.sha256 or loaded.classes != space.classes:
            what = f"expected sha256 {loaded.sha256}, found {entry.sha256}"
            what = f"class map {entry.version} is not the published one, or not for {space}: {what}"
            check.faults.append(Fault(MANIFEST, what))
    for source in manifest.sources:
        told = space.classes if source.nameable is None else source.nameable
        version, sha256 = source.class_map.version, source.class_map.sha256
        if set(told) != set(nameable.get(sha256, told)):
            what = f"nameable of {source.kind} are not the classes of {version}"
            check.faults.append(Fault(MANIFEST, what))
    return {entry.version for entry in manifest.class_maps}


def _check_files(dataset: Path, manifest: Manifest) -> Iterator[Fault]:
    """Check that recipes and tables have files, and that cards are there and nothing else."""
    for table, recipe in (("splits", manifest.split), ("pairs", manifest.pairs)):
        if bool(manifest.files_of(table)) != (recipe is not None):
            yield Fault(MANIFEST, f"has a recipe of {table} without files, or files without one")
    for table in TABLES:
        if not manifest.files_of(table):
            yield Fault(MANIFEST, f"lists no file of {table}")
    for name in list_strays(dataset, manifest):
        yield Fault(name, "is not in the manifest, so not of this program; move it away")
    for name in (CARD, CROISSANT):
        if not (dataset / name).is_file():
            yield Fault(name, "is missing; split or pairs writes it again")
