"""Open a dataset: read its manifest at once, and its tables shard by shard on demand.

Shards stay in memory up to a bound in bytes. A dataset below this bound is read once. To read a
larger dataset once, ask for its scenes in the order of the tables (`Dataset.in_shards`); memory
then does not grow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from bsg_data.arrays import Bools, Counts, Ints
from bsg_data.dataset.histograms import NO_CATEGORY, Unclassified, count_cells
from bsg_data.dataset.manifest import (
    SPLIT_NAME,
    FileEntry,
    read_hashed_manifest,
)
from bsg_data.dataset.scenes import take_adjacent
from bsg_data.dataset.schema import TABLES
from bsg_data.dataset.shards import DatasetFiles, refuse_replaced
from bsg_data.errors import DatasetError
from bsg_data.files import AnyPath
from bsg_data.scene.class_map import is_nameless
from bsg_data.scene.connections import Connections
from bsg_data.scene.surroundings import ROOM_COLUMNS, SCENE_COLUMNS, Surroundings

NAMES = ("train", "val", "test")  # of splits; folds have others
_HELD_BYTES = 256 * 2**20  # bound of the shards in memory
_NODE_BYTES = 170  # about what is held of a node besides its cells
_OBJECT_BYTES = 23
_WORDS = ("scene_id", "category", "kind", "method")  # columns of few words


@dataclass(frozen=True, eq=False, slots=True)
class Building:
    """What a dataset knows of a scene besides the objects outside the classes."""

    cells: Counts  # [N, C] as `Dataset.cells`
    connections: Connections
    surroundings: Surroundings
    nameable: Bools  # [C] as `Dataset.nameable`


@dataclass(frozen=True, eq=False)
class Dataset(DatasetFiles):
    """An opened dataset.

    Attributes:
        path: folder of the dataset.
        manifest: its manifest.
        sha256: hash of the manifest, which identifies the whole dataset.
    """

    sha256: str

    @classmethod
    def open(cls, path: AnyPath, *, sha256: str | None = None) -> Dataset:
        """Open a dataset; an unchanged dataset is returned from memory.

        A file is compared with its hash when it is read. Give the hash of the manifest if it is
        known: it is then not read again, which takes long in large datasets.

        Raises:
            DatasetError: if the dataset is missing, unfinished or damaged, or has another hash.
        """
        known = sha256 or read_hashed_manifest(Path(path))[1]
        return _open_once(Path(path).absolute(), known)

    def __reduce__(self) -> tuple[Callable[[Path, str], Dataset], tuple[Path, str]]:
        """Have another process open the same dataset."""
        return _open_once, (self.path, self.sha256)

    @cached_property
    def scene_ids(self) -> tuple[str, ...]:
        """The ids of the scenes, in the order of the tables."""
        return tuple(self._scenes["scene_id"].to_pylist())

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """The keys of the buildings, in the order of the tables."""
        keys = self._scenes["building"].to_pylist()
        return tuple(key or scene for key, scene in zip(keys, self.scene_ids, strict=True))

    @cached_property
    def _scenes(self) -> pa.Table:
        columns = ["scene_id", "building", "num_rooms", *SCENE_COLUMNS]
        return self.read_table("scenes", columns=columns)

    @cached_property
    def splits(self) -> dict[str, tuple[str, ...]]:
        """Split or fold → ids of its scenes, train, val and test first; empty before a split."""
        if self.manifest.split is None:
            return {}
        table = self.read_table("splits").to_pydict()
        splits: dict[str, list[str]] = {}
        for scene, split in zip(table["scene_id"], table["split"], strict=True):
            if not SPLIT_NAME.fullmatch(split):  # names of files have it in them
                place = self.manifest.files_of("splits")[0].path
                raise DatasetError(
                    f"{self.path / place}: {scene} is in split {split!r}; expected train, val or "
                    "test, or fold-N. Split again with --force",
                    code="split-name",
                    where=place,
                )
            splits.setdefault(split, []).append(scene)
        order = [name for name in NAMES if name in splits]
        order += sorted(splits.keys() - {*NAMES}, key=lambda name: (len(name), name))  # 2, then 10
        return {name: tuple(splits[name]) for name in order}

    def require_splits(self) -> dict[str, tuple[str, ...]]:
        """Return the splits; refuse a dataset that has none."""
        if self.manifest.split is None:
            message = f"{self.path}: is not split yet; run `bsg-data split {self.path}` first"
            raise DatasetError(message, code="split-missing", where=self.path)
        return self.splits

    def __contains__(self, scene_id: object) -> bool:
        """Say whether the dataset has a scene."""
        return scene_id in self._number

    def in_shards(self, scenes: Iterable[str]) -> Iterator[tuple[str, ...]]:
        """Yield some scene ids in the order of the tables, those of one shard together.

        Reading scenes in this order reads each shard only once.

        Raises:
            DatasetError: if a scene is not in the dataset.
        """
        numbers = np.sort([self._number_of(scene) for scene in scenes])
        for some in np.split(numbers, np.searchsorted(numbers, self._ends)):
            if len(some):
                yield tuple(self.scene_ids[number] for number in some)

    def building(self, scene_id: str) -> Building:
        """Return what is known of a scene besides the objects outside the classes."""
        views = (self.cells, self.connections, self.surroundings, self.nameable)
        return Building(*(view(scene_id) for view in views))  # type: ignore[arg-type]

    def cells(self, scene_id: str) -> Counts:
        """Return the classified objects of a scene, `[1 + R, C]`, row 0 the null region."""
        shard, index = self._find(scene_id)
        return shard.cells[shard.rows_of(index)]

    def unclassified(self, scene_id: str) -> Unclassified:
        """Return the objects of a scene outside the classes, by category."""
        shard, index = self._find(scene_id)
        return shard.unclassified(index)

    def nameable(self, scene_id: str) -> Bools:
        """Return the classes that the source of a scene has a word for, `[C]`.

        Its buildings say of the others neither that they are there nor that they are not.
        """
        shard, index = self._find(scene_id)
        return self._nameable[shard.sources[index]]

    @cached_property
    def _nameable(self) -> dict[str, Bools]:
        """The classes that all sources of a kind have a word for, by kind."""
        classes = self.manifest.class_space.classes
        found: dict[str, Bools] = {}
        for entry in self.manifest.sources:
            own = np.isin(classes, classes if entry.nameable is None else entry.nameable)
            found[entry.kind] = found.get(entry.kind, own) & own
        return found

    def connections(self, scene_id: str) -> Connections:
        """Return the known connections between rooms of a scene, in the order of the table."""
        shard, index = self._find(scene_id)
        starts, every = shard.connections
        return every.take(np.s_[starts[index] : starts[index + 1]])

    def surroundings(self, scene_id: str) -> Surroundings:
        """Return what is known of a scene and its rooms besides their objects.

        Impossible values, and labels that this version does not list, count as unknown.
        """
        shard, index = self._find(scene_id)
        return shard.surroundings.take(shard.rows_of(index), buildings=slice(index, index + 1))

    @cached_property
    def connection_methods(self) -> frozenset[str]:
        """The methods by which connections of this dataset are known (`ADJACENCY_METHODS`)."""
        every = (shard.connections[1].methods for shard in self._shards())
        return frozenset().union(*(np.unique(methods).tolist() for methods in every))

    def count_unconnected(self) -> int:
        """Return the number of scenes without known connections."""
        every = (shard.connections[0] for shard in self._shards())
        return sum(int((np.diff(starts) == 0).sum()) for starts in every)

    def _shards(self) -> Iterator[_Shard]:
        return map(self._shard, range(len(self._files)))

    def _find(self, scene_id: str) -> tuple[_Shard, int]:
        """Return the shard of a scene, and its index there."""
        number = self._number_of(scene_id)
        shard = int(self._ends.searchsorted(number, side="right"))
        first = int(self._ends[shard - 1]) if shard else 0
        return self._shard(shard), number - first

    def _number_of(self, scene_id: str) -> int:
        if scene_id not in self._number:
            raise DatasetError(f"{self.path}: has no scene {scene_id!r}")
        return self._number[scene_id]

    @cached_property
    def _number(self) -> dict[str, int]:
        return {scene_id: number for number, scene_id in enumerate(self.scene_ids)}

    @cached_property
    def _ends(self) -> Ints:
        """Number of the first scene after each shard."""
        return np.cumsum([files["scenes"].rows for files in self._files])

    @cached_property
    def _files(self) -> tuple[dict[str, FileEntry], ...]:
        """The file of every table of each shard."""
        files = zip(*map(self.manifest.files_of, TABLES), strict=True)
        return tuple(dict(zip(TABLES, some, strict=True)) for some in files)

    @cached_property
    def _shard(self) -> Callable[[int], _Shard]:
        """A function that returns a shard by its number and keeps the last ones."""
        width = 8 * len(self.manifest.class_space.classes) + _NODE_BYTES
        weights = (
            (files["scenes"].rows + files["rooms"].rows) * width
            + files["objects"].rows * _OBJECT_BYTES
            for files in self._files
        )
        return lru_cache(maxsize=max(2, _HELD_BYTES // max(weights, default=1)))(
            lambda number: _Shard(self, self._files[number], self._scenes_of(number))
        )

    def _scenes_of(self, number: int) -> pa.Table:
        rows = self._files[number]["scenes"].rows
        return self._scenes.slice(int(self._ends[number]) - rows, rows)


@lru_cache(maxsize=8)
def _open_once(path: Path, sha256: str) -> Dataset:
    manifest, found = read_hashed_manifest(path)
    if found != sha256:
        refuse_replaced(path)
    return Dataset(path, manifest, sha256)


def read_splits(dataset: AnyPath) -> dict[str, tuple[str, ...]]:
    """Return split → scene ids, with train, val and test first.

    Raises:
        DatasetError: if the dataset has no split yet, or a split has an impossible name.
    """
    return Dataset.open(dataset).require_splits()


def read_cells(dataset: AnyPath) -> dict[str, Counts]:
    """Return scene id → cells `[1 + R, C]` for all scenes, in the order of the tables."""
    data = Dataset.open(dataset)
    return {scene_id: data.cells(scene_id) for scene_id in data.scene_ids}


@dataclass(frozen=True, eq=False)
class _Shard:
    """A shard: B buildings with N nodes and O objects in all.

    Each table is read on first use, as one array for all buildings with an offset for each.
    """

    data: DatasetFiles
    files: Mapping[str, FileEntry]  # table → file of this shard
    scenes: pa.Table  # its rows of the table of scenes

    def rows_of(self, index: int) -> slice:
        """Return the rows of the nodes of the scene with an index in the shard."""
        return slice(int(self._starts[index]), int(self._starts[index + 1]))

    @cached_property
    def cells(self) -> Counts:
        """The cells of all scenes in order, `[N, C]`."""
        nodes, classes, _ = self._objects
        shape = int(self._starts[-1]), len(self.data.manifest.class_space.classes)
        classified = classes.is_valid().to_numpy()
        cells = count_cells(nodes[classified], classes.drop_null().to_numpy(), shape=shape)
        cells.setflags(write=False)  # all readers of this dataset share it
        return cells

    def unclassified(self, index: int) -> Unclassified:
        """Return the objects of a scene outside the classes, by category."""
        nodes, kinds, counts, names, starts = self._unclassified
        some, first = slice(starts[index], starts[index + 1]), int(self._starts[index])
        return Unclassified(
            names,
            int(self._starts[index + 1]) - first,
            nodes[some] - first,
            kinds[some],
            counts[some],
        )

    @cached_property
    def connections(self) -> tuple[Ints, Connections]:
        """Offsets of the scenes `[B + 1]`, and the connections of all of them."""
        columns = ["scene_id", "source_index", "target_index", "kind", "method", "distance_m"]
        table = take_adjacent(self._read("edges", columns))
        pairs = np.stack([table[f"{end}_index"].to_numpy() for end in ("source", "target")], axis=1)
        every = Connections(
            pairs.astype(np.int64),
            np.array(table["method"].to_pylist(), dtype=str),
            table["distance_m"].to_numpy(),  # NaN for null
        )
        numbers = np.arange(len(self.scenes) + 1)
        return np.searchsorted(self._number_scenes(table), numbers), every

    @cached_property
    def surroundings(self) -> Surroundings:
        """What is known of all scenes, one after another."""
        rooms = self._read("rooms", ["scene_id", "room_index", *ROOM_COLUMNS])
        nodes = int(self._starts[-1])
        return Surroundings.of_tables(self.scenes, rooms, rows=self._find_nodes(rooms), nodes=nodes)

    def _read(self, table: str, columns: list[str]) -> pa.Table:
        words = [name for name in columns if name in _WORDS]
        return self.data.read_file(self.files[table], columns=columns, dictionaries=words)

    @cached_property
    def sources(self) -> list[str]:
        """The kind of source of every scene."""
        return list(self.scenes["source"].to_pylist())

    @cached_property
    def _starts(self) -> Ints:
        """Row of the first node of every scene, and the end, `[B + 1]`."""
        return np.cumsum([0, *(self.scenes["num_rooms"].to_numpy() + 1)])

    @cached_property
    def _objects(self) -> tuple[Ints, pa.ChunkedArray, pa.ChunkedArray]:
        """Row of the node, class and category of every object, each `[O]`."""
        table = self._read("objects", ["scene_id", "room_index", "class_index", "category"])
        return self._find_nodes(table), table["class_index"], table["category"]

    @cached_property
    def _unclassified(self) -> tuple[Ints, Ints, Ints, tuple[str, ...], Ints]:
        """Row of the node, category and number of unclassified objects; names of the categories.

        They are sorted by node, then by name; at last, where each scene begins, `[B + 1]`.
        """
        nodes, classes, categories = self._objects
        outside = classes.is_null()
        encoded = categories.filter(outside).combine_chunks()
        words = [*encoded.dictionary.to_pylist(), NO_CATEGORY]
        given = [NO_CATEGORY if is_nameless(word) else word for word in words]
        names, kinds = np.unique(np.array(given, dtype=str), return_inverse=True)
        width = len(names)
        codes = encoded.indices.fill_null(len(words) - 1).to_numpy()
        key = nodes[outside.to_numpy()] * width + kinds[codes]
        pairs, counts = np.unique(key, return_counts=True)
        rows, columns = np.divmod(pairs, width)
        return rows, columns, counts, tuple(names.tolist()), np.searchsorted(rows, self._starts)

    def _find_nodes(self, table: pa.Table) -> Ints:
        """Return the row of the node that every row of a table is in or is."""
        rows: Ints = self._starts[self._number_scenes(table)] + table["room_index"].to_numpy()
        return rows

    def _number_scenes(self, table: pa.Table) -> Ints:
        """Return the index of the scene of every row of a table."""
        words = table["scene_id"].combine_chunks()
        numbers = pc.index_in(words.dictionary, value_set=self.scenes["scene_id"])
        numbers = np.asarray(numbers.to_numpy(zero_copy_only=False), dtype=np.int64)
        return np.asarray(numbers[words.indices.to_numpy()])
