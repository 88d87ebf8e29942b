"""Read one part of all tables, the unit of the check, and collect its faults."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.dataset.manifest import FileEntry, Manifest
from bsg_data.dataset.shards import read_file
from bsg_data.errors import BSGError

NULL = -1  # instead of a word


@dataclass(frozen=True, eq=False)
class Words:
    """A column of words."""

    names: tuple[str, ...]  # the distinct words
    codes: Ints  # `[n]` index of every row's word in `names`, or `NULL`

    @classmethod
    def of(cls, column: pa.ChunkedArray) -> Words:
        """Read a column."""
        encoded = column.combine_chunks().dictionary_encode()
        codes = encoded.indices.fill_null(NULL).to_numpy().astype(np.int64)
        return cls(tuple(encoded.dictionary.to_pylist()), codes)

    def __getitem__(self, row: int) -> str | None:
        """Return the word of a row; equal words are the same object."""
        code = int(self.codes[row])
        return None if code == NULL else self.names[code]

    @property
    def missing(self) -> Bools:
        """Whether each row is null, `[n]`."""
        return np.equal(self.codes, NULL)

    def look_up(self, find: Callable[[str], Any], *, null: Any) -> npt.NDArray[Any]:
        """Return `find(word)` for every row, `[n]`; `null` for rows without a word."""
        return np.array([*map(find, self.names), null])[self.codes]  # the last one is at NULL

    def is_word(self, word: str) -> Bools:
        """Say for every row whether it has this word, `[n]`."""
        return self.look_up(lambda name: name == word, null=False)


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of one table of a part."""

    table: pa.Table  # the columns
    scene: Ints  # `[n]` number of every row's scene in the part; `NULL` for other scenes
    strangers: tuple[str, ...]  # names of the other scenes

    @classmethod
    def of(cls, table: pa.Table, scenes: Mapping[str, int]) -> Rows:
        """Return the rows of a table, with their scenes numbered as in the part."""
        names = Words.of(table["scene_id"])
        scene = names.look_up(lambda name: scenes.get(name, NULL), null=NULL).astype(np.int64)
        return cls(table, scene, tuple(name for name in names.names if name not in scenes))

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.scene)

    def integers(self, name: str) -> Ints:
        """Return a column of integers without nulls, `[n]`."""
        return np.asarray(self.table[name].to_numpy(), dtype=np.int64)

    def flags(self, name: str) -> Bools:
        """Return a column of booleans without nulls, `[n]`."""
        return np.asarray(self.table[name].to_numpy(), dtype=np.bool_)

    def numbers(self, name: str) -> Floats:
        """Return a column of numbers, `[n]`; null is NaN."""
        if self.table[name].null_count == len(self):
            return np.full(len(self), np.nan)
        return np.asarray(self.table[name].to_numpy(), dtype=np.float64)

    def points(self, name: str) -> Floats:
        """Return the columns `<name>_x`, `_y` and `_z`, `[n, 3]`; null is NaN."""
        return np.stack([self.numbers(f"{name}_{axis}") for axis in "xyz"], axis=1)

    def is_valid(self, name: str) -> Bools:
        """Say for every row whether it has a value in a column, `[n]`."""
        return np.asarray(self.table[name].is_valid().to_numpy(), dtype=np.bool_)

    def words(self, name: str) -> Words:
        """Return a column of words."""
        return Words.of(self.table[name])


@dataclass(frozen=True, eq=False)
class Part:
    """One part of a dataset.

    Attributes:
        number: number of the part, from 0.
        scene_ids: ids of its scenes, in the order of the table.
        scenes: rows of the table of scenes.
        rooms: rows of the table of rooms.
        objects: rows of the table of objects.
        edges: rows of the table of edges.
    """

    number: int
    scene_ids: tuple[str, ...]
    scenes: Rows
    rooms: Rows
    objects: Rows
    edges: Rows

    @classmethod
    def of(cls, number: int, tables: Mapping[str, pa.Table]) -> Part:
        """Return the part with these four tables."""
        scene_ids = tuple(tables["scenes"]["scene_id"].to_pylist())
        scenes = {scene_id: place for place, scene_id in enumerate(scene_ids)}
        return cls(
            number, scene_ids, **{name: Rows.of(table, scenes) for name, table in tables.items()}
        )

    def name_scenes(self, rows: Rows, wrong: Bools) -> list[str]:
        """Return the ids of the scenes with faulty rows, each once, in order."""
        numbers = np.unique(rows.scene[wrong & (rows.scene != NULL)])
        return [self.scene_ids[number] for number in numbers]


_NAMED = 3  # rows named for each fault; the others are counted


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of a dataset: where it is, and what is wrong."""

    where: str
    what: str


class ObjectFaults:
    """Faults of objects: the first of each kind are named, the others counted."""

    def __init__(self) -> None:
        """Start without faults."""
        self._named: dict[str, list[str]] = {}
        self._times: Counter[str] = Counter()

    def add(self, what: str, names: Iterable[str], *, times: int) -> None:
        """Add the objects with one fault: the names of the first, and the number of all."""
        named = self._named.setdefault(what, [])
        named += list(names)[: _NAMED - len(named)]
        self._times[what] += times

    def __iter__(self) -> Iterator[Fault]:
        """Yield the faults, kind by kind."""
        for what, names in self._named.items():
            yield from (Fault("objects", f"{name}: {what}") for name in names)
            if self._times[what] > len(names):
                yield Fault("objects", f"… and {self._times[what] - len(names)} more: {what}")


@dataclass(eq=False)
class FileReader:
    """Read the files of a dataset and collect their faults."""

    dataset: Path  # folder of the dataset
    manifest: Manifest  # manifest to compare the files with
    progress: Callable[[int, int], None] | None = None  # called with (files done, files in all)
    faults: list[Fault] = field(default_factory=list)  # the faults found so far
    _done: int = 0

    def read(self, entry: FileEntry) -> pa.Table | None:
        """Read a file; None if it has a fault."""
        try:
            table = read_file(self.dataset, entry, manifest=self.manifest)
            found = _find_nulls(entry, table)
            if len(table) != entry.rows:
                found.append(Fault(entry.path, f"expected {entry.rows} rows, found {len(table)}"))
        except BSGError as error:
            found = [Fault(entry.path, str(error))]
        self.faults += found
        self._done += 1
        if self.progress is not None:
            self.progress(self._done, len(self.manifest.files))
        return None if found else table


def _find_nulls(entry: FileEntry, table: pa.Table) -> list[Fault]:
    return [
        Fault(entry.path, f"column {field.name} has nulls and must not")
        for field in table.schema
        if not field.nullable and table[field.name].null_count
    ]
