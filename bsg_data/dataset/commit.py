"""Publish datasets and change them: the manifest is the commit.

    DATASET.partial/           a dataset that is being built; one rename publishes it
    DATASET.partial/.build/    plan.json, and a report of every finished shard
    DATASET/.staged/           the files of a change, each renamed to its place, the manifest last

A killed command leaves the old dataset or the new one. Where `.staged` is there, the next command
that changes the dataset removes it, and the splits and pairs that the manifest does not list.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from bsg_data.dataset.card import write_card, write_croissant
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import (
    CARD,
    CROISSANT,
    MANIFEST,
    STAGED,
    STAGED_PATH,
    FileEntry,
    Manifest,
    encode_manifest,
    read_manifest,
)
from bsg_data.errors import DatasetError
from bsg_data.files import (
    flush_folder,
    hold,
    list_files,
    remove,
    resolve_links,
    write_bytes,
    writing,
)
from bsg_data.places import BUILD, FolderKind, is_left
from bsg_data.results import recover


def _list_known(manifest: Manifest) -> set[str]:
    known = {entry.path for entry in manifest.files} | {MANIFEST, CARD, CROISSANT}
    return known | {path for entry in manifest.class_maps for path in entry.paths}


def _list_own(dataset: Path) -> set[str]:
    """Return the files of a dataset, with what a killed command left in it."""
    return _list_known(read_manifest(dataset)) | _list_staged(dataset)


def _list_staged(dataset: Path) -> set[str]:
    """Return the files that a change may have left which was stopped."""
    files = list_files(dataset) if (dataset / STAGED).is_dir() else []
    return {path for path in files if STAGED_PATH.fullmatch(path)}


DATASET = FolderKind("dataset", mark=MANIFEST, lists=_list_own)


def list_strays(dataset: Path, manifest: Manifest) -> list[str]:
    """Return the sorted files in a dataset's folder that no command of ours put there."""
    known = _list_known(manifest) | _list_staged(dataset)
    plan = f"{BUILD}/" if is_left(dataset) else "/"
    return [path for path in list_files(dataset) if path not in known and not path.startswith(plan)]


def update_manifest(
    dataset: Path, write: Callable[[Dataset], Manifest], *, is_made: Callable[[Manifest], bool]
) -> Manifest:
    """Change a finished dataset, and return its new manifest.

    Args:
        dataset: its folder.
        write: called with the dataset, while no other command writes. It stages files, and returns
            the manifest that names them.
        is_made: says whether a manifest is that of this change, so that after a kill it is done.
    """
    with hold(dataset):
        recover(resolve_links(dataset), DATASET)
        data = Dataset.open(dataset)
        for name in ("pairs", "splits", STAGED):
            if (dataset / name).is_symlink():
                message = f"{dataset / name}: is a link, and may lead anywhere; remove it"
                raise DatasetError(message, code="link", where=dataset / name)
        was_stopped = (dataset / STAGED).is_dir()
        _sweep(dataset)
        if was_stopped and is_made(data.manifest):
            return data.manifest
        staged = dataset / STAGED
        try:
            with writing(dataset):
                staged.mkdir()
                new = write(data)
                publish(staged, new)
                _move(staged, dataset)
        finally:
            _sweep(dataset)
    return new


def name_by_content(
    dataset: Path, name: str, staged: Mapping[str, FileEntry]
) -> tuple[FileEntry, ...]:
    """Give staged files names of their own content, and return their new entries.

    Args:
        dataset: its folder.
        name: begins the new name: `splits/ratios`, `pairs/uniform`.
        staged: name of the file below the new one → entry of the staged file; the name "" is that
            of a single file.
    """
    digest = hashlib.sha256("".join(entry.sha256 for entry in staged.values()).encode())
    stem = f"{name}-{digest.hexdigest()[:8]}"
    named = []
    for inner, entry in staged.items():
        path = f"{stem}/{inner}" if inner else f"{stem}.parquet"
        _rename(dataset / entry.path, dataset / STAGED / path)
        named.append(entry.model_copy(update={"path": path}))
    return tuple(named)


def publish(folder: Path, manifest: Manifest) -> None:
    """Write the cards, which follow from a manifest, and the manifest, last."""
    for name, text in ((CARD, write_card(manifest)), (CROISSANT, write_croissant(manifest))):
        (folder / name).write_text(text, "utf-8", newline="\n")  # each change writes it
    write_bytes(folder / MANIFEST, encode_manifest(manifest))


def _move(staged: Path, dataset: Path) -> None:
    """Move what is staged to its place, the manifest last: the commit."""
    names = list_files(staged)
    for name in sorted(names, key=lambda name: name == MANIFEST):
        if name == MANIFEST:
            for folder in {(dataset / other).parent for other in names}:
                flush_folder(folder)
        _rename(staged / name, dataset / name)
    flush_folder(dataset)


def _rename(path: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    path.replace(target)


def _sweep(dataset: Path) -> None:
    """Remove what a change left; `.staged` last, for by it the next command is told."""
    for path in _list_staged(dataset) - _list_known(read_manifest(dataset)):
        (dataset / path).unlink()
        with suppress(OSError):
            (dataset / path).parent.rmdir()  # unless anything is in it
    for folder in (dataset / "pairs", dataset / "splits"):
        with suppress(OSError):
            folder.rmdir()
    remove(dataset / STAGED)
