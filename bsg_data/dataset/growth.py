"""Let a dataset grow in `<out>.partial`, and move it to `<out>` by one rename."""

from __future__ import annotations

import glob
import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from bsg_data.dataset.manifest import MANIFEST, Manifest, read_manifest
from bsg_data.dataset.own_files import is_own, refuse_foreign, remove_own
from bsg_data.dataset.publication import PLAN, RECIPE, REPORTS, list_paths, list_strays, publish
from bsg_data.dataset.replacement import name_growing, put_in_place, restore, settle
from bsg_data.errors import DatasetError
from bsg_data.files import write_bytes
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import MANIFEST_FILE
from bsg_data.lock import hold
from bsg_data.recipes import Record

MOST_BYTES = 255  # of a name, in usual file systems
_ADDED = len("..partial.shard-00000.abcdefgh")  # to the name of a dataset while it grows
SECONDS_TO_JOIN = 60.0  # a part waits so long while another one makes the folder


def refuse_place(out: Path) -> None:
    """Refuse a path where a growing dataset could not be renamed to.

    The files beside it need names. The working folder cannot be in it: the shell would go on in the
    folder that was replaced, which is removed.

    Raises:
        DatasetError: with the number of bytes that the name may have, or with another folder to
            work in.
    """
    size, most = len(os.fsencode(out.name)), MOST_BYTES - _ADDED
    if size > most:
        raise DatasetError(
            f"{out}: expected a name of at most {most} bytes, found {size}; choose a shorter one"
        )
    with suppress(FileNotFoundError):  # the working folder was removed
        here = Path.cwd()
        if out.name and out in (here, *here.parents):
            raise DatasetError(
                f"{out}: is the working folder or contains it, so it cannot be replaced; change to "
                f"another folder, such as {out.parent}, and run again"
            )


def make_parent(out: Path) -> None:
    """Make the folder that a dataset will be in.

    Raises:
        DatasetError: if it cannot be made.
    """
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DatasetError(f"{out}: cannot be written ({error.strerror})") from error


def refuse_overwriting(out: Path, *, force: bool) -> None:
    """Refuse a path for a dataset that holds something else.

    Args:
        out: folder of the new dataset.
        force: allow replacing a finished dataset, if nothing else is in its folder.

    Raises:
        DatasetError: if something is there that may not be replaced.
    """
    outer = next((folder for folder in out.parents if (folder / MANIFEST).is_file()), None)
    if outer is not None:
        raise DatasetError(f"{out}: is inside the dataset {outer}; choose another --out")
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    if not (out / MANIFEST).is_file():
        raise DatasetError(f"{out}: exists and is no dataset; choose another --out")
    if not force:
        raise DatasetError(f"{out}: is a finished dataset; --force replaces it")
    try:
        manifest = read_manifest(out)
    except DatasetError as error:
        raise DatasetError(f"{error}. --force does not remove it; move it away") from error
    users = [name for name in list_strays(out, manifest) if not is_own(name)]
    if users:
        raise DatasetError(
            f"{out}: holds {users[0]}, which is no part of the dataset; move it away, then --force"
        )


def open_partial(out: Path, recipe: Record) -> Path:
    """Return the folder of a growing dataset; files of an interrupted build of the recipe stay.

    Raises:
        DatasetError: if something else is there.
    """
    partial = name_growing(out)
    path = partial / RECIPE
    if partial.is_symlink():
        raise DatasetError(f"{partial}: is a link, and no build of this program; move it away")
    if partial.exists():
        if _read(path) == _encode(recipe):
            refuse_foreign(partial)
            return partial
        if (partial / PLAN).exists():
            raise DatasetError(
                f"{partial}: holds parts of another build (--parts); remove it, or choose "
                "another --out"
            )
        if not path.is_file() and not _is_bare(partial):
            raise DatasetError(
                f"{partial}: is in the way, and no build of this program; move it away"
            )
        remove_growing(out)  # left by another interrupted build
    try:
        write_bytes(path, _encode(recipe))
    except BaseException:
        with suppress(OSError):
            path.parent.rmdir()
            partial.rmdir()
        raise
    return partial


def remove_growing(out: Path) -> None:
    """Remove a growing dataset, the recipe last, because it identifies the rest.

    Raises:
        DatasetError: if the folder holds foreign files, or cannot be removed.
    """
    remove_own(name_growing(out), last=[RECIPE])


def recall(out: Path, recipe: Record | None = None) -> Manifest | None:
    """Finish the last steps of a command that was killed after its dataset was complete.

    The caller holds the lock of `out`.

    Args:
        out: folder of the dataset.
        recipe: recipe of the current command; None: any.

    Returns:
        The manifest, if the dataset belongs to this recipe; None if there is more to do.

    Raises:
        DatasetError: if something foreign is in the way.
    """
    restore(out)
    found = _read(out / RECIPE)
    settle(out)
    done = found is not None and (recipe is None or found == _encode(recipe))
    return read_manifest(out) if done else None


def join_partial(
    out: Path, recipe: Record, plan: Record, *, prepare: Callable[[Path], None]
) -> Path:
    """Return the folder of a dataset that several processes build in parts.

    The first process makes the folder; the others wait for that only.

    Args:
        out: folder of the finished dataset.
        recipe: recipe of the build.
        plan: plan to store there, for the final step.
        prepare: called with the new folder by the process that makes it.

    Raises:
        DatasetError: if another build or something else is there.
    """
    partial = name_growing(out)
    wanted = plan.model_dump_json().encode()
    if _read(partial / PLAN) != wanted:
        with hold(out, wait=SECONDS_TO_JOIN):
            settle(out)
            found = _read(partial / PLAN)
            if found is None:
                prepare(open_partial(out, recipe))
                write_bytes(partial / PLAN, wanted)
            elif found != wanted:
                raise DatasetError(
                    f"{partial}: holds parts of another build (other options, or the source "
                    "changed since); remove it, or choose another --out"
                )
    return partial


def name_unfinished(growing: Path) -> str:
    """Return the first part of the names of folders in which shards are built."""
    return f".{growing.name}.shard-"


def _encode(recipe: Record) -> bytes:
    return recipe.model_dump_json().encode()


def _read(path: Path) -> bytes | None:
    return read_bytes(path, MANIFEST_FILE, error=_refuse) if path.is_file() else None


def _refuse(said: str) -> DatasetError:
    return DatasetError(f"{said}; no build of this program wrote it; move it away")


def _is_bare(partial: Path) -> bool:
    """Say whether a folder holds only what a build leaves that is killed at its start or end."""
    return partial.is_dir() and set(list_paths(partial)) <= {f"{REPORTS}/.recipe.json.partial"}


def finish(out: Path, manifest: Manifest, *, force: bool) -> None:
    """Publish a complete dataset, and rename it to its final path.

    Raises:
        DatasetError: if the path was taken meanwhile, or a file cannot be renamed.
    """
    growing = name_growing(out)
    refuse_foreign(growing)
    refuse_overwriting(out, force=force)
    for name in list_strays(growing, manifest):
        if not name.startswith(f"{REPORTS}/"):
            (growing / name).unlink()
    publish(growing, manifest)
    put_in_place(out)
    for left in growing.parent.glob(f"{glob.escape(name_unfinished(growing))}*"):
        shutil.rmtree(left, ignore_errors=True)  # left by a killed or late process
