"""The manifest: what a finished dataset holds, and how every byte of it was made.

`dataset.json` is written last and replaced whole, so a folder with a manifest is a finished
dataset. It holds no date, no path and no name of a machine: the same inputs give the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from bsg_data.dataset.schema import FORMAT_VERSION, SPLIT_NAME
from bsg_data.errors import DatasetError, MismatchError
from bsg_data.recipes import PairsRecipe, Record, SplitRecipe, name_fault
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.mesh_coverage import MeshCoverage

MANIFEST = "dataset.json"


# Exactly the paths that the format has: a manifest edited by hand cannot point elsewhere.
FILE_PATH = re.compile(
    r"(scenes|rooms|objects|edges)/part-[0-9]{5}\.parquet|splits\.parquet"
    rf"|pairs/{SPLIT_NAME.pattern}-[0-9]{{5}}\.parquet",
)


class FileEntry(Record):
    """One file of a dataset: its path below the dataset, rows, bytes and hash."""

    path: str = Field(pattern=rf"^({FILE_PATH.pattern})$")
    rows: int = Field(ge=0)
    bytes: int = Field(ge=0)
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")


class ClassMapEntry(Record):
    """The class map that a dataset was made with, and its classes in histogram order."""

    version: str
    sha256: str
    classes: tuple[str, ...]

    @classmethod
    def of(cls, class_map: ClassMap) -> ClassMapEntry:
        """Describe a loaded map."""
        return cls(version=class_map.version, sha256=class_map.sha256, classes=class_map.classes)


class SkipEntry(Record):
    """A scene that was left out, and why."""

    scene_id: str
    location: str
    reason: str


class UnmappedEntry(Record):
    """A name that the class map does not know, how often it occurs, and what it looks like."""

    name: str
    instances: int
    nearest: tuple[str, ...]


class Totals(Record):
    """Sums over the scenes; `placed` are those with geometry, `adjacent` the pairs of rooms."""

    scenes: int = 0
    rooms: int = 0
    objects: int = 0
    classified: int = 0
    unmapped: int = 0
    placed: int = 0
    adjacent: int = 0


class SourceEntry(Record):
    """What the dataset was built from; `fingerprint` hashes the annotations of all its scenes."""

    kind: str
    version: str | None
    fingerprint: str


class Manifest(Record):
    """Everything that `dataset.json` says."""

    format: Literal["bsg"] = "bsg"
    format_version: int = FORMAT_VERSION
    generator: str
    source: SourceEntry
    class_map: ClassMapEntry
    options: dict[str, int]
    totals: Totals
    files: tuple[FileEntry, ...]
    skipped: tuple[SkipEntry, ...] = ()
    left_out: tuple[SkipEntry, ...] = ()
    meshes: dict[str, MeshCoverage] = Field(default_factory=dict)
    unmapped: tuple[UnmappedEntry, ...] = ()
    split: SplitRecipe | None = None
    pairs: PairsRecipe | None = None

    def files_of(self, table: str) -> tuple[FileEntry, ...]:
        """Return the files of one table (`scenes`, `pairs`, ...) in order."""
        return tuple(f for f in self.files if f.path.split("/")[0] in (table, f"{table}.parquet"))

    def with_table(self, table: str, entries: tuple[FileEntry, ...], **update: object) -> Manifest:
        """Return the manifest with the files of `table` replaced by `entries`."""
        gone = self.files_of(table)
        files = sorted((*(f for f in self.files if f not in gone), *entries), key=lambda f: f.path)
        return self.model_copy(update={"files": tuple(files), **update})

    def without_pairs(self) -> Manifest:
        """Return the manifest of the same dataset without pairs."""
        return self.with_table("pairs", (), pairs=None)

    def without_split(self) -> Manifest:
        """Return the manifest without the split, and without the pairs that follow from it."""
        return self.without_pairs().with_table("splits", (), split=None)


def read_manifest(dataset: Path) -> Manifest:
    """Read the manifest of a finished dataset.

    Raises:
        DatasetError: if there is none or it is damaged.
        MismatchError: if it is of another format version.
    """
    path = dataset / MANIFEST
    try:
        text = path.read_text("utf-8")
    except FileNotFoundError as error:
        if not dataset.is_dir():
            raise DatasetError(f"{dataset}: no such folder") from error
        raise DatasetError(
            f"{dataset}: no {MANIFEST} there, so it is not a finished dataset; "
            "make one with `bsg-data build --out DATASET`"
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise DatasetError(f"{path}: cannot be read ({error})") from error
    try:
        found = json.loads(text).get("format_version")
        if found != FORMAT_VERSION:
            raise MismatchError(
                f"{path}: format version {found}, this program reads {FORMAT_VERSION}: "
                "build the dataset again, or use the program that made it"
            )
        manifest = Manifest.model_validate_json(text)
    except (json.JSONDecodeError, AttributeError) as error:
        raise DatasetError(f"{path}: not JSON ({error}); build the dataset again") from error
    except ValidationError as error:
        raise DatasetError(
            f"{path}: {name_fault(error)} ({error.error_count()} faults in all); "
            "the manifest was changed by hand or by another version: build the dataset again"
        ) from error
    return manifest


def encode_manifest(manifest: Manifest) -> bytes:
    """Return the bytes of `dataset.json`."""
    return (manifest.model_dump_json(indent=1, exclude_none=False) + "\n").encode()


def hash_manifest(dataset: Path) -> str:
    """Return the sha256 of `dataset.json`, which stands for the whole dataset."""
    return hashlib.sha256((dataset / MANIFEST).read_bytes()).hexdigest()


def require_class_map(manifest: Manifest, other: ClassMapEntry, *, what: str) -> None:
    """Refuse to mix two class maps.

    Raises:
        MismatchError: naming both versions and hashes.
    """
    ours = manifest.class_map
    if ours != other:
        raise MismatchError(
            f"{what} is of class map {other.version} (sha256 {other.sha256[:12]}…), the dataset of "
            f"{ours.version} (sha256 {ours.sha256[:12]}…): their histograms do not mean the same"
        )
