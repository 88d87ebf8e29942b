"""Publish datasets and change them: the manifest is the commit.

    DATASET.partial/           a dataset that is being built; one rename publishes it
    DATASET.partial/.build/    plan.json, and a report of every finished shard
    DATASET/splits/, pairs/    files named by their content: replacing dataset.json commits them

A killed command leaves the old dataset or the new one. What else it leaves has a name of ours that
no manifest has: the next command that writes there removes it.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from bsg_data.dataset.card import write_card, write_croissant
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import (
    CARD,
    CROISSANT,
    FILE_PATH,
    KEPT,
    MANIFEST,
    STAGED,
    FileEntry,
    Manifest,
    encode_manifest,
)
from bsg_data.errors import DatasetError
from bsg_data.files import flush_folder, hold, list_files, name_finished, resolve_links, write_bytes
from bsg_data.results import BUILD, FolderKind, recover

_OWN_PATH = re.compile(
    rf"{FILE_PATH.pattern}|{MANIFEST}|{CARD}|{re.escape(CROISSANT)}"
    rf"|(?:{re.escape(BUILD)}|{re.escape(STAGED)})/.*|{KEPT}/[0-9a-f]{{12}}/[^/]+\.csv"
)
_ADDED = ("pairs", "splits", STAGED)  # folders of what commands add later


def is_own(path: str) -> bool:
    """Say whether a path below a dataset is a name that commands give.

    >>> is_own("rooms/part-00000.parquet"), is_own("pairs/notes.txt")
    (True, False)
    """
    return bool(_OWN_PATH.fullmatch(name_finished(path)))


DATASET = FolderKind("dataset", mark=MANIFEST, owns=lambda _: is_own)


def list_strays(dataset: Path, manifest: Manifest) -> list[str]:
    """Return the sorted files in a dataset's folder that its manifest does not name."""
    known = {entry.path for entry in manifest.files} | {MANIFEST, CARD, CROISSANT}
    known |= {path for entry in manifest.class_maps for path in entry.paths}
    return [path for path in list_files(dataset) if path not in known]


def update_manifest(dataset: Path, write: Callable[[Dataset], Manifest]) -> Manifest:
    """Change a finished dataset, and return its new manifest.

    Args:
        dataset: its folder.
        write: called with the dataset, while no other command writes. It adds files that no
            manifest names yet, and returns the manifest that names them.
    """
    with hold(dataset):
        recover(resolve_links(dataset), DATASET)
        data = Dataset.open(dataset)
        manifest = data.manifest
        for name in _ADDED:
            if (dataset / name).is_symlink():
                message = f"{dataset / name}: is a link, and may lead anywhere; remove it"
                raise DatasetError(message, code="link", where=dataset / name)
        sweep(dataset, manifest)
        try:
            new = write(data)
            publish(dataset, new)
            manifest = new
        except OSError as error:
            message = f"{dataset}: cannot be changed ({error})"
            raise DatasetError(message, code="not-written", where=dataset) from error
        finally:
            sweep(dataset, manifest)
    return manifest


def name_by_content(
    dataset: Path, name: str, staged: Mapping[str, FileEntry]
) -> tuple[FileEntry, ...]:
    """Move staged files to names of their own content, and return their new entries.

    Args:
        dataset: its folder.
        name: begins the new name: `splits/ratios`, `pairs/uniform`.
        staged: name of the file below the new one → entry of the staged file; the name "" is that
            of a single file.
    """
    digest = hashlib.sha256("".join(entry.sha256 for entry in staged.values()).encode())
    stem = f"{name}-{digest.hexdigest()[:8]}"
    moved = []
    for inner, entry in staged.items():
        path = f"{stem}/{inner}" if inner else f"{stem}.parquet"
        (dataset / path).parent.mkdir(parents=True, exist_ok=True)
        (dataset / entry.path).replace(dataset / path)
        moved.append(entry.model_copy(update={"path": path}))
    for folder in {(dataset / entry.path).parent for entry in moved}:
        flush_folder(folder)
    return tuple(moved)


def publish(dataset: Path, manifest: Manifest) -> None:
    """Write the cards, which follow from it, then the manifest that names all files: the commit."""
    for name, text in ((CARD, write_card(manifest)), (CROISSANT, write_croissant(manifest))):
        partial = dataset / f".{name}.partial"  # not flushed: the next change writes it again
        partial.write_bytes(text.encode())
        partial.replace(dataset / name)
    write_bytes(dataset / MANIFEST, encode_manifest(manifest))


def sweep(dataset: Path, manifest: Manifest) -> None:
    """Remove our files that the manifest does not name."""
    for path in list_strays(dataset, manifest):
        if is_own(path) and not path.startswith(f"{BUILD}/"):
            (dataset / path).unlink()
    for folder in (*dataset.glob("pairs/*/"), *(dataset / name for name in _ADDED)):
        with suppress(OSError):
            folder.rmdir()  # unless anything is in it
