"""Change a finished dataset: one command at a time; the old files stay until the new are ready.

New files, cards and manifest are first written into a separate folder inside the dataset. After
that only renames are left, which need no disk space. Their order keeps the manifest correct at
every moment, so a killed command leaves one of these states:

    while files are written       the old dataset, and `.revision` beside its files
    after the first manifest      the old dataset without what was to be replaced
    while files are renamed       the same
    after the last manifest       the new dataset, and `.revision` with the old files

`bsg-data check` names leftover files. The same command, run again, removes them. Any other
interruption is undone at once.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from bsg_data.dataset.manifest import FILE_PATH, MANIFEST, Manifest, read_manifest
from bsg_data.dataset.own_files import remove_own
from bsg_data.dataset.publication import CARD, CROISSANT, REVISION, publish
from bsg_data.dataset.replacement import settle
from bsg_data.dataset.schema import TABLES
from bsg_data.errors import DatasetError
from bsg_data.files import flush_folder
from bsg_data.lock import hold
from bsg_data.signals import hold_signals

_PUBLISHED = (CARD, CROISSANT, MANIFEST)  # in this order: the manifest last


def revise(dataset: Path, write: Callable[[Manifest, Path], Manifest]) -> Manifest:
    """Change the files of a finished dataset and return its new manifest.

    Args:
        dataset: its folder.
        write: called with the manifest and a folder, while no other command can change either. It
            writes the new files into that folder, at their paths below the dataset, and returns
            the manifest with them. If it raises, the dataset stays as it was.

    Raises:
        DatasetError: if there is no dataset, another command is writing, or a file cannot be
            written or renamed.
    """
    staged = dataset / REVISION
    with hold(dataset):
        settle(dataset)
        old = read_manifest(dataset)
        remove_own(dataset, below=REVISION)  # of a killed command
        try:
            new = write(old, staged / "new")
            with hold_signals():
                _swap(dataset, old, new, staged)
        except OSError as error:
            raise DatasetError(f"{dataset}: cannot be changed ({error})") from error
        finally:
            remove_own(dataset, below=REVISION)
    return new


def remove_left(dataset: Path) -> None:
    """Remove leftovers of a killed change from a dataset; usually there are none.

    Raises:
        DatasetError: if another command is writing, or something that is not ours is there.
    """
    if (dataset / REVISION).exists():
        with hold(dataset):
            settle(dataset)
            remove_own(dataset, below=REVISION)


def _swap(dataset: Path, old: Manifest, new: Manifest, staged: Path) -> None:
    """Put the new files in the place of the old ones."""
    arriving = [entry.path for entry in new.files if (staged / "new" / entry.path).is_file()]
    leaving = _list_leaving(dataset, new, arriving)
    _refuse_links(dataset, arriving)
    publish(staged / "new", new)
    publish(staged / "rest", _without(old, leaving))
    for name in _PUBLISHED:
        if (dataset / name).is_file():
            (staged / "old").mkdir(exist_ok=True)
            shutil.copy2(dataset / name, staged / "old" / name)
    moved: list[tuple[Path, Path]] = []
    try:
        if any(entry.path in leaving for entry in old.files):
            _take(staged / "rest", dataset)
        _move(leaving, dataset, staged / "old", moved)
        _move(arriving, staged / "new", dataset, moved)
        _take(staged / "new", dataset)
    except BaseException:
        for source, target in reversed(moved):
            if not source.exists():  # it was renamed, and not stopped just before that
                target.rename(source)
        _take(staged / "old", dataset)
        raise
    finally:
        _remove_empty(dataset)


def _remove_empty(dataset: Path) -> None:
    """Remove the folders of tables that have no file: this change emptied them, or a killed one."""
    for name in (*TABLES, "pairs"):
        with suppress(OSError):
            (dataset / name).rmdir()  # unless anything is in it


def _list_leaving(dataset: Path, new: Manifest, arriving: Sequence[str]) -> list[str]:
    """Return the dataset's own files that are replaced or no longer listed.

    Those that a killed command left are among them. The user's own, which have other names, are
    not.
    """
    stay = {entry.path for entry in new.files} - set(arriving)
    paths = (path.relative_to(dataset).as_posix() for path in dataset.rglob("*.parquet"))
    return sorted(path for path in paths if FILE_PATH.fullmatch(path) and path not in stay)


def _without(manifest: Manifest, paths: Sequence[str]) -> Manifest:
    """Return a manifest without some files, and without the recipe of a table that loses one."""
    tables = {path.split("/")[0] for path in paths}
    if "splits.parquet" in tables:
        manifest = manifest.without_split()
    if "pairs" in tables:
        manifest = manifest.without_pairs()
    files = tuple(entry for entry in manifest.files if entry.path not in paths)
    return manifest.model_copy(update={"files": files})


def _refuse_links(dataset: Path, paths: Sequence[str]) -> None:
    """Refuse to write through a link: it may lead out of the dataset."""
    for folder in sorted({(dataset / path).parent for path in paths} - {dataset}):
        if folder.is_symlink():
            raise DatasetError(
                f"{folder}: is a link; a dataset's folders must not be links; remove it"
            )


def _move(paths: Sequence[str], source: Path, target: Path, moved: list[tuple[Path, Path]]) -> None:
    """Rename files from one folder into another, and note each in `moved`.

    It is noted first: Ctrl-C may come when it is renamed, before anything else is done.
    """
    for path in paths:
        (target / path).parent.mkdir(parents=True, exist_ok=True)
        moved.append((source / path, target / path))
        (source / path).rename(target / path)
    for folder in {(target / path).parent for path in paths}:
        flush_folder(folder)  # before a manifest speaks of what is there now


def _take(folder: Path, dataset: Path) -> None:
    """Rename cards and manifest from a folder into the dataset."""
    for name in _PUBLISHED:
        if (folder / name).is_file():
            (folder / name).replace(dataset / name)
    flush_folder(dataset)
