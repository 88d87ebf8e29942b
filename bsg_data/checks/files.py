"""Check the files of a dataset: read each once, hash it, and parse the hashed bytes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow as pa

from bsg_data.checks.faults import Fault
from bsg_data.dataset.manifest import FileEntry, Manifest
from bsg_data.dataset.shards import (
    check_file_metadata,
    read_listed,
    schema_of,
    table_of,
    to_current,
)
from bsg_data.errors import BSGError, DatasetError
from bsg_data.inputs.parquet import DAMAGE, reading_parquet


@dataclass(eq=False)
class FileReader:
    """Read the files of a dataset and collect their faults.

    Attributes:
        dataset: folder of the dataset.
        manifest: manifest to compare the files with.
        progress: called with (files done, files in all).
        faults: the faults found so far.
    """

    dataset: Path
    manifest: Manifest
    progress: Callable[[int, int], None] | None = None
    faults: list[Fault] = field(default_factory=list)
    _done: int = 0

    def read(self, entry: FileEntry) -> pa.Table | None:
        """Read a file as a table with the columns of version 2; None if it has a fault."""
        faults: list[Fault] = []
        table = self._parse(entry, faults)
        self.faults += faults
        self._done += 1
        if self.progress is not None:
            self.progress(self._done, len(self.manifest.files))
        if table is None or faults:
            return None
        try:
            return to_current(self.dataset / entry.path, table, self.manifest)
        except (*DAMAGE, BSGError):  # of format 1, whose scenes say what an edge joins
            return None  # their own file is a fault

    def _parse(self, entry: FileEntry, faults: list[Fault]) -> pa.Table | None:
        path = self.dataset / entry.path
        if not path.is_file():
            faults.append(Fault(entry.path, "is in the manifest but missing"))
            return None
        try:
            data = read_listed(path, entry, error=DatasetError)
            faults += _compare_bytes(entry, data)
            with reading_parquet(path, data=data, rows=entry.rows, error=DatasetError) as file:
                check_file_metadata(path, file.schema_arrow, self.manifest)
                table = file.read(use_threads=False)
                table.validate(full=True)
        except BSGError as error:
            faults.append(Fault(entry.path, str(error)))
        else:
            faults += _compare_columns(entry, table, schema_of(table_of(entry), self.manifest))
            return table
        return None


def _compare_bytes(entry: FileEntry, data: bytes) -> list[Fault]:
    sha256 = hashlib.sha256(data).hexdigest()
    if sha256 == entry.sha256:
        return []
    return [
        Fault(
            entry.path,
            f"was changed: expected sha256 {entry.sha256[:12]}…, found {sha256[:12]}…, of as many "
            "bytes",
        )
    ]


def _compare_columns(entry: FileEntry, table: pa.Table, expected: pa.Schema) -> list[Fault]:
    if not table.schema.equals(expected, check_metadata=False):
        return [Fault(entry.path, f"expected the columns\n{expected}\nfound\n{table.schema}")]
    return [
        Fault(entry.path, f"column {field.name} has nulls and must not")
        for field in expected
        if not field.nullable and table[field.name].null_count
    ]
