"""Check the files of a dataset: read each once, and collect what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow as pa

from bsg_data.checks.faults import Fault
from bsg_data.dataset.manifest import FileEntry, Manifest
from bsg_data.dataset.shards import read_file
from bsg_data.errors import BSGError


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
