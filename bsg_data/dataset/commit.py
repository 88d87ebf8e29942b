"""Put datasets in place and change them: the manifest is the commit.

    DATASET.partial/           a dataset that is being built; one rename puts it in place
    DATASET.partial/.build/    plan.json, and a report of every finished shard
    DATASET/splits/, pairs/    files named by their content: replacing dataset.json commits them

A killed command leaves the old dataset or the new one. What else it leaves has a name of ours that
no manifest has: the next command that writes there removes it.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import re
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from bsg_data.dataset.card import write_card, write_croissant
from bsg_data.dataset.kept_maps import KEPT
from bsg_data.dataset.manifest import (
    CARD,
    CROISSANT,
    FILE_PATH,
    MANIFEST,
    STAGED,
    FileEntry,
    Manifest,
    encode_manifest,
    read_card_hashes,
    read_manifest,
    seal_manifest,
)
from bsg_data.errors import DatasetError
from bsg_data.files import flush_folder, hold, resolve_links, write_bytes
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.recipes import Record

BUILD = ".build"  # of a dataset that is not in its place yet, or replaced another just now
PLAN = f"{BUILD}/plan.json"
_ASIDE = ".{}.replaced"  # name of a dataset while another takes its place
SECONDS_TO_JOIN = 60.0  # a part waits so long while another one makes the folder
_OURS = re.compile(
    rf"{FILE_PATH.pattern}|{MANIFEST}|{CARD}|{re.escape(CROISSANT)}"
    rf"|(?:{re.escape(BUILD)}|{re.escape(STAGED)})/.*|{KEPT}/[0-9a-f]{{12}}/[^/]+\.csv"
)
_ADDED = ("pairs", "splits", STAGED)  # folders of what commands add later
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


def name_growing(out: Path) -> Path:
    """Return the folder that a dataset grows in."""
    return out.with_name(f"{out.name}.partial")


def require_place(out: Path, *, force: bool) -> None:
    """Refuse a path where no dataset can be put."""
    with suppress(FileNotFoundError):  # the working folder was removed
        if out in (Path.cwd(), *Path.cwd().parents):
            raise DatasetError(
                f"{out}: is the working folder or contains it; run this from another folder",
                code="working-folder",
                where=out,
            )
    outer = next((folder for folder in out.parents if (folder / MANIFEST).is_file()), None)
    if outer is not None:
        message = f"{out}: is inside the dataset {outer}; choose another --out"
        raise DatasetError(message, code="inside-dataset", where=out)
    if not out.exists() or (out.is_dir() and not any(out.iterdir())) or (out / BUILD).exists():
        return
    if not (out / MANIFEST).is_file():
        message = f"{out}: exists and is no dataset; choose another --out"
        raise DatasetError(message, code="path-taken", where=out)
    if not force:
        message = f"{out}: is a finished dataset; --force replaces it"
        raise DatasetError(message, code="dataset-exists", where=out)
    _require_own(out)


def _require_own(folder: Path) -> None:
    """Refuse a folder with a file that no command of this program wrote."""
    foreign = [path for path in _list_paths(folder) if not is_own(path)]
    if folder.is_symlink() or foreign:
        what = "is a link" if folder.is_symlink() else f"holds {foreign[0]}, which is not ours"
        message = f"{folder}: {what}; move it away, and run the command again"
        raise DatasetError(message, code="foreign-file", where=folder)


def is_own(path: str) -> bool:
    """Say whether a path below a dataset is a name that commands give.

    >>> is_own("rooms/part-00000.parquet"), is_own("pairs/notes.txt")
    (True, False)
    """
    return bool(_OURS.fullmatch(re.sub(r"(^|/)\.([^/]+)\.partial$", r"\1\2", path)))


def _list_paths(folder: Path) -> list[str]:
    """Return the sorted relative paths of all files below a folder."""
    found = (path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir())
    return sorted(path.relative_to(folder).as_posix() for path in found)


def list_strays(dataset: Path, manifest: Manifest) -> list[str]:
    """Return the sorted files in a dataset's folder that its manifest does not name."""
    known = {entry.path for entry in manifest.files} | {MANIFEST, CARD, CROISSANT}
    known |= {path for entry in manifest.class_maps for path in entry.paths}
    return [path for path in _list_paths(dataset) if path not in known]


@contextmanager
def growing(
    out: Path, plan: Record, *, force: bool, shared: bool = False
) -> Iterator[tuple[Path, bool]]:
    """Lock the place of a dataset, and yield the folder that it grows in.

    Args:
        out: folder of the dataset.
        plan: all that determines its bytes. A folder with the same plan is gone on with.
        force: whether a finished dataset may be replaced.
        shared: whether other processes build parts: then the lock is held only here.

    Yields:
        The folder; whether the same dataset is in its place already.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    folder = name_growing(out)
    if shared and _read(folder / PLAN) == _encode(plan):
        yield folder, False
        return
    with hold(out, wait=SECONDS_TO_JOIN if shared else 0.0):
        done = _settle(out) == _encode(plan)
        if not done:
            require_place(out, force=force)
            _prepare(folder, plan)
        if done or not shared:
            yield (out if done else folder), done
            return
    yield folder, False


def _prepare(folder: Path, plan: Record) -> None:
    """Make the folder of a growing dataset, unless the same plan began it."""
    if folder.exists() or folder.is_symlink():
        _require_own(folder)
        found = _read(folder / PLAN)
        if found == _encode(plan):
            return
        if any(folder.glob(f"{BUILD}/parts-of-*")):
            raise DatasetError(
                f"{folder}: holds parts of another build (other options, or the source changed "
                "since); remove it, or choose another --out",
                code="other-build",
                where=folder,
            )
        shutil.rmtree(folder)
    (folder / BUILD).mkdir(parents=True)
    partial = folder / f"{PLAN}.partial"  # not flushed: after a loss of power all is built anew
    partial.write_bytes(_encode(plan))
    partial.replace(folder / PLAN)


def put_in_place(out: Path, manifest: Manifest) -> None:
    """Publish a dataset that has grown, move it to its place, and remove the one it replaces."""
    folder = name_growing(out)
    for name in set(list_strays(folder, manifest)):
        if not name.startswith(f"{BUILD}/"):
            (folder / name).unlink()
    try:
        publish(folder, manifest)
        flush_folder(folder)
        if (out / MANIFEST).is_file():
            _exchange(folder, out)
        else:
            folder.rename(out)
        flush_folder(out.parent)
    except OSError as error:
        raise DatasetError(
            f"{out}: cannot be put in place ({error.strerror or error}); the finished dataset is "
            f"{folder}: run the command again",
            code="not-written",
            where=out,
        ) from error
    _settle(out)


def _settle(out: Path) -> bytes | None:
    """Finish what a killed command began at the place of a dataset; the caller holds the lock.

    Returns:
        The plan of the dataset, if it was put in place by a command that did not come to its end.
    """
    folder, aside = name_growing(out), out.with_name(_ASIDE.format(out.name))
    if aside.is_dir() and not out.exists():  # killed between two renames
        (folder if (folder / MANIFEST).is_file() else aside).rename(out)
    if not (out / BUILD).is_dir():
        return None
    plan = _read(out / PLAN)
    for old in (folder, aside):
        if old.is_dir() and not (old / BUILD).exists():  # what was replaced has none
            shutil.rmtree(old)
    for path in sorted((out / BUILD).iterdir(), key=lambda path: path.name == "plan.json"):
        path.unlink()
    (out / BUILD).rmdir()
    return plan


def revise(dataset: Path, write: Callable[[Manifest], Manifest]) -> Manifest:
    """Change a finished dataset, and return its new manifest.

    Args:
        dataset: its folder.
        write: called with the manifest, while no other command writes. It adds files that no
            manifest names yet, and returns the manifest that names them.
    """
    with hold(dataset):
        _settle(resolve_links(dataset))
        manifest = read_manifest(dataset)
        for name in _ADDED:
            if (dataset / name).is_symlink():
                message = f"{dataset / name}: is a link, and may lead anywhere; remove it"
                raise DatasetError(message, code="link", where=dataset / name)
        sweep(dataset, manifest)
        try:
            new = write(manifest)
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
        name: first part of the new name: `splits/ratios`, `pairs/uniform`.
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
    """Write the cards, then the manifest that names all files: the commit."""
    cards = _write_cards(dataset, manifest)
    write_bytes(dataset / MANIFEST, seal_manifest(encode_manifest(manifest), cards))


def _write_cards(dataset: Path, manifest: Manifest) -> dict[str, bytes]:
    """Write the card and the Croissant description; they follow from the manifest."""
    cards = {CARD: write_card(manifest).encode(), CROISSANT: write_croissant(manifest).encode()}
    for name, card in cards.items():
        (dataset / name).write_bytes(card)
    return cards


def sweep(dataset: Path, manifest: Manifest) -> None:
    """Remove our files that the manifest does not name; mend cards that are not its own."""
    for path in list_strays(dataset, manifest):
        if is_own(path):
            (dataset / path).unlink()
    for folder in (*dataset.glob("pairs/*/"), *(dataset / name for name in _ADDED)):
        with suppress(OSError):
            folder.rmdir()  # unless anything is in it
    hashes = read_card_hashes(dataset)
    paths = {dataset / name: sha256 for name, sha256 in hashes.items()}
    if not all(path.is_file() and hash_file(path) == sha256 for path, sha256 in paths.items()):
        _write_cards(dataset, manifest)


def _exchange(new: Path, old: Path) -> None:
    """Let two folders change places: in one step on Linux, elsewhere by two renames."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if sys.platform == "linux" and rename is not None:
        sys.audit("os.rename", str(new), str(old), -1, -1)  # as os.rename does
        paths = os.fsencode(new), os.fsencode(old)
        if rename(_AT_FDCWD, paths[0], _AT_FDCWD, paths[1], _RENAME_EXCHANGE) == 0:
            return
    old.rename(old.with_name(_ASIDE.format(old.name)))
    new.rename(old)


def _encode(plan: Record) -> bytes:
    return plan.model_dump_json().encode()


def _read(path: Path) -> bytes | None:
    return path.read_bytes() if path.is_file() else None
