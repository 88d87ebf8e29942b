"""The manifest `dataset.json`: what a finished dataset holds, and how it was made.

It is written last and replaced as a whole, so a folder with a manifest is a finished dataset. It
holds no date, path or machine name: the same inputs give the same bytes.

It names the class map of each source with its hash. Published maps come with the package; of a
user's own map the dataset keeps a copy, `class_maps/<sha256[:12]>/<version>.csv`: two maps with one
name can coexist.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final, Literal, TypeVar

from pydantic import Field, ValidationError

from bsg_data.errors import (
    ClassMapError,
    DatasetError,
    MismatchError,
    RecipeError,
    ask_to_upgrade,
)
from bsg_data.files import AnyPath, resolve_links
from bsg_data.inputs.bounded_file import hash_file, read_bytes
from bsg_data.inputs.documents import parse_json
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_data.records import Record, name_fault
from bsg_data.results import name_staged
from bsg_data.scene.class_map import (
    MAP_FILES,
    ClassMap,
    OwnMap,
    parse_own_map,
    published_maps,
    read_own_map,
    write_own_map,
)
from bsg_data.scene.class_space import ClassSpace
from bsg_data.scene.scene_graph import MeshCoverage
from bsg_data.scene.synonyms import Rule
from bsg_data.terms import Terms

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
        suffixes = MAP_FILES.values()
        return tuple(f"{self.folder}/{self.version}{suffix}" for suffix in suffixes)

    def read(self, dataset: Path) -> str | OwnMap:
        """Return the name of a published map, or the copy that a dataset keeps."""
        if self.version in published_maps():
            return self.version
        path = dataset / self.paths[0]
        own = read_own_map(path)
        found = parse_own_map(own).sha256
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


FORMAT_VERSION: Final = 1
# The name of a split is part of the names of files, so no other is read from a file or written.
SPLIT_NAME = re.compile(r"(?:train|val|test|fold-[0-9]{1,5})")
MANIFEST = "dataset.json"
CARD, CROISSANT = "README.md", "croissant.json"
_MAX_SHARDS = 100_000  # the names of their files number no more
STAGED = ".staged"  # folder of what a command is about to add


# Exactly the paths that the format has: a manifest edited by hand cannot point elsewhere.
_STAGED_PATH = (
    r"splits/[a-z]+-[0-9a-f]{8}\.parquet"
    rf"|pairs/[a-z][a-z0-9-]*-[0-9a-f]{{8}}/{SPLIT_NAME.pattern}-[0-9]{{5}}\.parquet"
)
_FILE_PATH = rf"(?:scenes|rooms|objects|edges)/part-[0-9]{{5}}\.parquet|{_STAGED_PATH}"
STAGED_PATH = re.compile(rf"{re.escape(STAGED)}/.*|{_STAGED_PATH}")  # of what a change adds


class FileEntry(Record):
    """One file of a dataset: its path below the dataset, rows, bytes and hash."""

    path: str = Field(pattern=rf"^({_FILE_PATH}|{re.escape(STAGED)}/[a-z0-9.-]+)$")
    rows: int = Field(ge=0)
    bytes: int = Field(ge=0)
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")


@dataclass(frozen=True, slots=True)
class SkippedScene:
    """A scene, or what belongs to it, that was left out, with the reason."""

    scene_id: str
    location: str
    reason: str


class CountedName(Record):
    """A name, and the number of objects or rooms that have it."""

    name: str
    instances: int


class UnmappedEntry(CountedName):
    """A name that is not in the class map, and the nearest names."""

    nearest: tuple[str, ...] = ()  # of the most frequent names alone


class ResolvedEntry(CountedName):
    """A name that is not in the class map, and its category by a rule."""

    rule: Rule
    category: str
    class_name: str | None


_Entry = TypeVar("_Entry", bound=CountedName)
_COMPARED = 10  # unmapped names, the most frequent ones, that get their nearest known names


def describe_unmapped(names: Mapping[str, int], class_map: ClassMap) -> Iterator[UnmappedEntry]:
    """Yield the names that are not in a class map, with their objects, most frequent first."""
    unknown = [(name, n) for name, n in _rank(names) if class_map.classify(name).category is None]
    for place, (name, instances) in enumerate(unknown):
        nearest = class_map.nearest(name) if place < _COMPARED else ()
        yield UnmappedEntry(name=name, instances=instances, nearest=nearest)


def _rank(names: Mapping[str, int]) -> list[tuple[str, int]]:
    return sorted(names.items(), key=lambda item: (-item[1], item[0]))


def list_resolved(names: Mapping[str, int], class_map: ClassMap) -> Iterator[ResolvedEntry]:
    """Yield the names that rules resolve, most frequent first."""
    for name, instances in _rank(names):
        known = class_map.classify(name)
        if known.rule is not None and known.category is not None:
            index = known.class_index
            yield ResolvedEntry(
                name=name,
                instances=instances,
                rule=known.rule,
                category=known.category,
                class_name=None if index is None else class_map.classes[index],
            )


class Totals(Record):
    """Sums over all scenes.

    `labelled`: rooms with a label; `placed`: scenes with geometry; `adjacent`: pairs of rooms.
    """

    scenes: int = 0
    rooms: int = 0
    labelled: int = 0
    objects: int = 0
    classified: int = 0
    unmapped: int = 0
    placed: int = 0
    adjacent: int = 0

    @classmethod
    def sum(cls, several: Iterable[Totals]) -> Totals:
        """Return the sums of several."""
        rows = [totals.model_dump() for totals in several]
        return cls(**{name: sum(row[name] for row in rows) for name in cls.model_fields})


class SourceEntry(Record):
    """One source of a dataset."""

    kind: str  # its name in the catalogue of sources
    version: str | None  # version of the source; None if it has none
    fingerprint: str  # of the annotations of all its scenes: the sum of their hashes
    class_map: ClassMapEntry  # the class map of its names
    options: dict[str, int | str] = Field(default_factory=dict)  # options that its bytes depend on
    terms: Terms | None = None  # licence and citation of its data; None if unknown
    # classes that it has a word for; of the others its buildings say nothing. None: all
    nameable: tuple[str, ...] | None = None
    # whether its buildings are all there; not if they are what a robot saw: no ground truth
    is_complete: bool = True


def add_fingerprints(fingerprints: Iterable[str]) -> str:
    """Return the fingerprint of what several are of, in whatever order."""
    return f"{sum(int(fingerprint, 16) for fingerprint in fingerprints) % 2**256:064x}"


def count_shards(scenes: int, *, scenes_per_shard: int) -> int:
    """Return how many shards a dataset has."""
    if scenes_per_shard < 1:
        raise RecipeError(f"scenes_per_shard: expected 1 or more, found {scenes_per_shard}")
    shards = -(-scenes // scenes_per_shard)
    if shards > _MAX_SHARDS:
        raise RecipeError(
            f"{scenes:,} scenes, {scenes_per_shard:,} per shard, make {shards:,} shards; expected "
            f"at most {_MAX_SHARDS:,}: set scenes_per_shard={-(-scenes // _MAX_SHARDS):,} or more"
        )
    return shards


class Manifest(Record):
    """All content of `dataset.json`."""

    format: Literal["bsg"] = "bsg"
    format_version: Literal[1] = FORMAT_VERSION
    generator: str
    class_space: ClassSpace
    sources: tuple[SourceEntry, ...] = Field(min_length=1)
    scenes_per_shard: int = Field(ge=1)
    totals: Totals
    files: tuple[FileEntry, ...]
    skipped: tuple[SkippedScene, ...] = ()
    left_out: tuple[SkippedScene, ...] = ()
    meshes: dict[str, MeshCoverage] = Field(default_factory=dict)
    unmapped: tuple[UnmappedEntry, ...] = ()
    resolved: tuple[ResolvedEntry, ...] = ()
    unknown_labels: tuple[CountedName, ...] = ()  # what sources call rooms of no kind we know
    split: SplitRecipe | None = None
    pairs: PairsRecipe | None = None

    @property
    def class_maps(self) -> tuple[ClassMapEntry, ...]:
        """The class maps of its sources, each once."""
        return tuple(dict.fromkeys(source.class_map for source in self.sources))

    @property
    def class_map_names(self) -> str:
        """The class maps of its sources, as text."""
        return ", ".join(sorted({entry.version for entry in self.class_maps}))

    def files_of(self, table: str) -> tuple[FileEntry, ...]:
        """Return the files of one table (`scenes`, `pairs`, ...) in order."""
        return tuple(file for file in self.files if file.path.startswith(f"{table}/"))

    def with_table(self, table: str, entries: tuple[FileEntry, ...], **update: object) -> Manifest:
        """Return the manifest with the files of `table` replaced by `entries`."""
        gone = {entry.path for entry in self.files_of(table)}
        others = (entry for entry in self.files if entry.path not in gone)
        files = sorted((*others, *entries), key=lambda entry: entry.path)
        return self.model_copy(update={"files": tuple(files), **update})

    def without_split(self) -> Manifest:
        """Return the manifest without the split, and without the pairs that follow from it."""
        return self.with_table("pairs", (), pairs=None).with_table("splits", (), split=None)


def combine_manifests(manifests: Sequence[Manifest]) -> Manifest:
    """Return the manifest of a dataset that holds what several hold, with all their files."""
    sources: dict[str, list[SourceEntry]] = {}  # those that differ in their annotations alone
    for source in (source for manifest in manifests for source in manifest.sources):
        sources.setdefault(source.model_dump_json(exclude={"fingerprint"}), []).append(source)
    return Manifest(
        generator=manifests[0].generator,
        class_space=manifests[0].class_space,
        sources=tuple(_join_sources(same) for _, same in sorted(sources.items())),
        scenes_per_shard=max(manifest.scenes_per_shard for manifest in manifests),
        totals=Totals.sum(manifest.totals for manifest in manifests),
        files=tuple(
            sorted((f for manifest in manifests for f in manifest.files), key=lambda f: f.path)
        ),
        skipped=tuple(skip for manifest in manifests for skip in manifest.skipped),
        left_out=tuple(skip for manifest in manifests for skip in manifest.left_out),
        meshes={scene: mesh for manifest in manifests for scene, mesh in manifest.meshes.items()},
        unmapped=_add_up(entry for manifest in manifests for entry in manifest.unmapped),
        resolved=_add_up(entry for manifest in manifests for entry in manifest.resolved),
        unknown_labels=_add_up(
            entry for manifest in manifests for entry in manifest.unknown_labels
        ),
    )


def _join_sources(same: Sequence[SourceEntry]) -> SourceEntry:
    fingerprint = add_fingerprints(source.fingerprint for source in same)
    return same[0].model_copy(update={"fingerprint": fingerprint})


def _add_up(entries: Iterable[_Entry]) -> tuple[_Entry, ...]:
    """Add up the objects of equal names, most frequent first."""
    times, first = Counter[tuple[object, ...]](), dict[tuple[object, ...], _Entry]()
    for entry in entries:
        key = tuple(value for name, value in entry if name not in ("instances", "nearest"))
        times[key] += entry.instances
        first.setdefault(key, entry)
    added = (entry.model_copy(update={"instances": times[key]}) for key, entry in first.items())
    return tuple(sorted(added, key=lambda entry: (-entry.instances, entry.name)))


def read_manifest(dataset: AnyPath) -> Manifest:
    """Read the manifest of a finished dataset.

    Raises:
        DatasetError: if there is none or it is damaged.
        MismatchError: if it is of another format version.
    """
    dataset = Path(dataset)
    return read_hashed_manifest(dataset)[0]


def read_hashed_manifest(dataset: Path) -> tuple[Manifest, str]:
    """Return the manifest of a finished dataset, and the sha256 of the bytes read."""
    path = dataset / MANIFEST
    if not path.is_file():
        raise _missing(dataset)
    data = read_bytes(path, error=DatasetError)
    return _parse_manifest(path, data), hashlib.sha256(data).hexdigest()


@lru_cache(maxsize=2)  # a command reads it several times, and parses it once
def _parse_manifest(path: Path, data: bytes) -> Manifest:
    try:
        document = parse_json(data, once=False)
        found = document.get("format_version")
    except (ValueError, AttributeError) as error:
        raise DatasetError(f"{path}: not JSON ({error}); build the dataset again") from error
    if found != FORMAT_VERSION:
        again = "build the dataset again, or use the program that made it"
        raise MismatchError(
            f"{path}: expected format version {FORMAT_VERSION}, found {found}; "
            + ask_to_upgrade(found, FORMAT_VERSION, otherwise=again),
            code="format-version",
            where=path,
        )
    try:
        manifest = Manifest.model_validate(
            {key: document[key] for key in document if key != "sha256"}
        )
        fault = "" if encode_manifest(manifest) == data else "its sha256 is that of other bytes"
    except ValidationError as error:
        fault = name_fault(error)
    if fault:
        raise DatasetError(
            f"{path}: is damaged ({fault}); take another copy of the dataset, or build it again"
        )
    return manifest


def _missing(dataset: Path) -> DatasetError:
    """Return the error for a folder without a manifest; it names an unfinished dataset beside."""
    code, what = "dataset-missing", "no such folder"
    staged = name_staged(resolve_links(dataset))
    if dataset.is_dir():
        code, what = "no-dataset", f"has no {MANIFEST}, so it is no finished dataset; make one with"
        what += " `bsg-data build --out DATASET`"
    elif dataset.is_file():
        what = "is a file; expected the folder of a dataset"
    elif staged.is_dir():
        what += f"; {staged} beside it belongs to a running or interrupted command: run that "
        what += "command again to continue"
    return DatasetError(f"{dataset}: {what}", code=code, where=dataset)


def encode_manifest(manifest: Manifest) -> bytes:
    """Return the bytes of `dataset.json`; its last key is the hash of all before that hash."""
    text = manifest.model_dump_json(indent=1).encode().removesuffix(b"\n}") + b',\n "sha256": "'
    return text + f'{hashlib.sha256(text).hexdigest()}"\n}}\n'.encode()


def hash_manifest(dataset: Path) -> str:
    """Return the sha256 of `dataset.json`, which identifies the whole dataset."""
    return hash_file(dataset / MANIFEST)


def require_class_space(manifest: Manifest, other: ClassSpace, *, what: str) -> None:
    """Refuse to mix two class spaces."""
    if manifest.class_space != other:
        raise MismatchError(
            f"{what} has class space {other}, the dataset has {manifest.class_space}; use two "
            "with the same class space, because histograms of different classes do not compare"
        )
