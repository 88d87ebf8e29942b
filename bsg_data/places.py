"""Where something may be written: nowhere in a dataset, and over what is ours alone.

A folder of ours has a mark, which says what its files are; it is replaced if it holds no others. A
single file is one that the user named.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import list_files, refuse_device, resolve_links
from bsg_data.seal import SEAL, read_seal

BUILD = ".build"  # in a folder that is not in place yet, or was put there just now
PLAN = f"{BUILD}/plan.json"
_DATASET = "dataset.json"  # the file by which a dataset is known
_LOCK = re.compile(r"\..+\.lock")  # left by a killed command; it is empty


@dataclass(frozen=True, slots=True)
class FolderKind:
    """A kind of folder with files of ours alone."""

    what: str  # in words: `dataset`
    mark: str  # the file that makes it a finished one
    lists: Callable[[Path], Collection[str]]  # what a finished one says are its files


RESULTS = FolderKind("folder of results", SEAL, lambda path: {SEAL, *(read_seal(path) or ())})


def require_free(folder: Path, kind: FolderKind, *, force: bool) -> None:
    """Refuse a path where no folder of a kind can be put."""
    with suppress(FileNotFoundError):  # the working folder was removed
        if folder in (Path.cwd(), *Path.cwd().parents):
            raise DatasetError(
                f"{folder}: is the working folder or contains it; run this from another folder",
                code="working-folder",
                where=folder,
            )
    for outer in folder.parents:
        _refuse_inside(folder, outer)
    if not os.path.lexists(folder) or (folder.is_dir() and not any(folder.iterdir())):
        return
    if not (folder / kind.mark).is_file():
        message = f"{folder}: exists and is no {kind.what}; choose another --out"
        raise DatasetError(message, code="path-taken", where=folder)
    if not force and not is_left(folder):
        raise taken(folder)
    refuse_foreign(folder, _list_foreign(folder, kind.lists(folder)))


def is_left(folder: Path) -> bool:
    """Say whether a folder has its plan: it is not in place, or a killed command put it there."""
    return (folder / PLAN).is_file()


def _list_foreign(folder: Path, listed: Collection[str]) -> Iterator[str]:
    """Yield the files of a folder that are not listed, nor of results in it, nor left by a kill."""
    for name in list_files(folder):
        top = folder / name.partition("/")[0]
        is_inner = (top / SEAL).is_file() or is_left(top) or _is_lock(top)
        is_plan = top.name == BUILD and is_left(folder)
        if name not in listed and not is_inner and not is_plan:
            yield name


def _is_lock(path: Path) -> bool:
    return _LOCK.fullmatch(path.name) is not None and path.is_file() and not path.stat().st_size


def refuse_foreign(folder: Path, foreign: Iterable[str]) -> None:
    """Refuse to replace a folder that holds a file of somebody else."""
    for name in foreign:
        message = (
            f"{folder}: holds {name}, which is not ours; move it away, and run the command again"
        )
        raise DatasetError(message, code="foreign-file", where=folder)


def refuse_datasets(path: Path) -> None:
    """Refuse to write into a dataset, because a dataset lists and hashes all its files.

    Call this before anything is written, also before a lock: its file lies beside the folder.
    """
    resolved = resolve_links(path)
    for outer in (resolved, *resolved.parents):
        _refuse_inside(path, outer)


def _refuse_inside(path: Path, outer: Path) -> None:
    if (outer / _DATASET).is_file():
        message = f"{path}: is in the dataset {outer}; choose another place"
        raise DatasetError(message, code="inside-dataset", where=path)


def refuse_file(path: Path, *, force: bool) -> None:
    """Refuse to write a file into a dataset, over sealed results, or, without `force`, at all."""
    refuse_datasets(path)
    resolved = resolve_links(path.parent) / path.name  # a link to the folder leads to the same file
    for folder in resolved.parents:
        sealed = {SEAL, *(read_seal(folder) or ())} if (folder / SEAL).is_file() else ()
        if resolved.name == SEAL or resolved.relative_to(folder).as_posix() in sealed:
            raise DatasetError(
                f"{path}: is one of the results that {SEAL} lists in {folder}; name another file",
                code="sealed-file",
                where=path,
            )
    if path.is_dir():
        message = f"{path}: is a folder; name a file"
        raise DatasetError(message, code="path-folder", where=path)
    refuse_device(path)
    if os.path.lexists(path) and not force:
        raise taken(path)


def taken(path: Path) -> DatasetError:
    """Return the error for a path where something is."""
    message = f"{path}: is there already; --force replaces it"
    return DatasetError(message, code="path-taken", where=path)
