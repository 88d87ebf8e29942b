"""Copies of users' own class maps in a dataset: `class_maps/<sha256[:12]>/<version>.csv`.

The manifest names the class map of each source with its hash. Published maps come with the package;
of a user's own map the dataset keeps a copy. Each hash has its own folder, so two maps with one
name can coexist.
"""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from bsg_data.errors import ClassMapError
from bsg_data.recipes import Record
from bsg_data.scene.class_map import (
    CLASSES,
    STRUCTURE,
    SUFFIX,
    ClassMap,
    OwnMap,
    parse_own_map,
    published_maps,
    read_own_map,
    write_own_map,
)

KEPT = "class_maps"


class ClassMapEntry(Record):
    """The class map that the names of a source were read with."""

    version: str = Field(pattern=r"^[^/\\\x00-\x1f]+$", max_length=250)  # the stem of a file
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")

    @classmethod
    def of(cls, class_map: ClassMap) -> ClassMapEntry:
        """Describe a loaded map."""
        return cls(version=class_map.version, sha256=class_map.sha256)

    @property
    def folder(self) -> str:
        """The folder, below the dataset, that keeps its copy."""
        return f"{KEPT}/{self.sha256[:12]}"

    @property
    def paths(self) -> tuple[str, ...]:
        """The paths of the copy below the dataset, first that of `NAME.csv`."""
        suffixes = (SUFFIX, CLASSES, STRUCTURE)
        return tuple(f"{self.folder}/{self.version}{suffix}" for suffix in suffixes)

    def read(self, dataset: Path) -> str | OwnMap:
        """Return the name of a published map, or the copy that a dataset keeps."""
        if self.version in published_maps():
            return self.version
        path = dataset / self.paths[0]
        own = read_own_map(path)
        found = parse_own_map(own).with_hash(self.sha256).sha256
        if found != self.sha256:
            raise ClassMapError(
                f"{path}: differs from the class map that the dataset was built with: expected "
                f"sha256 {self.sha256[:12]}…, found {found[:12]}…; put the map back, or build again"
            )
        return own

    def copy_map(self, source: Path, dataset: Path) -> None:
        """Copy what one dataset keeps into another one."""
        own = self.read(source)
        if isinstance(own, OwnMap):
            write_own_map(own, dataset / self.folder)

    def name_in(self, dataset: Path) -> str:
        """Return how `load_class_map` finds it: by path if the dataset keeps it."""
        path = dataset / self.paths[0]
        return str(path) if path.is_file() else self.version
