"""A dataset grows beside its place, in `<out>.partial`, and becomes `<out>` by one rename."""

from __future__ import annotations

import glob
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

SECONDS_TO_JOIN = 60.0  # that a part waits while another one makes the folder


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
    """Refuse a place where something is that may not be replaced.

    Args:
        out: where a dataset will be.
        force: whether a finished dataset, with nothing else in its folder, may be replaced.

    Raises:
        DatasetError: saying what is there.
    """
    outer = next((folder for folder in out.parents if (folder / MANIFEST).is_file()), None)
    if outer is not None:
        raise DatasetError(f"{out}: is inside the dataset {outer}; choose another --out")
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    if not (out / MANIFEST).is_file():
        raise DatasetError(f"{out}: is no dataset and is left alone; choose another --out")
    if not force:
        raise DatasetError(f"{out}: is a finished dataset; --force replaces it")
    try:
        manifest = read_manifest(out)
    except DatasetError as error:
        raise DatasetError(f"{error}. --force does not remove it; move it away") from error
    users = [name for name in list_strays(out, manifest) if not is_own(name)]
    if users:
        raise DatasetError(
            f"{out}: holds {users[0]}, which is not the dataset's; move it away, then --force"
        )


def open_partial(out: Path, recipe: Record) -> Path:
    """Return the folder that a dataset grows in, keeping what the same recipe left there.

    Raises:
        DatasetError: if something else is in the way.
    """
    partial = name_growing(out)
    path = partial / RECIPE
    if partial.is_symlink():
        raise DatasetError(f"{partial}: is a link and no build of ours; move it away")
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
            raise DatasetError(f"{partial}: is in the way and no build of ours; move it away")
        remove_growing(out)  # of a build that was stopped and is not this one
    try:
        write_bytes(path, _encode(recipe))
    except BaseException:
        with suppress(OSError):
            path.parent.rmdir()
            partial.rmdir()
        raise
    return partial


def remove_growing(out: Path) -> None:
    """Remove what has grown for a place, the recipe last: whatever is left is known by it.

    Raises:
        DatasetError: if it holds something that is not ours, or cannot be removed.
    """
    remove_own(name_growing(out), last=[RECIPE])


def recall(out: Path, recipe: Record | None = None) -> Manifest | None:
    """Finish what a killed command was about to do when its dataset was whole.

    Whoever calls it holds the lock of `out`.

    Args:
        out: where the dataset is.
        recipe: of the command that runs now; None for whatever was left to be finished.

    Returns:
        The manifest, if that was the dataset of this recipe; None if there is more to do.

    Raises:
        DatasetError: if something that is not ours is in the way.
    """
    restore(out)
    found = _read(out / RECIPE)
    settle(out)
    done = found is not None and (recipe is None or found == _encode(recipe))
    return read_manifest(out) if done else None


def join_partial(
    out: Path, recipe: Record, plan: Record, *, prepare: Callable[[Path], None]
) -> Path:
    """Return the folder that a dataset grows in by parts, which several processes make at once.

    Whoever comes first makes it; the others wait for that moment, and only for that.

    Args:
        out: where the dataset will be.
        recipe: of the build.
        plan: what is left there for whoever finishes it.
        prepare: called with the folder by whoever makes it.

    Raises:
        DatasetError: if something else is in the way, also another build.
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
                    f"{partial}: holds parts of another build: of other options, or of a source "
                    "that has changed since; remove it, or choose another --out"
                )
    return partial


def name_unfinished(growing: Path) -> str:
    """Return how the folders begin, beside a dataset that grows, in which shards are made."""
    return f".{growing.name}.shard-"


def _encode(recipe: Record) -> bytes:
    return recipe.model_dump_json().encode()


def _read(path: Path) -> bytes | None:
    return read_bytes(path, MANIFEST_FILE, error=_refuse) if path.is_file() else None


def _refuse(said: str) -> DatasetError:
    return DatasetError(f"{said}; no build of ours wrote it: move it away")


def _is_bare(partial: Path) -> bool:
    """Say whether nothing is there but what a build leaves that is killed at its start or end."""
    return partial.is_dir() and set(list_paths(partial)) <= {f"{REPORTS}/.recipe.json.partial"}


def finish(out: Path, manifest: Manifest, *, force: bool) -> None:
    """Publish a dataset that has grown, and rename it to its place.

    Raises:
        DatasetError: if the place was taken meanwhile, or a file cannot be renamed.
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
        shutil.rmtree(left, ignore_errors=True)  # of a process that was killed, or is late
