"""Check that a dataset agrees with its manifest, and its tables with each other.

Every file is read again, and compared with its hash and with the schema. Tables must have the rows
that the manifest and the scenes count, and keep the rules of scene graphs. What a program edited
and hashed again by the rules is not found.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pyarrow as pa

from bsg_data.checks.graphs import find_faults
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
from bsg_data.dataset.scenes import count_totals, divide
from bsg_data.dataset.schema import TABLES
from bsg_data.dataset.splits import assign_splits
from bsg_data.errors import BSGError, ClassMapError, DatasetError, RecipeError
from bsg_data.files import AnyPath, hold
from bsg_data.observation.pairs import split_of_file
from bsg_data.recipes import SplitRecipe
from bsg_data.scene.class_map import load_class_map, parse_own_map

_NAMED = 3  # named of each kind of fault; the others are counted
_KEPT = ["scene_id", "building", "source", "source_split"]  # columns that are kept of all scenes


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
        data = Dataset(Path(dataset), manifest, sha256)
        strays = list_strays(data.path, manifest)
        check = _Check(data, progress)
        check.run()
        if not check.faults or _is_still(data, strays):
            return (*dict.fromkeys(check.faults), *check.count_others())


def _is_still(data: Dataset, strays: list[str]) -> bool:
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


class _Check:
    """A check of a dataset, and the faults found so far."""

    def __init__(self, data: Dataset, progress: Callable[[int, int], None] | None) -> None:
        self.data, self.manifest, self.progress = data, data.manifest, progress
        self.faults: list[Fault] = []
        self._times, self._done = Counter[Fault](), 0

    def run(self) -> None:
        """Check all; what follows from a damaged file is not looked at."""
        self.faults += _check_files(self.data.path, self.manifest)
        self.faults += _check_class_maps(self.data.path, self.manifest)
        scenes = self._check_shards()
        splits = [self.read(entry) for entry in self.manifest.files_of("splits")]
        if self.manifest.split is None or self.faults:
            return
        table = pa.concat_tables(splits)
        self.add("splits", _check_splits(table, scenes, self.manifest.split))
        if self.manifest.pairs is not None and not self.faults:
            self.add("pairs", _check_pairs(self.data, table, self.read))

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
            self.progress(self._done, len(self.manifest.files))
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

    def _check_shards(self) -> pa.Table:
        """Check the tables of all shards one after another, and return words of all scenes."""
        totals, scenes = [], [TABLES["scenes"].empty_table().select(_KEPT)]
        for entries in zip(*map(self.manifest.files_of, TABLES), strict=False):
            read = dict(zip(TABLES, map(self.read, entries), strict=True))
            tables = {name: table for name, table in read.items() if table is not None}
            if len(tables) == len(TABLES):  # a damaged file is a fault already
                scenes.append(tables["scenes"].select(_KEPT))
                totals.append(count_totals(tables))
                for table, name, rule in find_faults(tables):
                    self.add(table, iter([(name, rule)]))
        every = pa.concat_tables(scenes)
        self.add("scenes", _check_order(every))
        if not self.faults:
            self.faults += _check_totals(self.manifest, Totals.sum(totals))
        return every


def _check_order(every: pa.Table) -> Iterator[tuple[str, str]]:
    """Check that scenes are sorted, and that each building is there once."""
    ids, keys = every["scene_id"].to_pylist(), every["building"].to_pylist()
    yield from ((scene, "is there twice") for scene, times in Counter(ids).items() if times > 1)
    yield from ((b, "is not sorted by scene_id") for a, b in pairwise(ids) if b < a)
    pairs = {(key or scene, scene) for key, scene in zip(keys, ids, strict=True)}
    buildings = Counter(key for key, _ in pairs)
    yield from ((name, "has two scene ids") for name, times in buildings.items() if times > 1)


def _check_totals(manifest: Manifest, totals: Totals) -> Iterator[Fault]:
    for name, stated in manifest.totals:
        if stated != (counted := getattr(totals, name)):
            yield Fault(MANIFEST, f"totals.{name}: expected {counted}, found {stated}")


def _check_class_maps(dataset: Path, manifest: Manifest) -> Iterator[Fault]:
    """Compare class maps with those of the same names, and with the class space."""
    for entry in manifest.class_maps:
        try:
            found = entry.read(dataset)
        except ClassMapError as error:
            yield Fault(KEPT, str(error))
            continue
        loaded = load_class_map(found) if isinstance(found, str) else parse_own_map(found)
        if loaded.sha256 != entry.sha256 or loaded.classes != manifest.class_space.classes:
            what = f"class map {entry.version} is not the published one, or not for "
            hashes = f"expected sha256 {loaded.sha256}, found {entry.sha256}"
            yield Fault(MANIFEST, f"{what}{manifest.class_space}: {hashes}")


def _check_files(dataset: Path, manifest: Manifest) -> Iterator[Fault]:
    """Check that recipes and tables have files, and that cards are there and nothing else."""
    for table, recipe in (("splits", manifest.split), ("pairs", manifest.pairs)):
        if bool(manifest.files_of(table)) != (recipe is not None):
            yield Fault(MANIFEST, f"has a recipe of {table} without files, or files without one")
    numbers = {name: len(manifest.files_of(name)) for name in TABLES}
    if len({*numbers.values()}) > 1 or 0 in numbers.values():
        found = ", ".join(f"{number} of {name}" for name, number in numbers.items())
        yield Fault(MANIFEST, f"expected as many files of each table, found {found}")
    for name in list_strays(dataset, manifest):
        yield Fault(name, "is not in the manifest, so not of this program; move it away")
    for name in (CARD, CROISSANT):
        if not (dataset / name).is_file():
            yield Fault(name, "is missing; split or pairs writes it again")


def _check_splits(
    splits: pa.Table, scenes: pa.Table, recipe: SplitRecipe
) -> Iterator[tuple[str, str]]:
    """Check that every scene is in the split of the recipe, once, and in no other."""
    own, sources = (_map_scenes(scenes, name) for name in ("source_split", "source"))
    try:
        expected = Counter(assign_splits(own, recipe, sources=sources).items())
    except RecipeError as error:
        yield "the split", f"cannot be made by the recipe: {error}"
        return
    rows = zip(splits["scene_id"].to_pylist(), splits["split"].to_pylist(), strict=True)
    found = Counter(rows)
    for scene, split in sorted(found - expected):
        yield f"{scene}, {split}", "is not its split by the recipe, or is there twice"
    for scene, split in sorted(expected - found):
        yield f"{scene}, {split}", "is its split by the recipe, but not there"


def _check_pairs(
    data: Dataset, splits: pa.Table, read: Callable[[FileEntry], pa.Table | None]
) -> Iterator[tuple[str, str]]:
    """Check that every scene has its pairs in one file, which is of its split, all draws of them.

    Args:
        data: a dataset with sound tables and pairs.
        splits: its table of splits.
        read: reads a file; None if it has a fault.
    """
    draws = 1 if data.manifest.pairs is None else data.manifest.pairs.draws
    split_of, times = _map_scenes(splits, "split"), Counter[str]()
    for entry in data.manifest.files_of("pairs"):
        table = read(entry)
        for scene, rows in () if table is None else divide(table):
            where, split = f"{entry.path}, {scene}", split_of.get(scene)
            times[scene] += 1
            if split != split_of_file(entry.path):
                yield where, f"expected split {split_of_file(entry.path)}, found {split}"
            elif (splits_found := rows["split"].unique().to_pylist()) != [split]:
                yield where, f"expected {split} as `split` of every row, found {splits_found}"
            elif rows["draw"].unique().to_pylist() != list(range(draws)):
                yield where, f"expected draws 0..{draws - 1}, in order"
    for scene in sorted(split_of):
        if times[scene] != 1:
            yield scene, f"has pairs in {times[scene]} places, expected 1"


def _map_scenes(table: pa.Table, column: str) -> dict[str, str]:
    return dict(zip(table["scene_id"].to_pylist(), table[column].to_pylist(), strict=True))
