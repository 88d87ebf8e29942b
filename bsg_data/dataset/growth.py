"""A dataset grows beside its place, in `<out>.partial`, and becomes `<out>` by one rename."""

from __future__ import annotations

import glob
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from bsg_data.dataset.manifest import MANIFEST, Manifest, read_manifest
from bsg_data.dataset.publication import PLAN, REPORTS, REVISION, list_strays, publish
from bsg_data.errors import DatasetError
from bsg_data.files import write_bytes
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
        strays = list_strays(out, read_manifest(out))
    except DatasetError as error:
        raise DatasetError(f"{error}. --force does not remove it; move it away") from error
    users = [name for name in strays if not name.startswith(f"{REVISION}/")]
    if users:
        raise DatasetError(
            f"{out}: holds {users[0]}, which is not the dataset's; move it away, then --force"
        )


def open_partial(out: Path, recipe: Record) -> Path:
    """Return the folder that a dataset grows in, keeping what the same recipe left there.

    Raises:
        DatasetError: if something else is in the way.
    """
    partial = out.with_name(f"{out.name}.partial")
    path = partial / REPORTS / "recipe.json"
    wanted = recipe.model_dump_json().encode()
    if partial.exists():
        if path.is_file() and path.read_bytes() == wanted:
            return partial
        if (partial / PLAN).exists():
            raise DatasetError(
                f"{partial}: holds parts of another build (--parts); remove it, or choose "
                "another --out"
            )
        if not path.is_file() and not _is_bare(partial):
            raise DatasetError(f"{partial}: is in the way and no build of ours; move it away")
        shutil.rmtree(partial)  # of a build that was stopped and is not this one
    write_bytes(path, wanted)
    return partial


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
    partial = out.with_name(f"{out.name}.partial")
    wanted = plan.model_dump_json().encode()
    if _read(partial / PLAN) != wanted:
        with hold(out, wait=SECONDS_TO_JOIN):
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


def _read(path: Path) -> bytes | None:
    return path.read_bytes() if path.is_file() else None


def _is_bare(partial: Path) -> bool:
    """Say whether nothing is there but what a build killed at its very start leaves."""
    begun = {partial / REPORTS, partial / REPORTS / ".recipe.json.partial"}
    return partial.is_dir() and not partial.is_symlink() and set(partial.rglob("*")) <= begun


def finish(growing: Path, out: Path, manifest: Manifest, *, force: bool) -> None:
    """Publish a dataset that has grown, and rename it to its place.

    Raises:
        DatasetError: if the place was taken meanwhile, or a file cannot be renamed.
    """
    for name in list_strays(growing, manifest):
        (growing / name).unlink()
    publish(growing, manifest)
    refuse_overwriting(out, force=force)
    _move_into_place(growing, out)
    for left in growing.parent.glob(f"{glob.escape(name_unfinished(growing))}*"):
        shutil.rmtree(left, ignore_errors=True)  # of a process that was killed, or is late


def _move_into_place(partial: Path, out: Path) -> None:
    """Rename the finished dataset to its place; an old one is removed only after that."""
    try:
        if (out / MANIFEST).exists():
            aside = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
            out.rename(aside / out.name)
            partial.rename(out)
            shutil.rmtree(aside)
        else:
            partial.rename(out)
        shutil.rmtree(out / REPORTS)
    except OSError as error:
        raise DatasetError(
            f"{out}: cannot be put in place ({error.strerror or error}); "
            f"the finished dataset is {partial}"
        ) from error
