"""Keep copies of users' own class maps in a dataset: `class_maps/<sha256[:12]>/<version>.csv`.

The manifest names the class map of each source with its hash. Published maps come with the package;
of a user's own map the dataset keeps a copy. Each hash has its own folder, so two maps with one
name can coexist, and a merge copies folders.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from bsg_data.dataset.manifest import ClassMapEntry, Manifest
from bsg_data.errors import ClassMapError
from bsg_data.scene.class_map import (
    CLASSES,
    STRUCTURE,
    SUFFIX,
    OwnMap,
    parse_own_map,
    published_maps,
    read_own_map,
    write_own_map,
)

KEPT = "class_maps"


def keep_class_map(own: OwnMap, entry: ClassMapEntry, dataset: Path) -> Path:
    """Write the files of a class map into a dataset, and return the path of its `NAME.csv`."""
    return write_own_map(own, dataset / _path_of(entry).parent)


def name_kept(entry: ClassMapEntry, dataset: Path) -> str:
    """Return how `load_class_map` finds a class map of a dataset: by path if it is kept there."""
    kept = dataset / _path_of(entry)
    return str(kept) if kept.is_file() else entry.version


def read_class_maps(dataset: Path, manifest: Manifest) -> tuple[str | OwnMap, ...]:
    """Return the class maps of a dataset's sources: names of published ones, files of kept ones."""
    maps = (_read(dataset, entry) for entry in _list_entries(manifest))
    return tuple(maps)


def copy_class_maps(source: Path, manifest: Manifest, dataset: Path) -> None:
    """Copy the class maps that a dataset keeps into another one."""
    entries = _list_entries(manifest)
    for entry, found in zip(entries, read_class_maps(source, manifest), strict=True):
        if isinstance(found, OwnMap):
            keep_class_map(found, entry, dataset)


def list_kept(manifest: Manifest) -> Iterator[str]:
    """Yield the paths, below the dataset, of the files that it may keep."""
    for entry in filter(_is_own, _list_entries(manifest)):
        folder = _path_of(entry).parent
        for suffix in (SUFFIX, CLASSES, STRUCTURE):
            yield (folder / f"{entry.version}{suffix}").as_posix()


def _list_entries(manifest: Manifest) -> tuple[ClassMapEntry, ...]:
    return tuple(dict.fromkeys(source.class_map for source in manifest.sources))


def _is_own(entry: ClassMapEntry) -> bool:
    return entry.version not in published_maps()


def _path_of(entry: ClassMapEntry) -> PurePosixPath:
    return PurePosixPath(KEPT, entry.sha256[:12], f"{entry.version}{SUFFIX}")


def _read(dataset: Path, entry: ClassMapEntry) -> str | OwnMap:
    if not _is_own(entry):
        return entry.version
    path = dataset / _path_of(entry)
    own = read_own_map(path)
    found = parse_own_map(own).sha256
    if found != entry.sha256:
        raise ClassMapError(
            f"{path}: differs from the class map that the dataset was built with: expected sha256 "
            f"{entry.sha256[:12]}…, found {found[:12]}…; put the map back, or build again"
        )
    return own
